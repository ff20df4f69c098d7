"""The jump of force on the cable at the mass is what the mass needs.

    [ (N/|r'| - ds_o^2) r' ] = mu (p.. - sigma j),   j down, [ ] = ahead less behind, r' the one-sided slopes,

in units of rho, H; N tension, p place of the mass.

Source: Balance of force and momentum
Validity: any cable, any travel, 0 < s_o < l
Accuracy: exact
Group: The jump of force at the mass
"""

from typing import Any

import numpy as np

from cablefem.scene import Scene
from validation.oracles.case import WINDOW, Array, Law, ridden


def force(tension: Array, slope: Array, flux: Array) -> Array:
    """(n, 2) from tension (n,), slope r' (n, 2), flux rho ds_o^2 (n,)."""
    return (tension / np.hypot(*slope.T) - flux)[:, None] * slope


def _law(*, flux: bool) -> Law:
    scene = Scene.load("level")
    assert scene.mass is not None
    mass = scene.mass.mass
    rho = scene.rho if flux else 0.0

    def defect(r: Any) -> Array:
        streams = rho * np.gradient(r.s_o, r.t, edge_order=2) ** 2
        needs = mass * (r.acceleration - np.array([0.0, scene.gravity]))
        missing = force(r.T_ahead, r.slope_ahead, streams) - force(r.T_behind, r.slope_behind, streams) - needs
        inside = (r.s_o >= WINDOW[0] * r.length) & (r.s_o <= WINDOW[1] * r.length)
        return np.hypot(*missing[inside].T) / (mass * scene.gravity)

    told = "" if flux else ", without the cable's momentum flux"
    return Law(
        name="force and momentum at the mass, model full" + told, defect=ridden(scene, defect, WINDOW[1]),
        falls=1.0, because="slopes at the mass, and with them tensions, are worth one order",
        methods=("following-p1", "following-p2", "fourier-kink") if flux else ("following-p2",),
        expected="agree" if flux else "disagree", finer=1.6 if flux else 2.5,
    )  # fmt: skip


def cases() -> list[Law]:
    return [_law(flux=True), _law(flux=False)]
