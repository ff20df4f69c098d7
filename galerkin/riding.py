"""The full cable over sines that ride with the mass on either side of it; see README.md, "Riding sines"."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial
from typing import Any

import numpy as np

from cablefem.newmark import Solve
from cablefem.response import States
from cablefem.scene import Groups
from galerkin import kernels
from galerkin.bases.kink import Array
from galerkin.bases.riding import RidingSines, shape_functions
from galerkin.equations import GalerkinSystem, factorised
from galerkin.equilibrium import Equilibrium, force_and_energy_integrals, in_batches, min_tension_and_position
from galerkin.observe import NEAR_SUPPORT, Measures


class RidingSystem(GalerkinSystem):
    """`GalerkinSystem` over `RidingSines`; ValueError for a car that rolls."""

    by_force = True

    def __init__(
        self, groups: Groups, terms: int, *, model: str = "full", load: str = "mass", law: str = "elastic"
    ) -> None:
        if groups.drive.mode != "grip":
            raise ValueError(
                f"fourier-riding needs a car that grips the cable, not {groups.drive.mode}; take fourier-kink"
            )
        super().__init__(groups, RidingSines(terms), kink=True, model=model, load=load, law=law)
        self.tables = self.basis.tables

    def sines_by_rules(self, s_o: Array) -> Iterator[tuple[slice, kernels.CableSines]]:
        tables = self.tables
        rule = np.array([tables.xi, tables.weights])
        none = np.zeros(self.n - 1)
        rest = np.zeros((self.n, self.n)), none, none, 0.0, tables, self.groups.internal_damping
        yield slice(0, s_o.size), kernels.CableSines(self._kernel_constants, rule, rule, *rest)

    def residual(self, t: float, q: Array, v: Array, a: Array, phase: int) -> Array:
        if not self.groups.internal_damping:
            return super().residual(t, q, v, a, phase)
        return self._residual_and_derivatives(t, np.array([q, v, a]), phase, 0)[0]

    def linearise(self, t: float, q: Array, v: Array, a: Array, phase: int, *c: complex) -> tuple[Array, Solve]:
        """As of all sines; with internal damping both sides have their own blocks."""
        if not self.groups.internal_damping:
            return super().linearise(t, q, v, a, phase, *c)
        r, sides = self._residual_and_derivatives(t, np.array([q, v, a]), phase, 3)
        n = self.basis.terms
        K = np.zeros((self.n_dof, self.n_dof), dtype=np.result_type(*c, float))
        for side in range(2):
            of = np.arange(n) + side * n
            rows = np.concatenate([of, of + self.n, [2 * n, self.n + 2 * n]])
            K[np.ix_(rows, rows)] += np.tensordot(c, sides[:, side], 1)
        return r, factorised(K)

    def _residual_and_derivatives(self, t: float, state: Array, phase: int, parts: int) -> tuple[Array, Array]:
        """r, and dr/dq, dr/dv, dr/da of both sides, by the compiled equations."""
        kinematics = self.motion.at(t, phase)
        r = np.empty(self.n_dof)
        _, sines = next(self.sines_by_rules(np.empty(1)))
        K = np.empty((parts, 2, *(2 * self.basis.terms + 2,) * 2))
        _, self.min_tension = kernels.residual_and_derivatives(None, sines, kinematics, state, r, K)
        return r, K

    def _entrained_motion(self) -> tuple[Array, Array, float, float]:
        """The sines ahead are pushed along, the piece behind is straight."""
        pushed = np.linalg.solve(self.tables.mass, np.eye(len(self.tables.mass))[-1])
        behind = np.zeros(self.basis.terms)
        shape = pushed / pushed[-1]
        m = 1.0 / pushed[-1]
        drag = np.linalg.solve(self.tables.mass, self.tables.drift @ shape)
        return np.concatenate([behind, shape]), np.concatenate([behind, drag - drag[-1] * shape]), m, m


class _Side:
    """One side over n instants, behind the mass (sign 1) or ahead (-1); coefficients (n, fields, terms + 1)."""

    def __init__(self, x: Measures, sign: float) -> None:
        of: Any = x.system.basis
        self.tables = of.tables
        self.terms = of.terms
        self.damping = x.system.damping
        self.sign = sign
        own = np.append(np.arange(of.terms) + (0 if sign > 0.0 else of.terms), -1)
        self.h = np.clip(x.s_o if sign > 0.0 else 1.0 - x.s_o, NEAR_SUPPORT, 1.0)[:, None]
        self.dh = sign * x.ds_o[:, None]
        self.ddh = sign * x.dds_o[:, None]
        self.q = x.q[..., own]
        self.v = x.v[..., own]
        self.a = x.a[..., own]

    def functions_at(self, k: Array, s: Array) -> tuple[Array, Array, Array]:
        """xi (k, m), phi and phi' by xi (terms + 1, k, m), of places s at instants k."""
        xi = np.clip((s if self.sign > 0.0 else 1.0 - s) / self.h[k], 0.0, 1.0)
        values, slopes, _ = (y.reshape(len(y), *xi.shape) for y in shape_functions(self.terms, xi.ravel()))
        return xi, values, slopes

    def displacement_fields(self, k: Array, s: Array) -> Array:
        """w, w. at fixed s, and w', (3, k, fields, m)."""
        xi, values, slopes = self.functions_at(k, s)
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
        """int w.^2 ds of one side, (n,); the sines move with it."""
        xi = self.tables.xi
        weights = self.tables.weights
        bent = xi * shape_functions(self.terms, xi)[1]
        parts = (
            (self.v, self.tables.mass, self.v),
            (self.v, self.tables.drift, self.q),
            (self.q, (bent * weights) @ bent.T, self.q),
        )
        vMv, vGq, qHq = (np.einsum("nfi,ij,nfj->n", a, matrix, b, optimize=True)[:, None] for a, matrix, b in parts)
        return (self.h * vMv - 2.0 * self.dh * vGq + self.dh**2 / self.h * qHq)[:, 0]

    def momentum_coefficients(self, k: Any) -> tuple[Array, Array]:
        """a, b (k, fields, terms + 1) of a phi + b xi phi' + (h.^2/h) (xi^2 w_xi)_xi = h (w.. + c_d w.)."""
        h, dh, ddh = (y[k, :, None] for y in (self.h, self.dh, self.ddh))
        v = self.v[k]
        return h * (self.a[k] + self.damping * v), -2.0 * dh * v - (ddh + self.damping * dh) * self.q[k]

    def force_at_mass(self, internal: Array) -> Array:
        """N t - T X' less ds_o^2 w' (n, fields), from int (N t - T X') ds and the moment of h (w.. + c_d w.)."""
        a, b = self.momentum_coefficients(slice(None))
        moment = self.tables.weights * self.tables.xi @ shape_functions(self.terms, self.tables.xi)[0].T
        rest = np.append(np.zeros(self.terms), 1.0) - 2.0 * moment
        return internal / self.h + self.sign * (a @ moment + b @ rest - self.dh**2 / self.h * (self.q @ rest))

    def force_along(self, at_mass: Array, k: Array, s: Array) -> Array:
        """The same at places s: N t - T X' - c^2 w' (k, m, fields), c = h. xi."""
        a, b = self.momentum_coefficients(k)
        xi, values, _ = self.functions_at(k, s)
        wave = np.pi * np.arange(1, self.terms + 1)[:, None, None]
        integrals = np.concatenate([(1.0 - np.cos(wave * xi)) / wave, 0.5 * xi[None] ** 2])
        ends = np.append(2.0 * (np.arange(1, self.terms + 1) % 2) / wave[:, 0, 0], 0.5)
        up_to = np.einsum("kfj,jkm->kmf", a - b, integrals) + np.einsum("kfj,jkm->kmf", b, xi * values)
        rise = (a - b) @ ends + b[..., -1]
        return at_mass[k, None] - self.sign * (rise[:, None] - up_to)


class RidingMeasures(Measures):
    def __init__(self, system: GalerkinSystem, states: States) -> None:
        super().__init__(system, states)
        self.sides = _Side(self, 1.0), _Side(self, -1.0)

    def displacement_at_mass(self) -> Array:
        return self.q[..., -1]

    def motion_and_slopes_at_mass(self) -> tuple[Array, Array, Array, Array]:
        slopes = np.array([side.slope_at_mass() for side in self.sides]) + self.hat_slopes()
        return self.q[..., -1], self.v[..., -1], self.a[..., -1], slopes

    def displacement_fields(self, s: Array, frames: Array) -> Array:
        def of_instants(k: Array) -> Array:
            shown = np.where(
                (s <= self.s_o[k, None])[:, None], *(side.displacement_fields(k, s) for side in self.sides)
            )
            return shown.swapaxes(0, 1)

        return in_batches(of_instants, frames).swapaxes(0, 1)

    def kinetic_energy(self) -> Array:
        return 0.5 * sum((side.twice_kinetic() for side in self.sides), np.zeros(self.s_o.size))

    def forces_from_momentum(self, s: Array, frames: Array) -> Equilibrium:
        """Balances of both pieces; N t - c^2 r' = (N (1 - c^2/alpha) - c^2 (1 - T/alpha)) t gives N without slopes."""
        sides = self.sides
        groups = self.system.groups
        every = np.arange(self.s_o.size)
        cable: Any = self.system.cable
        internal, strain, damping_power = force_and_energy_integrals(self)
        at_mass = [side.force_at_mass(internal[:, i]) for i, side in enumerate(sides)]

        def whole(side: _Side, force: Array, k: Array, s: Array) -> Array:
            """N t (k, m, fields) from `force` at places s (k, m)."""
            T, xp, yp, _, _ = groups.tension_and_derivatives(s)
            static_slope = np.stack([xp, yp], axis=-1)
            xi, _, slopes = side.functions_at(k, s)
            w_s = side.sign * np.einsum("kfj,jkm->kmf", side.q[k], slopes) / side.h[k, None]
            flux = (side.dh[k] * xi) ** 2
            known = force + (T - flux)[..., None] * static_slope
            size = np.hypot(known[..., 0], known[..., 1])
            taut = np.copysign(1.0, np.sum(known * (static_slope + w_s), axis=-1))
            N = (taut * size + flux * (1.0 - T / cable.alpha)) / (1.0 - flux / cable.alpha)
            return (taut * N / np.where(size > 0.0, size, 1.0))[..., None] * known

        def along(s: Array, k: Array) -> Array:
            places = np.broadcast_to(s, (k.size, s.size))
            parts = (
                whole(side, side.force_along(at, k, places), k, places) for side, at in zip(sides, at_mass, strict=True)
            )
            return np.where((places <= self.inside[k, None])[..., None], *parts)

        ends = [
            whole(side, side.force_along(at, every, place), every, place)[:, 0]
            for side, at in zip(sides, at_mass, strict=True)
            for place in (self.inside[:, None], np.full((every.size, 1), 0.5 - 0.5 * side.sign))
        ]
        behind, left, ahead, right = ends
        smallest, where = min_tension_and_position(cable, every.size, lambda stations: partial(along, stations), s)
        shown = in_batches(partial(along, s), frames)
        return Equilibrium(behind, ahead, left, right, shown, strain, smallest, where, damping_power)


RidingSystem.measures = RidingMeasures
