"""The page of one run, or of a grid of runs."""

from collections.abc import Callable
from pathlib import Path

from cablefem.response import Response
from cablefem.scene import Scene
from validation.page import line, motion
from validation.page.answer import many
from validation.page.answer.content import answer_page_content
from validation.page.answer.stored import StoredAnswer
from validation.page.page import Section, callout, render_sections

HOMES: dict[str, Callable[[Path], list[Section]]] = {  # what draws a folder of results; another one is of a run
    "grid": many.run_grid_sections, "rest": line.rest_sections, "grid-rest-run": line.line_grid_sections,
    "motion-run": motion.motion_sections, "grid-motion-run": motion.motion_grid_sections,
}  # fmt: skip


def sections(folder: Path) -> list[Section]:
    files = [*folder.glob("*/summary.json"), *folder.glob("*/grid.json")]
    home = max(files, key=lambda file: file.stat().st_mtime).parent
    if home.name in HOMES:
        return HOMES[home.name](home)
    r = Response.read(home)
    if r.t.size < 2:
        return [Section("answer", "Answer", callout(f"The run broke at its start: {r.reason}.", "disagree"))]
    x = StoredAnswer(Scene.from_toml(r.scene_toml), (r,))
    return render_sections(__package__, **answer_page_content(x))
