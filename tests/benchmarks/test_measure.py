"""The benchmarks run; what they print is no verdict."""

from tests.benchmarks.measure import runs


def test_the_benchmark_of_runs_prints_its_ratios(capsys):
    runs("following-p2", 1)
    assert "march" in capsys.readouterr().out
