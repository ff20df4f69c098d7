"""A line at rest by elements on unstretched length, whose contacts slide on the rope.

A piece of rope between two stations is a mesh on 0 <= xi <= 1, s = s_k + xi h, with the energy

    V = int [W(lam) a - q y] h dxi,    lam = |r_xi|/(a h),   W' = N = EA (lam - 1),   W = N^2/(2 EA),   a = 1 + a_T dT.

Unknowns are places r of nodes, and s of sliding stations, with the equations

    of r:  int N t . eta' - q h eta_y dxi
    of h:  int a (W - N lam) - q y dxi             (dV/ds_k at fixed nodes, dh/ds_k = +-1)

Counterweight: dV/ds +- [a (G + G^2/(2 EA)) + q y] = 0.
Gripping car at a given x: horizontal balance instead of dV/ds = 0.
Hauled car: dV/ds = 0, and balance across tau, parallel to f_behind - f_ahead.
"""

from __future__ import annotations

import warnings
from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np
import skfem
from numpy.typing import NDArray
from scipy.sparse import bmat, coo_matrix, diags
from scipy.sparse.linalg import MatrixRankWarning, spsolve

from cablefem.scene.contacts import Array
from cablefem.scene.line import Case, LineNotConverged, LineState, NoLineAtRest
from cablefem.scene.taut import Start, first_guess

Fields = dict[str, Array]  # data of the forms
DEGREE = 4
ORDER = 12  # of quadrature
SOFTEST = 5.0  # first EA over H
LAST = 1e-9  # last step over the reach
SLACK = 0.1  # smallest tension of the tangent, over that of the guess


class Stages(NamedTuple):
    """How a soft rope becomes stiff."""

    smallest: float = 0.25  # change of softness; the first is the usual one
    heavier: float = 0.0  # share of its force that the softest rope has more at a pulley: it sags off it earlier
    rough: float = 1e-2  # last step over the reach, for a soft rope


USUAL = Stages()
# close to the smallest force of a pulley the rest moves far as the rope stiffens
CAREFUL = Stages(smallest=0.03, heavier=0.25, rough=1e-3)


def _dot_slope(vector, field):
    """Product of a vector with the slope of a field, d/dxi."""
    return vector[0] * field.grad[0, 0] + vector[1] * field.grad[1, 0]


@skfem.LinearForm
def weak_force(eta, w):
    """Equation of r."""
    return w.N * _dot_slope(w.t, eta) - w.q * w.h * eta[1]


@skfem.LinearForm
def weak_force_derivative_by_length(eta, w):
    """d/dh of `weak_force`."""
    return -w.EA * w.lam / w.h * _dot_slope(w.t, eta) - w.q * eta[1]


@skfem.BilinearForm
def weak_force_derivative_by_r(phi, eta, w):
    """d/dr of `weak_force`; across never that of a slack rope, or Newton's method goes astray on its way to rest."""
    both = _dot_slope(phi.grad[:, 0], eta)
    across = np.maximum(w.N, w.N_slack) / (w.a * w.h * w.lam)
    along = w.EA / (w.a * w.h) - across
    return across * both + along * _dot_slope(w.t, phi) * _dot_slope(w.t, eta)


@skfem.Functional
def energy_derivative_by_length(w):
    """Equation of h."""
    return w.a * (w.W - w.N * w.lam) - w.q * w.y


@skfem.Functional
def energy_second_derivative_by_length(w):
    """d/dh of `energy_derivative_by_length`."""
    return w.a * w.EA * w.lam**2 / w.h


def _vector_length(x: Array, y: Array) -> Array:
    """Length of vectors, also complex ones."""
    return np.sqrt(x * x + y * y)


class _Condition(NamedTuple):
    """A special row: a condition on the forces at a station, in the place of the equation of an unknown."""

    unknown: int
    station: int
    kind: str
    target: float


class _LineBatch:
    """Many cases as one mesh and one system of block equations.

    Values of pieces w = (u, h) follow from the unknowns, w = T X + w0.  With derivatives z = (f, g) of energies by w,
    B z + spring X + load = 0; B = T' except in special rows.
    """

    def __init__(self, starts: Sequence[tuple[Case, Start]], elements: int) -> None:
        self.cases = [case for case, _ in starts]
        self.elements = elements
        self._set_stations_and_mesh()
        self._set_rope_data()
        self._set_unknowns()
        self._set_springs_and_conditions()
        self._set_first_guess([start for _, start in starts])

    def _set_stations_and_mesh(self) -> None:
        self.stations = [p for case in self.cases for p in case.stations]
        counts = [len(case.stations) for case in self.cases]
        self.owner = np.repeat(np.arange(len(counts)), counts)  # case of each station
        self.last = np.cumsum(counts) - 1  # last station of each case
        self.left = np.delete(np.arange(self.owner.size), self.last)  # station at the left end of each piece
        self.pieces = self.left.size
        begins = 2.0 * np.arange(self.pieces)
        nodes = begins[:, None] + np.linspace(0.0, 1.0, self.elements + 1)
        ids = np.arange(nodes.size).reshape(nodes.shape)
        left = ids[:, :-1].ravel()
        right = ids[:, 1:].ravel()
        mesh = skfem.MeshLine(nodes.reshape(1, -1), np.stack([left, right]))
        element = skfem.ElementVector(skfem.ElementLinePp(DEGREE), 2)
        self.basis = skfem.Basis(mesh, element, intorder=ORDER)
        self.dofs = self.basis.nodal_dofs[:, ids]  # (2, pieces, elements + 1)

    def _set_rope_data(self) -> None:
        """Set weight, stiffness and thermal stretch of each element, (elements of all, 1)."""
        of_cases = np.array([(case.weight, case.EA, case.thermal_stretch) for case in self.cases])
        of_pieces = of_cases[self.owner[self.left]]
        self.q, self.EA, self.a = np.repeat(of_pieces, self.elements, axis=0).T[:, :, None]

    def _set_unknowns(self) -> None:
        """Number the unknowns, and set T and w0."""
        N = self.basis.N
        self.prescribed = np.concatenate([np.column_stack([case.points_or_nan, case.s_or_nan]) for case in self.cases])
        free = np.isnan(self.prescribed)
        self.number = np.where(free, np.cumsum(free).reshape(free.shape) - 1, -1)
        # (u_x, u_y, h) of the piece behind each station and ahead; -1: no piece
        h = N + np.arange(self.pieces)
        self.behind = np.full(free.shape, -1)
        self.ahead = np.full(free.shape, -1)
        first_x, first_y = self.dofs[:, :, 0]
        last_x, last_y = self.dofs[:, :, -1]
        self.behind[self.left + 1] = np.column_stack([last_x, last_y, h])
        self.ahead[self.left] = np.column_stack([first_x, first_y, h])
        inner = np.setdiff1d(np.arange(N), self.dofs[:, :, [0, -1]])
        inner_numbers = int(free.sum()) + np.arange(inner.size)
        self.size = int(free.sum()) + inner.size
        self.w0 = np.zeros(N + self.pieces)
        rows = [inner]
        columns = [inner_numbers]
        entries = [np.ones(inner.size)]
        for side, by_s in ((self.behind, 1.0), (self.ahead, -1.0)):  # by_s : dh/ds
            signs = np.broadcast_to([1.0, 1.0, by_s], side.shape)
            fixed = (side >= 0) & ~free
            np.add.at(self.w0, side[fixed], (signs * self.prescribed)[fixed])
            moving = (side >= 0) & free
            rows.append(side[moving])
            columns.append(self.number[moving])
            entries.append(signs[moving])
        positions = np.concatenate(rows), np.concatenate(columns)
        self.T = coo_matrix((np.concatenate(entries), positions), (self.w0.size, self.size)).tocsr()
        of_nodes = np.empty(N, int)
        of_nodes[self.basis.element_dofs] = np.repeat(self.owner[self.left], self.elements)
        of_stations = np.repeat(self.owner, 3)[free.ravel()]
        self.case_of = np.concatenate([of_stations, of_nodes[inner]])

    def _set_loads(self, softness: Array, heavier: float) -> None:
        """Set constant loads and prescribed tensions; those of a pulley are larger where the rope is soft."""
        factor = (1.0 + heavier * softness)[self.owner]
        self.load = np.zeros(self.size)
        for k, p in enumerate(self.stations):
            case = self.cases[self.owner[k]]
            _, row, slides = self.number[k]
            if p.kind == "counterweight":
                force = float(factor[k]) * p.force
                stretching = force + force**2 / (2.0 * case.EA)
                energy = case.thermal_stretch * stretching + case.weight * p.y
                self.load[slides] = energy if self.ahead[k, 0] < 0 else -energy
            elif p.stiffness is not None:
                self.load[self.number[k, :2]] = -np.array(p.stiffness) * (p.x, p.y)
            elif p.kind == "grips":
                self.load[row] = -p.force
        self.targets = np.where(self.kinds == "tied", factor[self.at], 1.0) * self.prescribed_targets

    def _set_springs_and_conditions(self) -> None:
        """Set springs, special rows, and B without these."""
        self.spring = np.zeros(self.size)
        for k, p in enumerate(self.stations):
            if p.stiffness is not None:
                self.spring[self.number[k, :2]] = p.stiffness
        special = [*self._car_conditions(), *self._tension_conditions()]
        self.rows = np.array([x.unknown for x in special], int)
        self.at = np.array([x.station for x in special], int)
        self.kinds = np.array([x.kind for x in special])
        self.prescribed_targets = np.array([x.target for x in special])
        behind = self.behind[self.at, :2]
        ahead = self.ahead[self.at, :2]
        self.ends = np.concatenate([behind, ahead], axis=1)
        plain = np.ones(self.size)
        plain[self.rows] = 0.0
        self.B = diags(plain) @ self.T.T

    def _car_conditions(self) -> Iterator[_Condition]:
        """Of cars that grip or are hauled."""
        for k, p in enumerate(self.stations):
            _, row, slides = self.number[k]
            if p.kind == "grips":
                yield _Condition(slides, k, p.kind, 0.0)
            elif p.kind == "hauled":
                yield _Condition(row, k, p.kind, p.force)

    def _tension_conditions(self) -> Iterator[_Condition]:
        """Of cases whose tension is prescribed at a station."""
        for case, last in zip(self.cases, self.last, strict=True):
            if case.prescribed_tension is not None:
                station, tension = case.prescribed_tension
                first = last + 1 - len(case.stations)
                yield _Condition(self.number[last, 2], first + station, "tied", tension)

    def _condition_values_and_derivatives(self, z: Array) -> tuple[Array, Array]:
        """Values (m,) of the conditions, and their derivatives (m, 4) by the forces at the stations."""
        # complex-step differentiation
        forces = np.where(self.ends >= 0, z[self.ends], 0.0).T
        tiny = 1e-30
        shifted = forces[:, None] + 1j * tiny * np.eye(4)[:, :, None]
        derivatives = self._condition_values(shifted).imag.T / tiny
        return self._condition_values(forces), derivatives

    def _condition_values(self, forces: Array) -> Array:
        """Values of the conditions on forces (4, ..., m), x and y behind and ahead; also complex ones."""
        bx, by, ax, ay = forces
        W = self.targets
        last = self.ends[:, 2] < 0
        # across tau: (f_behind + f_ahead - W j) x (f_behind - f_ahead) = 0, over 2 |f|
        turn = 2.0 * (ax * by - ay * bx) + W * (bx - ax)
        across = turn / _vector_length(bx - ax, by - ay)
        # |f| = T, of the rope ahead or at the right end behind
        x = np.where(last, bx, ax)
        y = np.where(last, by, ay)
        tension = _vector_length(x, y)
        is_hauled = self.kinds == "hauled"
        is_tied = self.kinds == "tied"
        return np.select([is_hauled, is_tied], [across, tension - W], bx + ax)

    def _set_first_guess(self, starts: Sequence[Start]) -> None:
        """Set X to parabolas between guessed stations, with scales of lengths and forces."""
        self.reach = np.array([np.ptp(x.points[:, 0]) for x in starts])
        self.H = np.array([x.H.mean() for x in starts])
        stations = np.concatenate([np.column_stack([x.points, x.s]) for x in starts])  # x, y and s
        H = np.concatenate([x.H for x in starts])
        chord = np.diff(stations, axis=0)[self.left]
        dx, dy, h = chord.T
        tension = H * np.hypot(dx, dy) / dx
        self.N_ref = np.repeat(tension, self.elements)[:, None]
        sag = self.q[:: self.elements, 0] * h * dx / (8.0 * H)
        xi = np.linspace(0.0, 1.0, self.elements + 1)
        begin = stations[self.left, :2].T
        path = begin[:, :, None] + chord[:, :2].T[:, :, None] * xi
        path[1] += 4.0 * sag[:, None] * xi * (1.0 - xi)
        w = np.zeros(self.basis.N + self.pieces)
        w[self.dofs] = path
        w[self.basis.N :] = h
        sharing = np.asarray(abs(self.T).sum(axis=0)).ravel()  # pieces at each unknown
        self.X = self.T.T @ w / np.maximum(sharing, 1.0)
        free = self.number >= 0
        self.X[self.number[free]] = stations[free]

    def element_fields(self, X: Array, softness: Array) -> Fields:
        """Data of the forms; softness (cases,) 0 is EA, 1 is SOFTEST times the tension.

        The soft law N = N_ref + EA_soft (lam - lam_ref) keeps the length of the rope.
        """
        w = self.T @ X + self.w0
        u = self.basis.interpolate(w[: self.basis.N])
        h = np.repeat(w[self.basis.N :], self.elements)[:, None]
        slope = u.grad[:, 0]
        length = np.hypot(*slope)
        lam = length / (self.a * h)
        soft = np.minimum(self.EA, SOFTEST * self.N_ref)
        exponent = np.repeat(softness[self.owner[self.left]], self.elements)[:, None]
        EA = self.EA ** (1.0 - exponent) * soft**exponent
        more = lam - 1.0 - self.N_ref / self.EA
        N = self.N_ref + EA * more
        W = 0.5 * self.N_ref**2 / self.EA + self.N_ref * more + 0.5 * EA * more**2
        of_elements = {"q": self.q, "a": self.a, "h": h, "EA": EA, "N_slack": SLACK * self.N_ref}
        data = {name: np.broadcast_to(x, lam.shape) for name, x in of_elements.items()}
        tangent = slope / length
        return data | {"lam": lam, "N": N, "W": W, "t": tangent, "y": u[1]}

    def energy_gradient(self, fields: Fields) -> Array:
        """z = (f, g) by the nodes and by h; fields : see `element_fields`."""
        of_elements = energy_derivative_by_length.elemental(self.basis, **fields)
        f = weak_force.assemble(self.basis, **fields)
        g = of_elements.reshape(self.pieces, -1).sum(axis=1)
        return np.concatenate([f, g])

    def residual_and_condition_slopes(self, X: Array, fields: Fields) -> tuple[Array, Array]:
        """The residual (size,), and the derivatives of `_condition_values_and_derivatives`."""
        z = self.energy_gradient(fields)
        value, slope = self._condition_values_and_derivatives(z)
        R = self.B @ z + self.spring * X + self.load
        R[self.rows] = value
        return R, slope

    def tangent(self, fields: Fields, condition_slopes: Array) -> Any:
        """Derivatives of the residual, sparse (size, size)."""
        by_length = weak_force_derivative_by_length.assemble(self.basis, **fields)
        piece = np.empty(self.basis.N, int)
        piece[self.basis.element_dofs] = np.repeat(np.arange(self.pieces), self.elements)
        positions = np.arange(piece.size), piece
        C = coo_matrix((by_length, positions), (piece.size, self.pieces))
        of_elements = energy_second_derivative_by_length.elemental(self.basis, **fields)
        of_pieces = of_elements.reshape(self.pieces, -1)
        D = diags(of_pieces.sum(axis=1))
        by_r = weak_force_derivative_by_r.assemble(self.basis, **fields)
        K = bmat([[by_r, C], [C.T, D]], format="csr")
        real = self.ends >= 0
        rows = np.broadcast_to(self.rows[:, None], real.shape)
        at_ends = rows[real], self.ends[real]
        special = coo_matrix((condition_slopes[real], at_ends), self.B.shape)
        return (self.B + special.tocsr()) @ K @ self.T + diags(self.spring)

    def residual_norm_per_case(self, R: Array) -> Array:
        return np.sqrt(np.bincount(self.case_of, R**2, len(self.cases)))

    def solve(self, stages: Stages) -> list[LineState | NoLineAtRest]:
        """Each case at rest; LineNotConverged where the residual of a case falls no further.

        From stages where it does not, a case goes back and takes half of them, down to the smallest one.
        Raises LineNotConverged if a singular case spoils the step of all, or if there are too many steps.
        """
        softness = np.ones(len(self.cases))
        stage = np.full(len(self.cases), USUAL.smallest)
        failed = np.zeros(len(self.cases), bool)
        self._iterate_newton(softness, stages, stages.rough, failed)
        while (soft := ~failed & (softness > 0.0)).any():
            X = self.X
            harder = np.where(soft, np.maximum(softness - stage, 0.0), softness)
            stuck = ~soft
            tolerance = stages.rough if (harder[soft] > 0.0).all() else LAST
            self._iterate_newton(harder, stages, tolerance, stuck)
            back = stuck & soft
            self.X = np.where(back[self.case_of], X, self.X)
            softness = np.where(back, softness, harder)
            stage[back] *= 0.5
            failed |= stage < stages.smallest
        self._iterate_newton(softness, stages, LAST, failed)  # one step more: what the last one leaves may exceed a bar
        solved: list[LineState | NoLineAtRest] = [*self._states_of_cases()]
        for i in np.flatnonzero(failed).tolist():
            solved[i] = LineNotConverged("no state of rest was found")
        return solved

    def _iterate_newton(
        self, softness: Array, stages: Stages, tolerance: float, stuck: NDArray[np.bool_]
    ) -> None:  # fmt: skip
        """Set X by Newton's method on all cases that are not stuck; marks more of them in `stuck` (cases,).

        softness : see `element_fields`.  tolerance : of the last step, over the reach.
        """
        self._set_loads(softness, stages.heavier)
        fields = self.element_fields(self.X, softness)
        R, slope = self.residual_and_condition_slopes(self.X, fields)
        near = 1e-6  # residual over H for undamped steps
        smallest_factor = 1e-3  # of damping
        for _ in range(100):  # of Newton's method
            step = -spsolve(self.tangent(fields, slope).tocsc(), R)
            if not np.isfinite(step).all():
                break
            before = self.residual_norm_per_case(R)
            part = np.where(stuck, 0.0, 1.0)
            while True:
                trial = self.X + part[self.case_of] * step
                fields = self.element_fields(trial, softness)
                R, slope = self.residual_and_condition_slopes(trial, fields)
                falls = self.residual_norm_per_case(R) < before
                worse = ~falls & (before > near * self.H) & ~stuck
                if not worse.any():
                    break
                part[worse] *= 0.5
                stuck |= part < smallest_factor
                part[stuck] = 0.0
            self.X = trial
            relative_step = np.abs(step) / self.reach[self.case_of]
            if np.max(relative_step, where=~stuck[self.case_of], initial=0.0) < tolerance:
                return
        raise LineNotConverged("no state of rest was found")

    def _states_of_cases(self) -> list[LineState]:
        """State of each case; the forces of the rope are the weak ones at the nodes."""
        free = self.number >= 0
        stations = self.prescribed.copy()  # x, y and s
        stations[free] = self.X[self.number[free]]
        fields = self.element_fields(self.X, np.zeros(len(self.cases)))
        z = np.append(self.energy_gradient(fields), np.nan)  # last: no piece
        behind = z[self.behind[:, :2]]
        ahead = -z[self.ahead[:, :2]]
        tau = behind + ahead
        tau /= np.linalg.norm(tau, axis=1)[:, None]
        weight = np.array([p.force if p.kind == "hauled" else np.nan for p in self.stations])
        from_rope = np.sum((behind - ahead) * tau, axis=1)
        haul = from_rope - weight * tau[:, 1]
        w = self.T @ self.X + self.w0
        middle = w[self.dofs[:, :, self.elements // 2]].T
        begins = self.last[:-1] + 1
        of_stations = [stations[:, 2], stations[:, :2], behind, ahead, haul]
        columns = [np.split(x, begins) for x in of_stations]
        columns.append(np.split(middle, begins - np.arange(1, len(self.cases))))
        return [LineState(*of_case) for of_case in zip(self.cases, *columns, strict=True)]


def solve(cases: Sequence[Case], elements: int = 4) -> list[LineState | NoLineAtRest]:
    """Each case at rest with an even number of elements on each piece.

    Cases without a rest in the usual stages are solved again in smaller ones.
    """
    starts = [first_guess(case) for case in cases]
    carried = [(case, x) for case, x in zip(cases, starts, strict=True) if isinstance(x, Start)]
    with warnings.catch_warnings(), np.errstate(all="ignore"):
        warnings.simplefilter("ignore", MatrixRankWarning)
        states = _solve_with_guesses(carried, elements, USUAL)
        unsolved = [i for i, x in enumerate(states) if isinstance(x, NoLineAtRest)]
        again = _solve_with_guesses([carried[i] for i in unsolved], elements, CAREFUL)
    for i, x in zip(unsolved, again, strict=True):
        states[i] = x
    solved = iter(states)
    return [next(solved) if isinstance(x, Start) else x for x in starts]


def _solve_with_guesses(
    cases: Sequence[tuple[Case, Start]], elements: int, stages: Stages
) -> list[LineState | NoLineAtRest]:
    """The same with a first guess of each case; if the equations of a case are singular, both halves apart."""
    if not cases:
        return []
    try:
        return _LineBatch(cases, elements).solve(stages)
    except NoLineAtRest as error:
        half = len(cases) // 2
        if not half:
            return [error]
        first = _solve_with_guesses(cases[:half], elements, stages)
        return first + _solve_with_guesses(cases[half:], elements, stages)
