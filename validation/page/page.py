"""A report: sections in one HTML file that needs no network, on a phone, a desktop or paper.

Study pages build `Section`s from stored results with `table`, `figure`, `badge` and the like; text is escaped unless
it is `Markup`.  Nothing here calls a solver.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from importlib import resources
from numbers import Integral, Real
from pathlib import Path
from typing import Any

import jinja2
from markupsafe import Markup, escape
from matplotlib.figure import Figure

from cablefem.response import whole
from validation.page.figures import panels, style, svg

__all__ = [
    "Section", "badge", "callout", "details", "figure", "gallery", "missing", "number", "panels", "percent", "render",
    "style", "svg", "table",
]  # fmt: skip

# worst first; the sign stands beside the word, so that no verdict depends on colour
VERDICTS = {"disagree": "✗", "not comparable": "?", "too coarse": "?", "agree": "✓"}


@dataclass(frozen=True, slots=True)
class Section:
    """One part of a report."""

    id: str  # its anchor; unique in a report, so it begins with the study's name
    title: str
    html: str
    verdict: str | None = None  # "agree" | "disagree" | "not comparable"
    summary: str = ""  # plain text, a sentence or two: what was found
    scripts: tuple[str, ...] = ()  # files of assets/ that it needs


def render(title: str, sections: Sequence[Section], out_file: Path) -> None:
    """Write the report, whole or not at all; the contents list verdicts worst first."""
    twice = [id for id, n in Counter(s.id for s in sections).items() if n > 1]
    if twice:
        raise ValueError(f"two sections have the id {twice[0]!r}")
    unknown = [s.verdict for s in sections if s.verdict is not None and s.verdict not in VERDICTS]
    if unknown:
        raise ValueError(f"a verdict is one of {', '.join(VERDICTS)}; got {unknown[0]!r}")
    judged = sorted((s for s in sections if s.verdict), key=lambda s: list(VERDICTS).index(s.verdict or ""))
    names = ["page.js", *dict.fromkeys(name for s in sections for name in s.scripts)]
    page = _ENVIRONMENT.get_template("page.html").render(
        title=title, sections=sections, judged=judged, rest=[s for s in sections if not s.verdict],
        css=Markup(asset("page.css")), scripts=[Markup(asset(name)) for name in names],
    )  # fmt: skip
    with whole(out_file) as temporary:
        temporary.write_text(page, encoding="utf-8")


def badge(verdict: str, text: str | None = None) -> Markup:
    """Return a verdict as a coloured word with its sign; `text` is said in its place."""
    kind = {"agree": "good", "disagree": "bad"}.get(verdict, "open")
    return Markup('<span class="badge {}"><span aria-hidden="true">{}</span> {}</span>').format(
        kind, VERDICTS.get(verdict, "?"), text or verdict
    )


def table(
    rows: Iterable[Mapping[str, Any]], columns: Mapping[str, str] | Sequence[str], *, caption: str = "",
    sort: bool = False, stack: bool = False,
) -> Markup:  # fmt: skip
    """Return a table: one line per row, one column per key of `columns` (key -> heading, unit in brackets).

    Cells: numbers to three digits, None or a key a row lacks as a dash, a verdict under the key "verdict" as a badge,
    text escaped, Markup as it is.  sort : put disagreements first, then what is not comparable.  stack : on a phone
    every row becomes a block of its own, for tables with words in them; others scroll sideways.
    """
    heads = dict(columns) if isinstance(columns, Mapping) else {name: name for name in columns}
    rows = list(rows)
    if sort:
        order = list(VERDICTS)
        rows.sort(key=lambda row: order.index(row["verdict"]) if row.get("verdict") in order else len(order))
    numeric = {
        key for key in heads if rows and all(isinstance(row.get(key), Real | None) for row in rows)
    }  # fmt: skip
    kind = "stack" if stack else "wide" if len(heads) > 3 else "narrow"
    name = escape(Markup(escape(caption)).striptags() or "table")
    out = [f'<div class="scroll" tabindex="0" role="region" aria-label="{name}">', f'<table class="{kind}">']
    if caption:
        out.append(f"<caption>{escape(caption)}</caption>")
    cells = "".join(f"<th scope=col{_kind(key in numeric)}>{escape(head)}</th>" for key, head in heads.items())
    out.append(f"<thead><tr>{cells}</tr></thead><tbody>")
    for row in rows:
        cells = "".join(
            f'<td{_kind(key in numeric, row.get(key) is None)} data-label="{escape(head)}">'
            f"<div>{_cell(key, row.get(key))}</div></td>"
            for key, head in heads.items()
        )
        out.append(f"<tr>{cells}</tr>")
    out.append("</tbody></table></div>")
    return Markup("\n".join(out))


def _kind(numeric: bool, empty: bool = False) -> str:
    names = ["n"] * numeric + ["none"] * empty
    return f' class="{" ".join(names)}"' if names else ""


def _cell(key: str, value: Any) -> Markup:
    if key == "verdict" and value in VERDICTS:
        return badge(value)
    if isinstance(value, bool):
        return escape("yes" if value else "no")
    if value is None or isinstance(value, Real):
        return escape(number(value))  # type: ignore[arg-type]
    return escape(value)


def number(x: float | None, digits: int = 3) -> str:
    """Return a number to so many significant digits, 2.1 × 10⁻⁵ style when far from one; a dash if there is none."""
    if x is None or not math.isfinite(x):
        return "–"
    if isinstance(x, Integral):
        return f"{x:,}".replace(",", "\u202f").replace("-", "−")
    if x == 0.0:
        return "0"
    mantissa, exponent = f"{x:.{digits - 1}e}".split("e")
    power = int(exponent)
    if -4 < power < 5:
        return f"{float(f'{mantissa}e{power}'):.{max(0, digits - 1 - power)}f}".replace("-", "−")
    return f"{mantissa} × 10{str(power).translate(_RAISED)}".replace("-", "−")


_RAISED = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


def percent(x: float | None, digits: int = 2) -> str:
    """Return a ratio in percent, with its unit."""
    return number(x) if x is None or not math.isfinite(x) else f"{number(100.0 * x, digits)}\u202f%"


def figure(fig: Figure, caption: str, *, label: str = "", wide: bool = False) -> Markup:
    """Return a figure with its caption; `label` says in words what a reader who cannot see it would miss.

    wide : over the whole text width of a desktop; else half of it, side by side in a `gallery`.
    """
    text = label or Markup(escape(caption)).striptags()
    return Markup("<figure{}>{}<figcaption>{}</figcaption></figure>").format(
        Markup(" class=wide") if wide else "", svg(fig, text), caption
    )


def gallery(*figures: str) -> Markup:
    """Return figures side by side where the page is wide enough, below one another on a phone."""
    return Markup('<div class="gallery">{}</div>').format(Markup("\n").join(figures))


def details(title: str, html: str) -> Markup:
    """Return a part that opens when its title is clicked, and is open in print."""
    return Markup("<details><summary>{}</summary>{}</details>").format(title, html)


def callout(text: str, verdict: str | None = None) -> Markup:
    """Return a paragraph that must not be overlooked."""
    kind = {"agree": "good", "disagree": "bad", "not comparable": "open", "too coarse": "open"}.get(
        verdict or "", "note"
    )
    return Markup('<p class="callout {}">{}</p>').format(kind, text)


def missing(what: str, consequence: str) -> Markup:
    """Return the place where something would stand if the stored results had it: which file, and what is lost."""
    return Markup('<p class="callout missing"><strong>Missing: {}.</strong> {}</p>').format(what, consequence)


def asset(name: str) -> str:
    """Return a file of assets/."""
    return (resources.files("validation.page") / "assets" / name).read_text(encoding="utf-8")


_ENVIRONMENT = jinja2.Environment(
    loader=jinja2.FunctionLoader(asset), autoescape=True, undefined=jinja2.StrictUndefined, trim_blocks=True,
    lstrip_blocks=True,
)  # fmt: skip
_ENVIRONMENT.globals["badge"] = badge
