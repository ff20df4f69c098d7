"""Cable elements on a mesh that follows the mass: the mass is inertia on its own node, and nothing else.

A node rides on the mass.  On the left s = s_o xi, on the right s = s_o + (1 - s_o) xi, each side with its own
fixed reference mesh on 0 <= xi <= 1, so nodes move with c(s, t) = ds_o w, w = xi on the left and 1 - xi on the
right.  In the conservative (arbitrary Lagrangian-Eulerian) weak form with w. = dq/dt phi - c q phi',

    d/dt int w. phi_i ds + int c w. phi_i' ds + int (N t - T t_static) . phi_i' ds = external,

each side of length h gives, with matrices M^, G^, H^ that scikit-fem assembles once on the reference mesh,

    M = h M^,   C = dh/dt M^ - G + G^T,   K = -(dG/dt + H),   G = ds_o G^,  H = (ds_o^2 / h) H^.

None of the paper's three acceleration terms (21)-(23) appears: they are checked by a model that does not know them.
Dimensionless: l = H = rho = 1.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solveh_banded
from scipy.sparse import coo_array

from cablefem.elements.cable import CableElements, bands, elements_allowed, limits
from cablefem.elements.kernels.balance import Contact, Mesh, follow
from cablefem.elements.kernels.law import pull
from cablefem.elements.kernels.newton import settle
from cablefem.elements.kernels.observe import along, end_forces
from cablefem.elements.reference import Reference, graded_knots, reference
from cablefem.newmark import Array, Newton, Settled, State, StepFailure, Tableau, begun, consistent_acceleration
from cablefem.response import States
from cablefem.scene import Groups
from cablefem.scene.motion import standing

_ONE, _ZERO = np.ones(1), np.zeros(1)


class Tables(NamedTuple):
    """What both sides have on their reference meshes, whatever the scene."""

    left: Reference
    right: Reference
    dofs: NDArray[np.int64]
    forces: Array
    inertia: Array
    operators: Array  # bands of M^, G^, G^T, H^, left and right each
    ride: Array  # d2q/dt2 of all nodes when that of the mass is one, at entry
    entrained: float  # the inertia of the elements that it entrains then
    slopes: tuple[tuple[NDArray[np.int64], Array], ...]  # unknowns and d/dxi of them, behind and ahead of the mass


@lru_cache(maxsize=64)
def _tables(elements: int, degree: int, grading: float) -> Tables:
    """Tabulate both sides of the mass; runs that differ in their steps or scenes alone share it."""
    sides = tuple(
        reference(graded_knots(elements, grading, fine_at_end=x), degree, pull_at_end=x) for x in (True, False)
    )
    left, right = sides
    node, n = left.n - 2, left.n + right.n - 3
    shift, b = (-1, node), degree
    dofs = []
    for side, offset in zip(sides, shift, strict=True):
        d = side.dofs + offset
        d[(d < 0) | (d >= n)] = -1
        dofs.append(d)
    operators = []
    for name in ("M", "G", "GT", "H"):
        for side, offset in zip(sides, shift, strict=True):
            full = getattr(side, name[0])
            full = full.T if name == "GT" else full
            row, col = full.row + offset, full.col + offset
            inner = (row >= 0) & (row < n) & (col >= 0) & (col < n)
            operators.append(bands(coo_array((full.data[inner], (row[inner], col[inner])), shape=(n, n)), b))
    linear = np.zeros(left.n)  # nodal values of the function xi
    linear[::b] = left.knots
    if b == 2:  # Lagrange midpoints; from degree 3 on interior functions are bubbles
        linear[1::2] = 0.5 * (left.knots[1:] + left.knots[:-1])
    # ahead of the mass, with M x = e at the mass: its node moves with x/x_mass and weighs 1/x_mass
    M = bands(right.M, b)[b:, :-1].copy()
    pushed = solveh_banded(M[: M.shape[1]], np.eye(M.shape[1], 1)[:, 0], lower=True)  # one element: no band
    forces, inertia = (np.concatenate([getattr(x, of) for x in sides]) for of in ("forces", "inertia"))
    ride, entrained = np.concatenate([linear[1:], pushed[1:] / pushed[0]]), float(1.0 / pushed[0])
    slopes = []
    for side, xi, offset in zip(sides, (1.0, 0.0), shift, strict=True):
        at, _, slope = side.evaluate(np.array(xi))
        keep = (at + offset >= 0) & (at + offset < n)
        slopes.append((at[keep] + offset, slope[keep]))
    return Tables(
        left, right, np.concatenate(dofs), forces, inertia, np.array(operators), ride, entrained, tuple(slopes)
    )


class FollowingElements(CableElements):
    """The cable with its moving mass on mass-following elements; a `cablefem.newmark.System`.

    groups : the scene in dimensionless form, with its motion.
    elements : per side of the mass.
    degree : of the elements, 1 to 8.
    grading : largest over smallest element length; the smallest elements are next to the mass.
    model : "full" for (u, v), or one unknown field normal to the chord: "string", "sagged", "stretching".
    load : "mass", or "force" for its weight alone.
    law : "elastic", or "tension-only": N = max(0, T + alpha eps).
    """

    strides = True

    def __init__(
        self, groups: Groups, *, elements: int = 10, degree: int = 2, grading: float = 1.0, model: str = "full",
        load: str = "mass", law: str = "elastic",
    ) -> None:  # fmt: skip
        super().__init__(groups, model, load, law)
        elements_allowed(elements)
        if not (math.isfinite(grading) and 1.0 <= grading <= 1e6):
            raise ValueError(f"grading must lie in [1, 1e6], got {grading!r}")
        of = _tables(elements, degree, grading)
        self.left, self.right, self._dofs = of.left, of.right, of.dofs
        self._operators = np.repeat(of.operators, self.fields, axis=2)
        self._tab, self._fine, self._slopes = of.forces, of.inertia, of.slopes
        self._ride, self._entrained = of.ride, of.entrained
        self.node = self.left.n - 2  # scalar dof of the mass; the supports carry none
        self.n_scalar = self.left.n + self.right.n - 3
        self.n_dof, self._n_left = self.fields * self.n_scalar, elements
        self._band = self.fields * degree + self.fields - 1
        self._fresh()

    def start(self, phase: int, state: State | None) -> State:
        """Return the state at the beginning of a phase.

        Entering with speed the mass falls freely, no contact force yet; from rest with s_o = a t^2/2 and
        w(s_o) = b t^2 the left part is strained by r' = X' + 2b/a at once, and with the node's inertia m
        m 2b + mu (a X' - sigma j) + [N t - T t_static] = 0 gives b.  Either way m is what the node and the
        elements ahead weigh together: a start that moves the mass alone costs an order in time.  The nodes
        behind, on a part of no length yet, follow linearly (w is of second degree in s and t, so w ~ s t).
        After a jump of the drive's acceleration q and dq/dt go on and d2q/dt2 is solved for.
        """
        t = self.phases[phase][0]
        if state is not None:
            return consistent_acceleration(self, t, state.q, state.v, phase)
        s_o, ds, dds = self.motion.at(t, phase)
        if s_o > 0.0:
            return begun(self, self.standing, s_o, ds)
        if ds > 0.0:
            node_a = -np.array(self._load(0.0, ds, dds)) / (self.inertia + self._entrained)
        elif dds > 0.0:
            node_a = 2.0 * self._strained_start(dds)
        else:
            raise ValueError("the travel starts with neither speed nor acceleration")
        zero = np.zeros(self.n_dof)
        return State(t, zero, zero.copy(), (self._ride[:, None] * node_a).ravel(), phase)

    def standing(self, s_o: float) -> FollowingElements:
        """Return the same elements with the mass held at s_o."""
        twin = self.with_law(self.law)
        twin.motion = standing(s_o, 1.0)
        return twin

    # --- assembly --------------------------------------------------------------------------------------
    def _strained_start(self, dds: float) -> Array:
        """Solve m 2b + mu a X' - weight + [N t - T t_static](X' + 2b/a) = 0 for b by Newton's method."""
        rest = np.array(self._load(0.0, 0.0, dds))
        inertia = self.inertia + self._entrained
        if self.fields == 1:
            return -rest / (2.0 * inertia + 2.0 * self._cable[1] / dds)
        b = np.zeros(2)
        p = self.groups.c
        T = math.hypot(1.0, p)
        xp, yp = 1.0 / T, p / T
        for _ in range(50):
            du, dv = 2.0 * b / dds
            fx, fy, k_geo, k_mat, *_ = pull(xp, yp, T, du, dv, self.groups.alpha, self._cable[3])
            r = np.array([xp + du, yp + dv])
            f = 2.0 * inertia * b + rest + [fx, fy]
            J = (2.0 * inertia + 2.0 / dds * k_geo) * np.eye(2) + 2.0 / dds * k_mat * np.outer(r, r)
            step = np.linalg.solve(J, f)
            b -= step
            if np.abs(step).max() <= 1e-14 * (dds + np.abs(b).max()):
                return b
        raise StepFailure(0.0, "no equilibrium of the start from rest was found", "let the mass start more gently")

    def _time(self, t: float, phase: int) -> None:
        """Scale the reference operators to this instant."""
        s_o, ds, dds = self.motion.at(t, phase)
        if not 0.0 < s_o < 1.0:
            raise ValueError(f"s_o = {s_o!r}: a side of the following mesh has no length")
        follow(s_o, ds, dds, self._n_left, self._coefficients, self._mesh.span)
        self._contact.load[:] = self._load(s_o, ds, dds)

    def stride(
        self, t: Array, phase: int, start: Array, rules: Array, bound: float, newton: Newton
    ) -> tuple[Array, Array]:
        """Take steps until the cable falls slack."""
        now, told, taken = self._stride(t, phase, start, rules, bound, newton)
        if taken:
            self.least_tension = told.item(taken - 1, 4), told.item(taken - 1, 5)
        return now[:taken], told[: taken + 1]

    def settle(
        self, t: float, phase: int, start: Array, now: Array, rule: Array, bound: float, newton: Newton
    ) -> Settled:
        (now[:],), told, _ = self._stride(np.array([t]), phase, start, rule[None], bound, newton)
        *done, least, where = told[0].tolist()
        self.least_tension = least, where
        return Settled(*done)

    def _stride(
        self, t: Array, phase: int, start: Array, rules: Array, bound: float, newton: Newton
    ) -> tuple[Array, Array, int]:
        """Return the ends of steps (m, 3, n_dof), what is told of each (m, 6), and how many are good."""
        now, told = np.empty((t.size, *start.shape)), np.empty((t.size, 6))
        of = tuple(self._mesh), self._cable, tuple(self._work), start, now, rules, told, bound, limits(newton)
        return now, told, settle(*self._moved(t, phase, float(start[1, -1])), *of)

    def _moved(self, t: Array, phase: int, slip: float) -> tuple[Any, Any]:
        """Return `grip` and `ride` of `kernels.newton.settle`."""
        return self._grip(*self._travel(t, phase)), None

    def _travel(self, t: Array, phase: int) -> tuple[Array, Array]:
        """Return s_o, ds_o, dds_o (..., 3) at instants (...), and the loads of the mass (..., n_fields)."""
        self._at = None  # the mesh is that of another instant now
        places = self.motion.along(t.ravel(), phase)
        if not (places[0].min() > 0.0 and places[0].max() < 1.0):
            raise ValueError("a side of the following mesh has no length at an end of the travel")
        loads = np.stack(self._load(*places), axis=1)
        return np.ascontiguousarray(places.T).reshape(*t.shape, 3), loads.reshape(*t.shape, -1)

    def collocate(
        self, t: Array, phase: int, ends: Array, a: Array, further: Array, rule: Tableau, bound: float, newton: Newton
    ) -> Iterator[Settled]:
        instants, loads = rule.instants(t), np.empty((3, self.fields))
        contacts = tuple((*self._contact[:-1], load) for load in loads)
        of = self._coefficients, *self._at_nodes(), contacts, self._n_left, *self._travel(instants, phase)
        grip, fronts = (self._operators, *of), self._fronts(instants)
        return self._said(self._collocated(grip, fronts, None, t, ends, a, further, rule, bound, newton))

    def _fronts(self, instants: Array) -> Any:
        """Return what `kernels.collocation.collocate` takes of fronts that nodes travel with."""
        return None

    # --- observation -----------------------------------------------------------------------------------
    def path(self, states: States) -> tuple[Array, Array]:
        states, kinematics = self._split(states)
        return kinematics[:, 0], states.q.reshape(-1, self.n_scalar, self.fields)[:, self.node] @ self.direction

    def _fresh(self) -> None:
        super()._fresh()
        self._coefficients = np.empty((8, 3))
        self._mesh = Mesh(np.empty((self._dofs.shape[0], 6)), self._dofs, self._tab)
        node = self.fields * self.node + np.arange(self.fields)[None, :]
        self._contact = Contact(node, _ONE, self.inertia * _ONE, _ZERO, _ZERO, np.empty(self.fields))

    def _at_mass(self, states: States, kinematics: Array) -> tuple[Array, Array, Array, Array, Array]:
        s_o, ds, dds = kinematics.T
        q, v, a = (x.reshape(s_o.size, self.n_scalar, self.fields) for x in (states.q, states.v, states.a))
        behind, ahead = (np.tensordot(q[:, dofs], grad, axes=(1, 0)) for dofs, grad in self._slopes)
        left, right = self._beside(states, kinematics)
        behind /= np.where(s_o > 0.0, left, 1.0)[:, None]
        ahead /= right[:, None]
        if s_o.size and s_o[0] == 0.0:  # limit of w(s_o)/s_o as the mass leaves the left support, 0 where it rests
            gone, way = (v, ds) if ds[0] > 0.0 else (a, dds)
            behind[0] = gone[0, self.node] / way[0] if way[0] > 0.0 else 0.0
        return q[:, self.node], v[:, self.node], a[:, self.node], behind, ahead

    def _beside(self, states: States, kinematics: Array) -> tuple[Array, Array]:
        """Return ds/dxi of the elements behind and ahead of the mass, (n,) each."""
        return kinematics[:, 0], 1.0 - kinematics[:, 0]

    def _along(self, states, kinematics, force, rise, s, frames):
        n, f, spans = states.t.size, self.fields, self._spans(states, kinematics)
        ends, out, c = np.empty((n, 4, f)), np.empty((4, frames.size, s.size, f)), np.empty((frames.size, s.size))
        of = states.q, states.v, states.a
        end_forces(self._mesh, self._n_left, self.node, self._cable, kinematics, spans, rise, *of, ends)
        self._at = None  # the mesh is that of another instant now
        knots, history = np.stack([self.left.knots, self.right.knots]), np.stack([x[frames] for x in of])
        places = kinematics[frames], spans[frames] if len(spans) else spans
        along(self._mesh, knots, self.left.shapes, self.node, *places, s, history, ends[frames], out, c)
        return out[:3], ends, out[3], (kinematics[:, 1], c)
