"""The full cable over sines that ride with the mass on either side of it; see README.md, "Riding sines"."""

from __future__ import annotations

from typing import Any

import numpy as np

from cablefem.newmark import Solve, State
from cablefem.response import States
from cablefem.scene import Groups
from galerkin import kernels
from galerkin.bases.kink import Array
from galerkin.bases.riding import RidingSines, Tables, shapes
from galerkin.equations import GalerkinSystem, factorised
from galerkin.equilibrium import Equilibrium, least_along
from galerkin.models import FullCable
from galerkin.observe import NEAR_SUPPORT, AtMass, Fields, History, Measures, hat_slopes

BATCH = 64  # instants at once


class RidingSystem(GalerkinSystem):
    """`GalerkinSystem` over `RidingSines`; ValueError for a car that rolls."""

    basis: Any  # RidingSines

    def __init__(
        self, groups: Groups, terms: int, *, model: str = "full", load: str = "mass", law: str = "elastic"
    ) -> None:
        if groups.drive.mode != "grip":
            raise ValueError(
                f"fourier-riding needs a car that grips the cable, not {groups.drive.mode}; take fourier-kink"
            )
        super().__init__(groups, RidingSines(terms), kink=True, model=model, load=load, law=law)

    def _moving(self, basis: Any) -> RidingSines:
        return basis

    @property
    def of(self) -> Tables:
        return self.basis.of

    @property
    def _compiled(self) -> bool:
        return isinstance(self.cable, FullCable)

    def _lines(self, places: Array) -> tuple[int, kernels.Line]:
        return places.size, self.line()

    def line(self) -> kernels.Line:
        assert isinstance(self.cable, FullCable)
        return self.cable.riding(self.of, self.inertia)

    def residual(self, t: float, q: Array, v: Array, a: Array, phase: int) -> Array:
        if not self.groups.internal_damping:
            return super().residual(t, q, v, a, phase)
        return self._weighed(t, np.array([q, v, a]), phase, 0)[0]

    def linearise(
        self, t: float, q: Array, v: Array, a: Array, phase: int, c0: complex, c1: complex, c2: complex
    ) -> tuple[Array, Solve]:
        if not self.groups.internal_damping:
            return super().linearise(t, q, v, a, phase, c0, c1, c2)
        r, sides = self._weighed(t, np.array([q, v, a]), phase, 3)
        n, K = self.basis.terms, np.zeros((self.n_dof, self.n_dof), dtype=np.result_type(c0, c1, c2, float))
        for side in range(2):
            of = np.arange(n) + side * n
            rows = np.concatenate([of, of + self.n, [2 * n, self.n + 2 * n]])
            K[np.ix_(rows, rows)] += np.tensordot((c0, c1, c2), sides[:, side], 1)
        return r, factorised(K)

    def _weighed(self, t: float, state: Array, phase: int, parts: int) -> tuple[Array, Array]:
        """r, and dr/dq, dr/dv, dr/da of both sides, by the compiled equations."""
        r, K = np.empty(self.n_dof), np.empty((parts, 2, *(2 * self.basis.terms + 2,) * 2))
        self.least_tension = kernels.weighed(self.line(), np.array(self.motion.at(t, phase)), state, r, K)
        return r, K

    def sides(self, pointwise: Array, forces: Equilibrium, s_o: Array) -> Array:
        """r' by the tension from equilibrium: slopes of sines converge slowly at the mass."""
        T, out = self.groups.static(s_o)[0], pointwise.copy()
        for side, force in zip(out, (forces.behind, forces.ahead), strict=True):
            N = np.hypot(*force.T)
            taut = N > 0.0
            stretch = 1.0 + (N[taut] - T[taut]) / self.cable.alpha
            side[taut] = (stretch / N[taut])[:, None] * force[taut]
        return out

    def _entry(self) -> State:
        """The limit t -> 0+: the sines ahead are pushed along, the piece behind is straight.

        q_hat = d s_o, d the slope behind the mass; m' is the inertia of the cable that is pushed.  The hat's row is
        (mu + m') a_hat + (c_d - ds_o) ds_o m' d + [N t - T t_static](d) + mu (X.. - sigma j) = 0.  A mass that enters
        with speed falls freely, d = 0.
        """
        t = self.phases[0][0]
        s_o, ds_o, dds_o = self.motion.at(t, 0)
        pushed = np.linalg.solve(self.of.mass, np.eye(len(self.of.mass))[-1])
        shape, entrained = pushed / pushed[-1], 1.0 / pushed[-1]
        m, load = self.inertia + entrained, self.mu * self._load(s_o, ds_o, dds_o)
        q, v, a = np.zeros((3, self.n_dof))
        if self.inertia and ds_o > 0.0:
            v_hat, a_hat = np.zeros(self.fields), -load / m
            if self.groups.internal_damping:  # N_v t (t . d.) pulls, d. = a_hat/(2 ds_o)
                viscous, (X, _) = self.cable.alpha * self.groups.internal_damping, self.cable.static_slope(0.0)
                pulled = m * np.eye(self.fields) + np.multiply.outer(X, viscous / (2.0 * ds_o) * X)
                a_hat = -np.linalg.solve(pulled, load)
        else:
            d = self._slope_behind(m * dds_o + (self.damping - ds_o) * ds_o * entrained, load)
            v_hat, a_hat = d * ds_o, d * dds_o
        drag = np.linalg.solve(self.of.mass, self.of.drift @ shape)
        behind = np.zeros(self.basis.terms)
        v[:] = np.multiply.outer(v_hat, np.concatenate([behind, shape])).ravel()
        a[:] = np.multiply.outer(a_hat, np.concatenate([behind, shape])).ravel()
        a -= np.multiply.outer(2.0 * ds_o * v_hat, np.concatenate([behind, drag - drag[-1] * shape])).ravel()
        return State(t, q, v, a, 0)


class _Side:
    """One side over n instants: behind the mass (sign 1) or ahead of it (-1); coefficients (n, fields, terms + 1)."""

    def __init__(self, system: RidingSystem, x: History, sign: float) -> None:
        n, self.damping = system.basis.terms, system.damping
        own = slice(0, n) if sign > 0.0 else slice(n, 2 * n)
        self.of, self.terms, self.sign = system.of, n, sign
        self.h = np.clip(x.s_o if sign > 0.0 else 1.0 - x.s_o, NEAR_SUPPORT, 1.0)[:, None]
        self.dh, self.ddh = sign * x.ds_o[:, None], sign * x.dds_o[:, None]
        self.q, self.v, self.a = (
            np.concatenate([y[..., own], hat[..., None]], axis=2)
            for y, hat in ((x.Q, x.q_hat), (x.V, x.v_hat), (x.A, x.a_hat))
        )

    def at(self, k: Array, s: Array) -> tuple[Array, Array, Array]:
        """xi (k, m), and phi and phi' by xi (terms + 1, k, m), of places s at instants k."""
        xi = np.clip((s if self.sign > 0.0 else 1.0 - s) / self.h[k], 0.0, 1.0)
        values, slopes, _ = (y.reshape(-1, *xi.shape) for y in shapes(self.terms, xi.ravel()))
        return xi, values, slopes

    def shown(self, k: Array, s: Array) -> Array:
        """w, w. at fixed s, and w', (3, k, fields, m)."""
        xi, values, slopes = self.at(k, s)
        w, w_t, w_xi = (
            np.einsum("kfj,jkm->kfm", y[k], x) for y, x in ((self.q, values), (self.v, values), (self.q, slopes))
        )
        w_s = w_xi / self.h[k, None]
        return np.array([w, w_t - (self.dh[k] * xi)[:, None] * w_s, self.sign * w_s])

    def slope_at_mass(self) -> Array:
        """w' of the sines alone, (n, fields)."""
        wave = np.pi * np.arange(1, self.terms + 1)
        return self.sign * (self.q[..., :-1] @ (wave * (-1.0) ** np.arange(1, self.terms + 1))) / self.h

    def twice_kinetic(self) -> Array:
        xi, weights = self.of.xi, self.of.weights
        bent = xi * shapes(self.terms, xi)[1]
        parts = (
            (self.v, self.of.mass, self.v),
            (self.v, self.of.drift, self.q),
            (self.q, (bent * weights) @ bent.T, self.q),
        )
        vMv, vGq, qHq = (np.einsum("nfi,ij,nfj->n", a, matrix, b, optimize=True)[:, None] for a, matrix, b in parts)
        return (self.h * vMv - 2.0 * self.dh * vGq + self.dh**2 / self.h * qHq)[:, 0]

    def steepness(self) -> Array:
        slope = self.q[:, 0] @ self.of.slope
        return slope**2 @ self.of.weights / self.h[:, 0]

    def factors(self, k: Any) -> tuple[Array, Array]:
        """a, b (k, fields, terms + 1) of a phi + b xi phi' + (h.^2/h) (xi^2 w_xi)_xi = h (w.. + c_d w.)."""
        h, dh, ddh = (y[k, :, None] for y in (self.h, self.dh, self.ddh))
        v = self.v[k]
        return h * (self.a[k] + self.damping * v), -2.0 * dh * v - (ddh + self.damping * dh) * self.q[k]

    def force_at_mass(self, internal: Array) -> Array:
        """N t - T X' less ds_o^2 w' (n, fields), from int (N t - T X') ds and the moment of h (w.. + c_d w.)."""
        a, b = self.factors(slice(None))
        moment = self.of.weights * self.of.xi @ shapes(self.terms, self.of.xi)[0].T
        rest = np.append(np.zeros(self.terms), 1.0) - 2.0 * moment
        return internal / self.h + self.sign * (a @ moment + b @ rest - self.dh**2 / self.h * (self.q @ rest))

    def force_along(self, at_mass: Array, k: Array, s: Array) -> Array:
        """The same at places s: N t - T X' - c^2 w' (k, m, fields), c = h. xi."""
        a, b = self.factors(k)
        xi, values, _ = self.at(k, s)
        wave = np.pi * np.arange(1, self.terms + 1)[:, None, None]
        whole = np.concatenate([(1.0 - np.cos(wave * xi)) / wave, 0.5 * xi[None] ** 2])
        ends = np.append(2.0 * (np.arange(1, self.terms + 1) % 2) / wave[:, 0, 0], 0.5)
        up_to = np.einsum("kfj,jkm->kmf", a - b, whole) + np.einsum("kfj,jkm->kmf", b, xi * values)
        rise = (a - b) @ ends + b[..., -1]
        return at_mass[k, None] - self.sign * (rise[:, None] - up_to)


def _sides(system: Any, x: History) -> tuple[_Side, _Side]:
    return _Side(system, x, 1.0), _Side(system, x, -1.0)


class RidingMeasures(Measures):
    """`Measures` over sines that ride with the mass."""

    @staticmethod
    def displaced(system: GalerkinSystem, states: States, x: History) -> Array:
        return x.q_hat

    @staticmethod
    def at_mass(system: GalerkinSystem, states: States, x: History) -> AtMass:
        slopes = np.array([side.slope_at_mass() for side in _sides(system, x)])
        return AtMass(x.q_hat, x.v_hat, x.a_hat, slopes + hat_slopes(x))

    @staticmethod
    def fields(system: GalerkinSystem, x: History, s: Array, frames: Array) -> Fields:
        sides, out = _sides(system, x), []
        for k in np.array_split(frames, 1 + frames.size // BATCH):
            behind = (s <= x.s_o[k, None])[:, None]
            out.append(np.where(behind, *(side.shown(k, s) for side in sides)))
        return Fields(*np.concatenate(out, axis=1))

    @staticmethod
    def kinetic(system: GalerkinSystem, x: History) -> Array:
        behind, ahead = _sides(system, x)
        return 0.5 * (behind.twice_kinetic() + ahead.twice_kinetic())

    @staticmethod
    def mean(system: GalerkinSystem, x: History) -> Array:
        behind, ahead = _sides(system, x)
        return behind.h * (behind.q @ behind.of.mean) + ahead.h * (ahead.q @ ahead.of.mean)

    @staticmethod
    def steepness(system: GalerkinSystem, x: History) -> Array:
        return sum((side.steepness() for side in _sides(system, x)), np.zeros(x.s_o.size))

    @staticmethod
    def recover(system: Any, x: History, s: Array, frames: Array) -> Equilibrium:
        """Balances of both pieces; N t - c^2 r' = (N (1 - c^2/alpha) - c^2 (1 - T/alpha)) t gives N without slopes."""
        cable: FullCable = system.cable
        Q = np.concatenate([x.Q, x.q_hat[:, :, None]], axis=2)
        internal, strain = np.empty((x.s_o.size, 2, 2)), np.empty(x.s_o.size)
        kernels.surveyed(system.line(), x.s_o, Q, internal, strain)
        lost = np.zeros(x.s_o.size)
        if system.groups.internal_damping:
            rates = np.concatenate([x.V, x.v_hat[:, :, None]], axis=2)
            states = np.stack([y.reshape(len(y), -1) for y in (Q, rates, 0.0 * Q)], axis=1)
            kernels.lost(system.line(), np.stack([x.s_o, x.ds_o, x.dds_o], axis=1), states, internal, lost)
        sides = _sides(system, x)
        at_mass = [side.force_at_mass(internal[:, :, i]) for i, side in enumerate(sides)]

        def whole(side: _Side, force: Array, k: Array, s: Array) -> Array:
            """N t (k, m, fields) from `force` at places s (k, m)."""
            T, xp, yp, _, _ = system.groups.static(s)
            static_slope = np.stack([xp, yp], axis=-1)
            xi, _, slopes = side.at(k, s)
            w_s = side.sign * np.einsum("kfj,jkm->kmf", side.q[k], slopes) / side.h[k, None]
            flux = (side.dh[k] * xi) ** 2
            known = force + (T - flux)[..., None] * static_slope
            size = np.hypot(known[..., 0], known[..., 1])
            taut = np.copysign(1.0, np.sum(known * (static_slope + w_s), axis=-1))
            N = (taut * size + flux * (1.0 - T / cable.alpha)) / (1.0 - flux / cable.alpha)
            return (taut * N / np.where(size > 0.0, size, 1.0))[..., None] * known

        def along(k: Array, s: Array) -> Array:
            out = []
            for some in np.array_split(k, 1 + k.size // BATCH):
                places = np.broadcast_to(s, (some.size, s.size))
                parts = (
                    whole(side, side.force_along(at, some, places), some, places)
                    for side, at in zip(sides, at_mass, strict=True)
                )
                out.append(np.where((places <= x.s_o[some, None])[..., None], *parts))
            return np.concatenate(out)

        every = np.arange(x.s_o.size)
        ends = [
            whole(side, side.force_along(at, every, place), every, place)[:, 0]
            for side, at in zip(sides, at_mass, strict=True)
            for place in (x.s_o[:, None], np.full((every.size, 1), 0.5 - 0.5 * side.sign))
        ]
        behind, left, ahead, right = ends
        least, where = least_along(cable, x, along, s)
        return Equilibrium(behind, ahead, left, right, along(frames, s), strain, least, where, lost)


RidingSystem.measures = RidingMeasures
