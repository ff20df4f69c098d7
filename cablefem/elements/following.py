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

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import lapack

from cablefem.elements import kernels
from cablefem.elements.reference import graded_knots, reference
from cablefem.newmark import Solve, State, consistent_acceleration
from cablefem.response import Observation, States
from cablefem.scene import Groups

Array = NDArray[np.float64]

MODELS = {"string": (0.0, 0.0), "sagged": (1.0, 0.0), "stretching": (1.0, 1.0), "full": None}


class FollowingElements:
    """The cable with its moving mass on mass-following elements; a `cablefem.newmark.System`.

    groups : the scene in dimensionless form, with its motion.
    elements : per side of the mass.
    degree : of the elements, 1 to 8.
    grading : largest over smallest element length; the smallest elements are next to the mass.
    model : "full" for (u, v), or one unknown field normal to the chord: "string", "sagged", "stretching".
    load : "mass", or "force" for its weight alone.
    law : "elastic", or "tension-only": N = max(0, T + alpha eps).
    """

    def __init__(
        self, groups: Groups, *, elements: int = 10, degree: int = 2, grading: float = 1.0, model: str = "full",
        load: str = "mass", law: str = "elastic",
    ) -> None:  # fmt: skip
        if groups.motion is None:
            raise ValueError("the scene has no mass that travels")
        if elements < 1 or not isinstance(elements, int):
            raise ValueError(f"elements must be an integer >= 1, got {elements!r}")
        if not (math.isfinite(grading) and 1.0 <= grading <= 1e6):
            raise ValueError(f"grading must lie in [1, 1e6], got {grading!r}")
        if model not in MODELS:
            raise ValueError(f"model must be one of {', '.join(MODELS)}, got {model!r}")
        if load not in ("mass", "force"):
            raise ValueError(f"load must be mass or force, got {load!r}")
        self.groups, self.model, self.load = groups, model, load
        self.motion = groups.motion
        self.fields = 2 if model == "full" else 1
        self.left = reference(graded_knots(elements, grading, fine_at_end=True), degree, pull_at_end=True)
        self.right = reference(graded_knots(elements, grading, fine_at_end=False), degree, pull_at_end=False)
        self.node = self.left.n - 2  # scalar dof of the mass; the supports carry none
        self.n_scalar = self.left.n + self.right.n - 3
        self._n_dof = self.fields * self.n_scalar
        self.inertia = groups.mu if load == "mass" else 0.0
        self._tabulate()
        self._set_law(law)
        self._at: tuple[float, int] | None = None
        self.tension_min = (math.inf, 0.0)  # least tension and its s, at the last residual

    # --- the System protocol ---------------------------------------------------------------------------
    @property
    def n_dof(self) -> int:
        return self._n_dof

    @property
    def phases(self) -> tuple[tuple[float, float], ...]:
        return self.motion.phases

    @property
    def force_scale(self) -> float:
        return self.groups.mu * self.groups.sigma

    @property
    def force_floor(self) -> float:
        # a strain carries the rounding of slopes of order one
        return 16.0 * np.finfo(float).eps * max(1.0, self.groups.alpha)

    def with_law(self, law: str) -> FollowingElements:
        """Return the same discretisation with another cable law, sharing all tables."""
        twin = object.__new__(type(self))
        twin.__dict__.update(self.__dict__)
        twin._set_law(law)
        return twin

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
        _, ds, dds = self.motion.at(t, phase)
        if ds > 0.0:
            pull = self._weight() - self.inertia * self._static_acceleration(0.0, ds, dds)
            node_a = pull / (self.inertia + self._entrained)
        elif dds > 0.0:
            node_a = 2.0 * self._strained_start(dds)
        else:
            raise ValueError("the travel starts with neither speed nor acceleration")
        zero = np.zeros(self._n_dof)
        return State(t, zero, zero.copy(), (self._ride[:, None] * node_a).ravel(), phase)

    def residual(self, t: float, q: Array, v: Array, a: Array, phase: int) -> Array:
        r = np.zeros(self._n_dof)
        self._assemble(t, q, v, a, phase, r, self._no_band, False, 0.0, 0.0, 0.0)
        return r

    def linearise(
        self, t: float, q: Array, v: Array, a: Array, phase: int, c0: float, c1: float, c2: float
    ) -> tuple[Array, Solve]:
        r = np.zeros(self._n_dof)
        band = self._band
        ab = np.zeros((self._n_dof, 3 * band + 1))
        increment = self._assemble(t, q, v, a, phase, r, ab, True, c0, c1, c2)
        lu, pivots, info = lapack.dgbtrf(ab.T, band, band, overwrite_ab=1)
        if info > 0:
            raise np.linalg.LinAlgError("singular tangent")

        def solve(b: Array) -> Array:
            return lapack.dgbtrs(lu, band, band, b, pivots, overwrite_b=1)[0]

        if increment is None:
            return r, solve
        # Sherman & Morrison: the uniform tension increment couples all nodes through one vector
        g = solve(increment.copy())
        rank_one = c0 * self.groups.alpha * self._chord[3]
        g *= rank_one / (1.0 + rank_one * (increment @ g))

        def solve_coupled(b: Array) -> Array:
            x = solve(b)
            return x - g * (increment @ x)

        return r, solve_coupled

    # --- assembly --------------------------------------------------------------------------------------
    def _tabulate(self) -> None:
        sides = (self.left, self.right)
        shift = (-1, self.node)
        n_loc = self.left.dofs.shape[1]
        dofs, tab = [], []
        for side, offset in zip(sides, shift, strict=True):
            d = side.dofs + offset
            d[(d < 0) | (d >= self.n_scalar)] = -1
            dofs.append(d)
            rows = np.empty((*side.xi.shape, 2 + 2 * n_loc))
            rows[:, :, 0], rows[:, :, 1] = side.xi, side.dx
            rows[:, :, 2 : 2 + n_loc] = side.value.transpose(0, 2, 1)
            rows[:, :, 2 + n_loc :] = side.grad.transpose(0, 2, 1)
            tab.append(rows)
        self._dofs, self._tab = np.concatenate(dofs), np.concatenate(tab)
        self._n_left = self.left.dofs.shape[0]
        b = self.left.degree
        self._band = self.fields * b + self.fields - 1
        operators = []
        for name in ("M", "G", "GT", "H"):
            for side, offset in zip(sides, shift, strict=True):
                full = getattr(side, name[0])
                full = full.T if name == "GT" else full
                inner = np.zeros((self.n_scalar + 2, self.n_scalar + 2))  # supports at the rim, then cut off
                inner[offset + 1 : offset + 1 + side.n, offset + 1 : offset + 1 + side.n] = full
                inner = inner[1:-1, 1:-1]
                bands = np.zeros((self.n_scalar, 2 * b + 1))
                for k in range(-b, b + 1):
                    rows_k = np.arange(max(0, -k), min(self.n_scalar, self.n_scalar - k))
                    bands[rows_k, k + b] = inner[rows_k, rows_k + k]
                operators.append(bands)
        self._kin = np.array(operators)
        self._no_band = np.zeros((1, 3 * self._band + 1))
        linear = np.zeros(self.left.n)  # nodal values of the function xi
        linear[::b] = self.left.knots
        if b == 2:  # Lagrange midpoints; from degree 3 on interior functions are bubbles
            linear[1::2] = 0.5 * (self.left.knots[1:] + self.left.knots[:-1])
        M = self.right.M[:-1, :-1]
        ahead = np.concatenate([[1.0], -np.linalg.solve(M[1:, 1:], M[1:, 0])])
        # d2q/dt2 of all nodes when that of the mass is one, at entry, and the inertia of the elements it entrains
        self._ride = np.concatenate([linear[1:], ahead[1:]])
        self._entrained = float(M[0] @ ahead)

    def _set_law(self, law: str) -> None:
        if law not in ("elastic", "tension-only"):
            raise ValueError(f"law must be elastic or tension-only, got {law!r}")
        self.law = law
        g, flag = self.groups, float(law == "tension-only")
        self._cable = np.array([g.alpha, g.sigma, g.c, flag])
        if self.model != "full":
            tau = 1.0 / g.chord_cos
            self._chord = np.array([g.alpha, tau, g.sigma * g.chord_cos / tau, *MODELS[self.model], flag])

    def _spans(self, s_o: float, ds: float) -> Array:
        span = np.empty((self._dofs.shape[0], 4))
        span[: self._n_left] = (0.0, s_o, 0.0, ds)
        span[self._n_left :] = (s_o, 1.0 - s_o, ds, -ds)
        return span

    def _weight(self) -> Array:
        """Return the weight of the mass in the model's fields."""
        g = self.groups
        return g.mu * g.sigma * (np.array([0.0, 1.0]) if self.fields == 2 else np.array([g.chord_cos]))

    def _static_acceleration(self, s_o: float, ds: float, dds: float) -> Array:
        """Return d2/dt2 X(s_o(t)) on the static shape (parabola for the one-field models)."""
        if self.fields == 1:
            curvature = self._chord[2]
            return np.array([dds * curvature * (0.5 - s_o) - ds * ds * curvature])
        p = self.groups.c - self.groups.sigma * s_o
        T = math.sqrt(1.0 + p * p)
        bend = ds * ds * self.groups.sigma / T**3
        return np.array([dds / T + bend * p, dds * p / T - bend])

    def _strained_start(self, dds: float) -> Array:
        """Solve m 2b + mu a X' - weight + [N t - T t_static](X' + 2b/a) = 0 for b by Newton's method."""
        rest = self.inertia * self._static_acceleration(0.0, 0.0, dds) - self._weight()
        inertia = self.inertia + self._entrained
        if self.fields == 1:
            return -rest / (2.0 * inertia + 2.0 * self._chord[1] / dds)
        b = np.zeros(2)
        p = self.groups.c
        T = math.hypot(1.0, p)
        static = np.array([1.0, p]) / T
        for _ in range(50):
            r = static + 2.0 * b / dds
            stretch = math.hypot(*r)
            N = T + self.groups.alpha * (stretch - 1.0)
            f = 2.0 * inertia * b + rest + N / stretch * r - T * static
            k_mat = (self.groups.alpha - T) / stretch**3
            J = (2.0 * inertia + 2.0 / dds * N / stretch) * np.eye(2) + 2.0 / dds * k_mat * np.outer(r, r)
            step = np.linalg.solve(J, f)
            b -= step
            if np.abs(step).max() <= 1e-14 * (dds + np.abs(b).max()):
                return b
        raise ValueError("no equilibrium of the start from rest was found")

    def _time(self, t: float, phase: int) -> None:
        """Scale the reference operators to this instant."""
        s_o, ds, dds = self.motion.at(t, phase)
        h_l, h_r = s_o, 1.0 - s_o
        if not (h_l > 0.0 and h_r > 0.0):
            raise ValueError(f"s_o = {s_o!r}: a side of the following mesh has no length")
        self._coefficients = np.array([
            (h_l, ds, 0.0), (h_r, -ds, 0.0),
            (0.0, -ds, -dds), (0.0, -ds, -dds),
            (0.0, ds, 0.0), (0.0, ds, 0.0),
            (0.0, 0.0, -ds * ds / h_l), (0.0, 0.0, -ds * ds / h_r),
        ])  # fmt: skip
        self._span = self._spans(s_o, ds)
        self._load = self.inertia * self._static_acceleration(s_o, ds, dds) - self._weight()
        self._at = (t, phase)

    def _assemble(self, t, q, v, a, phase, r, ab, tangent, c0, c1, c2) -> Array | None:
        if self._at != (t, phase):
            self._time(t, phase)
        f, m, mu = self.fields, self.node, self.inertia
        increment = None
        kernels.add_banded(self._kin, self._coefficients, f, q, v, a, r, ab, tangent, c0, c1, c2)
        if f == 2:
            self.tension_min = kernels.add_catenary(
                self._span, self._dofs, self._tab, self._cable, q, r, ab, tangent, c0
            )
        else:
            increment = np.zeros(self._n_dof)
            tension = kernels.add_chord(
                self._span, self._dofs, self._tab, self._chord, q, r, ab, increment, tangent, c0
            )
            self.tension_min = (tension, 0.5)
        r[f * m : f * m + f] += mu * a[f * m : f * m + f] + self._load
        if tangent:
            ab[f * m : f * m + f, 2 * self._band] += c2 * mu
        return increment

    # --- observation -----------------------------------------------------------------------------------
    def observe(self, states: States, s: Array, frames: NDArray[np.intp]) -> Observation:
        """Measure paths, tensions, energies and fields on a history; see `Observation`."""
        g, f, n = self.groups, self.fields, states.t.size
        kinematics = np.array([self.motion.at(t, p) for t, p in zip(states.t, states.phase, strict=True)])
        s_o, ds, dds = kinematics.T
        q, v, a = (x.reshape(n, self.n_scalar, f) for x in (states.q, states.v, states.a))
        normal = np.eye(2) if f == 2 else np.array([[-g.chord_sin, g.chord_cos]])
        T, xp, yp, xpp, ypp = g.static(s_o)
        static = np.stack([xp, yp], axis=1)
        bend = np.stack([xpp, ypp], axis=1)
        left_slope, right_slope = self._mass_slopes(q, s_o)
        if s_o[0] == 0.0:
            left_slope[0] = self._entry_slope(v[0], a[0], ds[0], dds[0])
        slope_behind, slope_ahead = static + left_slope @ normal, static + right_slope @ normal
        acceleration = a[:, self.node] @ normal + dds[:, None] * static + (ds**2)[:, None] * bend
        velocity = v[:, self.node] @ normal + ds[:, None] * static
        energy, least, where, chord = np.empty(n), np.empty(n), np.empty(n), np.zeros(n)
        for i in range(n):
            span = self._spans(s_o[i], ds[i])
            if s_o[i] == 0.0:
                span = span[self._n_left :]
            skip = self._dofs.shape[0] - span.shape[0]
            tables = (span, self._dofs[skip:], self._tab[skip:])
            if f == 2:
                energy[i], least[i], where[i] = kernels.cable_energy(*tables, self._cable, states.q[i], states.v[i])
            else:
                energy[i], chord[i] = kernels.chord_energy(*tables, self._chord, states.q[i], states.v[i])
        mass_y = q[:, self.node] @ normal[:, 1] + self._depth(s_o)
        energy += self.inertia * 0.5 * np.sum(velocity**2, axis=1) - g.mu * g.sigma * mass_y
        if f == 2:
            T_behind, T_ahead = self._tension(slope_behind, T), self._tension(slope_ahead, T)
        else:
            least[:], where[:] = chord, 0.5
            increment = chord - self._chord[1]
            T_behind = T_ahead = T + increment
        power = self._power(ds, acceleration, slope_behind, slope_ahead, T)
        fields = self._fields(q, v, s_o, ds, s, frames, normal)
        tension = self._tension(fields[4], np.broadcast_to(g.static(s)[0], fields[0].shape))
        if f == 1:
            tension = g.static(s)[0] + (chord - self._chord[1])[frames][:, None]
        return Observation(
            path=q[:, self.node] @ normal, path_velocity=velocity, path_acceleration=acceleration,
            slope_behind=slope_behind, slope_ahead=slope_ahead,
            T_behind=np.where(s_o > 0.0, T_behind, np.nan), T_ahead=np.where(s_o < 1.0, T_ahead, np.nan),
            energy=energy, power=power, tension_min=least, tension_min_at=where,
            u=fields[0], v=fields[1], du=fields[2], dv=fields[3], T=tension,
        )  # fmt: skip

    def _mass_slopes(self, q: Array, s_o: Array) -> tuple[Array, Array]:
        """Return w' on both sides of the mass, (n, fields) each."""
        with np.errstate(divide="ignore", invalid="ignore"):
            dofs, _, grad = self.left.evaluate(np.array(1.0))
            keep = dofs > 0
            behind = np.tensordot(q[:, dofs[keep] - 1], grad[keep], axes=(1, 0)) / s_o[:, None]
            dofs, _, grad = self.right.evaluate(np.array(0.0))
            keep = dofs < self.right.n - 1
            ahead = np.tensordot(q[:, dofs[keep] + self.node], grad[keep], axes=(1, 0)) / (1.0 - s_o)[:, None]
        return behind, ahead

    def _entry_slope(self, v: Array, a: Array, ds: float, dds: float) -> Array:
        """Return the limit of w(s_o)/s_o as the mass leaves the left support."""
        return v[self.node] / ds if ds > 0.0 else a[self.node] / dds

    def _depth(self, s: Array) -> Array:
        """Return y of the static shape over l: int y' ds = int p/T ds = (T(0) - T(s))/sigma."""
        c, sigma = self.groups.c, self.groups.sigma
        p = c - sigma * s
        return (c + p) * s / (np.hypot(1.0, c) + np.hypot(1.0, p))

    def _tension(self, slope: Array, T: Array) -> Array:
        N = T + self.groups.alpha * (np.hypot(slope[..., 0], slope[..., 1]) - 1.0)
        return np.maximum(N, 0.0) if self.law == "tension-only" else N

    def _power(self, ds: Array, acceleration: Array, behind: Array, ahead: Array, T: Array) -> Array:
        """Return dE/dt = ds_o F . <r'> + ds_o ( <N t> . [r'] - [W] ), F = mu (p.. - sigma j)."""
        force = self.inertia * acceleration - np.array([0.0, self.groups.mu * self.groups.sigma])
        mean, jump = 0.5 * (behind + ahead), ahead - behind
        pull, stored = [], []
        for slope in (behind, ahead):
            stretch = np.hypot(slope[:, 0], slope[:, 1])
            N, eps = self._tension(slope, T), stretch - 1.0
            pull.append((N / stretch)[:, None] * slope)
            W = T * eps + 0.5 * self.groups.alpha * eps**2
            stored.append(np.where(N > 0.0, W, -0.5 * T**2 / self.groups.alpha) if self.law == "tension-only" else W)
        kink = 0.5 * np.sum((pull[0] + pull[1]) * jump, axis=1) - (stored[1] - stored[0])
        return ds * (np.sum(force * mean, axis=1) + kink)

    def _fields(self, q, v, s_o, ds, s, frames, normal):
        """Return u, v, du, dv (k, m) and total slopes (k, m, 2) at fixed stations."""
        k, m = frames.size, s.size
        out = np.empty((4, k, m))
        slopes = np.empty((k, m, 2))
        static = np.stack(self.groups.static(s)[1:3], axis=1)
        padded = np.zeros((2, self.n_scalar + 2, self.fields))
        for row, i in enumerate(frames):
            padded[0, 1:-1], padded[1, 1:-1] = q[i], v[i]
            behind = (s <= s_o[i]) & (s_o[i] > 0.0)
            for side, mask, s_0, h, offset in (
                (self.left, behind, 0.0, s_o[i], 0),
                (self.right, ~behind, s_o[i], 1.0 - s_o[i], self.node + 1),
            ):
                if not mask.any():
                    continue
                xi = np.clip((s[mask] - s_0) / h, 0.0, 1.0)
                c = ds[i] * (xi if side is self.left else 1.0 - xi)
                dofs, value, grad = side.evaluate(xi)
                local = padded[:, dofs + offset]  # (2, n_loc, points, fields)
                w = np.einsum("lp,lpf->pf", value, local[0])
                w_s = np.einsum("lp,lpf->pf", grad, local[0]) / h
                w_t = np.einsum("lp,lpf->pf", value, local[1]) - c[:, None] * w_s
                out[:2, row, mask] = (w @ normal).T
                out[2:, row, mask] = (w_t @ normal).T
                slopes[row, mask] = static[mask] + w_s @ normal
        return out[0], out[1], out[2], out[3], slopes

