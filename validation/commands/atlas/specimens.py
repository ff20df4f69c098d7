"""Systems of the failure catalogue: planted faults, and the limits of theory."""

from dataclasses import replace
from typing import Any

import numpy as np
from scipy.linalg import eigvals

from cablefem.newmark import State
from cablefem.response import Array
from cablefem.scene import Groups
from galerkin.bases.fourier import Fourier
from galerkin.equations import GalerkinSystem, Instant
from validation.core.methods import METHODS, Method


def frozen_matrices(system: GalerkinSystem, t: float) -> list[Array]:
    """M, C and K of the cable and mass at rest, frozen at time t."""
    q = np.zeros(system.n_dof)
    return [system.tangent(t, q, 0, factors) for factors in ((0, 0, 1.0), (0, 1.0, 0), (1.0, 0, 0))]


def frozen_growth_rate(system: GalerkinSystem, t: float) -> float:
    """Largest growth rate Re lambda of the system of `frozen_matrices`, per unit of dimensionless time."""
    M, C, K = frozen_matrices(system, t)
    n = system.n_dof
    lower = -np.linalg.solve(M, np.hstack([K, C]))  # (n, 2 n)
    A = np.vstack([np.eye(n, 2 * n, n), lower])
    return float(eigvals(A).real.max())


def _system_without_inertia_terms(*terms: str) -> type[GalerkinSystem]:
    """FAULT: the acceleration of the mass without terms (22), (23) of the travel; f_v : 2 ds_o w.'."""

    class Faulty(GalerkinSystem):
        def _instant_at(self, *kinematics: float) -> Instant:
            x = super()._instant_at(*kinematics)
            zeros = {name: np.zeros_like(getattr(x.inertia_terms, name)) for name in terms}
            return x._replace(inertia_terms=x.inertia_terms._replace(**zeros))

    return Faulty


class _RestingStart(GalerkinSystem):
    """FAULT: at entry the hat accelerates with the mass alone and the sines rest, instead of the limit t -> 0+."""

    def _state_at_entry(self) -> State:
        x = super()._state_at_entry()
        s_o, ds_o, dds_o = self.motion.position_with_rates(x.t, 0)
        a = np.zeros_like(x.a)
        a[self.n - 1 :: self.n] = -self._inertia_and_weight_per_mass(s_o, ds_o, dds_o)
        return State(x.t, x.q, np.zeros_like(x.v), a, 0)


def method_with_fault(method: str, fault: type[GalerkinSystem]) -> Method:
    """A method whose system is the faulty one."""

    def build_faulty(groups: Groups, x: dict[str, Any], **model_options: Any) -> Any:
        return fault(groups, Fourier(x["terms"]), kink=method.endswith("kink"), **model_options)

    return replace(METHODS[method], build=build_faulty)


PLANTED = {
    "no Coriolis": method_with_fault("fourier", _system_without_inertia_terms("f_v")),
    "no convection": method_with_fault("fourier", _system_without_inertia_terms("f_v", "f_q")),
    "resting start": method_with_fault("fourier-kink", _RestingStart),
}  # fmt: skip
