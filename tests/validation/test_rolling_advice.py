"""The least model of a car that rolls."""

from cablefem import Scene
from validation.commands.advise.page import sections
from validation.commands.advise.study import advise


def test_a_zip_line_s_timetable_needs_the_load_path_and_no_more(tmp_path):
    found = advise(Scene.load("zipline"), 2e-2, tmp_path)
    assert found["least"]["timetable"] == "quasi-static"
    off = {r["model"]: r["gaps"]["timetable"] for r in found["rungs"]}
    assert off["chord"] > off["empty cable"] > 2e-2 > off["quasi-static"] > off["full"]
    assert found["meets"]
    (section,) = sections(tmp_path)
    assert "timetable, quasi-static" in section.summary
