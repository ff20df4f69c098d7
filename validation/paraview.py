"""A response as files that ParaView animates: response.xdmf, the cable, and mass.xdmf, the mass on it.

Axes are ParaView's: x to the right, y UP, so that y and the second component of every vector have the opposite sign of
y, v in path.csv.  Points stand on the static cable; "Warp By Vector" with `displacement` shows the motion, with one
scale factor for both files.  Single precision: for eyes; response.npz holds everything in full.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np

from cablefem.response import Array, Response, whole
from cablefem.scene import Scene

CABLE, MASS = "response.xdmf", "mass.xdmf"


def write(r: Response, folder: Path) -> None:
    """Write both files; the data are inside the XML, so that each file needs no other.

    Cable: points (m + 2, 3) [m], first the fixed stations, then the place of the mass twice: the ends of the cable
    behind and ahead of it, where the tension has two values.  Per frame `displacement` (m + 2, 3) [m], `velocity`
    (m + 2, 3) [m/s] at fixed s, behind the mass for both of its points, and `tension` (m + 2,) [N].
    Mass: one point with `displacement` (1, 3) [m] and `tension_behind`, `tension_ahead` (1,) [N].
    """
    shape, f = Scene.from_toml(r.scene_toml).catenary, r.fields
    places, moved = _upward(shape.x(f.s_o), shape.y(f.s_o)), _upward(f.mass_u, f.mass_v)
    m, stations = f.s.size, _upward(shape.x(f.s), shape.y(f.s))
    ends = np.arange(m)
    with whole(folder / CABLE) as temporary, _writer(temporary) as out:
        for k, t in enumerate(f.t.tolist()):
            i = min(max(int(np.searchsorted(f.s, f.s_o[k], side="right")) - 1, 0), m - 2)  # the mass is in s_i .. s_i+1
            lines = np.stack([np.insert(ends[:-1], i + 1, m + 1), np.insert(ends[1:], i, m)], axis=1)
            du, dv = (np.interp(f.s_o[k], f.s, x[k]) for x in (f.du, f.dv))
            _add_frame(
                out, t, np.vstack([stations, places[k], places[k]]), ("line", lines),
                displacement=np.vstack([_upward(f.u[k], f.v[k]), moved[k], moved[k]]),
                velocity=_upward(np.append(f.du[k], [du, du]), np.append(f.dv[k], [dv, dv])),
                tension=np.append(f.T[k], [f.T_behind[k], f.T_ahead[k]]),
            )  # fmt: skip
    with whole(folder / MASS) as temporary, _writer(temporary) as out:
        for k, t in enumerate(f.t.tolist()):
            at = slice(k, k + 1)
            sides = {"tension_behind": f.T_behind[at], "tension_ahead": f.T_ahead[at]}
            _add_frame(out, t, places[at], ("vertex", np.array([[0]])), displacement=moved[at], **sides)


def _writer(path: Path) -> Any:
    from meshio.xdmf import TimeSeriesWriter

    return TimeSeriesWriter(path, data_format="XML")


def _add_frame(out: Any, t: float, points: Array, cells: tuple[str, Any], **data: Array) -> None:
    """Add one instant with points and cells of its own: meshio's writer by itself knows only one mesh for all."""
    frame = ElementTree.SubElement(out.collection, "Grid", Name="frame", GridType="Uniform")
    ElementTree.SubElement(frame, "Time", Value=repr(t))
    out.cells([cells], frame)
    out.points(frame, points.astype(np.float32))
    out.point_data({name: values.astype(np.float32) for name, values in data.items()}, frame)


def _upward(x: Array, y: Array) -> Array:
    """Return (n, 3) vectors with y up from (n,) components with y down."""
    return np.stack([x, -y, np.zeros_like(x)], axis=1)
