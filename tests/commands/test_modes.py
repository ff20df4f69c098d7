"""Frequencies of the bare cable."""

import json
from pathlib import Path

import numpy as np


def test_modes_of_both_solvers_and_the_exact_ones(cablefem):
    code, out, _ = cablefem("modes", "bare")
    assert code == 0
    found = json.loads(Path("cablefem-out/bare/modes.json").read_text())
    # Section 7.1 of the paper, computed to 11 digits: the exact linearised catenary.
    exact = [5.3454766022, 6.2761408254, 9.5728553824, 12.5684221916, 15.7413444234, 18.8571036040, 22.0114146253,
             25.1448878959, 28.2937309199, 31.4323118252]  # fmt: skip
    # The scene's length has 11 digits, its alpha thus 7 of the 844.416 behind these; Galerkin is good to a few 1e-7.
    np.testing.assert_allclose(found["exact"], exact, rtol=2e-8)
    for name in ("elements", "fourier", "wavelet"):
        np.testing.assert_allclose(found[name], exact, rtol=1e-6)
    assert "5.3454766" in out


def test_modes_that_disagree_are_1(cablefem, monkeypatch):
    from cablefem.elements import modes

    right = modes.bare_frequencies
    monkeypatch.setattr(modes, "bare_frequencies", lambda *a, **k: 1.001 * right(*a, **k))
    code, out, _ = cablefem("modes", "inclined")
    assert code == 1
    assert "disagree" in out
