"""Another program's path is read for what it says, compared with what both owe, and refused with the remedy."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from cablefem import Scene
from validation.commands.check.page import third_party_verdict_and_sentence
from validation.core import foreign, measures
from validation.core.agreement import Verdict
from validation.core.foreign import ForeignPath, refuse_wrong_unit_or_direction
from validation.core.refine import run_with_error_bars
from validation.core.running import run
from validation.core.store import Refused

DATA = Path(__file__).parent / "data"
LEVEL = Scene.load("level")
L = LEVEL.length


@pytest.fixture(scope="module")
def our_ladder():
    return run_with_error_bars(LEVEL, "following-p2", elements=16, steps=800)


@pytest.fixture(scope="module")
def coarse_run():
    return run(LEVEL, "following-p2", elements=6, steps=200)


def rows_by_quantity(path, ours, with_tol=5e-3):
    return {
        row.quantity: row for row in foreign.third_party_rows(path, ours, measures.common_window(*ours.runs), with_tol)
    }


def opensees_columns():
    """Time [s], s_o/l, u/l, v/l of a real file, every third row."""
    return np.loadtxt(DATA / "opensees_level.csv", delimiter=",", skiprows=1)[::3].T


def write_path_file(tmp_path, header, *arrays, delimiter=","):
    file = tmp_path / "other.csv"
    rows = [delimiter.join(f"{x:.9g}" for x in row) for row in zip(*arrays, strict=True)]
    file.write_text("\n".join([header, *rows]) + "\n")
    return file


def faults_of_refusal(call, *arguments):
    with pytest.raises(Refused) as caught:
        call(*arguments)
    return caught.value.faults


# --- real files -----------------------------------------------------------------------------------------------------


# Measured by hand with v alone: 0.26 and 0.21 percent of the largest deflection.
@pytest.mark.parametrize(("name", "gap"), [("exudyn", 2.6e-3), ("opensees", 2.1e-3)])
def test_the_two_real_files_agree_with_the_error_they_have(name, gap, our_ladder, coarse_run):
    path = ForeignPath.read(DATA / f"{name}_level.csv", LEVEL)
    refuse_wrong_unit_or_direction(path, coarse_run)
    row = rows_by_quantity(path, our_ladder)["path_max"]
    assert row.verdict is Verdict.AGREE
    assert row.gap == pytest.approx(gap, rel=0.1, abs=0.0)  # ours moves by its own error bar, a tenth of it
    assert row.third_party == f"{name}_level.csv"
    assert row.to_json()["with"] == f"{name}_level.csv"
    assert "its error bar" in row.allowed_because
    assert "0.005" in row.allowed_because
    assert rows_by_quantity(path, our_ladder)["path_rms"].verdict is Verdict.AGREE


def test_a_fault_is_flagged(our_ladder, coarse_run):
    path = ForeignPath.read(DATA / "opensees_level.csv", LEVEL)
    off = replace(path, v=1.01 * path.v)
    for wrong in (off, replace(path, t=path.t + 0.1), replace(path, u=path.u + 0.02 * path.v)):
        assert rows_by_quantity(wrong, our_ladder)["path_max"].verdict is Verdict.DISAGREE
    assert rows_by_quantity(off, our_ladder, with_tol=2e-2)["path_max"].verdict is Verdict.AGREE
    refuse_wrong_unit_or_direction(replace(path, v=1.3 * path.v), coarse_run)  # wrong, but in the right unit
    without = rows_by_quantity(replace(path, u=None), our_ladder)["path_max"]
    assert without.verdict is Verdict.AGREE
    assert "v alone" in without.allowed_because


# --- names of columns -----------------------------------------------------------------------------------------------

t, s, u, v = opensees_columns()
X, Y = LEVEL.catenary.x(L * s), LEVEL.catenary.y(L * s)


@pytest.mark.parametrize(
    ("header", "arrays", "delimiter", "has_u"),
    [
        ("t_s,s_o_over_l,u_over_l,v_over_l_down", (t, s, u, v), ",", True),
        ("t,s_o,u,v", (t, L * s, L * u, L * v), ",", True),
        ("t;v_mm", (t, 1e3 * L * v), ";", False),
        ("s_o_over_l\tv_over_l_up", (s, -v), "\t", False),
        ("# t_ms,v_over_l,label", (1e3 * t, v, t), ",", False),
        ("s_o_km,y_down,x_m", (1e-3 * L * s, Y + L * v, X + L * u), ",", True),
        ("v , t", (L * v, t), ",", False),
    ],
)
def test_names_tell_units_and_directions(tmp_path, header, arrays, delimiter, has_u):
    path = ForeignPath.read(write_path_file(tmp_path, header, *arrays, delimiter=delimiter), LEVEL)
    # nine digits were written, of y a sum of which v may be a hundredth
    np.testing.assert_allclose(path.v, L * v, rtol=1e-7, atol=1e-6)
    # the travel of the file is the scene's to its own digits
    np.testing.assert_allclose(path.s_o, L * s, rtol=0.0, atol=1e-5 * L)
    np.testing.assert_allclose(path.t, t, rtol=1e-5, atol=1e-6)
    if has_u:
        np.testing.assert_allclose(path.u, L * u, rtol=0.0, atol=2e-5)  # nine digits of a place up to 2000 m
    else:
        assert path.u is None


def test_our_own_path_csv_is_read_as_it_was_computed(tmp_path, coarse_run):
    coarse_run.write(tmp_path)
    path = ForeignPath.read(tmp_path / "path.csv", LEVEL)
    for name in ("t", "s_o", "u", "v", "T_behind", "T_ahead"):
        np.testing.assert_array_equal(getattr(path, name), getattr(coarse_run, name))


def test_a_path_with_tensions_has_a_row_for_them(tmp_path, coarse_run, our_ladder):
    coarse_run.write(tmp_path)
    path = ForeignPath.read(tmp_path / "path.csv", LEVEL)
    # Six elements against sixteen: the largest gap is where a front passes, some percent of H.
    assert rows_by_quantity(path, our_ladder, with_tol=0.1)["tension"].verdict is Verdict.AGREE
    wrong = replace(path, T_ahead=1.5 * path.T_ahead)
    assert rows_by_quantity(wrong, our_ladder, with_tol=0.1)["tension"].verdict is Verdict.DISAGREE


def test_what_is_written_reads_back(tmp_path):
    path = ForeignPath.read(DATA / "exudyn_level.csv", LEVEL)
    path.write(tmp_path / "with.csv")
    back = ForeignPath.read(tmp_path / "with.csv", LEVEL)
    np.testing.assert_array_equal(back.v, path.v)
    np.testing.assert_array_equal(back.u, path.u)


def test_rows_after_the_travel_are_left_out():
    end = LEVEL.arrival_time
    path = ForeignPath.of(LEVEL, None, np.linspace(0.0, 7.0, 40), t=np.linspace(0.0, 1.5 * end, 40))
    assert path.t[-1] <= end
    assert path.t.size == 27  # the last is at 26/39 x 1.5 = 1, the exit itself


# --- refused --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", ["the file is empty"]),
        ("t,v\n", ["no rows below the names of the columns"]),
        ("0,0\n1,2\n", ["no column v (deflection of the mass [m], positive down); it has 0, 0"]),
        ("t,w\n0,0\n", ["no column v (deflection of the mass [m], positive down); it has t, w"]),
        ("t,v_ft\n0,0\n", ["the ending of v_ft is not understood: must be v in m, or v_mm or v_km"]),
        ("s_o_ft,v\n0,0\n", ["the ending of s_o_ft is not understood: must be s_o in m, or s_o_mm or s_o_km"]),
        ("place,v\n0,0\n", ["neither a column t [s] nor s_o [m]; it has place, v"]),
        ("t,v,v_mm\n0,0,0\n", ["columns v and v_mm both say v; leave one"]),
        ("t,v\n0,0\n1\n", ["line 3: 1 cells under 2 names"]),
        (
            "# made by hand\nt,v\n0,0\n# half way\n1,abc\n2,nan\n",
            ["line 5: v = 'abc' is no number", "line 6: v = 'nan'"],
        ),
        ("t;v\n0;0\n1;0,5\n", ["line 3: v = '0,5' is no number (a decimal comma? write a point)"]),
        ("t,v\n0,0\n2,1\n2,1\n", ["line 4: t = 2 s does not come after 2 s in line 3; t must increase"]),
        ("t,v\n0,0\n1,1\n2,2\n", ["2 rows in s_o/l = 0.02 to 0.8", "it covers s_o/l = 0 to 0.14"]),
    ],
)
def test_a_bad_file_is_refused_line_by_line(tmp_path, text, said):
    file = tmp_path / "bad.csv"
    file.write_text(text)
    lines = faults_of_refusal(ForeignPath.read, file, LEVEL)
    assert all(line.startswith("bad.csv: ") and "\n" not in line for line in lines)
    for part in said:
        assert any(part in line for line in lines), (part, lines)


def test_a_file_without_the_path_of_a_free_ride_is_told_what_such_a_ride_needs(tmp_path):
    file = tmp_path / "bad.csv"
    file.write_text("t,x,y_ft\n0,0,0\n1,1,1\n")
    (line,) = faults_of_refusal(ForeignPath.read, file, Scene.load("zipline"))
    assert line.startswith("bad.csv: a free ride needs t, s_o or x, and v or y; it has t, x, y_ft; the ending of y_ft")


def test_many_bad_cells_make_a_few_lines(tmp_path):
    file = tmp_path / "bad.csv"
    file.write_text("t,v\n" + "".join(f"{i},x\n" for i in range(30)))
    lines = faults_of_refusal(ForeignPath.read, file, LEVEL)
    assert len(lines) == 6
    assert lines[-1] == "bad.csv: and 25 more cells like these"


def test_files_that_cannot_be_read_are_told(tmp_path):
    for file in (tmp_path / "no.csv", tmp_path):
        assert f"{file}: cannot be read" in faults_of_refusal(ForeignPath.read, file, LEVEL)[0]
    (tmp_path / "b.csv").write_bytes(b"t,v\n0,\xff\n")
    assert "not text in UTF-8" in faults_of_refusal(ForeignPath.read, tmp_path / "b.csv", LEVEL)[0]
    (tmp_path / "c.csv").write_text("t,v\n0,0\n")
    assert "no travelling mass" in faults_of_refusal(ForeignPath.read, tmp_path / "c.csv", Scene.load("bare"))[0]


@pytest.mark.parametrize(
    ("header", "arrays", "said"),
    [
        ("t,s_o,v", (1e3 * t, L * s, L * v), "t and s_o are not the scene's travel: at t ="),
        ("t_ms,s_o,v", (t, L * s, L * v), "t and s_o are not the scene's travel"),
        ("t,s_o,v", (t, s, L * v), "t and s_o are not the scene's travel"),
        ("t,s_o,v", (t, L * s**1.2, L * v), "t and s_o are not the scene's travel"),
        ("s_o,v", (s, L * v), "on a cable of 2002.37 m"),
        ("s_o,v", (1e3 * L * s, L * v), "on a cable of 2002.37 m"),
        ("s_o,v", (L * s - 300.0, L * v), "s_o runs from -300"),
    ],
)
def test_time_and_place_in_other_units_are_refused(tmp_path, header, arrays, said):
    (line,) = faults_of_refusal(ForeignPath.read, write_path_file(tmp_path, header, *arrays), LEVEL)
    assert said in line
    assert "t_ms, s_o_over_l" in line


@pytest.mark.parametrize(
    ("header", "values", "said"),
    [
        ("v", -L * v, ["v points the other way", "multiplied by -1 "]),
        ("v_over_l", -v, ["v points the other way", "multiplied by -1 "]),
        ("v", 1e3 * L * v, ["v is in another unit", "multiplied by 0.001 "]),
        ("v", v, ["v is in another unit", "multiplied by 2002.37 (l = 2002.37 m)"]),
        ("v_over_l", L * v, ["v is in another unit"]),
        ("v_up", L * v, ["v points the other way"]),
    ],
)
def test_deflection_in_another_unit_or_direction_is_told(tmp_path, coarse_run, header, values, said):
    path = ForeignPath.read(write_path_file(tmp_path, f"t,{header}", t, values), LEVEL)
    (line,) = faults_of_refusal(refuse_wrong_unit_or_direction, path, coarse_run)
    assert line.startswith("other.csv: v ")
    assert all(part in line for part in said), line


def test_a_path_that_ends_early_is_not_comparable_but_told(our_ladder):
    half = s <= 0.5
    row = rows_by_quantity(ForeignPath.of(LEVEL, L * s[half], L * v[half], name="short"), our_ladder)["path_max"]
    assert row.verdict is Verdict.NOT_COMPARABLE
    assert row.gap < 3e-3
    assert "short covers s_o/l 0.02 to 0.498 of 0.02 to 0.8" in row.allowed_because
    _, sentence = third_party_verdict_and_sentence([row.to_json()], "short")
    assert sentence.startswith("cannot be compared; short covers s_o/l 0.02 to 0.498 of 0.02 to 0.8")


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (([1.0, 2.0, 3.0], [1.0, 2.0]), "columns of one length, got the shapes s_o (3,), v (2,)"),
        (([1.0, 2.0], [1.0, np.nan]), "v[1] is not a finite number"),
        ((["a", "b"], [1.0, 2.0]), "could not convert"),
        ((np.eye(3), np.eye(3)), "columns of one length"),
    ],
)
def test_bad_numbers_of_a_solver_are_refused(arguments, said):
    assert said in faults_of_refusal(ForeignPath.of, LEVEL, *arguments)[0]


# --- free rides: compared over time -----------------------------------------------------------------------------------

ZIPLINE = Scene.load("zipline")


@pytest.fixture(scope="module")
def ride_ladder():
    return run_with_error_bars(ZIPLINE, "following-p2", elements=6, steps=300)


@pytest.fixture(scope="module")
def ride_by_sines():
    return run(ZIPLINE, "fourier-kink", terms=12, steps=300)


def write_ride_file(tmp_path, r, **changes):
    columns = {"t": r.t, "x": r.x, "y": r.y, "speed": r.speed} | changes
    return write_path_file(tmp_path, ",".join(columns), *columns.values())


def test_another_wing_s_ride_agrees_and_a_late_one_does_not(tmp_path, ride_ladder, ride_by_sines):
    path = ForeignPath.read(write_ride_file(tmp_path, ride_by_sines), ZIPLINE)
    refuse_wrong_unit_or_direction(path, ride_ladder.finest)
    found = rows_by_quantity(path, ride_ladder)
    assert {name: row.verdict for name, row in found.items()} == dict.fromkeys(
        ("path_max", "path_rms", "speed"), Verdict.AGREE
    )
    assert "of x and y" in found["path_max"].allowed_because
    late = rows_by_quantity(
        ForeignPath.read(write_ride_file(tmp_path, ride_by_sines, t=ride_by_sines.t + 0.1), ZIPLINE), ride_ladder
    )
    assert late["path_max"].verdict is Verdict.DISAGREE
    fast = rows_by_quantity(
        ForeignPath.read(write_ride_file(tmp_path, ride_by_sines, speed=1.05 * ride_by_sines.speed), ZIPLINE),
        ride_ladder,
    )
    assert fast["speed"].verdict is Verdict.DISAGREE
    assert fast["path_max"].verdict is Verdict.AGREE


def test_a_ride_by_its_place_on_the_cable_is_the_same_ride(tmp_path, ride_ladder, ride_by_sines):
    file = write_path_file(
        tmp_path,
        "t,s_o,u,v,speed_kmh",
        ride_by_sines.t,
        ride_by_sines.s_o,
        ride_by_sines.u,
        ride_by_sines.v,
        3.6 * ride_by_sines.speed,
    )
    path = ForeignPath.read(file, ZIPLINE)
    np.testing.assert_allclose(path.x, ride_by_sines.x, rtol=0.0, atol=1e-4)
    np.testing.assert_allclose(path.speed, ride_by_sines.speed, rtol=1e-6, atol=1e-7)
    assert rows_by_quantity(path, ride_ladder)["path_max"].verdict is Verdict.AGREE
    path.write(tmp_path / "with.csv")
    back = ForeignPath.read(tmp_path / "with.csv", ZIPLINE)
    np.testing.assert_array_equal(back.y, path.y)


def test_a_ride_that_ends_early_is_not_comparable(tmp_path, ride_ladder, ride_by_sines):
    half = ride_by_sines.t < 0.5 * ride_by_sines.t[-1]
    file = write_path_file(tmp_path, "t,x,y", ride_by_sines.t[half], ride_by_sines.x[half], ride_by_sines.y[half])
    row = rows_by_quantity(ForeignPath.read(file, ZIPLINE), ride_ladder)["path_max"]
    assert row.verdict is Verdict.NOT_COMPARABLE
    assert row.gap < 1e-2
    assert "covers t [s] 0 to " in row.allowed_because


@pytest.mark.parametrize(
    ("header", "factor", "said"), [("y", -1.0, "y points the other way"), ("y", 1e3, "y is in another unit")]
)
def test_height_in_another_unit_or_direction_is_told(tmp_path, ride_ladder, ride_by_sines, header, factor, said):
    file = write_path_file(tmp_path, f"t,x,{header}", ride_by_sines.t, ride_by_sines.x, factor * ride_by_sines.y)
    (line,) = faults_of_refusal(refuse_wrong_unit_or_direction, ForeignPath.read(file, ZIPLINE), ride_ladder.finest)
    assert said in line


def test_a_ride_needs_its_time(tmp_path, ride_by_sines):
    said = "a free ride needs t, s_o or x, and v or y; it has x, y"
    assert (
        said
        in faults_of_refusal(
            ForeignPath.read, write_path_file(tmp_path, "x,y", ride_by_sines.x, ride_by_sines.y), ZIPLINE
        )[0]
    )
    assert "it has s_o, v" in faults_of_refusal(ForeignPath.of, ZIPLINE, ride_by_sines.s_o, ride_by_sines.v)[0]
    far = write_path_file(tmp_path, "t,s_o_km,y", ride_by_sines.t, ride_by_sines.s_o, ride_by_sines.y)
    assert "s_o runs from" in faults_of_refusal(ForeignPath.read, far, ZIPLINE)[0]
