"""A response and its scene's TOML, in SI, without solvers and scene package."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import fields, replace
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import simpson
from scipy.interpolate import CubicHermiteSpline, CubicSpline

from cablefem.response import Array, Response
from validation.core.scene_data import ROUNDING, OneSpanData, air_drag_factor, is_within, thrust_times_and_forces
from validation.core.timetable import Timetable

AT_REST = ("s", "x", "y", "T_static")

Window = tuple[float, float]


class TimeWindows(NamedTuple):
    """Ends of the time windows [s] of the laws, the same for all runs of a ladder."""

    frames: Array  # (k,) for laws of the cable
    steps: Array  # (k',) for laws of the mass, with begin and end

    @classmethod
    def over_part_of_run(cls, r: Response, window: Window, until: float) -> TimeWindows:
        """Time windows over a part of a run, s_o/l of a prescribed travel; of a free ride all up to a time [s]."""
        begin = 0.0
        end = min(until, float(r.t[-1]))
        if r.drive != "free":
            begin, end = np.interp(np.array(window) * r.length, r.s_o, r.t)
        t = r.fields.t[is_within(r.fields.t, begin, end)]
        count = 12  # frames per window: 0.06 of the travel
        every = min(count, max(1, t.size // 4))
        frames = np.append(t[:-1:every], t[-1:])
        inside = (frames > begin * (1.0 + ROUNDING)) & (frames < end * (1.0 - ROUNDING))
        steps = np.concatenate([[begin], frames[inside], [end]])
        return cls(frames, steps)


class Side(NamedTuple):
    """One side of the mass at a frame; m nodes in order of s."""

    s: Array
    points: Array  # (m, 2)
    velocity: Array  # (m, 2) at fixed s
    T_static: Array  # (m,)
    T: Array  # (m,)

    @classmethod
    def from_rows(cls, rows: Array) -> Side:
        """Of rows (m, 7): s, x, y, both velocities, tension at rest, tension."""
        return cls(rows[:, 0], rows[:, 1:3], rows[:, 3:5], rows[:, 5], rows[:, 6])


class CableIntegrals(NamedTuple):
    """Integrals over the cable at the k window times."""

    velocity: Array  # (k, 2)
    points: Array  # (k, 2)
    spin: Array  # (k,) of points times velocities
    energies: Array  # (k, 3) kinetic, potential, strain [J]


class Evidence:
    """A response over time windows, and its scene's numbers."""

    def __init__(self, r: Response, windows: TimeWindows) -> None:
        self.r = r
        self.windows = windows
        self.data = OneSpanData(r.scene_toml, r.length)

    def without_every_second_step(self) -> Evidence:
        """Without every second step; jumps and the slack onset stay."""
        r = self.r
        selected = np.arange(r.t.size) % 2 == 0
        for jump in (*r.force_jump_times, r.slack_time_or_inf):
            if math.isfinite(jump):
                i = int(np.argmin(np.abs(r.t - jump)))
                selected[max(0, i - 1) : i + 2] = True
        selected[-1] = True
        rows = {name: x[selected] for name, x in _array_fields(r).items()}
        powers = {name: power[selected] for name, power in r.powers.items()}
        return Evidence(replace(r, **rows, powers=powers), self.windows)

    def with_halved_fields(self) -> Evidence:
        """Without every second station and frame; window ends stay."""
        f = self.r.fields
        rows = np.arange(f.t.size) % 2 == 0
        rows[self.window_frame_indices] = True
        thin: dict[str, Any] = {}
        for name, x in _array_fields(f).items():
            of_rows = x[::2] if name in AT_REST else x[rows]
            thin[name] = of_rows[:, ::2] if x.ndim == 2 else of_rows
        return Evidence(replace(self.r, fields=replace(f, **thin)), self.windows)

    @property
    def timetable(self) -> Timetable:
        return Timetable(self.data.travel, self.data.drive, self.r.length)

    # --- the cable at rest -----------------------------------------------------------------------------

    @cached_property
    def rest_curve(self) -> CubicSpline:
        """Points (x, y) at rest over s."""
        f = self.r.fields
        return CubicSpline(f.s, np.column_stack([f.x, f.y]))

    # --- windows -----------------------------------------------------------------------------------------

    @cached_property
    def steps_in_windows_off_supports(self) -> NDArray[np.bool_]:
        """Steps (n,) within the windows at which the car is off the supports."""
        r = self.r
        off_left = r.s_o > ROUNDING * r.length
        off_right = r.s_o < (1.0 - ROUNDING) * r.length
        return off_left & off_right & is_within(r.t, self.windows.steps[0], self.windows.steps[-1])

    @cached_property
    def window_frame_indices(self) -> NDArray[np.intp]:
        """Indices of frames at window ends; a run that ends early repeats its last."""
        t = self.r.fields.t
        return np.searchsorted(t, self.windows.frames * (1.0 - ROUNDING)).clip(max=t.size - 1)

    @property
    def window_times(self) -> Array:
        """Times [s] of these frames (k,)."""
        return self.r.fields.t[self.window_frame_indices]

    @property
    def mean_window_duration(self) -> float:
        return float(np.mean(np.diff(self.windows.frames)))

    def interpolate_steps(self, t: Array, step_values: Array) -> Array:
        """Values (k, c) at times t (k,), linear between the values (n, c) at steps."""
        return np.stack([np.interp(t, self.r.t, column) for column in step_values.T], axis=1)

    def cumulative_time_integral(self, rate: Array) -> Array:
        """Integral of a rate (n, c) up to each step, (n, c); nan if it is unknown between the ends."""
        if not np.isfinite(rate[1:-1]).all():
            return np.full_like(rate, math.nan)
        return cumulative_integral(self.r.t, np.nan_to_num(rate), self.r.force_jump_times)  # nan on the supports

    def integral_up_to_window_times(self, rate: Array) -> Array:
        """Integral of a rate (n, c) up to each window time, (k, c); nan if it is unknown."""
        total = self.cumulative_time_integral(rate)
        if np.isnan(total).any():
            return np.full((self.window_times.size, rate.shape[1]), math.nan)
        return CubicHermiteSpline(self.r.t, total, np.nan_to_num(rate))(self.window_times)

    @cached_property
    def damping_rate_with_wind(self) -> float:
        """Viscous damping of the cable per mass [1/s]."""
        return self.data.damping_rate_with_wind(self.r.length, self.r.horizontal_tension)

    @cached_property
    def swept_area_integral(self) -> Array:
        """int int r x dr ds up to the window times (k,), r on straight lines between frames."""
        f = self.r.fields
        points = np.stack([f.x + f.u, f.y + f.v], axis=2)  # (frames, stations, 2)
        areas = simpson(cross_product(points[:-1], points[1:]), x=f.s, axis=1)
        return np.append(0.0, np.cumsum(areas))[self.window_frame_indices]

    @cached_property
    def lever_integral(self) -> Array:
        """int int x ds dt up to the window times (k,), by cubics between all frames.

        Between windows alone it would miss axial waves.
        """
        f = self.r.fields
        lever = np.asarray(np.trapezoid(f.x + f.u, f.s, axis=1))
        lever_rate = np.trapezoid(f.du, f.s, axis=1)
        h = np.diff(f.t)
        pieces = 0.5 * h * (lever[1:] + lever[:-1]) - h**2 / 12.0 * np.diff(lever_rate)
        return np.append(0.0, np.cumsum(pieces))[self.window_frame_indices]

    # --- travel and drive --------------------------------------------------------------------------------

    @cached_property
    def travel_speed(self) -> Array:
        """ds_o/dt (n,)."""
        return CubicSpline(self.r.t, self.r.s_o)(self.r.t, 1)

    @cached_property
    def thrust_or_haul_force(self) -> Array:
        """Thrust on a free car along the mean tangent (n,) [N], else the run's haul force."""
        if self.r.drive == "haul":
            return np.nan_to_num(self.r.F_haul)
        return np.interp(self.r.t, *thrust_times_and_forces(self.data.drive), left=0.0, right=0.0)

    @cached_property
    def air_drag_force(self) -> Array:
        """Drag on the car by the TOML (n, 2) [N]."""
        drive = self.data.drive
        air = self.r.velocity - [drive.get("wind", 0.0), 0.0]  # velocity relative to the air
        return -air_drag_factor(drive) * np.hypot(*air.T)[:, None] * air

    @cached_property
    def rolling_friction_and_brake_force(self) -> tuple[Array, Array]:
        """Sizes (n,) [N] of rolling friction, and of all brakes together."""
        r = self.r
        drive = self.data.drive
        friction = drive.get("rolling_friction", 0.0) * np.abs(r.F_contact)
        brakes = [x["force"] * (r.s_o >= x["from"]) for x in drive.get("brake", [])]
        return friction, np.sum([np.zeros(r.t.size), *brakes], axis=0)

    def grip_power(self, T_behind: Array, T_ahead: Array) -> Array:
        """Power of a grip (n,) [W]: ds_o (-contact . <r'> + <N t> . [r'] - [W]), W = N^2/(2 EA) at equal rest."""
        behind = self.r.slope_behind
        ahead = self.r.slope_ahead
        work = -0.5 * np.sum(self.r.contact * (behind + ahead), axis=1)
        work -= (T_ahead**2 - T_behind**2) / (2.0 * self.data.EA)
        kink = ahead - behind
        for T, slope in ((T_behind, behind), (T_ahead, ahead)):
            work += 0.5 * T / np.hypot(*slope.T) * np.sum(slope * kink, axis=1)
        return self.travel_speed * work

    # --- the cable, at frames ------------------------------------------------------------------------------

    @cached_property
    def rope_sides_at_window_times(self) -> list[tuple[Side, Side]]:
        """The rope behind and ahead of the car at each window time, with the car as its last or first node."""
        r = self.r
        f = self.r.fields
        frames = self.window_frame_indices
        s_o = f.s_o[frames]
        T_static = CubicSpline(f.s, f.T_static)(s_o)
        displacement = np.column_stack([f.mass_u, f.mass_v])[frames]
        points = self.rest_curve(s_o) + displacement  # (k, 2)
        velocities = []  # dp/dt = r_t + ds_o r' on either side
        for slope in (r.slope_behind, r.slope_ahead):
            at_steps = r.velocity - self.travel_speed[:, None] * slope
            velocities.append(self.interpolate_steps(self.window_times, at_steps))
        v_behind, v_ahead = velocities
        pairs = []
        for i, k in enumerate(frames):
            rows = np.column_stack([f.s, f.x + f.u[k], f.y + f.v[k], f.du[k], f.dv[k], f.T_static, f.T[k]])  # (m, 7)
            car_behind = [s_o[i], *points[i], *v_behind[i], T_static[i], f.T_behind[k]]
            car_ahead = [s_o[i], *points[i], *v_ahead[i], T_static[i], f.T_ahead[k]]
            behind = Side.from_rows(np.vstack([rows[f.s < s_o[i] * (1.0 - ROUNDING)], car_behind]))
            ahead = Side.from_rows(np.vstack([car_ahead, rows[f.s > s_o[i] * (1.0 + ROUNDING)]]))
            pairs.append((behind, ahead))
        return pairs

    @cached_property
    def cable_integrals_at_window_times(self) -> CableIntegrals:
        pairs = self.rope_sides_at_window_times
        integrals = np.array([sum(self._cable_integrals_of(side) for side in pair) for pair in pairs])  # (k, 8)
        return CableIntegrals(integrals[:, :2], integrals[:, 2:4], integrals[:, 4], integrals[:, 5:])

    def _cable_integrals_of(self, side: Side) -> Array:
        """Integrals (8,) over one side, as in `CableIntegrals`."""
        data = self.data
        spin = cross_product(side.points, side.velocity)
        kinetic = 0.5 * data.rho * np.sum(side.velocity**2, axis=1)
        weight = -data.rho * data.gravity * side.points[:, 1]
        strain = (side.T**2 - side.T_static**2) / (2.0 * data.EA)
        densities = np.column_stack([side.velocity, side.points, spin, kinetic, weight, strain])  # (m, 8)
        return simpson(densities, x=side.s, axis=0)

    # --- energy --------------------------------------------------------------------------------------------

    @cached_property
    def energies_at_window_times(self) -> Array:
        """Kinetic, potential and strain energy of cable and mass (k, 3) [J]; W = (N^2 - T^2)/(2 EA)."""
        r = self.r
        potential = -self.data.weight * r.y
        of_mass = np.column_stack([self.kinetic_energy_of_mass, potential, np.zeros(r.t.size)])  # (n, 3)
        return self.interpolate_steps(self.window_times, of_mass) + self.cable_integrals_at_window_times.energies

    @property
    def kinetic_energy_of_mass(self) -> Array:
        """(n,) [J]."""
        return 0.5 * self.data.mass * np.sum(self.r.velocity**2, axis=1)

    @property
    def energy_scale(self) -> float:
        """Weight of the mass times largest deflection [J]."""
        return self.data.weight * self.r.max_deflection

    @cached_property
    def powers_by_source(self) -> dict[str, Array]:
        """Powers (n,) [W] of drive, friction, drag and damping by the name of their source.

        Damping: by the run's kinetic energy; a law checks it.
        """
        r = self.r
        if r.drive == "grip":
            powers = {"grip": self.grip_power(r.T_behind, r.T_ahead)}
        else:
            powers = self._powers_on_rolling_car()
        if self.damping_rate_with_wind:
            powers["lost_viscous"] = -2.0 * self.damping_rate_with_wind * (r.kinetic - self.kinetic_energy_of_mass)
        return powers

    @property
    def mean_stretch(self) -> Array:
        """Mean (n,) of |r'| on both sides of the car."""
        behind = np.hypot(*self.r.slope_behind.T)
        ahead = np.hypot(*self.r.slope_ahead.T)
        return 0.5 * (behind + ahead)

    def _powers_on_rolling_car(self) -> dict[str, Array]:
        """Powers (n,) [W] of drive, friction, brakes, drag, and of what holds the car until its release."""
        r = self.r
        release = self.data.drive.get("release")
        mean = 0.5 * (r.slope_behind + r.slope_ahead)
        along = np.sum(mean * r.velocity, axis=1) / np.hypot(*mean.T)
        stretch = self.mean_stretch
        speed = np.abs(self.travel_speed)
        friction, brakes = self.rolling_friction_and_brake_force
        x = np.minimum(r.t / release, 1.0) if release else np.ones(r.t.size)
        holding_force = (r.T_ahead - r.T_behind)[0] * stretch * (1.0 - x) ** 2 * (1.0 + 2.0 * x)
        return {
            "thrust" if r.drive == "free" else "haul": self.thrust_or_haul_force * along,
            "friction": -friction * stretch * speed,
            "brake": -brakes * stretch * speed,
            "drag": np.sum(self.air_drag_force * r.velocity, axis=1),
            "hold": holding_force * self.travel_speed,
        }


def _array_fields(x: Any) -> dict[str, Array]:
    values = {f.name: getattr(x, f.name) for f in fields(x)}
    return {name: value for name, value in values.items() if isinstance(value, np.ndarray)}


def cumulative_integral(t: Array, f: Array, jumps: Sequence[float]) -> Array:
    """Integral of f (n, c) up to each t by trapezoids; at times of a jump by the value on the step's own side."""
    mean = 0.5 * (f[1:] + f[:-1])
    changes = np.abs(np.diff(f, axis=0)).max(axis=1)
    for jump in jumps:
        i = int(np.argmin(np.abs(t - jump)))
        if 0 < i < t.size - 1:
            late = changes[i - 1] > changes[i]
            mean[i - 1 if late else i] = f[i - 1 if late else i + 1]
    integral = np.cumsum(mean * np.diff(t)[:, None], axis=0)
    return np.concatenate([0.0 * f[:1], integral])


def cross_product(a: Array, b: Array) -> Array:
    """a_x b_y - a_y b_x of (..., 2)."""
    return a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]
