"""Lines and fields over one common axis as SVG from a template, 100 times as fast as matplotlib."""

import base64
import io
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from markupsafe import Markup
from PIL import Image

from cablefem.response import Array
from validation.page.page import figure_of, plain, raised, rendered

# user units, pixels on a desktop
WIDTH = 480
LEFT = 70
RIGHT = 20
BELOW = 42
# Okabe and Ito (2008) without yellow
BLUE, VERMILLION, GREEN, PURPLE, ORANGE, SKY = "#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9"
BLACK, GREY = "#1a1a1a", "#767676"
COLORS = (BLUE, VERMILLION, GREEN, PURPLE, ORANGE, SKY)  # in the order of lines
DASHED = "8 4"
DOTTED = "2 3"
# matplotlib's viridis, to 2 percent
FIELD = (
    "440154 48186a 472d7b 424086 3b528b 33638d 2c728e 26828e 21918c 1fa088 28ae80 3fbc73 5ec962 84d44b addc30 d8e219 "
    "fde725"
)


@dataclass(slots=True)
class Panel:
    """One pair of axes and its contents; `low`, `high` bound y."""

    unit: str
    title: str = ""
    height: float = 140.0
    low: float = 0.0
    high: float = 1.0
    down: bool = False  # y points down
    log: bool = False
    lines: list[tuple[Array, Array, str, str, float, str]] = field(default_factory=list)  # x, y, look, key
    bands: list[tuple[Array, Array, Array, str]] = field(default_factory=list)  # x, low, high, colour
    dots: list[tuple[float, float, str, bool]] = field(default_factory=list)  # x, y, colour, filled
    labels: list[tuple[float, float, str]] = field(default_factory=list)  # x, y, text
    verticals: list[tuple[float, str, str]] = field(default_factory=list)  # x, colour, dash
    image: Array | None = None  # (rows from above, columns), 0 to 1 in the colours FIELD
    scale: tuple[float, float, str] | None = None  # of the image: values at 0 and 1, unit

    def line(self, x: Array, y: Array, color: str, dash: str = "", width: float = 2.0, name: str = "") -> None:
        self.lines.append((x, y, color, dash, width, name))

    def fit(self, values: Sequence[Array], pad: float = 0.12) -> None:
        """Fit the axis to all finite values; a spread of rounding errors is none."""
        finite = np.concatenate([np.ravel(v)[np.isfinite(np.ravel(v))] for v in values] or [np.zeros(1)])
        if finite.size:
            low = float(finite.min())
            high = float(finite.max())
            varies = high - low > 1e-9 * max(abs(low), abs(high))
            room = pad * (high - low) if varies else 0.1 * abs(high) or 1.0
            self.low = low - room
            self.high = high + room

    def decades(self, most: float) -> None:
        """Show four decades below the largest value; none if all values are equal."""
        if most > 0.0:
            self.log = True
            self.low = 1e-4 * most
            self.high = 4.0 * most

    def _y(self, y: Array | float) -> Array:
        """Places on the paper, downwards."""
        low, high = (math.log10(v) if self.log else v for v in (self.low, self.high))
        with np.errstate(divide="ignore", invalid="ignore"):
            part = ((np.log10(y) if self.log else np.asarray(y)) - low) / (high - low)
        return self.height * np.clip(part if self.down else 1.0 - part, -9.0, 9.0)

    def _scale(self) -> dict[str, Any] | None:
        if self.scale is None:
            return None
        low, high, unit = self.scale
        ticks = [(_place(self.height * (high - y) / (high - low)), words) for y, words in _ticks(low, high, False, 4)]
        return {"image": _png(np.linspace(1.0, 0.0, 64)[:, None]), "unit": unit, "ticks": ticks}

    def drawn(self, across: Callable[[Any], Array], w: float) -> dict[str, Any]:
        """The template's input in user units; across : place of x on the paper, w : width of the panel."""

        def at(x: float, y: float) -> tuple[float, float]:
            return _place(across(x)), _place(self._y(y))

        ticks = [(_place(self._y(y)), words) for y, words in _ticks(self.low, self.high, self.log, self.height / 28)]
        return {
            "h": self.height, "w": w, "title": self.title, "unit": self.unit, "ticks": ticks, "scale": self._scale(),
            "verticals": [(_place(across(x)), color, dash) for x, color, dash in self.verticals],
            "lines": [(_path(across(x), self._y(y)), color, dash, width) for x, y, color, dash, width, _ in self.lines],
            "bands": [
                (_path(np.r_[across(x), across(x)[::-1]], np.r_[self._y(high), self._y(low)[::-1]]), color)
                for x, low, high, color in self.bands
            ],
            "dots": [(*at(x, y), *how) for x, y, *how in self.dots],
            "labels": [(*at(x, y), words) for x, y, words in self.labels],
            "image": None if self.image is None else _png(self.image),
        }  # fmt: skip


def side(p: Panel, reach: float, ground: Any, obstacles: Sequence[tuple[str, float, float]]) -> str:
    """Draw ground and obstacles (name, x, depth of the top) in a side view over `reach` metres; return its caption.

    Depths are to scale, or enlarged by a whole number.
    """
    height = (p.high - p.low) * (WIDTH - LEFT - RIGHT) / reach
    times = max(1, round(80.0 / height))
    p.height = times * height
    if len(ground):
        x, depth = np.array(ground).T
        p.line(x, depth, "#8a7a55", "", 2.0, "ground")
    for name, at, top in obstacles:
        p.line(np.array([at, at]), np.array([top, p.high]), "#6b8e5a", "", 5.0, name)
    scale = "To scale." if times == 1 else f"Depths are drawn {times} times too large."
    return f"The line from the side. {scale}"


def plot(
    panels: Sequence[Panel], x: tuple[float, float], xlabel: str, caption: str, *, wide: bool = False
) -> Markup:  # fmt: skip
    """Panels below one another, with a caption and a key, over x between two values."""
    right = 74 if any(p.scale for p in panels) else RIGHT
    w = WIDTH - LEFT - right

    def across(values: Any) -> Array:
        return w * (np.asarray(values, dtype=float) - x[0]) / ((x[1] - x[0]) or 1.0)

    shown = []
    top = 6.0
    for p in panels:
        top += 20.0 if p.title or p.scale else 0.0
        shown.append(p.drawn(across, w) | {"top": top, "last": p is panels[-1]})
        top += p.height + 14.0
    key = {name: (*look, name) for p in panels for _, _, *look, name in p.lines if name}
    svg = rendered(
        "plot.svg", panels=shown, width=WIDTH, height=top - 14.0 + BELOW, left=LEFT, right=right, xlabel=xlabel,
        label=plain(caption), key=list(key.values()),
        xticks=[(_place(across(t)), words) for t, words in _ticks(*x, False, 7)],
    )  # fmt: skip
    return figure_of(svg, caption, wide=wide)


def _ticks(low: float, high: float, log: bool, most: float) -> list[tuple[float, str]]:
    """Round values and their text, about so many at most."""
    if log:
        powers = range(math.ceil(math.log10(low)), math.floor(math.log10(high)) + 1)
        return [(10.0**n, f"{10.0**n:g}" if -3 < n < 4 else f"10{raised(n)}") for n in powers]
    rough = (high - low) / max(most, 2.0)
    if not (rough > 0.0 and math.isfinite(rough)):
        return []
    tens = 10.0 ** math.floor(math.log10(rough))
    step = tens * next(k for k in (1.0, 2.0, 5.0, 10.0) if k * tens >= rough * (1.0 - 1e-9))
    if math.floor(high / step) - math.ceil(low / step) < 2:  # fewer than three values: one step less
        step /= 2.5 if 4.9 < step / tens < 5.1 else 2.0
    first = math.ceil(low / step - 1e-9)
    last = math.floor(high / step + 1e-9)
    digits = max(0, -math.floor(math.log10(step) + 1e-9))
    return [(n * step, f"{n * step:.{digits}f}".replace("-", "−")) for n in range(first, last + 1)]


def _place(x: Any) -> float:
    return round(float(x), 1)


def _path(x: Array, y: Array) -> str:
    """A path through the finite points; crowded columns of pixels keep their extremes."""
    good = np.isfinite(x) & np.isfinite(y)
    x = x[good]
    y = y[good]
    if x.size > 3 * WIDTH and np.all(np.diff(x) >= 0.0):
        at = np.flatnonzero(np.diff(np.floor(2.0 * x), prepend=-1.0))
        low = np.minimum.reduceat(y, at)
        high = np.maximum.reduceat(y, at)
        rising = y[np.append(at[1:] - 1, y.size - 1)] >= y[at]
        y = np.stack([np.where(rising, low, high), np.where(rising, high, low)], axis=1).ravel()
        x = np.repeat(x[at], 2)
    return "M" + " ".join(f"{a:.1f},{b:.1f}" for a, b in zip(x.tolist(), y.tolist(), strict=True)) if x.size else ""


def colors(n: int) -> Array:
    """(n, 3) colours, bytes, along FIELD."""
    known = np.array([list(bytes.fromhex(name)) for name in FIELD.split()], dtype=float)
    at = np.linspace(0.0, len(known) - 1.0, n)
    return np.stack([np.interp(at, np.arange(len(known)), c) for c in known.T], axis=1).round().astype(np.uint8)


def _png(values: Array) -> str:
    """Values (rows, columns) from 0 to 1 as a PNG of the 256 colours of FIELD, in base64."""
    image = Image.fromarray(np.clip(np.nan_to_num(values) * 255.0, 0.0, 255.0).round().astype(np.uint8))
    image.putpalette(colors(256).tobytes())
    image.save(out := io.BytesIO(), "PNG")
    return base64.b64encode(out.getvalue()).decode("ascii")
