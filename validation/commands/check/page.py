"""The page of a check: answer, certainty, sources; from the folder of `study.Check.store`."""

from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np
from markupsafe import Markup

from validation.core import store
from validation.core.quantities import named, told
from validation.page import line
from validation.page.answer import figures as draw
from validation.page.answer import many
from validation.page.answer.sections import answer, behind, typeset
from validation.page.answer.stored import Stored, read
from validation.page.page import VERDICTS, Section, callout, details, gallery, number, table

WORDS = store.shipped(__package__, "words.toml")
COUNTED, OTHERS = WORDS["counted"], "Other comparisons"


def sections(folder: Path) -> list[Section]:
    for name in ("rest-check", "grid-rest-check"):
        if (folder / name).is_dir():
            told = store.stored(folder / "agreement.json")
            at_rest = folder / name
            return (
                line.grid(at_rest) if name.startswith("grid") else line.sections(at_rest, told["rows"], told["verdict"])
            )
    grid, single = folder / "grid-check" / "grid.json", folder / "agreement.json"
    if grid.exists() and (not single.exists() or grid.stat().st_mtime > single.stat().st_mtime):
        return many.sections(grid.parent)
    x = read(folder)
    if x is None:
        return [Section("answer", "Answer", "", "not comparable", "No answer: every run broke at its start.")]
    first, *others = answer(x)
    doubts = [callout(f"{d['method']}: {d['words']}.", "not comparable") for d in x.agreement.get("doubts", [])]
    html = Markup("\n").join([*doubts, Markup(first.html)])
    head = Section(first.id, first.title, html, x.verdict or "not comparable", f"{first.summary} {_sentences(x)}")
    return [head, *others, _sure(x), _rests(x)]


def _sentences(x: Stored) -> str:
    said = sure([row for row in x.rows if not row.get("with")])
    return said if x.party is None else f"{said} {x.party.method}: {third(x.rows, x.party.method)[1]}"


def sure(rows: list[dict[str, Any]]) -> str:
    """One sentence: how many asked rows agree."""
    asked = Counter(row["verdict"] for row in rows if row.get("asked", True))
    if not asked:
        return "Nothing could be compared."
    parts = [f"{asked[verdict]} {COUNTED[verdict]}" for verdict in ("agree", *VERDICTS) if asked[verdict]]
    unique = list(dict.fromkeys(parts))
    return f"Two independent solvers, {sum(asked.values())} comparisons: {', '.join(unique)}."


def third(rows: list[dict[str, Any]], party: str) -> tuple[str, str]:
    """The verdict on a third party, and a sentence with the one change that would make it agree."""
    theirs = [row for row in rows if row.get("with") == party]
    worst = next(verdict for verdict in VERDICTS if any(row["verdict"] == verdict for row in theirs))
    notes = [note for row in theirs for note in row.get("notes", ())]
    return worst, "; ".join([WORDS["third"][worst], *dict.fromkeys(notes)]) + "."


def _sure(x: Stored) -> Section:
    group_of = {name: group for group, names in WORDS["groups"].items() for name in names}
    groups: dict[str, list[dict[str, Any]]] = {}
    for row in x.rows:
        groups.setdefault(group_of.get(row["quantity"], OTHERS), []).append(row)
    lines = [_line(name, groups[name]) for name in [*WORDS["groups"], OTHERS] if name in groups]
    html = [Markup("<p>{}</p>").format(WORDS["rule"])]
    if x.party is not None:
        worst, said = third(x.rows, x.party.method)
        html.insert(1, callout(f"{x.party.method}: {said}", worst))
    groups_of = table(lines, {"group": "comparison", "verdict": "verdict", "words": "of those asked"}, stack=True)
    apart = [draw.distance(x, "How far the two paths of the car are apart.")] if len(x.runs) > 1 else []
    html.append(gallery(groups_of, *apart))
    html.append(details(f"All {len(x.rows)} comparisons", _rows(x.rows)))
    return Section("how-sure", "How sure", Markup("\n").join(html))


def _line(group: str, rows: list[dict[str, Any]]) -> dict[str, Any]:
    asked = [row for row in rows if row.get("asked", True)]
    worst = next((v for v in VERDICTS if any(row["verdict"] == v for row in asked)), None)
    count = Counter(row["verdict"] for row in asked)
    words = ", ".join(f"{count[v]} {COUNTED[v]}" for v in reversed(VERDICTS) if count[v])
    bad = [_named(row) for row in asked if row["verdict"] != "agree"]
    return {"group": group, "verdict": worst, "words": words + (f" ({'; '.join(bad)})" if bad else "")}


def _named(row: dict[str, Any]) -> str:
    parts = [row["quantity"].replace("_", " "), row.get("law"), row.get("with")]
    return ": ".join(part for part in parts if part)


def _rows(rows: list[dict[str, Any]]) -> Markup:
    def percent(x: float | None) -> str:
        return "–" if x is None else f"{number(100.0 * x)}\u202f%"

    cells = [
        {
            "quantity": _named(row), "verdict": row["verdict"], "gap": percent(row.get("gap")),
            "allowed": percent(row.get("allowed")), "asked": percent(row.get("asked_for")),
            "where": "–" if row.get("where") is None else f"{row['where']:.3f}",
            "shown": "asked" if row.get("asked", True) else "shown only",
        }
        for row in rows
    ]  # fmt: skip
    heads = {
        "quantity": "comparison", "verdict": "verdict", "gap": "gap", "allowed": "sum of both bars",
        "asked": "asked for", "where": "largest at sₒ/l", "shown": "in the verdict",
    }  # fmt: skip
    return table(cells, heads, sort=True, stack=True)


def _rests(x: Stored) -> Section:
    html = [behind(x)]
    if x.grip is not None and (line := _gripped(x)):
        html.insert(0, Markup("<p>{}</p>").format(line))
    shared = [{"what": what, "how": how} for what, how in WORDS["shared"].items()]
    heads = {"what": "shared", "how": "checked on its own by"}
    html.append(details("What both solvers share: a fault in it would show as no gap", table(shared, heads)))
    return Section("rests", "What it rests on", Markup("\n").join(html))


def _gripped(x: Stored) -> str:
    assert x.grip is not None
    mine = next((d for d in x.design if d["quantity"] == "tension_max"), None)
    other = next((d for d in x.grip.design if d["quantity"] == "tension_max"), None)
    if mine is None or other is None:
        return ""
    apart = np.nanmax(np.abs(x.grip.T_ahead - x.grip.T_behind))
    jump = told({"quantity": "tension_max", "value": float(apart), "bar": None, "unit": "N"})["value"]
    value = typeset(told({**other, "bar": None})["value"])
    return f"A car that grips the rope would say {named('tension_max')} {value}, with a jump up to {jump} at the car."
