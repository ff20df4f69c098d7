"""A response as files that ParaView animates: response.xdmf, the cable, and mass.xdmf, the mass on it.

y is UP here, unlike in path.csv.  Points lie on the static cable; "Warp By Vector" with `displacement` shows the
motion.  Single precision; response.npz has all digits.
"""

import shutil
import tempfile
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from h5py import h5d, h5s, h5t

from cablefem.response import Array, Fields, Response
from cablefem.scene import Scene

CABLE = "response.xdmf"
MASS = "mass.xdmf"
DATA = "response.h5"  # of the cable
BEGIN = '<Xdmf Version="3.0"><Domain><Grid Name="frames" GridType="Collection" CollectionType="Temporal">'
END = "</Grid></Domain></Xdmf>"


def write(r: Response, folder: Path) -> None:
    """Write both files, and the HDF5 file of the first.

    Cable: points (m + 2, 3) [m]: the fixed stations, then the cable's ends behind and ahead of the mass.
    Per frame `displacement` (m + 2, 3) [m], `velocity` (m + 2, 3) [m/s] at fixed s, `tension` (m + 2,) [N].
    At both ends `velocity` is the one behind the mass; `tension` differs.
    Mass: one point, `displacement` (1, 3) [m], `tension_behind`, `tension_ahead` (1,) [N].
    """
    f = r.fields
    shape = Scene.from_toml(r.scene_toml).catenary
    stations = _upward(shape.x(f.s), shape.y(f.s))
    at_mass = _upward(shape.x(f.s_o), shape.y(f.s_o))
    displacement = _upward(f.mass_u, f.mass_v)
    velocity = _upward(_at_mass(f, f.du), _at_mass(f, f.dv))
    points = np.broadcast_to(stations, (f.t.size, *stations.shape))
    cable = {
        "points": _with_ends(points, at_mass, at_mass),
        "displacement": _with_ends(_upward(f.u, f.v), displacement, displacement),
        "velocity": _with_ends(_upward(f.du, f.dv), velocity, velocity),
        "tension": _with_ends(f.T, f.T_behind, f.T_ahead),
    }
    mass = {
        "points": at_mass[:, None],
        "displacement": displacement[:, None],
        "tension_behind": f.T_behind[:, None],
        "tension_ahead": f.T_ahead[:, None],
    }
    folder.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(dir=folder, prefix=".paraview") as name:
        temporary = Path(name)
        with h5py.File(temporary / DATA, "w", libver="latest") as data:
            _write_frames(temporary / CABLE, f.t, _lines(f), cable, partial(_stored, data))
        _write_frames(temporary / MASS, f.t, np.zeros((f.t.size, 1, 1), int), mass, _listed)
        for file in sorted(temporary.iterdir(), key=lambda file: file.suffix):  # data first
            shutil.move(file, folder / file.name)


def _write_frames(
    file: Path, t: Array, cells: Array, of_points: dict[str, Array], item: Callable[[Array], str]
) -> None:  # fmt: skip
    """Write the frames of a mesh.

    cells : points of each (frames, n, 1) or of each line (frames, n, 2);  of_points : places and data (frames, m, ...).
    item : the text of an array's values.
    """
    kind = "Polyline" if cells.shape[2] == 2 else "Polyvertex"
    single = {name: np.ascontiguousarray(values, np.float32) for name, values in of_points.items()}
    with file.open("w", encoding="ascii") as out:
        out.write(BEGIN)
        for k, time in enumerate(t.tolist()):
            out.write(f'<Grid Name="frame" GridType="Uniform"><Time Value="{time!r}"/>')
            out.write(f'<Topology TopologyType="{kind}" NumberOfElements="{len(cells[k])}">{item(cells[k])}</Topology>')
            for name, values in single.items():
                values_item = item(values[k])
                if name == "points":
                    out.write(f'<Geometry GeometryType="XYZ">{values_item}</Geometry>')
                else:
                    of = f'Name="{name}" AttributeType="{"Vector" if values.ndim == 3 else "Scalar"}" Center="Node"'
                    out.write(f"<Attribute {of}>{values_item}</Attribute>")
            out.write("</Grid>")
        out.write(END)


def _item(values: Array, format: str, text: str) -> str:
    kind = "Int" if values.dtype.kind == "i" else "Float"
    size = " ".join(map(str, values.shape))
    of = f'DataType="{kind}" Dimensions="{size}" Format="{format}" Precision="{values.itemsize}"'
    return f"<DataItem {of}>{text}</DataItem>"


def _listed(values: Array) -> str:
    return _item(values, "XML", " ".join(f"{x:.9g}" for x in values.ravel().tolist()))


def _stored(data: Any, values: Array) -> str:
    """The item of a new dataset of an HDF5 file; create_dataset takes twice as long."""
    name = f"data{len(data)}"
    dataset = h5d.create(data.id, name.encode(), h5t.py_create(values.dtype), h5s.create_simple(values.shape))
    dataset.write(h5s.ALL, h5s.ALL, values)
    return _item(values, "HDF", f"{DATA}:/{name}")


def _lines(f: Fields) -> Array:
    """Both points of the lines between stations, which part at the mass, (frames, m, 2)."""
    m = f.s.size
    line = np.arange(m)
    # station i of s_i <= s_o <= s_i+1
    behind_mass = np.clip(np.searchsorted(f.s, f.s_o, side="right") - 1, 0, m - 2)[:, None]
    begins = np.where(line <= behind_mass, line, line - 1)
    begins[line == behind_mass + 1] = m + 1
    ends = np.where(line < behind_mass, line + 1, line)
    ends[line == behind_mass] = m
    return np.stack([begins, ends], axis=2)


def _at_mass(f: Fields, values: Array) -> Array:
    """Values (frames, m) at the mass, (frames,)."""
    return np.array([np.interp(s_o, f.s, row) for s_o, row in zip(f.s_o, values, strict=True)])


def _with_ends(along: Array, behind: Array, ahead: Array) -> Array:
    """Values at the stations (frames, m, ...), then at the cable's ends at the mass."""
    return np.concatenate([along, behind[:, None], ahead[:, None]], axis=1)


def _upward(x: Array, y: Array) -> Array:
    """Vectors (..., 3), y up, from components (...), y down."""
    return np.stack([x, -y, np.zeros_like(x)], axis=-1)
