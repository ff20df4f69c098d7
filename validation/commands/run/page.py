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

HOMES: dict[str, Callable[[Path], list[Section]]] = {
    "rest": line.rest_sections, "grid-rest-run": line.line_grid_sections,
    "motion-run": motion.motion_sections, "grid-motion-run": motion.motion_grid_sections,
}  # fmt: skip


def sections(folder: Path) -> list[Section]:
    homes = [folder / name for name in HOMES if (folder / name).is_dir()]
    if homes:
        last = max(homes, key=_time_written)
        return HOMES[last.name](last)
    files = [*folder.glob("*/summary.json"), *folder.glob("*/grid.json")]
    last = max(files, key=lambda file: file.stat().st_mtime)
    if last.name == "grid.json":
        return many.run_grid_sections(last.parent)
    r = Response.read(last.parent)
    if r.t.size < 2:
        return [Section("answer", "Answer", callout(f"The run broke at its start: {r.reason}.", "disagree"))]
    x = StoredAnswer(Scene.from_toml(r.scene_toml), (r,))
    return render_sections(__package__, **answer_page_content(x))


def _time_written(home: Path) -> float:
    """When the result in a folder was written."""
    return max(file.stat().st_mtime for file in [*home.glob("summary.json"), *home.glob("grid.json")])
