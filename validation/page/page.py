"""A report: sections in one HTML file that needs no network.  Text is escaped unless `Markup`."""

import html
import math
import os
import platform
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from datetime import date
from functools import cache
from importlib import metadata, resources
from numbers import Integral, Real
from pathlib import Path
from typing import Any

import jinja2
import numpy as np
from markupsafe import Markup

from cablefem.response import write_text
from validation.core.quantities import (
    design_row_texts,
    factor_and_prefixed_unit,
    text_with_error_bar,
    verification_row_texts,
)

Row = dict[str, Any]  # of a table, by the keys of its columns
Content = dict[str, Any]  # of a template or a script, by the names that it uses
# worst first, with signs for readers who see no colour
VERDICTS = {"disagree": "✗", "not comparable": "?", "too coarse": "≈", "agree": "✓"}


def worst_verdict(rows: Iterable[Row]) -> str | None:
    """The worst verdict of rows that have one; None: none has."""
    verdicts = {row.get("verdict") for row in rows}
    return next((verdict for verdict in VERDICTS if verdict in verdicts), None)


@dataclass(frozen=True, slots=True)
class Section:
    """One part of a report; ValueError for an unknown verdict."""

    id: str  # anchor, unique in a report; begins with the study's name
    title: str
    html: str
    verdict: str | None = None  # one of VERDICTS
    summary: str = ""  # the finding, plain text
    scripts: tuple[str, ...] = ()  # files of assets/
    command: str = ""  # that drew it

    def __post_init__(self) -> None:
        if self.verdict and self.verdict not in VERDICTS:
            raise ValueError(f"verdict = {self.verdict!r}: must be one of {', '.join(VERDICTS)}")


def write_page(title: str, sections: Sequence[Section], out_file: Path) -> None:
    """Write the report atomically; the contents list the worst verdicts first.

    Of several commands only the first one's sections are unfolded there.
    """
    judged = [s for verdict in VERDICTS for s in sections if s.verdict == verdict]
    others = [s for s in sections if not s.verdict]
    scripts = dict.fromkeys(name for s in sections for name in s.scripts)

    content: Content = {"title": title, "sections": sections, "judged": judged}
    contents: dict[str, list[Section]] = {}  # by command, in the order of their first ones
    for section in sections if len(judged) < 2 else others:
        contents.setdefault(section.command, []).append(section)
    content["contents"] = contents
    content["css"] = Markup(read_asset("page.css"))
    content["scripts"] = [Markup(read_asset(name)) for name in ("page.js", *scripts)]
    write_text(out_file, render_template("page.html", **content))


def render_sections(package: str, file: str = "page.html", /, **content: Any) -> list[Section]:
    """The sections of a package's template, filled with `content`.

    A section's summary is text, or a macro's answer.
    """
    sections: list[Section] = []

    def section(
        id: str, title: str, verdict: str | None = None, summary: str = "", *, scripts: Sequence[str] = (),
        caller: Callable[[], Markup],
    ) -> str:  # fmt: skip
        """Collect a section; the template shows nothing in its stead."""
        text = text_without_tags(summary) if isinstance(summary, Markup) else summary
        sections.append(Section(id, title, caller(), verdict, text, tuple(scripts)))
        return ""

    _ENVIRONMENT.get_template(f"{package}/{file}").render(section=section, **content)
    return sections


def text_without_tags(markup: str) -> str:
    """The text of HTML; narrow spaces stay."""
    text = html.unescape(re.sub(r"<[^>]*>", "", str(markup)))
    return re.sub(r"[ \n]+", " ", text).strip()


def html_table(
    rows: Iterable[Row], columns: Sequence[str], *, caption: str = "", worst_first: bool = False,
    stack: bool = False,
) -> Markup:  # fmt: skip
    """A table of rows by `columns`: keys, with units in brackets.

    Cells: numbers to three digits, None as a dash, a verdict under the key "verdict" as a badge.
    worst_first : by verdict.  stack : on a phone every row becomes a block.
    """
    rows = list(rows)
    if worst_first:
        rank = {verdict: i for i, verdict in enumerate(VERDICTS)}
        rows.sort(key=lambda row: rank.get(row.get("verdict") or "", len(rank)))
    numeric = [key for key in columns if rows and all(isinstance(row.get(key), Real | None) for row in rows)]
    return _PARTS.table(rows, columns, numeric, caption, stack)


def html_table_by_heading(rows: Iterable[Row], columns: Mapping[str, Any], **options: Any) -> Markup:
    """A table by heading: an expression of a row's entries, or a macro of the row; `options` as in `html_table`."""

    def cells(row: Row) -> Row:
        out = {}
        for head, content in columns.items():
            out[head] = content(row) if callable(content) else compile_template_expression(content)(**row)
        return out

    return html_table(map(cells, rows), list(columns), **options)


@cache
def compile_template_expression(text: str) -> Callable[..., Any]:
    """An expression of templates as a function of the names in it."""
    return _ENVIRONMENT.compile_expression(text, undefined_to_none=False)


def _cell_content(value: Any) -> Any:
    if isinstance(value, bool):
        return "yes" if value else "no"
    if value is None or isinstance(value, Real):
        return number_text(value)  # type: ignore[arg-type]
    return value


def number_text(x: float | None, digits: int = 3) -> str:
    """A number to so many digits, like 2.1 × 10⁻⁵ if far from one; None: a dash."""
    if x is None or not math.isfinite(x):
        return "–"
    if isinstance(x, Integral):
        return f"{x:,}".replace(",", "\u202f").replace("-", "−")
    if x == 0.0:
        return "0"
    rounded = f"{x:.{digits - 1}e}"
    mantissa, exponent = rounded.split("e")
    power = int(exponent)
    if -4 < power < 5:
        decimals = max(0, digits - 1 - power)
        return f"{float(rounded):.{decimals}f}".replace("-", "−")
    return f"{mantissa}\u202f×\u202f10{superscript_text(power)}".replace("-", "−")


def superscript_text(n: int) -> str:
    return str(n).translate(_RAISED)


_RAISED = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


def percent_text(fraction: float | None, digits: int = 2) -> str:
    """A fraction in percent; None: a dash."""
    if fraction is None or not math.isfinite(fraction):
        return number_text(fraction)
    return f"{number_text(100.0 * fraction, digits)}\u202f%"


def typeset_error_bar_and_minus(text: str) -> str:
    """A number with bar and unit, with a minus sign and without line breaks."""
    return text.replace(" ± ", "\u202f±\u202f").replace("-", "−")


def force_text(x: float) -> str:
    """A force to four digits, in N, kN, MN or GN."""
    factor, unit = factor_and_prefixed_unit(np.array([x]), "N")
    return f"{number_text(factor * x, 4)}\u202f{unit}"


def html_table_of_pairs(pairs: Mapping[str, Any], *headings: str) -> Markup:
    return html_table([dict(zip(headings, pair, strict=True)) for pair in pairs.items()], headings)


def seconds_text(x: float | None) -> str:
    """Seconds in s or ms; None: a dash."""
    if x is None or not math.isfinite(x):
        return "–"
    if x < 1.0:
        return f"{number_text(1e3 * x, 2)} ms"
    return f"{number_text(x, 2)} s"


@cache
def package_versions() -> dict[str, str]:
    """Versions of Python and of the packages that results depend on."""
    packages = ("cablefem", "numpy", "scipy", "scikit-fem", "numba")
    return {"Python": platform.python_version()} | {name: metadata.version(name) for name in packages}


def versions_footer() -> Markup:
    """With what a page is drawn, and when: its last line."""
    when = f"{date.today().isoformat()} with {settings_text(package_versions())}"
    return Markup("<p><small>Page drawn on {}.</small></p>").format(when)


def settings_text(settings: Mapping[str, Any]) -> str:
    return ", ".join(f"{name} {value}" for name, value in settings.items())


def render_template(name: str, **content: Any) -> Markup:
    return Markup(_ENVIRONMENT.get_template(name).render(**content))


def read_asset(name: str) -> str:
    return (resources.files(__package__) / "assets" / name).read_text(encoding="utf-8")


def _template_text(name: str) -> str:
    """The text of a template: PACKAGE/FILE, or a file of assets/."""
    package, _, file = name.partition("/")
    return (resources.files(package) / file).read_text(encoding="utf-8") if file else read_asset(name)


def _template_cache() -> jinja2.BytecodeCache | None:
    """Compiled templates beside this compiled module; None where it has no folder that can be written."""
    folder = Path(__spec__.cached).parent if __spec__.cached else None
    return jinja2.FileSystemBytecodeCache(str(folder)) if folder and os.access(folder, os.W_OK) else None


_ENVIRONMENT = jinja2.Environment(
    loader=jinja2.FunctionLoader(_template_text),
    bytecode_cache=_template_cache(),
    autoescape=True,
    undefined=jinja2.StrictUndefined,
    trim_blocks=True,
    lstrip_blocks=True,
)
_ENVIRONMENT.filters |= {
    "cell": _cell_content,
    "number": number_text,
    "percent": percent_text,
    "seconds": seconds_text,
    "settings": settings_text,
    "force": force_text,
    "design_row_texts": design_row_texts,
    "verification_row_texts": verification_row_texts,
    "typeset": typeset_error_bar_and_minus,
    "text_with_error_bar": text_with_error_bar,
}
_ENVIRONMENT.globals["verdicts"] = VERDICTS
_PARTS: Any = _ENVIRONMENT.get_template("parts.html").module
badge = _PARTS.badge
callout = _PARTS.callout
details = _PARTS.details
limits_of = _PARTS.limits
gallery = _PARTS.gallery
figure_of = _PARTS.figure
_ENVIRONMENT.globals |= {
    "table": html_table,
    "listed": html_table_by_heading,
    "badge": badge,
    "callout": callout,
    "details": details,
    "gallery": gallery,
    "columns": _PARTS.columns,
    "pairs": html_table_of_pairs,
    "under_wheels": _PARTS.under_wheels,
}
