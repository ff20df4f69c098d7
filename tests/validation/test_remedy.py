"""What would make another program's path agree: done as it is worded, it agrees."""

import csv
import re
from dataclasses import replace

import pytest

from cablefem import Scene
from validation.core import foreign, measures, remedy
from validation.core.agreement import Verdict
from validation.core.foreign import ForeignPath
from validation.core.refine import run_with_error_bars
from validation.core.running import run


class Case:
    """Both solvers on a scene, and an answer to alter."""

    def __init__(self, name, elements, terms, steps):
        self.scene = Scene.load(name)
        self.both = (
            run_with_error_bars(self.scene, "following-p2", elements=elements, steps=steps),
            run_with_error_bars(self.scene, "fourier-kink", terms=terms, steps=steps),
        )
        self.window = measures.common_window(*(ladder.finest for ladder in self.both))
        self.other = run(self.scene, "fourier-kink", terms=terms, steps=steps)

    def rows(self, file, with_tol):
        path = ForeignPath.read(file, self.scene)
        rows = list(foreign.third_party_rows(path, self.both[0], self.window, with_tol))
        return remedy.with_remedy_note(rows, remedy.Remedies(path, self.scene, self.both, self.window, with_tol))


@pytest.fixture(scope="module")
def zipline_case():
    return Case("zipline", 6, 12, 300)


@pytest.fixture(scope="module")
def level_case():
    return Case("level", 16, 30, 800)


def write_columns(file, columns):
    with file.open("w", newline="") as out:
        rows = csv.writer(out)
        rows.writerow(columns)
        rows.writerows(zip(*columns.values(), strict=True))
    return file


def columns_after_remedy(columns, text, scene):
    """The columns after the change that a sentence names, by its words alone."""
    number = float(re.search(r"by (-?[\d.e-]+)", text)[1])
    changed = dict(columns)
    if "its v" in text:
        if "v" not in changed:  # the height above the rope at rest
            rest = scene.catenary.y(changed.pop("s_o"))
            changed["y"] = rest + number * (changed["y"] - rest)
        else:
            changed["v"] = number * changed["v"]
    else:
        of = {"times": ["t"], "places": ["s_o", "x"], "heights": ["y", "v"]}
        for name in next(names for word, names in of.items() if word in text):
            if name in changed:
                changed[name] = changed[name] + number
    return changed


@pytest.mark.parametrize(
    ("case", "names", "change", "said"),
    [
        ("zipline_case", "t,s_o,x,y", lambda r: {"t": r.t + 0.1}, r"its times are shifted by -0\.(1|09\d|10\d) s"),
        ("zipline_case", "t,x,s_o,y", lambda r: {"y": r.y + 0.03 * r.v}, r"its v is multiplied by 0\.97\d*"),
        (
            "zipline_case",
            "t,x,y",
            lambda r: {"y": r.y + 0.2},
            r"its heights are shifted by -0\.(2|19\d|20\d) m downwards",
        ),
        ("zipline_case", "t,x,y", lambda r: {"x": r.x + 1.0}, r"its places are shifted by -(1|0\.9\d+|1\.0\d) m"),
        ("level_case", "t,v", lambda r: {"v": 1.03 * r.v}, r"its v is multiplied by 0\.97\d*"),
        ("level_case", "t,s_o,u,v", lambda r: {"v": 0.97 * r.v}, r"its v is multiplied by 1\.03\d*"),
        ("level_case", "t,s_o,x,y,u,v", lambda r: {"v": 1.03 * r.v}, r"its v is multiplied by 0\.97\d*"),
    ],
)
def test_done_as_worded_it_agrees(tmp_path, request, case, names, change, said):
    case = request.getfixturevalue(case)
    columns = {name: getattr(case.other, name) for name in names.split(",")} | change(case.other)
    (note,) = case.rows(write_columns(tmp_path / "other.csv", columns), 2e-3)[0].bound.notes
    assert re.fullmatch(f"agrees if {said}", note), note
    after = case.rows(write_columns(tmp_path / "other.csv", columns_after_remedy(columns, note, case.scene)), 2e-3)
    assert {row.verdict for row in after} == {Verdict.AGREE}


def test_what_no_change_explains_has_no_advice(tmp_path, level_case):
    r = level_case.other
    columns = {"t": r.t, "s_o": r.s_o, "v": r.v * (1.0 + 0.1 * (r.s_o > 0.5 * r.length))}
    rows = level_case.rows(write_columns(tmp_path / "other.csv", columns), 2e-3)
    assert rows[0].verdict is Verdict.DISAGREE
    assert not rows[0].bound.notes


def test_a_path_that_a_change_takes_out_of_the_range_raises_no_warning(tmp_path, level_case):
    r = level_case.other
    some = slice(300, 340, 8)
    columns = {"t": r.t[some], "v": 1.2 * r.v[some]}
    rows = level_case.rows(write_columns(tmp_path / "other.csv", columns), 2e-3)
    assert not rows[0].bound.notes


def test_a_change_that_leaves_the_tensions_wrong_is_no_advice(tmp_path, level_case):
    r = level_case.other
    columns = {"t": r.t[1:-1], "v": 1.03 * r.v[1:-1], "T_behind": 1.5 * r.T_behind[1:-1], "T_ahead": r.T_ahead[1:-1]}
    rows = level_case.rows(write_columns(tmp_path / "other.csv", columns), 0.02)
    assert [row.verdict for row in rows if row.quantity != "path_rms"] == [Verdict.DISAGREE] * 2
    assert not rows[0].bound.notes


def test_the_headline_speaks_of_our_solvers_and_a_wrong_file_for_itself(tmp_path, level_case, capsys):
    from validation.commands.check import study, words
    from validation.core.rows import compare

    a, b = level_case.both
    check = study.Check(level_case.scene, a, b, 1e-2, level_case.window, [])
    ours = compare(level_case.scene, a, b, tol=1e-2, tol_tension=0.5)
    wrong = ForeignPath.of(level_case.scene, level_case.other.s_o, 1.3 * level_case.other.v, name="other.csv")
    check = study.with_third_party_rows(
        replace(check, rows=[row for row in ours if row.verdict is Verdict.AGREE]), wrong
    )
    assert check.verdict is Verdict.DISAGREE
    words.print_check(check)
    text = capsys.readouterr().out
    assert text.startswith("Both solvers agree.")
    assert "other.csv: DISAGREES with both" in text


def test_rows_after_the_end_of_the_travel_do_not_matter(tmp_path, level_case):
    r = level_case.other
    t = [*r.t, r.t[-1] + 1.0, r.t[-1] + 2.0]
    wrong = 1.02 * (r.y - level_case.scene.catenary.y(r.s_o)) + level_case.scene.catenary.y(r.s_o)
    file = write_columns(tmp_path / "other.csv", {"t": t, "y": [*wrong, 0.0, 0.0]})
    rows = level_case.rows(file, 2e-3)
    assert rows[0].verdict is Verdict.DISAGREE
    assert "v is multiplied by 0.98" in rows[0].bound.notes[0]
