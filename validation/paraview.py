"""A response as files that ParaView animates: response.xdmf, the cable, and mass.xdmf, the mass on it.

Axes are ParaView's: x to the right, y UP, so that y and the second component of every vector have the opposite sign of
y, v in path.csv.  Points stand on the static cable; "Warp By Vector" with `displacement` shows the motion, with one
scale factor for both files.  Single precision: for eyes; response.npz holds everything in full.
"""

from __future__ import annotations

from pathlib import Path

import h5py
import jinja2
import numpy as np

from cablefem.response import Array, Response, whole
from cablefem.scene import Scene

CABLE, MASS, DATA = "response.xdmf", "mass.xdmf", "response.h5"

_MASS = {"displacement": 3, "tension_behind": 1, "tension_ahead": 1}
_XDMF = jinja2.Template("""<?xml version="1.0" encoding="utf-8"?>
<Xdmf Version="3.0"><Domain><Grid Name="{{ name }}" GridType="Collection" CollectionType="Temporal">
{% for t in times %}
<Grid Name="frame" GridType="Uniform"><Time Value="{{ t }}"/>
<Topology TopologyType="{{ topology }}" NumberOfElements="{{ cells[0] }}" NodesPerElement="{{ cells[1] }}">
<DataItem DataType="Int" Precision="4" Dimensions="{{ cells|join(' ') }}" Format="HDF">{{ data }}:/{{ name }}/{{ loop.index0 }}/cells</DataItem></Topology>
<Geometry GeometryType="XYZ">
<DataItem DataType="Float" Precision="4" Dimensions="{{ points }} 3" Format="HDF">{{ data }}:/{{ name }}/{{ loop.index0 }}/points</DataItem></Geometry>
{% set frame = loop.index0 %}
{% for field, width in fields.items() %}
<Attribute Name="{{ field }}" AttributeType="{{ 'Vector' if width == 3 else 'Scalar' }}" Center="Node">
<DataItem DataType="Float" Precision="4" Dimensions="{{ points }}{{ ' 3' if width == 3 }}" Format="HDF">{{ data }}:/{{ name }}/{{ frame }}/{{ field }}</DataItem></Attribute>
{% endfor %}
</Grid>
{% endfor %}
</Grid></Domain></Xdmf>
""", trim_blocks=True)  # noqa: E501  # fmt: skip


def write(r: Response, folder: Path) -> None:
    """Write both files and response.h5, which holds their data.

    Cable: points (m + 2, 3) [m], first the fixed stations, then the place of the mass twice: the ends of the cable
    behind and ahead of it, where the tension has two values.  Per frame `displacement` (m + 2, 3) [m], `velocity`
    (m + 2, 3) [m/s] at fixed s, behind the mass for both of its points, and `tension` (m + 2,) [N].
    Mass: one point with `displacement` (1, 3) [m] and `tension_behind`, `tension_ahead` (1,) [N].
    """
    shape, f = Scene.from_toml(r.scene_toml).catenary, r.fields
    places, moved = _upward(shape.x(f.s_o), shape.y(f.s_o)), _upward(f.mass_u, f.mass_v)
    m, stations, ends = f.s.size, _upward(shape.x(f.s), shape.y(f.s)), np.arange(f.s.size)
    cable, mass = [], []
    for k in range(f.t.size):
        i = min(max(int(np.searchsorted(f.s, f.s_o[k], side="right")) - 1, 0), m - 2)  # the mass is in s_i .. s_i+1
        du, dv = (np.interp(f.s_o[k], f.s, x[k]) for x in (f.du, f.dv))
        cable.append({
            "cells": np.stack([np.insert(ends[:-1], i + 1, m + 1), np.insert(ends[1:], i, m)], axis=1),
            "points": np.vstack([stations, places[k], places[k]]),
            "displacement": np.vstack([_upward(f.u[k], f.v[k]), moved[k], moved[k]]),
            "velocity": _upward(np.append(f.du[k], [du, du]), np.append(f.dv[k], [dv, dv])),
            "tension": np.append(f.T[k], [f.T_behind[k], f.T_ahead[k]]),
        })  # fmt: skip
        mass.append({
            "cells": np.array([[0]]), "points": places[k : k + 1], "displacement": moved[k : k + 1],
            "tension_behind": f.T_behind[k : k + 1], "tension_ahead": f.T_ahead[k : k + 1],
        })  # fmt: skip
    with whole(folder / DATA) as temporary, h5py.File(temporary, "w", libver="latest") as out:
        for name, frames in (("cable", cable), ("mass", mass)):
            for k, frame in enumerate(frames):
                for key, values in frame.items():
                    out[f"{name}/{k}/{key}"] = values.astype("<i4" if key == "cells" else "<f4")
    _describe(folder / CABLE, "cable", "Polyline", f.t, (m, 2), {"displacement": 3, "velocity": 3, "tension": 1})
    _describe(folder / MASS, "mass", "Polyvertex", f.t, (1, 1), _MASS)


def _describe(
    file: Path, name: str, topology: str, t: Array, cells: tuple[int, int], fields: dict[str, int]
) -> None:  # fmt: skip
    points = cells[0] + 2 if name == "cable" else 1
    text = _XDMF.render(
        name=name, topology=topology, times=t.tolist(), cells=cells, points=points, fields=fields, data=DATA
    )
    with whole(file) as temporary:
        temporary.write_text(text, encoding="utf-8")


def _upward(x: Array, y: Array) -> Array:
    """Return (n, 3) vectors with y up from (n,) components with y down."""
    return np.stack([x, -y, np.zeros_like(x)], axis=1)
