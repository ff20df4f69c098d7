"""Frequencies of the bare cable."""

import json
import math
import re
from pathlib import Path

import numpy as np
import pytest

from cablefem import Scene
from tests.elements.test_modes import EXACT


def test_modes_of_both_solvers_and_the_exact_ones(cablefem):
    code, out, _ = cablefem("modes", "bare")
    assert code == 0
    found = json.loads(Path("cablefem-out/bare/modes.json").read_text())
    # The scene's length has 11 digits, its alpha thus 7 of the 844.416 behind these; Galerkin is good to a few 1e-7.
    np.testing.assert_allclose(found["exact"], EXACT, rtol=2e-8)
    for name in ("elements", "fourier", "wavelet"):
        np.testing.assert_allclose(found[name], EXACT, rtol=1e-6)
    assert "Frequencies of the bare cable" in Path("cablefem-out/bare/report.html").read_text()
    scene = Scene.load("bare")
    rows = [re.split("  +", row.strip()) for row in out.splitlines()]
    first = 1 + next(i for i, row in enumerate(rows) if row[:2] == ["mode", "Hz"])
    for row, omega in zip(rows[first:], EXACT, strict=False):  # omega l sqrt(rho/H) = 2 pi f l sqrt(rho/H)
        crossing_time = scene.length * math.sqrt(scene.cable.mass_per_length / scene.horizontal_tension)
        assert 2.0 * math.pi * float(row[1]) * crossing_time == pytest.approx(omega, rel=1e-4)
        assert [float(text) for text in row[2:]] == [pytest.approx(omega, rel=1e-6)] * 4


def test_modes_that_disagree_are_1(cablefem, monkeypatch):
    from cablefem.elements import modes

    right = modes.scaled_frequencies
    monkeypatch.setattr(modes, "scaled_frequencies", lambda *a, **k: 1.001 * right(*a, **k))
    code, out, _ = cablefem("modes", "inclined")
    assert code == 1
    assert "disagree" in out
