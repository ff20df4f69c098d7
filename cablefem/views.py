"""Values of a response at any instant and place, and pictures."""

from __future__ import annotations

import html
import io
from typing import TYPE_CHECKING, Any

import numpy as np

from cablefem.motion import CarMotion, ContactMotion

if TYPE_CHECKING:
    from cablefem.response import Array, Response

BLUE, GREY = "#0072B2", "#999"


def sample_fields(r: Response, t: Any, s: Any) -> dict[str, Array]:
    """`Response.at`: between frames displacements are cubic by their velocities, tensions linear."""
    t, s = (np.atleast_1d(np.asarray(x, dtype=float)) for x in (t, s))
    _raise_if_outside("t", t, r.t[0], r.t[-1])
    _raise_if_outside("s", s, 0.0, r.length)
    out = {name: np.empty((t.size, s.size)) for name in ("x", "y", "u", "v", "T")}
    x_rest = np.interp(s, r.fields.s, r.fields.x)
    y_rest = np.interp(s, r.fields.s, r.fields.y)
    beside = 1e-9 * r.length  # a station so near the mass is under it
    for k, instant in enumerate(t.tolist()):
        s_o, u, v, behind, ahead = (np.interp(instant, r.t, z) for z in (r.s_o, r.u, r.v, *_tensions_at_mass(r)))
        w, T = _displacements_and_tension_at_time(r, instant, s_o)
        # a station under the mass has no side; just beyond it T is that ahead
        i, j = np.searchsorted(r.fields.s, [s_o - beside, s_o + beside]).tolist()
        places = np.concatenate([r.fields.s[:i], [s_o, np.nextafter(s_o, np.inf)], r.fields.s[j:]])
        for name, z, at_mass in (("u", w[0], [u, u]), ("v", w[1], [v, v]), ("T", T, [behind, ahead])):
            out[name][k] = np.interp(s, places, np.concatenate([z[:i], at_mass, z[j:]]))
    out["x"] = x_rest + out["u"]
    out["y"] = y_rest + out["v"]
    return out


def _raise_if_outside(name: str, values: Array, low: float, high: float) -> None:
    """ValueError unless all values are from low to high, up to rounding."""
    if not (np.isfinite(values).all() and values.min() >= low and values.max() <= high * (1.0 + 1e-12)):
        raise ValueError(f"{name}: must be from {low:.6g} to {high:.6g}, got {values.tolist()}")


def _tensions_at_mass(r: Response) -> tuple[Array, Array]:
    """Tension at the mass behind and ahead; on a support the other side's."""
    missing = np.isnan(r.T_behind), np.isnan(r.T_ahead)
    return np.where(missing[0], r.T_ahead, r.T_behind), np.where(missing[1], r.T_behind, r.T_ahead)


def _displacements_and_tension_at_time(r: Response, t: float, s_o: float) -> tuple[Array, Array]:
    """(u, v) (2, m) and T (m,) at the stations; T is that of frames with the same side there."""
    f = r.fields
    if f.t.size < 2:
        raise ValueError("the response keeps fewer than two frames of its fields")
    i = min(max(int(np.searchsorted(f.t, t)) - 1, 0), f.t.size - 2)
    dt = f.t[i + 1] - f.t[i]
    x = min(max((t - f.t[i]) / dt, 0.0), 1.0)
    h = (1 + 2 * x) * (1 - x) ** 2, x * (1 - x) ** 2 * dt, x * x * (3 - 2 * x), x * x * (x - 1) * dt
    w = [h[0] * q[i] + h[1] * p[i] + h[2] * q[i + 1] + h[3] * p[i + 1] for q, p in ((f.u, f.du), (f.v, f.dv))]
    same_side, same_side_after = ((f.s > f.s_o[j]) == (f.s > s_o) for j in (i, i + 1))
    weight = np.where(same_side & same_side_after, x, np.where(same_side_after, 1.0, 0.0))
    return np.stack(w), (1.0 - weight) * f.T[i] + weight * f.T[i + 1]


def single_car_motion(r: Response) -> CarMotion:
    """The car of a run of one span; its speed along the rope is that of its point over the stretch."""
    stretch = 0.5 * (np.linalg.norm(r.slope_behind, axis=1) + np.linalg.norm(r.slope_ahead, axis=1))
    tangent = r.slope_behind + r.slope_ahead
    along = np.sum(r.velocity * tangent, axis=1) / np.linalg.norm(tangent, axis=1)
    return CarMotion(
        name="car", s=r.s_o, ds=along / stretch, point=np.stack([r.x, r.y], axis=1), velocity=r.velocity,
        acceleration=r.acceleration, tension_behind=r.T_behind, tension_ahead=r.T_ahead, slope_behind=r.slope_behind,
        slope_ahead=r.slope_ahead, haul_force=r.F_haul, grip_force=np.full_like(r.t, np.nan),
        contact_force=r.F_contact, shoe_force=np.zeros_like(r.t),
    )  # fmt: skip


def support_motions(r: Response) -> tuple[ContactMotion, ContactMotion]:
    """Left and right support of a run of one span; the force of the rope on them is that of the reactions."""
    none = np.full_like(r.t, np.nan)
    still = np.zeros_like(r.t)
    sides = (("left", 0, r.reaction_left), ("right", -1, r.reaction_right))
    out = []
    for name, k, reaction in sides:
        tension = np.linalg.norm(reaction, axis=1)
        point = np.broadcast_to([r.fields.x[k], r.fields.y[k]], (r.t.size, 2))
        behind, ahead = (none, tension) if name == "left" else (tension, none)
        out.append(ContactMotion(
            name=name, kind="anchor", s=np.full_like(r.t, r.fields.s[k]), ds=still, point=point,
            tension_behind=behind, tension_ahead=ahead, pressure=-reaction, rise=none,
        ))  # fmt: skip
    return out[0], out[1]


def side_view_svg(r: Response) -> str:
    """The side view for notebooks as SVG."""
    out = io.StringIO()
    plot_side_view(r).figure.savefig(out, format="svg")
    return f"<p>{html.escape(repr(r))}</p>{out.getvalue()[out.getvalue().index('<svg') :]}"


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
    ax.fill_between(f.x, np.min(f.y + f.v, axis=0), np.max(f.y + f.v, axis=0), color=BLUE, alpha=0.2, label="envelope")
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
