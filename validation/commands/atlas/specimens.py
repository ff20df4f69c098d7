"""Systems of the failure catalogue: the free cable, planted faults, and the limits of theory."""

import math
from contextlib import suppress
from dataclasses import replace
from typing import Any

import numpy as np
from scipy.linalg import eigvals

from cablefem import newmark
from cablefem.elements.fixed import FixedElements
from cablefem.elements.observing import energies
from cablefem.newmark import Newton, Scheme, State, consistent_acceleration
from cablefem.response import Array
from cablefem.scene import Groups
from cablefem.scene.motion import standing
from galerkin.bases.fourier import Fourier
from galerkin.equations import GalerkinSystem, Instant
from validation.core.methods import METHODS, Method


class FreeCable(FixedElements):
    """The bare cable let go from v = amplitude sin(2 pi s), linear elements; no load, so energy is kept.

    That mode does not stretch the cable.
    """

    def __init__(self, groups: Groups, *, elements: int, amplitude: float, end: float) -> None:
        super().__init__(
            replace(groups, mu=0.0, motion=standing(0.37, end)), elements=elements, element="p1", coupling="naive"
        )
        self.shape = amplitude * np.sin(2.0 * math.pi * np.arange(1, elements) / elements)

    def start(self, phase: int, state: State | None) -> State:
        q = np.zeros(self.n_dof)
        q[1::2] = self.shape
        return consistent_acceleration(self, 0.0, q, np.zeros_like(q), 0)

    def energy(self, x: State) -> float:
        """Kinetic and strain energy less the work of gravity; zero for the cable at rest."""
        q, v = (y.reshape(1, -1, 2) for y in (x.q, x.v))
        return float(energies(self, np.array([[1.0, 0.0, 0.0]]), q, v)[0].sum())


def free_vibration(system: FreeCable, scheme: Scheme, times: Any) -> Array:
    """Energy after every step over that at the start, (n,); short if the run broke."""
    tol = 1e-12 if scheme.average else 1e-9  # the energy is kept as well as the steps are solved
    energy: list[float] = []
    with suppress(newmark.NewtonStalled):
        for x in newmark.integrate(system, scheme, [times], newton=Newton(tol=tol, max_iter=40)):
            energy.append(system.energy(x))
    return np.array(energy) / energy[0]


def frozen(system: GalerkinSystem, t: float) -> Any:
    """M, C and K of the cable and mass at rest, frozen at time t."""
    return (system.tangent(t, np.zeros(system.n_dof), 0, *c) for c in ((0, 0, 1.0), (0, 1.0, 0), (1.0, 0, 0)))


def frozen_growth(system: GalerkinSystem, t: float) -> float:
    """Largest growth rate Re lambda of the `frozen` system."""
    M, C, K = frozen(system, t)
    n = system.n_dof
    A = np.block([[np.zeros((n, n)), np.eye(n)], [-np.linalg.solve(M, np.hstack([K, C]))]])
    return float(eigvals(A).real.max())


class _NoCoriolis(GalerkinSystem):
    """FAULT: 2 ds_o w.' left out of the acceleration of the mass."""

    def _instant(self, *kinematics: float) -> Instant:
        x = super()._instant(*kinematics)
        return x._replace(carried=x.carried._replace(f_v=np.zeros_like(x.carried.f_v)))


class _NoConvection(_NoCoriolis):
    """FAULT: all terms (22), (23) of the travel left out of the acceleration of the mass."""

    def _instant(self, *kinematics: float) -> Instant:
        x = super()._instant(*kinematics)
        return x._replace(carried=x.carried._replace(f_q=np.zeros_like(x.carried.f_q)))


class _RestingStart(GalerkinSystem):
    """FAULT: at entry the hat accelerates with the mass alone and the sines rest, instead of the limit t -> 0+."""

    def _entry(self) -> State:
        x = super()._entry()
        s_o, ds_o, dds_o = self.motion.at(x.t, 0)
        a = np.zeros_like(x.a)
        a[self.n - 1 :: self.n] = -self._load(s_o, ds_o, dds_o)
        return State(x.t, x.q, np.zeros_like(x.v), a, 0)


def planted(method: str, fault: type[GalerkinSystem]) -> Method:

    def build(groups: Groups, x: dict[str, Any], **kind: Any) -> Any:
        return fault(groups, Fourier(x["terms"]), kink=method.endswith("kink"), **kind)

    return replace(METHODS[method], build=build)


PLANTED = {
    "no Coriolis": planted("fourier", _NoCoriolis), "no convection": planted("fourier", _NoConvection),
    "resting start": planted("fourier-kink", _RestingStart),
}  # fmt: skip
