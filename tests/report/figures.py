"""Reads the curves of the SVG figures of a page, by the words at their axes."""

import re
from typing import NamedTuple

import numpy as np

NUMBER = r"(-?[\d.]+)"
SCALE_TICK = rf'<text x="[\d.]+" y="{NUMBER}">([^<]*)'  # beside a colour scale
LOOK = 'stroke="([^"]*)" stroke-width="[^"]*" stroke-dasharray="([^"]*)"'


def values_along_axis(words_at):
    """The function from places on paper to values, by the words at an axis: (place, word) each."""
    places, words = zip(*words_at, strict=True)
    slope, value = np.polyfit(np.array(places, float), [float(word.replace("−", "-")) for word in words], 1)
    return lambda place: slope * place + value


class DrawnPanel(NamedTuple):
    over: str  # words at the common axis
    title: str
    unit: str
    curves: dict[str, tuple[np.ndarray, np.ndarray]]  # by name, in the units of the axes
    labels: list[tuple[float, float, str]]  # x, y, text
    pixel: tuple[float, float]  # values of x and y


def drawn_panels(html):
    """Panels with a linear axis of all figures."""
    panels = []
    for figure in html.split('<svg role="img"')[1:]:
        x_of = values_along_axis(re.findall(rf'<text class="x" x="{NUMBER}"[^>]*>([^<]*)', figure))
        over = re.findall(r'<text class="l" x="[^>]*>([^<]*)', figure)[-1]
        key = re.findall(rf"<li>.*?{LOOK}[^>]*/></svg>([^<]*)", figure)
        names = {tuple(look): name for *look, name in key}
        for part in figure.split("<g transform")[1:]:
            ticks = re.findall(rf'<text class="y" x="-5" y="{NUMBER}">([^<]*)', part)
            if not ticks or any("10" in word and not re.fullmatch(r"[−\d.]+", word) for _, word in ticks):
                continue
            y_of = values_along_axis([(float(y) - 4.0, word) for y, word in ticks])
            unit = re.search(r'<text class="l" transform[^>]*>\[?([^<\]]*)', part)[1]
            title = re.search(r'<text class="t" x="0" y="-7">([^<]*)', part)
            curves = {}
            for d, *look in re.findall(rf'<path class="c" d="M([^"]*)" {LOOK}', part):
                points = np.array([point.split(",") for point in d.split()], float)
                curves[names.get(tuple(look), "")] = x_of(points[:, 0]), y_of(points[:, 1])
            pixel = abs(x_of(1.0) - x_of(0.0)), abs(y_of(1.0) - y_of(0.0))
            words = re.findall(rf'<text class="v" x="{NUMBER}" y="{NUMBER}"[^>]*>([^<]*)', part)
            labels = [(x_of(float(x)), y_of(float(y) - 4.0), text) for x, y, text in words]
            panels.append(DrawnPanel(over, title[1] if title else "", unit, curves, labels, pixel))
    return panels
