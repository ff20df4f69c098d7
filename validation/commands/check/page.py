"""The page of a check: answer, certainty, sources."""

from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any

from validation.core import store
from validation.page import line, motion
from validation.page.answer import figures as draw
from validation.page.answer import many
from validation.page.answer.content import answer_page_content
from validation.page.answer.stored import read_stored_check
from validation.page.page import VERDICTS, Section, render_sections, worst_verdict

WORDS = store.read_packaged_toml(__package__, "words.toml")
LINE_PAGES: dict[str, tuple[Callable[..., list[Section]], Callable[[Path], list[Section]]]] = {
    "rest-check": (line.rest_sections, line.line_grid_sections),
    "motion-check": (motion.motion_sections, motion.motion_grid_sections),
}
COUNTED = WORDS["counted"]


def sections(folder: Path) -> list[Section]:
    of_line = _sections_of_line(folder)
    if of_line:
        return of_line
    grid = folder / "grid-check" / "grid.json"
    single = folder / "agreement.json"
    if grid.exists() and (not single.exists() or grid.stat().st_mtime > single.stat().st_mtime):
        return many.run_grid_sections(grid.parent)
    x = read_stored_check(folder)
    if x is None:
        return [Section("answer", "Answer", "", "not comparable", "No answer: every run broke at its start.")]
    # of both solvers; a third party has its own verdict
    own = [row for row in x.comparison_rows if not row.get("with")]
    return render_sections(
        __package__, **answer_page_content(x) | {"verdict": worst_deciding_verdict(own) or "not comparable"},
        words=WORDS, named=_comparison_name, said=agreement_sentence(own), doubts=x.agreement.get("doubts", []),
        third=third_party_verdict_and_sentence(x.comparison_rows, x.third_party.method) if x.third_party else None,
        groups=_summary_rows_of_groups(x.comparison_rows),
        distance=draw.plot_path_distance(x) if len(x.runs) > 1 else "",
    )  # fmt: skip


def _sections_of_line(folder: Path) -> list[Section]:
    """Sections of a line or of a grid of lines; none where another check is stored."""
    for home, (line_sections, grid_sections) in LINE_PAGES.items():
        if (folder / home).is_dir():
            judged = store.read_json(folder / "agreement.json")
            return line_sections(folder / home, judged["rows"], judged["verdict"])
        if (folder / f"grid-{home}").is_dir():
            return grid_sections(folder / f"grid-{home}")
    return []


def agreement_sentence(rows: list[dict[str, Any]]) -> str:
    """One sentence: how many asked rows agree, by kind: two solvers, laws of one answer, printed numbers."""
    kinds = WORDS["sure"]
    named = {name for kind in kinds.values() for name in _quantities_of_groups(kind["groups"])}
    deciding = [row for row in rows if row.get("asked", True)]
    others = {row["quantity"] for row in deciding} - named
    parts = []
    for kind, how in kinds.items():
        quantities = _quantities_of_groups(how["groups"]) or others
        of_kind = [row for row in deciding if row["quantity"] in quantities]
        if of_kind:
            parts.append(_agreeing_count_text(kind, how["hold"], of_kind))
    return f"{'; '.join(parts)}." if parts else "Nothing could be compared."


def _quantities_of_groups(groups: list[str]) -> set[str]:
    return {name for group in groups for name in WORDS["groups"][group]}


def _agreeing_count_text(kind: str, hold: str, rows: list[dict[str, Any]]) -> str:
    """How many rows agree, as "3 of 4 laws hold, 1 disagrees"; kind, hold : subject and verb."""
    others = [row for row in rows if row["verdict"] != "agree"]
    agreeing = len(rows) - len(others)
    if not others:
        return f"{agreeing} {kind} {hold}"
    return f"{agreeing} of {len(rows)} {kind} {hold}, {_verdict_count_text(others)}"


def _verdict_count_text(rows: list[dict[str, Any]]) -> str:
    """How many rows have each verdict, the worst first."""
    count = Counter(row["verdict"] for row in rows)
    return ", ".join(f"{count[verdict]} {COUNTED[verdict]}" for verdict in reversed(VERDICTS) if count[verdict])


def worst_deciding_verdict(rows: list[dict[str, Any]]) -> str | None:
    """The worst verdict of the rows that decide."""
    return worst_verdict(row for row in rows if row.get("asked", True))


def third_party_verdict_and_sentence(rows: list[dict[str, Any]], name: str) -> tuple[str, str]:
    """The verdict on a third party, and a sentence with the one change that would make it agree."""
    theirs = [row for row in rows if row.get("with") == name]
    worst = worst_deciding_verdict(theirs) or "not comparable"
    notes = [note for row in theirs for note in row.get("notes", ())]
    return worst, "; ".join([WORDS["third"][worst], *dict.fromkeys(notes)]) + "."


def _summary_rows_of_groups(rows: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """One row for each of the page's groups of quantities: its worst verdict, and how many have each."""
    named = {name for names in WORDS["groups"].values() for name in names}
    groups = WORDS["groups"] | {"Other comparisons": {row["quantity"] for row in rows} - named}
    parts = {group: [row for row in rows if row["quantity"] in of] for group, of in groups.items()}
    return [_summary_row_of_group(group, part) for group, part in parts.items() if part]


def _summary_row_of_group(group: str, rows: list[dict[str, Any]]) -> dict[str, Any]:
    deciding = [row for row in rows if row.get("asked", True)]
    worst = worst_deciding_verdict(deciding)
    bad = "; ".join(_comparison_name(row) for row in deciding if row["verdict"] != "agree")
    return {"group": group, "verdict": worst, "words": _verdict_count_text(deciding) + (f" ({bad})" if bad else "")}


def _comparison_name(row: dict[str, Any]) -> str:
    parts = [row["quantity"].replace("_", " "), row.get("law"), row.get("with")]
    return ": ".join(part for part in parts if part)
