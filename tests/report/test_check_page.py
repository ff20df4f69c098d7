"""Pages about a check: the verdict in words, what is missing named, the player's data, never a solver."""

from __future__ import annotations

import base64
import json
import re
import shutil
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from markupsafe import Markup

from cablefem.response import Response
from cablefem.scene import Scene
from validation.commands.check import page as check
from validation.commands.check.figures import gap_of, path_of
from validation.commands.check.stored import read
from validation.core.bounds import Bound, Part, nothing
from validation.core.quantities import scale_of, told
from validation.page import page
from validation.page.player import player

A, B = "following-p2", "fourier-kink"


@pytest.fixture
def folder(stored: Path, tmp_path: Path) -> Path:
    """A copy that a test may spoil."""
    return Path(shutil.copytree(stored, tmp_path / "level"))


def doctored(folder: Path, **changes) -> dict:
    """Change agreement.json; a function is given the old value."""
    file = folder / "agreement.json"
    content = json.loads(file.read_text())
    for key, value in changes.items():
        content[key] = value(content[key]) if callable(value) else value
    file.write_text(json.dumps(content))
    return content


def loaded(folder: Path):
    faults: list[str] = []
    stored = read(folder, faults)
    assert stored is not None
    assert faults == []
    return stored


def test_a_whole_report(report, stored):
    text = report.read_text(encoding="utf-8")
    ids = re.findall(r'<section id="([^"]+)"', text)
    assert ids == [f"check-{x}" for x in ("verdict", "path", "motion", "tension", "laws", "refinement", "runs")]
    assert len(text.encode()) < 1.5e6
    assert text.count('<svg role="img"') == text.count("<figcaption") == 8
    assert text.count("&lt;scene&gt;") == 2
    assert re.findall(r"(?i)\bnan\b|\binf(?:inity)?\b|undefined", re.sub(r'"[A-Za-z0-9+/=]{200,}"', "", text)) == []
    assert "Missing" not in text


def test_the_verdict_is_told_in_percent_and_metres(stored):
    told = check._verdict(loaded(stored), Markup(""))
    row = loaded(stored).row("path_max")
    assert told.verdict == "agree"
    assert told.summary.startswith("Both solvers give the same mass path")
    size = Response.read(stored / B).max_deflection
    factor, unit = scale_of(np.array([row["gap"] * size]), "m")
    for words in (page.percent(row["gap"]), f"{page.number(factor * row['gap'] * size)}\u202f{unit}"):
        assert words in told.summary
    assert not re.search("[<>&]", told.summary)  # it is printed on terminals too
    onset = min(Response.read(stored / name).slack_onset for name in (A, B))
    assert f"From sₒ/l = {onset:.3f} on the cable is slack" in told.html


def test_every_row_is_there_with_its_reason(stored):
    html = check._verdict(loaded(stored), Markup("")).html + check._laws(loaded(stored)).html
    rows = json.loads((stored / "agreement.json").read_text())["rows"]
    for row in rows:
        assert check.QUANTITIES[row["quantity"]][0] in html
        assert page.percent(row["gap"], 3) in html
        assert page.percent(row["allowed"], 3) in html
    assert html.count("badge good") == sum(row["verdict"] == "agree" for row in rows)


def test_a_disagreement_is_said_first_and_stands_on_top(folder):
    def spoil(rows):
        return [
            r | {"gap": 3.0 * r["allowed"], "verdict": "disagree"} if r["quantity"] == "impulse" else r for r in rows
        ]

    doctored(folder, rows=spoil, verdict="disagree")
    told = check._verdict(loaded(folder), Markup(""))
    assert told.verdict == "disagree"
    assert told.summary.startswith("An answer breaks the laws of mechanics: momentum of the mass, rms defect ")
    assert "Both solvers give the same mass path" in told.summary
    assert re.search(r"<tbody><tr><td[^>]*><div>Momentum of the mass, rms", told.html.replace("\n", ""))
    assert "<div>3.0</div>" in told.html  # times what is allowed


def test_a_reason_is_short_and_the_whole_of_it_beneath():
    parts = Part("fourier", 0.018, "extrapolated 2 f(62) - f(31)"), Part("following-p2", 2.5e-5, "2^1.5 - 1 & co")
    told = check._because({"bound": Bound("error bars", parts).row()})
    lines = re.fullmatch(r"<details><summary>(.*?)</summary><p>(.*?)</p></details>\n", told)
    assert lines is not None
    assert lines[1] == "both error bars: fourier 1.8\u202f% + following-p2 0.0025\u202f%"
    assert lines[2].endswith("(2<sup>1.5</sup> − 1 &amp; co)")
    assert check._because({"bound": nothing("nothing to compare").row()}) == "nothing to compare"


def test_equal_answers_have_no_logarithm_but_a_page(folder):
    shutil.rmtree(folder / B)
    shutil.copytree(folder / A, folder / B)
    for spare in ("half-steps", "half-resolution"):
        Response.read(folder / A).write(folder / B / spare)
    r = Response.read(folder / A)
    replace(r, method=B).write(folder / B)
    x = loaded(folder)
    for section in (check._path(x), check._refinement(x)):
        assert "<svg" in section.html


def test_paths_that_disagree_are_said_plainly(folder):
    doctored(folder, rows=lambda rows: [rows[0] | {"gap": 0.091, "allowed": 0.013, "verdict": "disagree"}, *rows[1:]])
    assert check._headline(loaded(folder)).startswith("The solvers disagree on the mass path: they differ by up to 9.1")


def test_bars_too_wide_for_the_tolerance_give_no_verdict(folder):
    doctored(folder, tol=1e-4, rows=lambda rows: [rows[0] | {"verdict": "not comparable"}, *rows[1:]])
    told = check._headline(loaded(folder))
    assert told.startswith("No verdict on the mass path")
    assert "0.010\u202f%" in told


def test_paths_without_a_common_range(folder):
    row = {"quantity": "path_max", "gap": None, "allowed": None, "verdict": "not comparable", "where": None}
    doctored(
        folder, rows=[row | {"allowed_because": "nothing to compare"}], range=[0.02, 0.02], verdict="not comparable"
    )
    told = check._verdict(loaded(folder), Markup(""))
    assert told.summary == "The mass paths cannot be compared: nothing to compare."
    assert "share no range" in told.html


def test_a_third_party_has_its_rows_and_its_path(folder):
    party = {"quantity": "path_max", "gap": 0.073, "allowed": 0.0052, "allowed_because": "ours 0.0002 + <0.005>",
             "verdict": "disagree", "where": 0.31, "with": "other <code>"}  # fmt: skip
    doctored(folder, rows=lambda rows: [*rows, party], verdict="disagree")
    (folder / "with.csv").write_text("t,s_o,y\n0.5,80.0,2.5\n1.5,210.0,7.5\n")
    x = loaded(folder)
    assert x.party is not None
    assert x.party.name == "other <code>"
    assert x.party.y.tolist() == [2.5, 7.5]
    told = check._verdict(x, Markup(""))
    assert "other <code> disagrees with them" in told.summary
    assert "Mass path, largest distance: other &lt;code&gt;" in told.html
    assert "other &lt;code&gt;" in check._path(x).html  # in the legend
    assert check._words({"quantity": "new_measure", "with": "x"}) == ("New measure", "")


@pytest.mark.parametrize(
    "gone",
    ["agreement.json", "scene.toml", f"{A}/response.npz", f"{B}/estimate.json", f"{A}/half-steps/response.npz",
     f"{B}/half-resolution"],
)  # fmt: skip
def test_a_missing_piece_is_named_and_nothing_else(folder, gone):
    target = folder / gone
    shutil.rmtree(target) if target.is_dir() else target.unlink()
    faults: list[str] = []
    assert read(folder, faults) is not None
    assert len(faults) == 1
    assert faults[0].startswith(gone)


@pytest.mark.parametrize("name", [f"{A}/response.npz", "agreement.json", "scene.toml", f"{B}/estimate.json"])
def test_a_broken_piece_is_named(folder, name):
    (folder / name).write_text("{ not what it was", encoding="utf-8")
    faults: list[str] = []
    read(folder, faults)
    assert len(faults) == 1
    assert faults[0].startswith(name + " (")


def test_an_incomplete_check_shows_what_there_is(folder, tmp_path):
    shutil.rmtree(folder / B)
    shutil.rmtree(folder / A / "half-steps")
    (folder / "agreement.json").unlink()
    sections = check.sections(folder)
    page.render("incomplete", sections, tmp_path / "report.html")
    assert sections[0].verdict == "not comparable"
    assert sections[0].summary == "No verdict: the check did not finish."
    assert all(f"Missing: {name}." in sections[0].html for name in ("agreement.json", f"{A}/half-steps/response.npz"))
    assert f"Only {A} has an answer" in sections[1].summary
    assert [s.id for s in sections][-1] == "check-runs"


def test_an_empty_folder_gives_a_page_that_says_so(tmp_path):
    sections = check.sections(tmp_path)
    assert [s.verdict for s in sections] == ["not comparable"]
    assert "no finished answer" in sections[0].summary
    assert "agreement.json" in sections[0].html


def test_a_run_that_broke_at_once_is_told_with_its_reason(folder):
    r = Response.read(folder / B)
    first = {n: getattr(r, n)[:1] for n, f in Response.__dataclass_fields__.items() if f.type == "Array"}
    replace(r, **first, status="incomplete", reason="Newton stalled").write(folder / B)
    faults: list[str] = []
    x = read(folder, faults)
    assert x is not None
    assert [s.name for s in x.solvers] == [A]
    assert faults[0] == f"{B}/response.npz (broke after 1 steps: Newton stalled)"


def test_no_solver_is_loaded(stored):
    code = (
        "import sys; from pathlib import Path; from validation.commands.check import page as check\n"
        f"check.sections(Path({str(stored)!r}))\n"
        "solvers = 'skfem', 'galerkin', 'cablefem.elements', 'matplotlib.pyplot'\n"
        "bad = [m for m in sys.modules if m.startswith(solvers)]\n"
        "assert not bad, bad"
    )
    subprocess.run([sys.executable, "-c", code], check=True)


def test_the_distance_of_paths_is_what_was_planted(stored):
    r = Response.read(stored / A)
    t, gap = gap_of(r, replace(r, u=r.u + 0.03, v=r.v - 0.04), path_of)
    assert t.size == r.t.size
    np.testing.assert_allclose(gap, 0.05, rtol=0.0, atol=1e-9)  # metres; splines reproduce a constant to rounding


@pytest.mark.parametrize(("x", "unit", "told"), [(1163.0, "N", (1.0, "N")), (116312.0, "N", (1e-3, "kN")),
                                                 (0.0047, "m", (1e3, "mm")), (37.7, "m", (1.0, "m")),
                                                 (7.4e6, "J", (1e-6, "MJ")), (0.0, "J", (1.0, "J"))])  # fmt: skip
def test_units_suit_their_numbers(x, unit, told):
    assert scale_of(np.array([x]), unit) == told


@pytest.mark.parametrize(
    ("value", "bar", "shown"),
    [
        (-1705.3, 9531.0, "-1.7 ± 9.5 kN"), (1163.0, 131.0, "1160 ± 130 N"), (319468.0, 172.0, "319.47 ± 0.17 kN"),
        (591.2, 17.3, "591 ± 17 N"), (591.2, None, "591.2 N"),
    ],
)  # fmt: skip
def test_a_number_has_the_digits_that_its_bar_leaves(value, bar, shown):
    number = {"quantity": "contact_min", "value": value, "bar": bar, "unit": "N"}
    assert told(number, 100.0)["value"] == shown


# --- the player's data ----------------------------------------------------------------------------------------------


def unpacked(part: dict) -> np.ndarray:
    steps = np.frombuffer(base64.b64decode(part["data"]), "<u2")
    return part["low"] + steps / 65535.0 * (part["high"] - part["low"])


def data_of(stored: Path) -> tuple[dict, Response]:
    r = Response.read(stored / A)
    html = player(Scene.load("level"), [r], window=(0.02, 0.8), range_T=(1.1e5, 3.3e5))
    return json.loads(re.search(r'<script type="application/json">(.*?)</script>', html)[1]), r


def misfit(data: dict, r: Response) -> float:
    """Largest error of v along the cable in steps of the 16-bit scale."""
    part = data["cables"][0]["v"]
    v = unpacked(part).reshape(-1, len(data["s"]))[1:]  # the first frame is the cable at rest
    step = (part["high"] - part["low"]) / 65535.0
    return float(np.abs(v - r.fields.v[:, :: (r.fields.s.size - 1) // (len(data["s"]) - 1)]).max() / step)


def test_the_player_carries_the_stored_answer(stored):
    data, r = data_of(stored)
    cable = data["cables"][0]
    assert len(data["s"]) == 101
    assert misfit(data, r) < 0.51
    assert misfit(data, replace(r, fields=replace(r.fields, v=r.fields.v + 1e-4 * np.ptp(r.fields.v)))) > 5.0
    assert unpacked(cable["t"])[0] == 0.0
    np.testing.assert_allclose(unpacked(cable["mass_v"])[1:], r.fields.mass_v, rtol=0.0, atol=1e-3)
    step = (cable["u"]["high"] - cable["u"]["low"]) / 65535.0
    assert np.abs(unpacked(cable["u"])[: len(data["s"])]).max() < 0.51 * step  # at rest before the entry
    assert cable["slack"] == r.slack_onset


def test_a_name_cannot_end_the_player_s_script(stored):
    r = replace(Response.read(stored / A), method="</script><b>")
    html = player(Scene.load("level"), [r], window=(0.02, 0.8), range_T=(1.1e5, 3.3e5))
    assert html.count("</script>") == 1
    assert "<b>" not in html
