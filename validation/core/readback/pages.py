"""Pages of a run or a check."""

from __future__ import annotations

import json

from validation.core.readback.limits import limit_table_faults
from validation.core.readback.side_view import side_view_faults
from validation.core.readback.stored import Faults, StoredResults
from validation.core.readback.tables import count_faults, table_faults
from validation.core.readback.texts import contents_of_tags, plain_text

SECTIONS = ("answer", "side-view", "ride", "tension", "scene", "how-sure", "rests")


def section_html(html_text: str, name: str, command: str) -> str:
    """A section of a command, or ""; another command's may have the same name."""
    tag = f'section id="{name}(?:-{command})?" data-command="{command}"'
    return next(iter(contents_of_tags(tag, html_text)), "")


def page_faults(html_text: str, command: str, of: StoredResults) -> Faults:
    """Faults of the sections of a page that show a run or a check."""
    sections = {name: section_html(html_text, name, command) for name in SECTIONS}
    answer = sections["answer"]
    if not answer:
        yield "the page has no answer"
        return
    head = plain_text("".join(contents_of_tags("h2", answer)))
    if of.agreement and not head.endswith(f" {of.verdict}"):
        yield f"the page's verdict is {head!r}, that of the rows {of.verdict}"
    summary = plain_text("".join(contents_of_tags('p class="summary"', answer)))
    if not summary.startswith(plain_text(f"{of.outcome[0].upper()}{of.outcome[1:]}.")):
        yield f"{summary!r} where the outcome is {of.outcome!r}"
    if of.rows:
        yield from count_faults(summary, of)
    text = "".join(sections.values())
    yield from limit_table_faults(text, of.limits)
    for table in contents_of_tags("table", text):
        yield from table_faults(table, of)
    for data in contents_of_tags('script type="application/json"', text):
        for fault in side_view_faults(json.loads(data), of):
            yield f"side view: {fault}"
