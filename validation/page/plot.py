"""Curves and fields over one common axis as SVG from a template, 100 times as fast as matplotlib."""

import base64
import io
import math
from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from markupsafe import Markup
from PIL import Image

from cablefem.response import Array
from cablefem.scene import Obstacle
from validation.page.page import Content, figure_of, render_template, superscript_text, text_without_tags

# user units, pixels on a desktop
WIDTH = 480
LEFT = 70
RIGHT = 20
BELOW = 42
# Okabe and Ito (2008) without yellow
BLUE = "#0072b2"
VERMILLION = "#d55e00"
GREEN = "#009e73"
PURPLE = "#cc79a7"
ORANGE = "#e69f00"
SKY = "#56b4e9"
BLACK = "#1a1a1a"
GREY = "#767676"
COLORS = (BLUE, VERMILLION, GREEN, PURPLE, ORANGE, SKY)  # in the order of curves
DASHED = "8 4"
DOTTED = "2 3"
# matplotlib's viridis, to 2 percent
FIELD = (
    "440154 48186a 472d7b 424086 3b528b 33638d 2c728e 26828e 21918c 1fa088 28ae80 3fbc73 5ec962 84d44b addc30 d8e219 "
    "fde725"
)


SeriesByName = dict[str, Array]  # values (n,), or of the rope (frames, stations)


@dataclass(frozen=True, slots=True)
class Curve:
    x: Array
    y: Array
    color: str
    dash: str = ""
    width: float = 2.0
    name: str = ""  # in the key; without it the curve has none


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
    curves: list[Curve] = field(default_factory=list)
    bands: list[tuple[Array, Array, Array, str]] = field(default_factory=list)  # x, low, high, colour
    dots: list[tuple[float, float, str, bool]] = field(default_factory=list)  # x, y, colour, filled
    labels: list[tuple[float, float, str]] = field(default_factory=list)  # x, y, text
    verticals: list[tuple[float, str, str]] = field(default_factory=list)  # x, colour, dash
    image: Array | None = None  # (rows from above, columns), 0 to 1 in the colours FIELD
    scale: tuple[float, float, str] | None = None  # of the image: values at 0 and 1, unit

    def add_curve(self, x: Array, y: Array, color: str, dash: str = "", width: float = 2.0, name: str = "") -> None:
        """Add a `Curve`."""
        self.curves.append(Curve(x, y, color, dash, width, name))

    def fit_y_axis(self, values: Sequence[Array], pad: float = 0.12) -> None:
        """Fit the axis to all finite values, with a margin of `pad` times their range."""
        flat = np.concatenate([np.ravel(v) for v in values] or [np.zeros(1)])
        finite = flat[np.isfinite(flat)]
        if not finite.size:
            return
        low = float(finite.min())
        high = float(finite.max())
        margin = pad * (high - low)
        if high - low <= 1e-9 * max(abs(low), abs(high)):  # equal but for rounding
            margin = 0.1 * abs(high) or 1.0
        self.low = low - margin
        self.high = high + margin

    def show_four_log_decades(self, largest: float) -> None:
        """Scale y by logarithms and show four decades below the largest value; none if all values are zero."""
        if largest > 0.0:
            self.log = True
            self.low = 1e-4 * largest
            self.high = 4.0 * largest

    def _height_on_paper(self, y: Array | float) -> Array:
        """Heights on the paper, downwards."""
        values = np.append([self.low, self.high], y)
        if self.log:
            with np.errstate(divide="ignore", invalid="ignore"):
                values = np.log10(values)
        low, high, *_ = values
        fraction = (values[2:] - low) / (high - low)
        below_top = fraction if self.down else 1.0 - fraction
        return self.height * np.clip(below_top, -9.0, 9.0).reshape(np.shape(y))

    def _colour_scale_input(self) -> Content | None:
        if self.scale is None:
            return None
        low, high, unit = self.scale
        per_unit = self.height / (high - low)
        ticks = [(_round_to_tenth(per_unit * (high - y)), words) for y, words in _round_ticks(low, high, 4)]
        colours = np.linspace(1.0, 0.0, 64)[:, None]
        return {"image": _coloured_png_base64(colours), "unit": unit, "ticks": ticks}

    def template_input(self, x_to_user_units: Callable[[Any], Array], width: float) -> Content:
        """The template's input in user units; x_to_user_units : from x to user units; width : of the panel."""
        height = self._height_on_paper

        def point(x: float, y: float) -> tuple[float, float]:
            return _round_to_tenth(x_to_user_units(x)), _round_to_tenth(height(y))

        drawn: Content = {"h": self.height, "w": width, "title": self.title, "unit": self.unit}
        ticks = _log_ticks(self.low, self.high) if self.log else _round_ticks(self.low, self.high, self.height / 28)
        drawn["ticks"] = [(_round_to_tenth(height(y)), words) for y, words in ticks]
        drawn["scale"] = self._colour_scale_input()
        drawn["verticals"] = [(_round_to_tenth(x_to_user_units(x)), color, dash) for x, color, dash in self.verticals]
        drawn["curves"] = [(_svg_path_data(x_to_user_units(curve.x), height(curve.y)), curve) for curve in self.curves]
        drawn["bands"] = []
        for x, low, high, color in self.bands:
            around_x = np.append(x, x[::-1])
            around_y = np.append(high, low[::-1])
            drawn["bands"].append((_svg_path_data(x_to_user_units(around_x), height(around_y)), color))
        drawn["dots"] = [(*point(x, y), *look) for x, y, *look in self.dots]
        drawn["labels"] = []
        for at, y, text in self.labels:
            right, down = point(at, y)
            near_end = "end" if right > 0.85 * width else "middle"
            anchor = "start" if right < 0.15 * width else near_end  # names of supports stay inside
            drawn["labels"].append((right, down, anchor, text))
        drawn["image"] = None if self.image is None else _coloured_png_base64(self.image)
        return drawn


def side_view_panel(
    depths: Sequence[Array], width: float, grounds: Sequence[Array], obstacles: Collection[Obstacle], pad: float
) -> tuple[Panel, str]:
    """A panel of a side view with grounds and obstacles, and its caption: to scale, or enlarged by an integer.

    depths : [m] to show;  width : of the view [m];  grounds : (n, 2) of x and depth;  pad : margin, of the range.
    """
    panel = Panel("depth [m]", down=True)
    tops = np.array([obstacle.top for obstacle in obstacles])
    panel.fit_y_axis([*depths, *(ground[:, 1] for ground in grounds), tops], pad)
    height = (panel.high - panel.low) * (WIDTH - LEFT - RIGHT) / width
    times = max(1, round(80.0 / height))
    panel.height = times * height
    scale = "To scale." if times == 1 else f"Depths are drawn {times} times too large."
    for x, depth in (ground.T for ground in grounds):
        panel.add_curve(x, depth, "#8a7a55", name="ground")
    for obstacle in obstacles:
        from_top_down = np.array([obstacle.top, panel.high])
        panel.add_curve(np.full(2, obstacle.at), from_top_down, "#6b8e5a", "", 5.0, obstacle.name)
    return panel, f"The line from the side. {scale}"


def svg_figure(
    panels: Sequence[Panel], x_range: tuple[float, float], xlabel: str, caption: str, *, wide: bool = False
) -> Markup:  # fmt: skip
    """An HTML figure of panels below one another over a common x, with a caption and a key."""
    right = 74 if any(p.scale for p in panels) else RIGHT
    width = WIDTH - LEFT - right
    begin, end = x_range
    per_unit = width / ((end - begin) or 1.0)

    def x_to_user_units(values: Any) -> Array:
        return per_unit * (np.asarray(values, dtype=float) - begin)

    shown = []
    top = 6.0
    for panel in panels:
        top += 20.0 if panel.title or panel.scale else 0.0
        shown.append(panel.template_input(x_to_user_units, width) | {"top": top, "last": panel is panels[-1]})
        top += panel.height + 14.0
    content: Content = {"panels": shown, "xlabel": xlabel, "label": text_without_tags(caption)}
    content |= {"width": WIDTH, "height": top - 14.0 + BELOW, "left": LEFT, "right": right}
    content["key"] = {curve.name: curve for panel in panels for curve in panel.curves if curve.name}
    content["xticks"] = [
        (_round_to_tenth(x_to_user_units(value)), words) for value, words in _round_ticks(begin, end, 7)
    ]
    return figure_of(render_template("plot.svg", **content), caption, wide=wide)


def _log_ticks(low: float, high: float) -> list[tuple[float, str]]:
    """Powers of ten and their text."""
    first = math.ceil(math.log10(low))
    last = math.floor(math.log10(high))
    ticks = []
    for n in range(first, last + 1):
        value = 10.0**n
        ticks.append((value, f"{value:g}" if -3 < n < 4 else f"10{superscript_text(n)}"))
    return ticks


def _round_ticks(low: float, high: float, max_count: float) -> list[tuple[float, str]]:
    """Round values and their text."""
    rough = (high - low) / max(max_count, 2.0)
    if not (rough > 0.0 and math.isfinite(rough)):
        return []
    tens = 10.0 ** math.floor(math.log10(rough))
    factor = next(k for k in (1.0, 2.0, 5.0, 10.0) if k * tens >= rough * (1.0 - 1e-9))
    step = factor * tens
    if math.floor(high / step) - math.ceil(low / step) < 2:  # fewer than three values: the next smaller step
        step /= 2.5 if factor == 5.0 else 2.0
    first = math.ceil(low / step - 1e-9)
    last = math.floor(high / step + 1e-9)
    digits = max(0, -math.floor(math.log10(step) + 1e-9))
    ticks = []
    for n in range(first, last + 1):
        value = n * step
        ticks.append((value, f"{value:.{digits}f}".replace("-", "−")))
    return ticks


def _round_to_tenth(x: Any) -> float:
    return round(float(x), 1)


def _svg_path_data(x: Array, y: Array) -> str:
    """The `d` of an SVG path through the finite points; crowded columns of pixels keep their extremes."""
    good = np.isfinite(x) & np.isfinite(y)
    x = x[good]
    y = y[good]
    if x.size > 3 * WIDTH and np.all(np.diff(x) >= 0.0):
        first = np.flatnonzero(np.diff(np.floor(2.0 * x), prepend=-1.0))  # of each half pixel
        last = np.append(first[1:] - 1, y.size - 1)
        low = np.minimum.reduceat(y, first)
        high = np.maximum.reduceat(y, first)
        falls = y[last] < y[first]
        pairs = np.stack([low, high], axis=1)  # (half pixels, 2), in the order of the curve
        pairs[falls] = pairs[falls, ::-1]
        y = pairs.ravel()
        x = np.repeat(x[first], 2)
    points = [f"{a:.1f},{b:.1f}" for a, b in zip(x.tolist(), y.tolist(), strict=True)]
    return "M" + " ".join(points) if points else ""


def colour_map_bytes(n: int) -> Array:
    """(n, 3) colours, bytes, along FIELD."""
    nodes = np.array([list(bytes.fromhex(name)) for name in FIELD.split()], dtype=float)  # (nodes, 3)
    numbers = np.arange(len(nodes))
    at = np.linspace(0.0, len(nodes) - 1.0, n)
    channels = [np.interp(at, numbers, channel) for channel in nodes.T]
    return np.stack(channels, axis=1).round().astype(np.uint8)


def _coloured_png_base64(values: Array) -> str:
    """Values (rows, columns) from 0 to 1 as a PNG of the 256 colours of FIELD, in base64."""
    levels = np.clip(np.nan_to_num(values) * 255.0, 0.0, 255.0)
    image = Image.fromarray(levels.round().astype(np.uint8))
    image.putpalette(colour_map_bytes(256).tobytes())
    out = io.BytesIO()
    image.save(out, "PNG")
    return base64.b64encode(out.getvalue()).decode("ascii")
