"""What ParaView gets is the response: read back with meshio, frame by frame."""

import dataclasses

import numpy as np
import pytest
from meshio.xdmf import TimeSeriesReader

from cablefem import Scene
from validation.core.running import run
from validation.page import paraview

INCLINED = Scene.load("inclined")


@pytest.fixture(scope="module")
def inclined_response():
    return run(INCLINED, "following-p2", elements=4, steps=120)


@pytest.fixture(scope="module")
def paraview_folder(inclined_response, tmp_path_factory):
    folder = tmp_path_factory.mktemp("xdmf")
    paraview.write_paraview_files(inclined_response, folder)
    return folder


def read_frame(file, k):
    """Points, cells, time and point data of a frame."""
    with TimeSeriesReader(file) as reader:
        reader.mesh_grid = reader.collection[k]  # every frame has its own mesh
        points, cells = reader.read_points_cells()
        t, data, _ = reader.read_data(k)
        return points, cells[0], t, data


def assert_single_precision(a, b):
    """Single precision, of places up to 2000 m and tensions up to 4e5 N."""
    np.testing.assert_allclose(a, b, rtol=3e-7, atol=3e-4)


def vectors_with_y_up(x, y):
    return np.stack([x, -y, 0.0 * x], axis=-1)


@pytest.mark.parametrize("k", [0, 41, 70])
def test_the_cable_is_the_response_with_y_up(inclined_response, paraview_folder, k):
    f = inclined_response.fields
    at_rest = INCLINED.catenary
    points, cells, t, data = read_frame(paraview_folder / paraview.CABLE, k)
    assert t == f.t[k]
    assert_single_precision(points[:-2], vectors_with_y_up(at_rest.x(f.s), at_rest.y(f.s)))
    assert_single_precision(data["displacement"][:-2], vectors_with_y_up(f.u[k], f.v[k]))
    assert_single_precision(data["velocity"][:-2], vectors_with_y_up(f.du[k], f.dv[k]))
    assert_single_precision(data["tension"], [*f.T[k], f.T_behind[k], f.T_ahead[k]])
    assert points[100, 1] < 0.0  # hangs below the left support
    assert data["displacement"][2 * (k + 1), 1] < 0.0  # and the mass pulls it down
    assert cells.type == "line"


@pytest.mark.parametrize(("k", "beside"), [(0, 0.0), (41, 0.0), (97, 0.0), (41, 0.3)])
def test_the_lines_run_along_the_cable_and_part_at_the_mass_only(
    inclined_response, paraview_folder, tmp_path, k, beside
):
    """Also where the mass is between two stations."""
    f = inclined_response.fields
    if beside:
        paraview_folder = tmp_path
        f = dataclasses.replace(f, s_o=f.s_o + beside * (f.s[1] - f.s[0]))
        paraview.write_paraview_files(dataclasses.replace(inclined_response, fields=f), paraview_folder)
    m = f.s.size
    _, cells, _, _ = read_frame(paraview_folder / paraview.CABLE, k)
    s = np.append(f.s, [f.s_o[k], f.s_o[k]])
    begin, end = cells.data.T
    assert np.all(s[end] > s[begin] if beside else s[end] >= s[begin])
    assert (s[end] - s[begin]).sum() == pytest.approx(f.s[-1], rel=1e-12)  # nothing twice, nothing missing
    assert (begin == m + 1).sum() == 1  # one line starts ahead of the mass,
    assert (end == m).sum() == 1  # one ends behind it,
    assert not np.any((begin == m) | (end == m + 1))  # and none joins both


@pytest.mark.parametrize("k", [3, 66])
def test_the_mass_is_on_the_cable(inclined_response, paraview_folder, k):
    f = inclined_response.fields
    at_rest = INCLINED.catenary
    s_o = f.s_o[k]
    points, cells, t, data = read_frame(paraview_folder / paraview.MASS, k)
    assert (t, cells.type, points.shape) == (f.t[k], "vertex", (1, 3))
    assert_single_precision(points[0], vectors_with_y_up(at_rest.x(s_o), at_rest.y(s_o)))
    assert_single_precision(data["displacement"][0], vectors_with_y_up(f.mass_u[k], f.mass_v[k]))
    assert_single_precision(data["tension_behind"][0], f.T_behind[k])
    assert_single_precision(data["tension_ahead"][0], f.T_ahead[k])
    of_cable, _, _, cable_data = read_frame(paraview_folder / paraview.CABLE, k)
    np.testing.assert_array_equal(of_cable[-2:], np.repeat(points, 2, axis=0))
    np.testing.assert_array_equal(cable_data["displacement"][-2:], np.repeat(data["displacement"], 2, axis=0))


def test_all_frames_are_there_in_three_files(inclined_response, paraview_folder):
    for name in (paraview.CABLE, paraview.MASS):
        with TimeSeriesReader(paraview_folder / name) as reader:
            assert reader.num_steps == inclined_response.fields.t.size >= 98  # the last step is at 0.983
    assert sorted(file.name for file in paraview_folder.iterdir()) == [paraview.MASS, "response.h5", paraview.CABLE]


def test_a_run_that_broke_at_once_still_gives_files(inclined_response, tmp_path):
    f = inclined_response.fields
    none = {x.name: getattr(f, x.name)[:0] for x in dataclasses.fields(f) if x.name != "s"}
    paraview.write_paraview_files(
        dataclasses.replace(inclined_response, fields=dataclasses.replace(f, **none)), tmp_path
    )
    assert (tmp_path / paraview.CABLE).exists()
