"""Equal cable elements on a fixed mesh, the mass moving through them.

M d2q/dt2 + R(q) + N(s_o)^T F = 0, F = mu (d2p/dt2 - sigma j), p = X(s_o) + N(s_o) q, with couplings

chain    N a + 2 ds_o N' v + (ds_o^2 N'' + dds_o N') q, for C1 (Hermite) elements; error about elements^2/steps.
naive    the same in P1 elements.  WRONG: no centrifugal force, as N'' has deltas at nodes.
path     p is an unknown with the constraint p = N(s_o) q (index 3).  It needs numerical damping:
         Hermite generalised-alpha, rho_inf = 0.5, 12 steps per element; P1 gamma = 0.6, at most 25.
"""

from collections.abc import Iterator
from typing import Any

import numpy as np
import skfem
from numpy.polynomial.polynomial import polyder
from numpy.typing import NDArray
from skfem.models.poisson import mass

from cablefem.elements.cable import CableElements
from cablefem.elements.kernels.balance import Factors, MassCoupling, Mesh
from cablefem.elements.observing import HistoryWithForces, MotionAtMass, StationFields
from cablefem.elements.reference import (
    QuadraturePoints,
    assemble_bands,
    force_quadrature_order,
    shape_integrals,
    shape_polynomial_coefficients,
    shape_table,
)
from cablefem.newmark import (
    ACCELERATION_ONLY,
    Array,
    Solve,
    State,
    States,
    StepResult,
    TangentFactors,
    collocate_first_step,
    consistent_acceleration,
    take_newmark_step,
)
from cablefem.scene import Groups

_KINDS = {"hermite": skfem.ElementLineHermite, "p1": skfem.ElementLineP1}


class FixedElements(CableElements):
    at_support = True
    node = 0

    def __init__(
        self,
        groups: Groups,
        *,
        elements: int = 40,
        element: str = "hermite",
        coupling: str = "chain",
        **model_options: str,
    ) -> None:
        super().__init__(groups, **model_options)
        self.elements = elements
        self._set_tables_and_matrices(_KINDS[element])
        self.particle = coupling == "path"
        self.n_dof = self.fields * (self.n_scalar + self.particle)
        self._make_kernel_workspaces()

    def start(self, phase: int, state: State | None) -> State:
        """At entry everything rests.

        A jump of dds_o gives (M + mu N^T N) [a] = -mu N^T [dds_o] (X' + N' q).
        """
        t = self.phases[phase][0]
        if state is None:
            zero = np.zeros(self.n_dof)
            return State(t, zero, zero.copy(), zero.copy(), phase)
        if not self.particle:
            return consistent_acceleration(self, t, state.q, state.v, phase)
        s_o, _, dds = self.motion.position_with_rates(t, phase)
        jump = dds - self.motion.position_with_rates(t, phase - 1)[2]
        dofs, N, N_s, _ = self._unknowns_and_shape_functions_ahead(s_o)
        static_slope = self.static_shape_and_derivatives(s_o)[1]
        slope_jump = jump * N_s @ state.q[dofs]
        load = np.zeros(self.fields * self.n_scalar)
        load[dofs] = -self.inertia * np.outer(N, jump * static_slope + slope_jump)
        _, solve = super().linearise(t, state.q, state.v, state.a, phase, ACCELERATION_ONLY)
        a_jump = solve(load)
        of_particle = N @ a_jump[dofs] + slope_jump
        a = state.a + np.append(a_jump, of_particle)
        return State(t, state.q, state.v, a, phase)

    def linearise(self, t: float, q: Array, v: Array, a: Array, phase: int, c: TangentFactors) -> tuple[Array, Solve]:
        """As of the cable; the rows of a particle are eliminated by its constraint."""
        c0, _, c2 = c
        r, solve = super().linearise(t, q, v, a, phase, c)
        if not self.particle:
            return r, solve
        if c0 == 0.0:
            raise ValueError("coupling path needs an implicit scheme: a constraint on positions has no explicit one")
        f = self.fields
        mu = self.inertia
        dofs, N, *_ = self._instant.coupling

        # rows S x + c2 mu N^T y = b, c0 (y - N x) = d; the band of S includes mu c2 N^T N
        def solve_with_particle(b: Array) -> Array:
            d = b[-f:] / c0
            b[dofs] -= c2 * mu * np.outer(N, d)
            x = solve(b[:-f])
            return np.append(x, d + N @ x[dofs])

        return r, solve_with_particle

    def solve_step(self, *step: Any) -> StepResult:
        if self.particle:  # not compiled
            return take_newmark_step(self, *step)
        return super().solve_step(*step)

    def collocate_steps(self, *step: Any) -> Iterator[StepResult]:
        if self.particle:
            return collocate_first_step(self, *step)
        return super().collocate_steps(*step)

    def _set_tables_and_matrices(self, element: type[skfem.Element]) -> None:
        """Set tables and matrices of the mesh from one element, which is repeated.

        On fine meshes scikit-fem's Hermite functions lose digits (12.0.2).
        """
        n = self.elements
        k = element.nodal_dofs
        step = k + element.interior_dofs
        offsets = np.r_[0:k, step : step + k, k:step]  # in scikit-fem's order: left node, right node, inside
        n_loc = len(offsets)
        degree = n_loc - 1
        first = np.arange(n)[:, None]
        all_dofs = step * first + offsets
        number = np.arange(all_dofs.max() + 1)
        supports = (number == 0) | (number == step * n)
        number = np.where(supports, -1, np.cumsum(~supports) - 1)
        dofs = number[all_dofs]
        self.n_scalar = int(number.max()) + 1
        unit = skfem.MeshLine(np.array([0.0, 1.0]))
        of_products = skfem.Basis(unit, element(), intorder=2 * degree)
        of_forces = skfem.Basis(unit, element(), intorder=force_quadrature_order(degree))
        inertia = np.tile(shape_table(of_products), (n, 1, 1))
        forces = np.tile(shape_table(of_forces), (n, 1, 1))
        for tab in (inertia, forces):
            tab[:, :, 0] += first
            tab[:, :, :2] /= n
            tab[:, :, 2 + n_loc :] *= n
        self._mesh = Mesh(dofs, forces, n, (), ())
        self._at_inertia = QuadraturePoints.from_table(dofs, inertia, n, self.n_scalar)
        self._at_force = QuadraturePoints.from_table(dofs, forces, n, self.n_scalar)
        b = int(offsets.max())
        self._band = self.fields * b + self.fields - 1
        local_mass = np.repeat(mass.coo_data(of_products).tolocal() / n, n, axis=0)
        M = assemble_bands(local_mass, dofs, self.n_scalar, b)
        self._operators = np.repeat(M[None], self.fields, axis=2)
        self._moments = shape_integrals(dofs, inertia, inertia[..., 0], self.n_scalar)[None]
        self._knots = np.linspace(-1.0, 0.0, n + 1)
        self._shapes = shape_polynomial_coefficients(element())
        derivatives = []
        for order in range(3):
            derivative = float(n) ** order * polyder(self._shapes, order, axis=1)
            missing = n_loc - derivative.shape[1]
            derivatives.append(np.pad(derivative, ((0, 0), (0, missing))))
        self._powers = np.stack(derivatives)  # N, N', N'' (3, n_loc, n_loc)

    def _unknowns_and_shape_functions_ahead(self, s: float) -> tuple[NDArray[np.int64], Array, Array, Array]:
        """Unknowns (n_loc, fields) and N, N', N'' (n_loc,) at s, without supports; at a node of the element ahead."""
        (dofs,), shapes = self._shape_functions_on_side(np.array([s]), "ahead")
        keep = dofs >= 0
        N, N_s, N_ss = np.ascontiguousarray(shapes[:, keep, 0])  # one layout, compiled once
        unknowns = self.fields * dofs[keep][:, None] + np.arange(self.fields)
        return unknowns, N, N_s, N_ss

    def _kinematics_and_load(self, t: Array, phase: int) -> Array:
        kinematics = self.motion.positions_with_rates(t.ravel(), phase)
        load = self._inertia_less_weight_of_mass(*kinematics)
        zero = np.zeros(t.size)
        columns = [zero + 1.0, zero, zero, *load]
        return np.stack(columns, axis=1).reshape(*t.shape, -1)

    def _mass_coupling_at(self, t: float, phase: int) -> MassCoupling:
        s_o, ds, dds = self.motion.position_with_rates(t, phase)
        dofs, N, N_s, N_ss = self._unknowns_and_shape_functions_ahead(s_o)
        convected = 0.0 if self.particle else self.inertia  # a particle's path has them already
        c_row = 2.0 * convected * ds * N_s
        k_row = convected * (ds * ds * N_ss + dds * N_s)
        return MassCoupling(dofs, N, self.inertia * N, c_row, k_row)

    def _set_residual_and_tangent(self, t: float, phase: int, x: Array, r: Array, factors: Factors) -> None:
        super()._set_residual_and_tangent(t, phase, x, r, factors)
        if self.particle:
            dofs, N, m_row, *_ = self._instant.coupling
            q, _, a = x
            p = slice(-self.fields, None)
            r[p] = q[p] - N @ q[dofs]
            missing = self.inertia * a[p] - m_row @ a[dofs]
            r[dofs] += np.outer(N, missing)

    def _shape_functions_on_side(self, s: Array, side: str) -> tuple[NDArray[np.int64], Array]:
        """Unknowns (m, n_loc), -1 for supports, and N, N', N'' (3, n_loc, m) at s (m,).

        side : "behind" or "ahead", which counts at a node.
        """
        x = s * self.elements
        element = np.ceil(x) - 1 if side == "behind" else np.floor(x)
        e = np.clip(element, 0, self.elements - 1).astype(int)
        powers = (x - e) ** np.arange(self._powers.shape[2])[:, None]
        return self._mesh.dofs[e], self._powers @ powers

    def _moving_node_kinematics(self, mass_kinematics: Array) -> Array:
        return np.tile([1.0, 0.0, 0.0], (len(mass_kinematics), 1))  # one side, which rests

    def _cable_motion_at_mass(self, states: States, mass_kinematics: Array) -> MotionAtMass:
        s_o, ds, dds = mass_kinematics.T
        row = np.arange(s_o.size)[:, None]
        dofs, shapes = self._shape_functions_on_side(s_o, "ahead")
        q = self._nodal_values(states.q, dofs, row)  # (n, n_loc, fields)
        v = self._nodal_values(states.v, dofs, row)
        a = self._nodal_values(states.a, dofs, row)

        def at(shape: Array, x: Array) -> Array:
            return np.einsum("ln,nlf->nf", shape, x)

        N, N_s, N_ss = shapes
        ahead = at(N_s, q)
        dofs, shapes = self._shape_functions_on_side(s_o, "behind")
        behind = at(shapes[1], self._nodal_values(states.q, dofs, row))
        if self.particle:
            p = slice(-self.fields, None)
            return MotionAtMass(states.q[:, p], states.v[:, p], states.a[:, p], behind, ahead)
        velocity = at(N, v) + ds[:, None] * ahead
        coriolis = at(2.0 * ds * N_s, v)
        acceleration = at(N, a) + coriolis + at(ds**2 * N_ss + dds * N_s, q)
        return MotionAtMass(at(N, q), velocity, acceleration, behind, ahead)

    def _forces_at_side_ends_with_mass(self, history: HistoryWithForces) -> Array:
        """Adds the mass; half of ds_o^2 [r'] is missing in the element under it."""
        s_o = history.mass_kinematics[:, 0]
        force = history.contact_force
        behind, ahead = history.forces_at_side_ends[1:3]
        left = history.forces_at_side_ends[0] - (1.0 - s_o) * force
        right = behind + s_o * force
        of_cable = history._replace(forces_at_side_ends=np.stack([left, behind, ahead, right]))
        frames = np.arange(s_o.size)
        at_mass = self._fields_without_mass(of_cable, s_o[:, None], frames)
        at_behind = at_mass.force_less_flux[..., 0]
        return np.stack([left, at_behind, at_behind + force, right])

    def _fields_without_mass(self, history: HistoryWithForces, s: Array, frames: NDArray[np.intp]) -> StationFields:
        """`_fields_at_stations` of one side without the force of the mass inside."""
        mesh = self._moving_node_kinematics(history.mass_kinematics)
        return super()._fields_at_stations(history._replace(mass_kinematics=mesh), s, frames)

    def _fields_at_stations(self, history: HistoryWithForces, s: Array, frames: NDArray[np.intp]) -> StationFields:
        along = self._fields_without_mass(history, s, frames)
        is_ahead = s > history.mass_kinematics[frames, :1]  # (k, m)
        of_mass = is_ahead * history.contact_force[:, frames, None]
        return along._replace(force_less_flux=along.force_less_flux + of_mass)
