"""Pages of a run or a check."""

import json
import re

from validation.core.readback.limits import limit_table_faults
from validation.core.readback.side_view import side_view_faults
from validation.core.readback.stored import Faults, StoredResults
from validation.core.readback.tables import table_faults_or_note_unread, verdict_count_faults
from validation.core.readback.terminal import crosswind_faults
from validation.core.readback.texts import contents_of_tags, plain_text

SECTIONS = ("answer", "side-view", "ride", "tension", "scene", "how-sure", "rests")


def section_html(html_text: str, name: str, command: str) -> str:
    """A section of a command, or ""; another command's may have the same name."""
    tag = f'section id="{name}(?:-{command})?" data-command="{command}"'
    return next(iter(contents_of_tags(tag, html_text)), "")


def page_faults(html_text: str, command: str, stored: StoredResults) -> Faults:
    """Faults of the sections of a page that show a run or a check."""
    sections = {name: section_html(html_text, name, command) for name in SECTIONS}
    answer = sections["answer"]
    if not answer:
        yield "the page has no answer"
        return
    head = plain_text("".join(contents_of_tags("h2", answer)))
    if stored.agreement and not head.endswith(f" {stored.verdict_on_both_solvers}"):
        yield f"the page's verdict is {head!r}, that of the rows {stored.verdict_on_both_solvers}"
    summary = plain_text("".join(contents_of_tags('p class="summary"', answer)))
    if not summary.startswith(plain_text(f"{stored.outcome[0].upper()}{stored.outcome[1:]}.")):
        yield f"{summary!r} where the outcome is {stored.outcome!r}"
    if stored.rows:
        yield from verdict_count_faults(summary, stored)
    wind = re.search(r"Wind of [^:]*: the numbers hold [^:]*: .*? weight", plain_text(answer))
    if wind is None and stored.runs[0]["scene"].get("wind", {}).get("across", 0.0) > 0.0:
        yield "the page does not say what is left out of the wind across the line"
    if wind is not None:
        yield from crosswind_faults(wind[0], stored)
    text = "".join(sections.values())
    yield from limit_table_faults(text, stored.limits)
    for table in contents_of_tags("table", text):
        yield from table_faults_or_note_unread(table, stored)
    for data in contents_of_tags('script type="application/json"', text):
        for fault in side_view_faults(json.loads(data), stored):
            yield f"side view: {fault}"
