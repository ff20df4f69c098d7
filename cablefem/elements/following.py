"""Cable elements on a mesh that follows the mass: README.md, 1 and 2; `forms` has the weak form."""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy.linalg import solveh_banded

from cablefem.elements.cable import CableElements
from cablefem.elements.forms import section_state, section_stiffness
from cablefem.elements.kernels.balance import MassCoupling, Mesh
from cablefem.elements.observing import MotionAtMass
from cablefem.elements.reference import reference_mesh
from cablefem.newmark import Array, ManySteps, State, States, StepFailure, consistent_acceleration, quasi_static_start
from cablefem.newmark.equilibrium import solve_equilibrium
from cablefem.newmark.newton import solve_newton_dense
from cablefem.scene import Groups
from cablefem.scene.motion import rest_motion

_ONE = np.ones(1)
_ZERO = np.zeros(1)


class FollowingElements(CableElements):
    """The cable with its moving mass on mass-following elements.

    elements : per side; degree : 1 to 8.
    grading : largest over smallest element length; the smallest are next to the mass.
    model_options : model, load and law of `CableElements`.
    """

    many_steps = True

    def __init__(
        self, groups: Groups, *, elements: int = 10, degree: int = 2, grading: float = 1.0, **model_options: str
    ) -> None:
        super().__init__(groups, **model_options)
        self.reference = of = reference_mesh(elements, degree, grading)
        is_unrolled = degree == 2 and self.fields == 2
        functions = (0,) * (degree + 1) if is_unrolled else ()
        points = (0,) * of.forces.shape[1] if is_unrolled else ()
        self._mesh = Mesh(of.dofs, of.forces, elements, functions, points)
        self._at_inertia = of.at_inertia
        self._at_force = of.at_force
        self._moments = of.moments
        self._knots = of.knots
        self._shapes = of.shapes
        self._operators = np.repeat(of.operators, self.fields, axis=2)
        # d/dxi of the shapes behind and ahead of the mass
        ends = np.array([of.shapes @ np.arange(degree + 1), of.shapes[:, 1]])
        beside = slice(elements - 1, elements + 1)
        self._at_car = ends / np.diff(of.knots)[beside, None]
        self.node = of.node
        self.n_scalar = of.operators.shape[2]
        self.n_dof = self.fields * self.n_scalar
        self._band = self.fields * degree + self.fields - 1
        node = self.fields * self.node + np.arange(self.fields)[None, :]
        self._coupling = MassCoupling(node, _ONE, self.inertia * _ONE, _ZERO, _ZERO)
        self._make_kernel_workspaces()

    def start(self, phase: int, state: State | None) -> State:
        """The state at the beginning of a phase.

        With speed, the contact force is 0.  From rest, s_o = a t^2/2 and w(s_o) = d s_o with
        m a d + mu (a X' - sigma j) + [N t - T t_static] = 0 at r' = X' + d; m includes entrained cable.
        """
        t = self.phases[phase][0]
        if state is not None:
            return consistent_acceleration(self, t, state.q, state.v, phase)
        s_o, ds, dds = self.motion.position_with_rates(t, phase)
        if s_o > 0.0:
            return quasi_static_start(
                self, lambda at: solve_equilibrium(self.tension_only_at_rest_with_clamped_car(at)), s_o, ds
            )
        shape, entrained = self._entry_shape_and_entrained_inertia()
        inertia = self.inertia + entrained
        zero = np.zeros(self.n_dof)
        if ds > 0.0:
            node_a = -self._inertia_less_weight_of_mass(0.0, ds, dds) / inertia
        elif dds > 0.0:
            load = self._inertia_less_weight_of_mass(0.0, 0.0, dds)
            node_a = dds * self._entry_slope_behind(inertia * dds, load)
        else:
            raise ValueError("the travel starts with neither speed nor acceleration")
        a = shape[:, None] * node_a
        return State(t, zero, zero.copy(), a.ravel(), phase)

    def tension_only_at_rest_with_clamped_car(self, s_o: float) -> FollowingElements:
        """A copy with the law "tension-only", in which the mass is at rest at s_o."""
        other = self.with_law("tension-only")
        other.motion = rest_motion(s_o, 1.0)
        return other

    # --- assembly --------------------------------------------------------------------------------------
    def _entry_shape_and_entrained_inertia(self) -> tuple[Array, float]:
        """Accelerations of all nodes at entry over that of the mass, and the inertia of the cable that moves.

        Behind the mass they are linear.  Ahead M x = e at the mass: its node moves with x/x_mass and weighs 1/x_mass.
        """
        node = self.node
        degree = self.reference.degree
        knots = self.reference.knots
        linear = np.zeros(node + 2)  # nodal values of xi
        linear[::degree] = 1.0 + knots[: self._mesh.n_left + 1]
        if degree == 2:  # midpoints; from degree 3 on bubbles
            linear[1::2] = 0.5 * (linear[:-1:2] + linear[2::2])
        M = self.reference.operators[1, degree:, node:]
        at_mass = np.eye(M.shape[1], 1)[:, 0]
        ahead = solveh_banded(M[: M.shape[1]], at_mass, lower=True)
        shape = np.concatenate([linear[1:], ahead[1:] / ahead[0]])
        return shape, float(1.0 / ahead[0])

    def _entry_slope_behind(self, inertia: float, load: Array) -> Array:
        """d of `start`: inertia d + [N t - T t_static](X' + d) + load = 0."""
        if self.fields == 1:
            return -load / (inertia + self._law[1])
        T, *slope = self.groups.tension_and_slope(0.0)
        X_s = np.array(slope)

        def linearise(d: Array) -> tuple[Array, Array]:
            at = X_s, T, d, self.groups.alpha, self._law[3]
            force = inertia * d + section_state(*at).force + load
            return force, inertia * np.eye(2) + section_stiffness(*at)

        d = solve_newton_dense(linearise, np.zeros(2))
        if d is None:
            raise StepFailure(0.0, "no equilibrium of the start from rest was found", "let the mass start more gently")
        return d

    def solve_steps(self, *steps: Any) -> ManySteps:
        """Steps end where the cable falls slack."""
        ends, results, taken = self._take_newmark_steps(*steps)
        if taken:
            min_tension, s = results[taken - 1, 4:].tolist()
            self.min_tension_and_position = min_tension, s
        return ManySteps(ends[:taken], results[: taken + 1])

    def _kinematics_and_load(self, t: Array, phase: int) -> Array:
        kinematics = self.motion.positions_with_rates(t.ravel(), phase)
        if not (kinematics[0].min() > 0.0 and kinematics[0].max() < 1.0):
            raise ValueError("a side of the following mesh has no length at an end of the travel")
        load = self._inertia_less_weight_of_mass(*kinematics)
        columns = [*kinematics, *load]
        return np.stack(columns, axis=1).reshape(*t.shape, -1)

    def _mass_coupling_at(self, t: float, phase: int) -> MassCoupling:
        return self._coupling

    # --- observation -----------------------------------------------------------------------------------
    def _cable_motion_at_mass(self, states: States, mass_kinematics: Array) -> MotionAtMass:
        s_o, ds, dds = mass_kinematics.T
        node = self.node
        first_ahead = self._mesh.n_left
        beside = self._mesh.dofs[first_ahead - 1 : first_ahead + 1]
        around = self._nodal_values(states.q, beside)  # (n, 2, n_loc, fields)
        behind = np.tensordot(around[:, 0], self._at_car[0], axes=(1, 0))
        ahead = np.tensordot(around[:, 1], self._at_car[1], axes=(1, 0))
        q = self._nodal_values(states.q, node)
        v = self._nodal_values(states.v, node)
        a = self._nodal_values(states.a, node)
        behind /= np.where(s_o > 0.0, s_o, 1.0)[:, None]
        ahead /= (1.0 - s_o)[:, None]
        if s_o.size and s_o[0] == 0.0:  # limit of w(s_o)/s_o
            behind[0] = 0.0
            if ds[0] > 0.0:
                behind[0] = v[0] / ds[0]
            elif dds[0] > 0.0:
                behind[0] = a[0] / dds[0]
        return MotionAtMass(q, v, a, behind, ahead)
