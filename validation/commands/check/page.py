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
from validation.page.answer.stored import read_stored_check_if_started
from validation.page.page import VERDICTS, Section, render_sections, worst_verdict

Row = dict[str, Any]
WORDS = store.read_packaged_toml(__package__, "words.toml")
PageSections = Callable[..., list[Section]]
LINE_PAGES: dict[str, tuple[PageSections, PageSections]] = {  # of a line and of a grid of lines
    "rest-check": (line.rest_sections, line.line_grid_sections),
    "motion-check": (motion.motion_sections, motion.motion_grid_sections),
}
COUNTED = WORDS["counted"]


def sections(folder: Path) -> list[Section]:
    of_line = _line_sections_if_stored(folder)
    if of_line:
        return of_line
    grid = folder / "grid-check" / "grid.json"
    single = folder / "agreement.json"
    if grid.exists() and (not single.exists() or grid.stat().st_mtime > single.stat().st_mtime):
        return many.run_grid_sections(grid.parent)
    x = read_stored_check_if_started(folder)
    if x is None:
        return [Section("answer", "Answer", "", "not comparable", "No answer: every run broke at its start.")]
    # of both solvers; a third party has its own verdict
    own = [row for row in x.comparison_rows if not row.get("with")]
    content = answer_page_content(x)
    content |= {"verdict": worst_deciding_verdict(own) or "not comparable", "said": agreement_sentence(own)}
    content |= {"words": WORDS, "named": _comparison_name, "doubts": x.agreement.get("doubts", [])}
    content["third"] = None
    if x.third_party:
        content["third"] = third_party_verdict_and_sentence(x.comparison_rows, x.third_party.method)
    content["groups"] = _summary_rows_of_groups(x.comparison_rows)
    content["distance"] = draw.plot_path_distance_with_error_bars(x) if len(x.runs) > 1 else ""
    return render_sections(__package__, **content)


def _line_sections_if_stored(folder: Path) -> list[Section]:
    """Sections of a line or of a grid of lines; none where another check is stored."""
    for home, (line_sections, grid_sections) in LINE_PAGES.items():
        if (folder / home).is_dir():
            judged = store.read_json(folder / "agreement.json")
            return line_sections(folder / home, judged["rows"], judged["verdict"])
        if (folder / f"grid-{home}").is_dir():
            return grid_sections(folder / f"grid-{home}")
    return []


def agreement_sentence(rows: list[Row]) -> str:
    """One sentence: how many asked rows agree, by kind: two solvers, laws of one answer, printed numbers."""
    kinds = WORDS["sure"]
    named = {name for kind in kinds.values() for name in _quantities_of_groups(kind["groups"])}
    deciding = _deciding_rows(rows)
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


def _agreeing_count_text(kind: str, hold: str, rows: list[Row]) -> str:
    """How many rows agree, as "3 of 4 laws hold, 1 disagrees"; kind, hold : subject and verb."""
    others = [row for row in rows if row["verdict"] != "agree"]
    agreeing = len(rows) - len(others)
    if not others:
        return f"{agreeing} {kind} {hold}"
    return f"{agreeing} of {len(rows)} {kind} {hold}, {_verdict_count_text(others)}"


def _verdict_count_text(rows: list[Row]) -> str:
    """How many rows have each verdict, the worst first."""
    count = Counter(row["verdict"] for row in rows)
    return ", ".join(f"{count[verdict]} {COUNTED[verdict]}" for verdict in reversed(VERDICTS) if count[verdict])


def worst_deciding_verdict(rows: list[Row]) -> str | None:
    """The worst verdict of the rows that decide."""
    return worst_verdict(_deciding_rows(rows))


def _deciding_rows(rows: list[Row]) -> list[Row]:
    return [row for row in rows if row.get("asked", True)]


def third_party_verdict_and_sentence(rows: list[Row], name: str) -> tuple[str, str]:
    """The verdict on a third party, and a sentence with why it cannot be compared, or what would make it agree."""
    theirs = [row for row in rows if row.get("with") == name]
    worst = worst_deciding_verdict(theirs) or "not comparable"
    parts = [WORDS["third"][worst]]
    if worst == "not comparable":
        parts += [row["allowed_because"] for row in theirs if row["verdict"] == worst][:1]
    for row in theirs:
        parts += row.get("notes", ())
    return worst, "; ".join(dict.fromkeys(parts)) + "."


def _summary_rows_of_groups(rows: list[Row]) -> list[Row]:
    """One row for each of the page's groups of quantities: its worst verdict, and how many have each."""
    grouped: dict[str, list[Row]] = {group: [] for group in (*WORDS["groups"], "Other comparisons")}
    group_of = {name: group for group, names in WORDS["groups"].items() for name in names}
    for row in rows:
        group = group_of.get(row["quantity"], "Other comparisons")
        grouped[group].append(row)
    return [_summary_row_of_group(group, of_group) for group, of_group in grouped.items() if of_group]


def _summary_row_of_group(group: str, rows: list[Row]) -> Row:
    deciding = _deciding_rows(rows)
    text = _verdict_count_text(deciding)
    bad = "; ".join(_comparison_name(row) for row in deciding if row["verdict"] != "agree")
    if bad:
        text += f" ({bad})"
    return {"group": group, "verdict": worst_verdict(deciding), "words": text}


def _comparison_name(row: Row) -> str:
    parts = [row["quantity"].replace("_", " "), row.get("law"), row.get("with")]
    return ": ".join(part for part in parts if part)
