"""What a run returns: files whole and readable, labelled arrays, a small picture."""

import csv
import dataclasses
import errno
import gc
import json
import os
import pickle
import tracemalloc
import weakref

import numpy as np
import pytest

import cablefem as cf
from cablefem import Scene
from cablefem.response import Flag, Response, atomic_write, write_csv, write_json
from validation.core.design import design_numbers
from validation.core.refine import run_with_error_bars
from validation.core.running import Run, run


@pytest.fixture(scope="module")
def level_response() -> Response:
    return run(Scene.load("level"), "following-p2", elements=4, steps=120)


def csv_rows(path):
    with path.open() as file:
        return list(csv.reader(file))


@pytest.fixture(scope="module")
def written_folder(level_response, tmp_path_factory):
    folder = tmp_path_factory.mktemp("written")
    level_response.write(folder)
    return folder


def test_path_csv_follows_the_contract(level_response, written_folder):
    names, *path = csv_rows(written_folder / "path.csv")
    assert names == ["t", "s_o", "x", "y", "u", "v", "T_behind", "T_ahead", "speed", "F_haul", "F_contact"]
    assert len(path) == level_response.t.size
    assert [float(x) for x in path[6][:2]] == [level_response.t[6], level_response.s_o[6]]  # full precision
    first, later = (dict(zip(names, path[i], strict=True)) for i in (0, 8))
    assert (float(first["t"]), first["T_behind"]) == (0.0, "")  # nothing behind the mass on the left support
    assert (float(later["speed"]), later["F_haul"]) == (
        np.hypot(*level_response.velocity[8]),
        "",
    )  # a car that grips has none
    assert min(float(first["T_ahead"]), float(later["F_contact"])) > 0.0


def test_tension_csv_and_summary_json_follow_the_contract(level_response, written_folder):
    names, *tension = csv_rows(written_folder / "tension.csv")
    f = level_response.fields
    assert (names, len(tension)) == (["t", "s", "T"], f.t.size * (f.s.size + 2))
    assert f.s.size >= 201
    sides = [[float(x) for x in row[1:]] for row in tension[f.s.size : f.s.size + 2]]
    assert sides == [[f.s_o[0], f.T_behind[0]], [f.s_o[0], f.T_ahead[0]]]
    assert json.loads((written_folder / "summary.json").read_text()).keys() >= {
        "scene", "method", "settings", "model", "load", "law", "status", "reason", "reached", "slack_onset",
        "max_deflection", "path_error", "tension_error", "n_dof", "steps", "newton_iterations", "seconds",
    }  # fmt: skip
    assert not any("nan" in p.read_text().lower() for p in written_folder.glob("*.csv"))


def is_same(a, b):
    if isinstance(a, dict):
        return a.keys() == b.keys() and all(is_same(a[name], b[name]) for name in a)
    if isinstance(a, np.ndarray):
        return np.array_equal(a, b, equal_nan=a.dtype.kind == "f")
    return a == b or tuple(a) == tuple(b)


def test_what_is_written_reads_back(level_response, tmp_path):
    level_response = dataclasses.replace(
        level_response, powers={"haul": 2.5 * level_response.power}, events=[{"event": "turn", "t": 1.5}],
        cause="slack", flags=[Flag("energy", "gains {gain:.2f}", {"gain": 0.4})],
    )  # fmt: skip
    level_response.write(tmp_path)
    assert json.loads((tmp_path / "summary.json").read_text())["flags"] == ["gains 0.40"]
    again = Response.read(str(tmp_path))
    assert is_same(level_response.fields.T, again.fields.T)
    names = {field.name for field in dataclasses.fields(Response)} - {"fields"}
    assert [name for name in names if not is_same(getattr(level_response, name), getattr(again, name))] == []


def test_a_run_gives_its_path_and_all_else_when_it_is_looked_at():
    """A copy with one field changed is complete, and so is what another process gets, or a run that goes on."""
    marched = Run(Scene.load("level"), "following-p2", elements=4, steps=120)
    early = marched.run_to(0.3)
    late = marched.run_to(0.6)
    assert "fields" not in vars(early)
    assert "energy" not in vars(early)
    assert (early.status, early.slack_onset, early.reached < 0.35) == ("complete", None, True)
    alone = Run(Scene.load("level"), "following-p2", elements=4, steps=120).run_to(0.3)
    np.testing.assert_array_equal(early.fields.T, alone.fields.T)
    assert early.energy is early.energy
    changed = dataclasses.replace(late, T_behind=late.T_ahead)
    assert changed.T_behind is late.T_ahead
    assert changed.fields is late.fields
    again = pickle.loads(pickle.dumps(alone))
    names = {field.name for field in dataclasses.fields(Response)} - {"fields"}
    assert [name for name in names if not is_same(getattr(alone, name), getattr(again, name))] == []


def test_states_are_dropped_when_the_response_has_used_them_or_goes():
    for use in (lambda r: r.energy, lambda r: None):
        marched = Run(Scene.load("level"), "following-p2", elements=4, steps=120)
        response = marched.run_to(0.3)
        states = weakref.ref(marched.history.states)
        use(response)
        del marched
        if use(response) is None:
            assert states() is not None
            del response
        gc.collect()
        assert states() is None


def test_a_run_that_breaks_says_so_before_anything_is_looked_at():
    r = run(Scene.load("level"), "following-p2", elements=4, steps=120, law="elastic", scheme="central-difference")
    assert r.status == "incomplete"
    assert r.reason


def test_bars_are_computed_when_they_are_looked_at():
    r = cf.run("level", elements=4, steps=120, until=0.5)
    finest = run_with_error_bars(Scene.load("level"), "following-p2", elements=4, steps=120, until=0.5)
    assert {"path_error", "design", "flags"}.isdisjoint(vars(r))
    assert (r.path_error, r.error_parts) == (finest.finest.path_error, finest.finest.error_parts)
    assert r.design == design_numbers(finest)


def test_the_mass_is_where_the_displaced_cable_is(level_response):
    scene = Scene.load("level")
    np.testing.assert_allclose(
        level_response.x,
        scene.catenary.x(level_response.s_o) + level_response.u,
        rtol=0,
        atol=1e-9 * level_response.length,
    )
    np.testing.assert_allclose(
        level_response.y,
        scene.catenary.y(level_response.s_o) + level_response.v,
        rtol=0,
        atol=1e-9 * level_response.length,
    )
    speed = np.gradient(level_response.x, level_response.t, edge_order=2)
    inner = slice(5, 80)
    # differences of second order over 120 steps
    np.testing.assert_allclose(speed[inner], level_response.velocity[inner, 0], rtol=1e-2)


def test_a_full_disk_is_said_with_the_file_that_did_not_fit(tmp_path):
    with pytest.raises(OSError, match=r"No space left on device: '.*path.csv'"), atomic_write(tmp_path / "path.csv"):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))  # as a write says it, of no file


def test_a_file_is_written_whole_or_not_at_all(tmp_path):
    target = tmp_path / "a.json"
    write_json(target, {"x": 1})
    with pytest.raises(ValueError, match="not JSON compliant"):
        write_json(target, {"x": float("nan")})
    assert json.loads(target.read_text()) == {"x": 1}

    class Interrupted(Exception):
        pass

    def interrupted() -> None:
        with atomic_write(target) as temporary:
            temporary.write_text("half")
            raise Interrupted

    with pytest.raises(Interrupted):
        interrupted()
    assert json.loads(target.read_text()) == {"x": 1}
    assert [p.name for p in tmp_path.iterdir()] == ["a.json"]
    write_csv(tmp_path / "b.csv", {"p": np.array([1.5]), "q": np.array([np.nan])})
    assert (tmp_path / "b.csv").read_text() == "p,q\n1.5,\n"


def test_xarray_carries_units_and_the_same_numbers(level_response):
    data = level_response.to_xarray()
    assert data.v.attrs["units"] == "m"
    assert data.field_T.dims == ("frame", "s")
    np.testing.assert_array_equal(data.field_T.values, level_response.fields.T)
    assert float(data.v.max()) == level_response.max_deflection


def test_the_picture_is_an_svg_without_nan(level_response):
    picture = level_response._repr_html_()
    assert "<svg" in picture
    assert "nan" not in picture


def test_any_instant_and_place(level_response):
    """At the mass it is the mass path, at a frame and a station the field; between them it is continuous."""
    f, k = level_response.fields, 40
    at_mass = level_response.at(t=level_response.t[60], s=level_response.s_o[60])
    np.testing.assert_allclose(
        [at_mass["u"].item(), at_mass["v"].item()], [level_response.u[60], level_response.v[60]], rtol=1e-9
    )
    assert at_mass["T"].item() == pytest.approx(level_response.T_behind[60], rel=1e-9)
    far = np.abs(f.s - f.s_o[k]) > 0.02 * level_response.length
    seen = level_response.at(t=f.t[k], s=f.s[far])
    for name in ("u", "v", "T"):
        np.testing.assert_allclose(seen[name][0], getattr(f, name)[k][far], rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(seen["y"][0], f.y[far] + f.v[k][far], rtol=1e-9, atol=1e-9)
    t = np.linspace(f.t[k], f.t[k + 1], 41)
    s = 1.02 * f.s_o[k + 1]
    v = level_response.at(t=t, s=s)["v"][:, 0]
    assert np.abs(np.diff(v)).max() < 0.1 * np.ptp(v) + 1e-9
    assert level_response.at(t=[1.0, 2.0, 3.0], s=[0.0, level_response.length])["x"].shape == (3, 2)
    ahead = level_response.at(t=level_response.t[60], s=level_response.s_o[60] + 1e-6 * level_response.length)[
        "T"
    ].item()
    assert ahead == pytest.approx(level_response.T_ahead[60], rel=1e-4)
    for wrong in ({"t": -1.0, "s": 3.0}, {"t": 1.0, "s": 1.1 * level_response.length}, {"t": float("nan"), "s": 1.0}):
        with pytest.raises(ValueError, match="must be a number from"):
            level_response.at(**wrong)


def test_frames_are_dense_in_time_and_more_if_asked():
    """One of 98 fell into the braking, 9 s after the one before; values between them were up to a tenth off."""
    scene, how = Scene.load("tramway"), {"elements": 6, "steps": 600}
    coarse = run(scene, "following-p2", **how)
    f, lasts = coarse.fields, coarse.t[-1]
    assert (f.t[0], f.t[-1]) == (0.0, lasts)
    assert np.diff(f.t).max() <= 1.001 * lasts / 100
    fine, finest = (run(scene, "following-p2", frames=n, **how) for n in (400, 2000))
    assert np.diff(fine.fields.t).max() <= 1.001 * lasts / 400
    where = {"t": np.linspace(0.0, lasts, 301), "s": coarse.length * np.linspace(0.1, 0.9, 9)}
    exact = finest.at(**where)
    for r, within in ((coarse, 1e-2), (fine, 3e-3)):
        for name, values in r.at(**where).items():
            assert np.sqrt(np.mean((values - exact[name]) ** 2)) < within * np.ptp(exact[name]), name
    with pytest.raises(ValueError, match=r"frames must be a whole number from 2 to 20000, got 1\.5"):
        run(scene, "following-p2", frames=1.5)


def test_plots_and_tables(level_response):
    axes = level_response.plot()
    lines = {line.get_label(): line.get_xydata() for line in axes.lines}
    np.testing.assert_allclose(lines["path of the car"], np.stack([level_response.x, level_response.y], axis=1))
    assert axes.get_xlabel() == "x [m]"
    assert level_response.plot_tension().collections
    frame = level_response.to_dataframe()
    assert frame.attrs["units"]["T_behind"] == "N"
    np.testing.assert_array_equal(frame["v"], level_response.v)
    assert len(repr(level_response).splitlines()) == 1


def test_contact_force_is_taken_normal_to_the_mean_tangent(level_response):
    tangent = level_response.slope_behind + level_response.slope_ahead
    along = dataclasses.replace(level_response, contact=tangent)
    assert np.abs(along.F_contact).max() <= 1e-15 * np.abs(tangent).max() ** 2
    down = dataclasses.replace(level_response, contact=np.broadcast_to([0.0, 3.0], tangent.shape))
    np.testing.assert_allclose(down.F_contact, 3.0 * tangent[:, 0] / np.hypot(*tangent.T), rtol=1e-14)


def test_what_is_asked_at_no_instant_or_place_is_refused_in_a_sentence(level_response):
    for t, s in (("a", 1.0), (None, 1.0), ([[1.0, 2.0]], 1.0), (1.0, np.arange(5000.0)), (-1.0, 2.0)):
        with pytest.raises(ValueError, match=r"^[ts] must be a number from 0 to .* m?s?, or a list.*; got .{1,40}$"):
            level_response.at(t=t, s=s)
    assert level_response.at(t=[], s=[1.0, 2.0])["T"].shape == (0, 2)


def test_a_response_is_itself_and_may_be_a_key(level_response):
    other = cf.run("level", elements=4, steps=100)
    assert other != level_response
    assert {level_response: "a", other: "b"}[other] == "b"


def test_a_response_keeps_nothing_of_the_coarser_runs_of_its_bars():
    scene = Scene.load("level")
    assert cf.run(scene, elements=4, steps=200).design  # compiled
    tracemalloc.start()
    try:
        r = cf.run(scene, elements=4, steps=200)
        assert r.design
        gc.collect()
        stored = tracemalloc.get_traced_memory()[0]
    finally:
        tracemalloc.stop()
    assert stored < 1.3 * len(pickle.dumps(r))
