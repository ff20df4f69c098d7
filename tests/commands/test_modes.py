"""Frequencies of the bare cable."""

import json
import math
import re
from pathlib import Path

import numpy as np
import pytest
from scipy import sparse
from scipy.optimize import brentq
from scipy.sparse.linalg import eigsh

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


def test_frequencies_of_a_rope_thrice_as_long_as_its_span_are_those_of_a_chain(cablefem):
    """A chain of 1600 point masses and springs, whose error falls like the square of their number."""
    rho, g, EA, span, length = 5.0, 9.81, 5e7, 200.0, 600.0
    Path("deep.toml").write_text(
        f"[cable]\nmass_per_length = {rho}\nEA = {EA}\nlength = {length}\n[supports]\nspan = {span}\n"
    )
    a = brentq(lambda a: 2.0 * a * math.sinh(0.5 * span / a) - length, 10.0, 1000.0)
    links = 1600
    ds = length / links
    nodes = np.linspace(-0.5 * length, 0.5 * length, links + 1)
    chord = np.array([np.diff(a * np.arcsinh(nodes / a)), np.diff(np.hypot(a, nodes))])
    t = chord / np.hypot(*chord)  # (2, links)
    T = rho * g * np.hypot(a, 0.5 * (nodes[1:] + nodes[:-1]))
    along = t[:, None] * t[None]  # (2, 2, links)
    stiffness = (EA * along + T * (np.eye(2)[:, :, None] - along)) / ds
    D = sparse.diags([-np.ones(links), np.ones(links - 1)], [0, -1], shape=(links, links - 1))
    K = sparse.block_array([[D.T @ sparse.diags(k) @ D for k in row] for row in stiffness]).tocsc()
    squares = eigsh(K, k=10, sigma=0.0, return_eigenvectors=False) / (rho * ds)
    hertz = np.sort(np.sqrt(squares)) / (2.0 * math.pi)

    code, out, _ = cablefem("modes", "deep.toml")
    assert code == 0, out
    found = json.loads(Path("cablefem-out/deep/modes.json").read_text())
    np.testing.assert_allclose(found["hertz"], hertz, rtol=1e-4)
    assert [row["verdict"] for row in found["rows"]] == 3 * ["agree"]
    assert f"{found['hertz'][0]:.5g}" in Path("cablefem-out/deep/report.html").read_text()


def test_a_nearly_straight_stiff_rope_agrees(cablefem):
    """Rounding of matrices with axial stiffness 1e5 times the transverse one is no fault of a method."""
    Path("wire.toml").write_text(
        "[cable]\nmass_per_length = 1.0\nEA = 1e11\nhorizontal_tension = 1e6\n[supports]\nspan = 100.0\n"
    )
    code, out, _ = cablefem("modes", "wire.toml")
    assert code == 0, out


def test_modes_that_disagree_are_1(cablefem, monkeypatch):
    from cablefem.elements import modes

    right = modes.scaled_frequencies
    monkeypatch.setattr(modes, "scaled_frequencies", lambda *a, **k: 1.001 * right(*a, **k))
    code, out, _ = cablefem("modes", "inclined")
    assert code == 1
    assert "disagree" in out
    assert "disagree" in Path("cablefem-out/inclined/report.html").read_text().split("</style>")[1]
