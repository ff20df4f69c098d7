"""Values of a response at any instant and place, and pictures."""

from __future__ import annotations

import html
import io
from typing import TYPE_CHECKING, Any

import numpy as np

from cablefem.motion import CarMotion, ContactMotion

if TYPE_CHECKING:
    from cablefem.response import Array, Response

BLUE = "#0072B2"
GREY = "#999"


def sample_fields(r: Response, t: Any, s: Any) -> dict[str, Array]:
    """`Response.at`: between frames displacements are cubic by their velocities, tensions linear."""
    t = _numbers_in_range_or_raise("t", t, float(r.t[0]), float(r.t[-1]), "s")
    s = _numbers_in_range_or_raise("s", s, 0.0, r.length, "m")
    f = r.fields
    out = {name: np.empty((t.size, s.size)) for name in ("x", "y", "u", "v", "T")}
    u = np.interp(t, r.t, r.u)
    v = np.interp(t, r.t, r.v)
    T_behind, T_ahead = (np.interp(t, r.t, T) for T in _tensions_at_mass(r))
    at_mass = {"u": (u, u), "v": (v, v), "T": (T_behind, T_ahead)}  # behind and ahead of it
    beside = 1e-9 * r.length  # a station so near the mass is under it
    for k, s_o in enumerate(np.interp(t, r.t, r.s_o).tolist()):
        at_stations = _displacements_and_tension_at_time(r, float(t[k]), s_o)
        # a station under the mass has no side; just beyond it T is that ahead
        i, j = np.searchsorted(f.s, [s_o - beside, s_o + beside]).tolist()
        positions = np.concatenate([f.s[:i], [s_o, np.nextafter(s_o, np.inf)], f.s[j:]])
        for name, values in at_stations.items():
            behind, ahead = at_mass[name]
            values = np.concatenate([values[:i], [behind[k], ahead[k]], values[j:]])
            out[name][k] = np.interp(s, positions, values)
    out["x"] = np.interp(s, f.s, f.x) + out["u"]
    out["y"] = np.interp(s, f.s, f.y) + out["v"]
    return out


def _numbers_in_range_or_raise(name: str, values: Any, low: float, high: float, unit: str) -> Array:
    """One number, or a list of them, as (n,); ValueError unless all are from low to high, up to rounding."""
    must = f"{name} must be a number from {low:.6g} to {high:.6g} {unit}, or a list of such"
    try:
        numbers = np.atleast_1d(np.asarray(values, dtype=float))
    except (TypeError, ValueError):
        raise ValueError(f"{must}; got {values!r}") from None
    if numbers.ndim > 1:
        raise ValueError(f"{must}; got an array of shape {numbers.shape}")
    largest = high * (1.0 + 1e-12)
    outside = numbers[~((numbers >= low) & (numbers <= largest))]
    if outside.size:
        raise ValueError(f"{must}; got {outside[0]!s}")
    return numbers


def _tensions_at_mass(r: Response) -> tuple[Array, Array]:
    """Tension at the mass behind and ahead; on a support the other side's."""
    behind = np.where(np.isnan(r.T_behind), r.T_ahead, r.T_behind)
    ahead = np.where(np.isnan(r.T_ahead), r.T_behind, r.T_ahead)
    return behind, ahead


def _displacements_and_tension_at_time(r: Response, t: float, s_o: float) -> dict[str, Array]:
    """u, v and T (m,) at the stations with the mass at s_o; T is that of frames with the same side there."""
    f = r.fields
    if f.t.size < 2:
        raise ValueError("the response keeps fewer than two frames of its fields")
    i = min(max(int(np.searchsorted(f.t, t)) - 1, 0), f.t.size - 2)
    dt = f.t[i + 1] - f.t[i]
    x = min(max((t - f.t[i]) / dt, 0.0), 1.0)

    def hermite(value: Array, rate: Array) -> Array:
        at_begin = (1 + 2 * x) * (1 - x) ** 2 * value[i] + x * (1 - x) ** 2 * dt * rate[i]
        return at_begin + x * x * (3 - 2 * x) * value[i + 1] + x * x * (x - 1) * dt * rate[i + 1]

    ahead = f.s > s_o  # (m,)
    same_side_before = (f.s > f.s_o[i]) == ahead
    same_side_after = (f.s > f.s_o[i + 1]) == ahead
    weight = np.where(same_side_after, np.where(same_side_before, x, 1.0), 0.0)
    T = (1.0 - weight) * f.T[i] + weight * f.T[i + 1]
    return {"u": hermite(f.u, f.du), "v": hermite(f.v, f.dv), "T": T}


def single_car_motion(r: Response) -> CarMotion:
    """The car of a run of one span; its speed along the rope is that of its point over the stretch."""
    stretch = 0.5 * (np.linalg.norm(r.slope_behind, axis=1) + np.linalg.norm(r.slope_ahead, axis=1))
    tangent = r.slope_behind + r.slope_ahead
    speed = np.sum(r.velocity * tangent, axis=1) / np.linalg.norm(tangent, axis=1)
    return CarMotion(
        name="car", s=r.s_o, ds=speed / stretch, point=np.stack([r.x, r.y], axis=1), velocity=r.velocity,
        acceleration=r.acceleration, tension_behind=r.T_behind, tension_ahead=r.T_ahead, slope_behind=r.slope_behind,
        slope_ahead=r.slope_ahead, haul_force=r.F_haul, grip_force=np.full_like(r.t, np.nan),
        contact_force=r.F_contact, shoe_force=np.zeros_like(r.t),
    )  # fmt: skip


def support_motions(r: Response) -> tuple[ContactMotion, ContactMotion]:
    """Left and right support of a run of one span; the force of the rope on them is that of the reactions."""
    none = np.full_like(r.t, np.nan)
    f = r.fields

    def anchor(name: str, k: int, reaction: Array, tension_behind: Array, tension_ahead: Array) -> ContactMotion:
        return ContactMotion(
            name=name, kind="anchor", s=np.full_like(r.t, f.s[k]), ds=np.zeros_like(r.t),
            point=np.broadcast_to([f.x[k], f.y[k]], (r.t.size, 2)),
            tension_behind=tension_behind, tension_ahead=tension_ahead, pressure=-reaction, rise=none,
        )  # fmt: skip

    left = anchor("left", 0, r.reaction_left, none, np.linalg.norm(r.reaction_left, axis=1))
    right = anchor("right", -1, r.reaction_right, np.linalg.norm(r.reaction_right, axis=1), none)
    return left, right


def side_view_svg(r: Response) -> str:
    """The side view for notebooks as SVG."""
    out = io.StringIO()
    plot_side_view(r).figure.savefig(out, format="svg")
    _, tag, svg = out.getvalue().partition("<svg")
    return f"<p>{html.escape(repr(r))}</p>{tag}{svg}"


def _given_or_new_axes(ax: Any) -> Any:
    if ax is not None:
        return ax
    from matplotlib.figure import Figure

    return Figure(figsize=(9.0, 4.0), layout="constrained").add_subplot()


def plot_side_view(r: Response, ax: Any = None) -> Any:
    """Plot the rope at rest, the envelope of its motion and the path of the car; return the axes."""
    ax = _given_or_new_axes(ax)
    f = r.fields
    ax.plot(f.x, f.y, color=GREY, linestyle="--", label="rope at rest")
    depths = f.y + f.v  # (frames, stations)
    ax.fill_between(f.x, depths.min(axis=0), depths.max(axis=0), color=BLUE, alpha=0.2, label="envelope")
    ax.plot(r.x, r.y, color=BLUE, label="path of the car")
    ax.set(xlabel="x [m]", ylabel="depth below the left support [m]", title=r.scene)
    ax.invert_yaxis()
    ax.legend()
    return ax


def plot_tension(r: Response, ax: Any = None) -> Any:
    """Plot the tension [kN] along the rope over time; return the axes."""
    ax = _given_or_new_axes(ax)
    f = r.fields
    mesh = ax.pcolormesh(f.s, f.t, f.T / 1e3, shading="nearest")
    ax.plot(f.s_o, f.t, color="white", linewidth=1.0)
    ax.set(xlabel="place along the cable [m]", ylabel="time [s]", title=r.scene)
    ax.figure.colorbar(mesh, ax=ax, label="tension [kN]")
    return ax
