"""Cable elements on a mesh that follows the mass, an inertia at one node.

Nodes s = s_o xi behind the mass, s = s_o + (1 - s_o) xi ahead of it, move with c = ds_o chi, chi = xi and 1 - xi.
The conservative (arbitrary Lagrangian-Eulerian) weak form with w. = dq/dt phi - c q phi' is

    d/dt int w. phi_i ds + int c w. phi_i' ds + int (N t - T t_static) . phi_i' ds = external .

With M^, G^, H^ of its reference mesh, a side of length h gives

    M = h M^,   C = dh/dt M^ - G + G^T,   K = -(dG/dt + H),   G = ds_o G^,  H = (ds_o^2 / h) H^.

A force -c_d w. on the cable adds c_d M to C and -c_d G to K.

Dimensionless: l = H = rho = 1.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.polynomial.polynomial import polyint, polyval
from scipy.linalg import solveh_banded
from scipy.sparse import coo_array

from cablefem.elements.cable import CableElements, bands, elements_allowed
from cablefem.elements.forms import pull, stiffness
from cablefem.elements.kernels.balance import Contact, Mesh
from cablefem.elements.kernels.observe import fields
from cablefem.elements.observing import Side, side_of
from cablefem.elements.reference import Reference, graded_knots, reference
from cablefem.newmark import Array, Newton, Settled, State, StepFailure, Tableau, begun, consistent_acceleration
from cablefem.response import States
from cablefem.scene import Groups
from cablefem.scene.motion import standing

_ONE, _ZERO = np.ones(1), np.zeros(1)


class Tables(NamedTuple):
    """Reference meshes and operators of one field."""

    left: Reference
    right: Reference
    mesh: Mesh
    sides: tuple[Side, ...]
    operators: Array  # bands of M^, G^, G^T, H^ of each side
    ride: Array  # accelerations of all nodes at entry over that of the mass
    entrained: float  # inertia of the cable that moves with it
    at_mass: Array  # (2, n_loc) shape d/dxi at the mass, of the elements behind and ahead


@lru_cache(maxsize=64)
def _tables(elements: int, degree: int, grading: float) -> Tables:
    left, right = (
        reference(graded_knots(elements, grading, fine_at_end=x), degree, pull_at_end=x) for x in (True, False)
    )
    node, n = left.n - 2, left.n + right.n - 3

    def inner(matrix: coo_array, offset: int) -> coo_array:
        row, col = matrix.row + offset, matrix.col + offset
        kept = (row >= 0) & (row < n) & (col >= 0) & (col < n)
        return coo_array((matrix.data[kept], (row[kept], col[kept])), shape=(n, n))

    parts, dofs = [], []
    for side, offset in ((left, -1), (right, node)):
        parts.append(tuple(inner(x, offset) for x in (side.M, side.G, side.H)))
        numbers = side.dofs + offset
        dofs.append(np.where((numbers < 0) | (numbers >= n), -1, numbers))
    forces, inertia = (np.concatenate([getattr(x, of) for x in (left, right)]) for of in ("forces", "inertia"))
    known = ((0,) * (degree + 1), (0,) * forces.shape[1]) if degree == 2 else ((), ())
    mesh = Mesh(np.concatenate(dofs), forces, elements, *known)
    operators = np.array([
        bands(x, degree) for k in (0, 1, -1, 2) for x in (p[k] if k >= 0 else p[1].T.tocoo() for p in parts)
    ])  # fmt: skip
    sides = tuple(side_of(mesh, inertia, sign, n) for sign in (1.0, -1.0))

    at_mass = np.stack([side.evaluate(np.array(xi))[2] for side, xi in ((left, 1.0), (right, 0.0))])

    linear = np.zeros(left.n)  # nodal values of xi
    linear[::degree] = left.knots
    if degree == 2:  # midpoints; from degree 3 on bubbles
        linear[1::2] = 0.5 * (left.knots[1:] + left.knots[:-1])
    # ahead of the mass, with M x = e at the mass: its node moves with x/x_mass and weighs 1/x_mass
    M = bands(right.M, degree)[degree:, :-1].copy()
    pushed = solveh_banded(M[: M.shape[1]], np.eye(M.shape[1], 1)[:, 0], lower=True)
    ride = np.concatenate([linear[1:], pushed[1:] / pushed[0]])
    return Tables(left, right, mesh, sides, operators, ride, float(1.0 / pushed[0]), at_mass)


class FollowingElements(CableElements):
    """The cable with its moving mass on mass-following elements.

    elements : per side; degree : 1 to 8.
    grading : largest over smallest element length; the smallest are next to the mass.
    model, load, law : see `CableElements`.
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
        self.left, self.right, self._mesh, self._sides = of.left, of.right, of.mesh, of.sides
        self._operators = np.repeat(of.operators, self.fields, axis=2)
        if self.fields == 1:
            self._mesh = of.mesh._replace(functions=(), points=())
        self._at_car, self._ride, self._entrained = of.at_mass, of.ride, of.entrained
        self.node = self.left.n - 2
        self.n_scalar = self.left.n + self.right.n - 3
        self.n_dof = self.fields * self.n_scalar
        self._band = self.fields * degree + self.fields - 1
        node = self.fields * self.node + np.arange(self.fields)[None, :]
        self._contact = Contact(node, _ONE, self.inertia * _ONE, _ZERO, _ZERO)
        self._fresh()

    def start(self, phase: int, state: State | None) -> State:
        """Return the state at the beginning of a phase.

        With speed, the contact force is 0.  From rest, s_o = a t^2/2 and w(s_o) = b t^2 with
        m 2b + mu (a X' - sigma j) + [N t - T t_static] = 0 at r' = X' + 2b/a; m includes entrained cable.
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
        twin = self.with_law(self.law)
        twin.motion = standing(s_o, 1.0)
        return twin

    # --- assembly --------------------------------------------------------------------------------------
    def _strained_start(self, dds: float) -> Array:
        """Return b of `start`."""
        rest = np.array(self._load(0.0, 0.0, dds))
        inertia = self.inertia + self._entrained
        if self.fields == 1:
            return -rest / (2.0 * inertia + 2.0 * self._law[1] / dds)
        T, *slope = self.groups.static(0.0)[:3]
        b = np.zeros(2)
        for _ in range(50):
            at = np.array(slope), T, 2.0 * b / dds, self.groups.alpha, self._law[3]
            J = 2.0 * inertia * np.eye(2) + 2.0 / dds * stiffness(*at)
            step = np.linalg.solve(J, 2.0 * inertia * b + rest + pull(*at)[0])
            b -= step
            if np.abs(step).max() <= 1e-14 * (dds + np.abs(b).max()):
                return b
        raise StepFailure(0.0, "no equilibrium of the start from rest was found", "let the mass start more gently")

    def stride(
        self, t: Array, phase: int, start: Array, rules: Array, bound: float, newton: Newton
    ) -> tuple[Array, Array]:
        """See `System`; stops where the cable falls slack."""
        now, told, taken = self._steps(t, phase, start, rules, bound, newton)
        if taken:
            self.least_tension = told.item(taken - 1, 4), told.item(taken - 1, 5)
        return now[:taken], told[: taken + 1]

    def collocate(
        self, t: Array, phase: int, ends: Array, a: Array, further: Array, rule: Tableau, bound: float, newton: Newton
    ) -> Iterator[Settled]:
        return self._said(self._collocated(phase, (t, ends, a, further), rule, bound, newton))

    def _place(self, t: float, phase: int) -> Array:
        kinematics = self.motion.at(t, phase)
        if not 0.0 < kinematics[0] < 1.0:
            raise ValueError(f"s_o = {kinematics[0]!r}: a side of the following mesh has no length")
        return np.array([*kinematics, *self._load(*kinematics)])

    def _places(self, t: Array, phase: int) -> Array:
        kinematics = self.motion.along(t.ravel(), phase)
        if not (kinematics[0].min() > 0.0 and kinematics[0].max() < 1.0):
            raise ValueError("a side of the following mesh has no length at an end of the travel")
        return np.stack([*kinematics, *self._load(*kinematics)], axis=1).reshape(*t.shape, -1)

    def _contact_at(self, t: float, phase: int) -> Contact:
        return self._contact

    # --- observation -----------------------------------------------------------------------------------
    def path(self, states: States) -> tuple[Array, Array]:
        states, kinematics = self._split(states)
        return kinematics[:, 0], states.q.reshape(-1, self.n_scalar, self.fields)[:, self.node] @ self.direction

    def _at_mass(self, states: States, kinematics: Array) -> tuple[Array, Array, Array, Array, Array]:
        s_o, ds, dds = kinematics.T
        q, v, a = (x.reshape(s_o.size, self.n_scalar, self.fields) for x in (states.q, states.v, states.a))
        last, n = np.append(q, np.zeros_like(q[:, :1]), axis=1), self._mesh.n_left
        behind, ahead = (
            np.tensordot(last[:, self._mesh.dofs[e]], grad, axes=(1, 0))
            for e, grad in zip((n - 1, n), self._at_car, strict=True)
        )
        behind /= np.where(s_o > 0.0, s_o, 1.0)[:, None]
        ahead /= (1.0 - s_o)[:, None]
        if s_o.size and s_o[0] == 0.0:  # limit of w(s_o)/s_o
            gone, way = (v, ds) if ds[0] > 0.0 else (a, dds)
            behind[0] = gone[0, self.node] / way[0] if way[0] > 0.0 else 0.0
        return q[:, self.node], v[:, self.node], a[:, self.node], behind, ahead

    def _along(self, states, kinematics, ends, force, s, frames):
        """Momentum is tested with phi = 1 up to s, from the support or the mass."""
        mesh, shapes, sides = self._mesh, self.left.shapes, (self.left, self.right)
        q, v, a = (x[frames].reshape(frames.size, self.n_scalar, self.fields) for x in (states.q, states.v, states.a))
        c_d, (s_o, ds, dds) = self.groups.damping, kinematics[frames].T[..., None]
        a, dds = a + c_d * v, dds + c_d * ds
        first, length = (np.concatenate([f(x.knots) for x in sides]) for f in (lambda x: x[:-1], np.diff))
        rates = [  # d2(h w)/dt2 behind and ahead
            h[..., None] * a + sign * (dds[..., None] * q + 2.0 * ds[..., None] * v)
            for h, sign in ((s_o, 1.0), (1.0 - s_o, -1.0))
        ]
        begin = []  # integrals up to each element
        for part, rate in zip((slice(0, mesh.n_left), slice(mesh.n_left, None)), rates, strict=True):
            of_one = np.append(rate, np.zeros_like(rate[:, :1]), axis=1)[:, mesh.dofs[part]]  # supports last
            whole = np.einsum("kelf,l,e->kef", of_one, polyval(1.0, polyint(shapes.T)), length[part])
            begin.append(np.cumsum(whole, axis=1) - whole)
        behind = (s <= s_o) & (s_o > 0.0)
        h = np.where(behind, s_o, 1.0 - s_o)
        xi = np.clip((s - np.where(behind, 0.0, s_o)) / h, 0.0, 1.0)
        on_left, on_right = (np.searchsorted(x.knots[1:-1], xi) for x in sides)
        e = np.where(behind, on_left, mesh.n_left + on_right)
        w, w_t, w_x, up_to = out = np.empty((4, *e.shape, self.fields))
        fields(mesh, shapes, e, (xi - first[e]) / length[e], np.array([q, v, *rates]), out)
        w_x /= (length[e] * h)[..., None]
        up_to *= length[e][..., None]
        up_to += np.concatenate(begin, axis=1)[np.arange(frames.size)[:, None], e]
        chi = np.where(behind, xi, 1.0 - xi)
        node, c = self.node, ds * chi
        ahead = ends[frames, 2] + 2.0 * ds * v[:, node] + dds * q[:, node]
        start = np.where(behind[..., None], ends[frames, None, 0], ahead[:, None])
        carried = start + up_to - 2.0 * c[..., None] * w_t - (dds * chi)[..., None] * w
        return (w, w_t - c[..., None] * w_x, w_x), carried, c
