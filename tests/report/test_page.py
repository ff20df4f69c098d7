"""The page: escaped, self-contained, ids that do not clash, worst first, and refused rather than wrong."""

import re
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest
from markupsafe import Markup

from tests.report.figures import drawn_panels
from validation.page import page
from validation.page.figures import captioned_figure, figure_with_axes, inline_svg, report_style
from validation.page.page import Section, html_table, number_text, percent_text, write_page
from validation.page.plot import BLUE, Panel, svg_figure

EVIL = '<script>alert(7)</script> & "co"'


class Reader(HTMLParser):
    """What a browser would load, and what points where."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.ids: list[str] = []
        self.targets: list[str] = []
        self.loads: list[str] = []
        self.scripts = 0
        self.words: list[str] = []
        self.feed(text)
        self.loads += re.findall(r"url\((?!#)([^)]*)\)|@import\s+(\S+)", text)
        self.targets += re.findall(r"url\(#([^)]+)\)", text)

    def handle_starttag(self, tag, attrs):
        self.scripts += tag == "script"
        for name, value in attrs:
            if name == "id":
                self.ids.append(value)
            elif name in ("href", "xlink:href") and value.startswith("#"):
                self.targets.append(value[1:])
            elif name in ("src", "href", "xlink:href", "data", "action") and not value.startswith("data:"):
                self.loads.append(value)

    def handle_data(self, data):
        self.words.append(data)


def line_figure(label: str = "a line", marker: str = "o"):
    with report_style():
        fig, ax = figure_with_axes(height=2.3)
        ax.plot([0.0, 1.5, 2.5], [3.5, 7.0, 2.0], marker=marker, clip_on=True, label=label)
        ax.legend()
    return fig


def page_text(tmp_path: Path, *sections: Section, title: str = "A report") -> str:
    write_page(title, sections, tmp_path / "report.html")
    return (tmp_path / "report.html").read_text(encoding="utf-8")


def test_text_is_escaped_everywhere(tmp_path):
    html = (
        html_table([{EVIL: EVIL}], [EVIL], caption=EVIL)
        + page.callout(EVIL)
        + page.details(EVIL, page.callout(EVIL))
        + captioned_figure(line_figure(EVIL), EVIL, label=EVIL)
    )
    text = page_text(tmp_path, Section("one", EVIL, html, "agree", EVIL), Section("two", "Two", "", None), title=EVIL)
    read = Reader(text)
    assert read.scripts == 1  # the page's own
    assert "alert(7)" in "".join(read.words)
    assert "<script>alert" not in text


def test_ids_of_two_figures_do_not_clash_and_every_reference_has_a_target(tmp_path):
    html = page.gallery(
        captioned_figure(line_figure("first"), "First"), captioned_figure(line_figure("second"), "Second")
    )
    read = Reader(page_text(tmp_path, Section("one", "One", html), Section("two", "Two", "")))
    assert len(read.ids) > 30
    assert len(set(read.ids)) == len(read.ids)
    assert set(read.targets) <= set(read.ids)
    assert {"one", "two", "main"} <= set(read.targets)


def test_ids_as_matplotlib_writes_them_would_clash(tmp_path):
    bare = re.sub(
        r'"f[0-9a-f]{8}-', '"', inline_svg(line_figure("first"), "First") + inline_svg(line_figure("second"), "Second")
    )
    read = Reader(page_text(tmp_path, Section("one", "One", bare)))
    assert len(set(read.ids)) < len(read.ids)


def test_nothing_is_loaded_from_elsewhere(tmp_path):
    text = page_text(
        tmp_path, Section("one", "One", captioned_figure(line_figure(), "First"), scripts=("side_view.js",))
    )
    assert Reader(text).loads == []
    assert "http" not in text.replace("http-equiv", "")
    assert "default-src 'none'" in text


def test_a_load_from_elsewhere_would_be_found(tmp_path):
    html = '<img src="https://example.org/x.png"><style>@import "x.css"; a { background: url(y.png) }</style>'
    assert len(Reader(page_text(tmp_path, Section("one", "One", html))).loads) == 3


def test_disagreements_come_first(tmp_path):
    verdicts = ["agree", "not comparable", None, "disagree"]
    sections = [Section(f"s{i}", f"Part {i}", "", verdict, f"found {i}") for i, verdict in enumerate(verdicts)]
    text = page_text(tmp_path, *sections)
    contents = text[text.index("<nav") : text.index("</nav>")]
    assert re.findall(r'href="#(s\d)"', contents) == ["s3", "s1", "s0", "s2"]
    rows = html_table([{"verdict": v, "n": i} for i, v in enumerate(verdicts)], ["n", "verdict"], worst_first=True)
    assert re.findall(r"<div>(\d)</div>", rows) == ["3", "1", "0", "2"]
    assert rows.count("badge") == 3


def test_a_verdict_has_a_word_and_a_sign_besides_its_colour():
    words = ["✗ disagree", "? not comparable", "≈ too coarse", "✓ agree"]
    assert [Markup(page.badge(v)).striptags() for v in page.VERDICTS] == words


def test_an_unknown_verdict_is_refused_and_an_older_report_kept(tmp_path):
    before = page_text(tmp_path, Section("one", "One", "", "agree"))
    with pytest.raises(ValueError, match="perhaps"):
        page_text(tmp_path, Section("one", "One", "", "perhaps"))
    assert (tmp_path / "report.html").read_text(encoding="utf-8") == before
    assert [p.name for p in tmp_path.iterdir()] == ["report.html"]


@pytest.mark.parametrize(
    ("x", "digits", "text"),
    [
        (37.78661, 3, "37.8"), (2002.372, 3, "2000"), (0.0025329, 3, "0.00253"),
        (0.00025329, 3, "2.53\u202f×\u202f10⁻⁴"),
        (2.1195e-5, 2, "2.1\u202f×\u202f10⁻⁵"), (1.5e6, 3, "1.50\u202f×\u202f10⁶"),
        (-0.73, 2, "−0.73"), (-3e-7, 1, "−3\u202f×\u202f10⁻⁷"),
        (12345, 3, "12\u202f345"), (0.0, 3, "0"),
        (9.996, 3, "10.0"), (np.float64(2.5), 3, "2.50"), (np.int64(1101), 3, "1\u202f101"), (None, 3, "–"),
        (float("nan"), 3, "–"), (float("inf"), 3, "–"),
    ],
)  # fmt: skip
def test_numbers_are_short_and_never_nan(x, digits, text):
    assert number_text(x, digits) == text


def test_a_ratio_in_percent_has_its_unit():
    assert percent_text(0.000253) == "0.025\u202f%"
    assert percent_text(None) == "–"


def test_cells_of_a_table():
    rows = [{"a": 1.5, "b": 7, "c": True, "d": Markup("<b>x</b>")}, {"a": None, "b": 3}]
    html = html_table(rows, ["a", "b", "c", "d"])
    cells = re.findall(r'<td([^>]*) data-label="(\w)"><div>(.*?)</div></td>', html)
    assert [value for _, _, value in cells] == ["1.50", "7", "yes", "<b>x</b>", "–", "3", "–", "–"]
    assert ["n" in kind.split('"')[1].split() for kind, name, _ in cells[:2]] == [True, True]
    assert html_table([], ["a"]).count("<td") == 0
    # on a phone an empty cell takes no line
    assert html_table([{"a": "x", "b": ""}], ["a", "b"]).count('class="none"') == 1


def test_the_width_of_a_column_is_by_what_is_read_not_by_its_tags():
    """Columns of badges took a fifth of a page each, and the reasons beside them ran out of it."""
    badge = Markup('<span class="badge good"><span aria-hidden="true">✓</span> holds, as computed</span>')
    html = html_table([{"held": badge, "why": "of a sentence " * 6}], ["held", "why"])
    assert 'class="long" data-label="why"' in html
    assert html.count("long") == 1


def test_figures_are_the_same_every_time_small_and_keep_their_text():
    first, again = (inline_svg(line_figure(), "A line") for _ in range(2))
    assert first == again
    assert "<text" in first
    assert 'aria-label="A line"' in first
    x = np.linspace(0.0, 1.0, 30_000)
    with report_style():
        fig, ax = figure_with_axes()
        ax.plot(x, np.sin(9.0 * x))
        long = inline_svg(fig, "A long line")
        fig, ax = figure_with_axes()
        ax.pcolormesh(x[::100], x[::150], np.outer(x[::150], x[::100]), rasterized=True)
        field = inline_svg(fig, "A field")
    assert len(long) < 40_000
    assert len(field) < 80_000
    assert "data:image/png;base64," in field


@pytest.mark.parametrize(("spread", "told"), [(1e-12, False), (0.3, True)], ids=["rounding", "a change"])
def test_an_axis_shows_changes_and_no_rounding_errors(spread, told):
    panel = Panel("[-]")
    panel.fit_y_axis([3.69 * np.array([1.0, 1.0 + spread, 1.0])])
    assert panel.low < 3.69 <= 3.69 * (1.0 + spread) < panel.high
    assert (panel.high - panel.low < 2.0 * 3.69 * spread) is told


def test_a_depth_points_down_and_a_crowded_curve_keeps_its_extremes():
    x = np.linspace(0.0, 50.0, 20_001)
    y = 30.0 + 4.0 * np.sin(x)
    y[[7_000, 13_000]] = 37.0, 23.0
    panel = Panel("[m]", "depth", down=True)
    panel.fit_y_axis([y])
    panel.add_curve(x, y, BLUE)
    (drawn,) = drawn_panels(str(svg_figure([panel], (0.0, 60.0), "time [s]", "A depth.")))
    at, depth = drawn.curves[""]
    close = 1.1 * drawn.pixel[1]
    assert abs(depth.max() - 37.0) < close
    assert abs(depth.min() - 23.0) < close
    smooth = np.abs(depth - 30.0) < 4.5
    assert np.max(np.abs(depth - 30.0 - 4.0 * np.sin(at))[smooth]) < 4.0 * drawn.pixel[0] + close
    assert panel._height_on_paper(34.0) > panel._height_on_paper(26.0)
