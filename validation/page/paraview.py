"""A response as files that ParaView animates: response.xdmf, the cable, and mass.xdmf, the mass on it.

y is UP here, unlike in path.csv.  Points lie on the static cable; "Warp By Vector" with `displacement` shows the
motion.  Single precision; response.npz has all digits.
"""

import shutil
import tempfile
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import h5py
import numpy as np
from h5py import h5d, h5s, h5t
from meshio.xdmf import TimeSeriesWriter

from cablefem.response import Array, Response
from cablefem.scene import Scene

CABLE = "response.xdmf"
MASS = "mass.xdmf"


class _Writer(TimeSeriesWriter):
    """meshio's, with one mesh per frame and the HDF5 file beside it."""

    def __enter__(self) -> Any:
        if self.data_format == "HDF":
            self.h5_filename = str(self.filename.with_suffix(".h5"))
            self.h5_file = h5py.File(self.h5_filename, "w", libver="latest")
        return self

    def numpy_to_xml_string(self, data: Array) -> str:
        """The text of an item: the numbers, or the name of a dataset; create_dataset takes twice as long."""
        if self.data_format == "XML":
            return " ".join(f"{x:.9g}" for x in data.ravel().tolist())
        name = f"data{self.data_counter}"
        self.data_counter += 1
        content = np.ascontiguousarray(data)
        kind = h5t.py_create(content.dtype)
        space = h5s.create_simple(content.shape)
        dataset = h5d.create(self.h5_file.id, name.encode(), kind, space)
        dataset.write(h5s.ALL, h5s.ALL, content)
        return f"{Path(self.h5_filename).name}:/{name}"

    def add_frame(self, t: float, points: Array, cells: tuple[str, Array], **data: Array) -> None:
        """Add a frame: points (m, 3), cells, and named data of the points."""
        grid = ElementTree.SubElement(self.collection, "Grid", Name="frame", GridType="Uniform")
        ElementTree.SubElement(grid, "Time", Value=repr(t))
        self.cells([cells], grid)
        self.points(grid, points.astype(np.float32))
        self.point_data({name: values.astype(np.float32) for name, values in data.items()}, grid)


def write_paraview_files(r: Response, folder: Path) -> None:
    """Write both files, and the HDF5 file of the first.

    Cable: points (m + 2, 3) [m]: the fixed stations, then the cable's ends behind and ahead of the mass.
    Per frame `displacement` (m + 2, 3) [m], `velocity` (m + 2, 3) [m/s] at fixed s, `tension` (m + 2,) [N].
    At both ends `velocity` is the one behind the mass; `tension` differs.
    Mass: one point, `displacement` (1, 3) [m], `tension_behind`, `tension_ahead` (1,) [N].
    """
    folder.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(dir=folder, prefix=".paraview") as name:
        temporary = Path(name)
        with _Writer(temporary / CABLE) as cable, _Writer(temporary / MASS, "XML") as mass:
            _write_frames(r, cable, mass)
        for file in sorted(temporary.iterdir(), key=lambda file: file.suffix):  # data first
            shutil.move(file, folder / file.name)


def _write_frames(r: Response, cable: Any, mass: Any) -> None:
    shape = Scene.from_toml(r.scene_toml).catenary
    f = r.fields
    stations = _vectors_with_y_up(shape.x(f.s), shape.y(f.s))
    at_mass = _vectors_with_y_up(shape.x(f.s_o), shape.y(f.s_o))
    displacement = _vectors_with_y_up(f.mass_u, f.mass_v)
    m = f.s.size
    numbers = np.arange(m)
    behind_mass = np.searchsorted(f.s, f.s_o, side="right") - 1  # station i of s_i <= s_o <= s_i+1
    behind_mass = np.clip(behind_mass, 0, m - 2)
    vertex = "vertex", np.array([[0]])
    for k, t in enumerate(f.t.tolist()):
        i = behind_mass[k]
        begins = np.insert(numbers[:-1], i + 1, m + 1)
        ends = np.insert(numbers[1:], i, m)
        lines = "line", np.stack([begins, ends], axis=1)
        du = np.interp(f.s_o[k], f.s, f.du[k])
        dv = np.interp(f.s_o[k], f.s, f.dv[k])
        points = np.vstack([stations, at_mass[k], at_mass[k]])
        moved = np.vstack([_vectors_with_y_up(f.u[k], f.v[k]), displacement[k], displacement[k]])
        velocity = _vectors_with_y_up(np.append(f.du[k], [du, du]), np.append(f.dv[k], [dv, dv]))
        T_behind = f.T_behind[k : k + 1]
        T_ahead = f.T_ahead[k : k + 1]
        tension = np.concatenate([f.T[k], T_behind, T_ahead])
        cable.add_frame(t, points, lines, displacement=moved, velocity=velocity, tension=tension)

        point = at_mass[k : k + 1]
        mass_moved = displacement[k : k + 1]
        mass.add_frame(t, point, vertex, displacement=mass_moved, tension_behind=T_behind, tension_ahead=T_ahead)


def _vectors_with_y_up(x: Array, y: Array) -> Array:
    """(n, 3) vectors, y up, from components (n,), y down."""
    return np.stack([x, -y, np.zeros_like(x)], axis=1)
