"""One style for all figures: inline SVG, colours for colour-blind readers, dashes for print."""

import hashlib
import io
import re
import tomllib
from importlib import resources
from typing import Any

import matplotlib as mpl
from cycler import cycler
from markupsafe import Markup, escape
from matplotlib.backends.backend_svg import FigureCanvasSVG
from matplotlib.figure import Figure

from validation.page.page import figure_of, read_asset, text_without_tags
from validation.page.plot import BLACK, COLORS, GREY

WIDTH = 4.8  # inches: fills a phone, and two fill a row of a desktop

PALETTE = (*COLORS, BLACK)
_LOOKS = tomllib.loads(read_asset("looks.toml"))
DASHES = ("-", *((0, tuple(dash)) for dash in _LOOKS["dashes"]))  # after a solid line
MARKERS = tuple(_LOOKS["markers"])

_FILE = resources.files(__package__) / "assets" / "report.mplstyle"
STYLE: Any = mpl.rc_params_from_file(str(_FILE), use_default_template=False)
STYLE["axes.edgecolor"] = GREY
STYLE["axes.prop_cycle"] = cycler(color=list(PALETTE)) + cycler(linestyle=list(DASHES))


def report_style() -> Any:
    """Matplotlib's style of the report, a context or decorator."""
    return mpl.rc_context(STYLE)


def figure_with_axes(rows: int = 1, columns: int = 1, *, height: float = 2.9, **options: Any) -> tuple[Figure, Any]:
    """A figure and its axes, as from `subplots`; `height` in inches."""
    with report_style():
        fig = Figure(figsize=(WIDTH, height), layout="constrained")
        return fig, fig.subplots(rows, columns, **options)


def captioned_figure(fig: Figure, caption: str, *, label: str = "") -> Markup:
    """A figure with its caption; `label` describes it for screen readers."""
    return figure_of(inline_svg(fig, text_without_tags(label or caption)), caption)


def inline_svg(fig: Figure, label: str) -> Markup:
    """A figure as inline SVG with ids of its own."""
    out = io.BytesIO()
    with report_style():
        FigureCanvasSVG(fig).print_svg(out, metadata=dict.fromkeys(("Date", "Creator", "Format", "Type")))
    text = out.getvalue().decode("utf-8")
    mark = "f" + hashlib.sha256((label + text).encode()).hexdigest()[:8]
    text = text[text.index("<svg") :]
    text = re.sub(r'(\bid="|href="#|url\(#)', rf"\1{mark}-", text)
    text = re.sub(r"<!--.*?-->\s*", "", text, flags=re.DOTALL)
    # to 0.01 pt
    text = re.sub(r'(?<= d=")[^"]+', lambda d: re.sub(r"(\.\d\d)\d+", r"\1", d[0]), text)
    text = re.sub(r'\s(?:xmlns(?::xlink)?|version)="[^"]*"', "", text)  # HTML needs none
    text = text.replace("xlink:href", "href")
    # at most the drawn size
    size = r'<svg width="[\d.]+pt" height="[\d.]+pt"'
    text = re.sub(size, f'<svg role="img" aria-label="{escape(label)}"', text, count=1)
    return Markup(re.sub(r"\n\s*", "\n", text).strip())
