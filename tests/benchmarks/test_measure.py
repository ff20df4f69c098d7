"""The benchmarks run; what they print is no verdict."""

from tests.benchmarks.measure import runs, statics


def test_the_benchmarks_of_runs_and_statics_run(capsys):
    runs("following-p2", 1, variant_count=2)
    statics(1)
    out = capsys.readouterr().out
    assert "2 variants, path alone" in out
    assert "all fields" in out
