"""A report as its reader meets it: no errors, nothing that overflows or overlaps, a player that plays."""

import re
import time
from pathlib import Path

import numpy as np
import pytest

from cablefem.response import Response
from validation.page import page
from validation.page.answer.many import grid_table
from validation.page.motion import motion_table_columns

pytestmark = pytest.mark.browser
PHONE, DESKTOP = 390, 1280

OVERFLOW = "return document.documentElement.scrollWidth - document.documentElement.clientWidth"

# words of one figure that lie on other words of it, and the smallest text
WORDS = """
const clashes = [];
let least = Infinity;
for (const svg of document.querySelectorAll("figure svg")) {
  const words = [...svg.querySelectorAll("text")].map((t) => [t.textContent.trim(), t.getBoundingClientRect(), t]);
  const unit = svg.getBoundingClientRect().width / svg.viewBox.baseVal.width;
  for (const [, , t] of words) least = Math.min(least, unit * parseFloat(getComputedStyle(t).fontSize));
  words.forEach(([a, p], i) => words.slice(i + 1).forEach(([b, q]) => {
    const w = Math.min(p.right, q.right) - Math.max(p.left, q.left);
    const h = Math.min(p.bottom, q.bottom) - Math.max(p.top, q.top);
    if (w > 1 && h > 0.25 * Math.min(p.height, q.height)) clashes.push(`${a} | ${b}`);
  }));
}
return [clashes, least];
"""

NOW = """
const root = document.querySelector(".player");
const cells = [...root.querySelectorAll(".readout td")].map((c) => c.textContent);
return {now: root.querySelector(".now").textContent, cells, time: Number(root.querySelector(".time input").value),
        spoken: root.querySelector(".time input").getAttribute("aria-valuetext"),
        play: root.querySelector(".play").textContent};
"""

# how many different colours a canvas shows: an empty one shows one or two
COLOURS = """
const c = document.querySelector(arguments[0]), d = c.getContext("2d").getImageData(0, 0, c.width, c.height).data;
const seen = new Set();
for (let i = 0; i < d.length; i += 4) seen.add((d[i] << 24) + (d[i + 1] << 16) + (d[i + 2] << 8) + d[i + 3]);
return seen.size;
"""

PICTURE = "return document.querySelector('.player canvas').toDataURL()"


def press_keys(browser, *names: str) -> dict:
    for name in names:
        browser.run(
            "document.querySelector('.player').dispatchEvent(new KeyboardEvent('keydown', "
            "{key: arguments[0], bubbles: true, cancelable: true}))",
            name,
        )
    return browser.run(NOW)


def wait_for_state(browser, met) -> dict:
    """Return the player's state once it meets a condition; give up after a while."""
    for _ in range(100):
        state = browser.run(NOW)
        if met(state):
            return state
        time.sleep(0.05)
    raise AssertionError(state)


@pytest.mark.parametrize("width", [PHONE, DESKTOP])
def test_it_opens_without_complaint_and_fits(browser, report_file, tmp_path, width):
    browser.open(report_file, width)
    assert browser.complaints() == []
    assert browser.run("return performance.getEntriesByType('resource').length") == 0
    assert browser.run(OVERFLOW) <= 0
    clashes, least = browser.run(WORDS)
    assert clashes == []
    assert least >= 8.5  # CSS pixels: smaller text is for nobody
    assert len(browser.picture(tmp_path / f"{width}.png")) > 100_000


def test_what_does_not_fit_would_be_found(browser, tmp_path):
    figure = '<figure><svg viewBox="0 0 9 9"><text>here</text><text>too</text></svg></figure>'
    wide = f'<p style="width: 500px">wide</p>{figure}'
    page.write_page("Twin", [page.Section("one", "One", wide)], tmp_path / "report.html")
    browser.open(tmp_path / "report.html", PHONE)
    assert browser.run(OVERFLOW) > 50
    assert browser.run(WORDS)[0] == ["here | too"]


@pytest.mark.parametrize("width", [PHONE, DESKTOP])
def test_a_row_of_many_lines_is_not_a_screen_high_and_shows_its_outcome(browser, tmp_path, width):
    """An outcome of 200 letters stood last, 4.5 rem wide: every row was 690 px high, and blank on the screen."""
    outcome = "the shoe of T1 would have to hold the car down; " * 4
    numbers = {f"load_max:{name}": 3e5 for name in ("weight", "T1", "T2", "top")}
    numbers |= {f"haul_{of}:{car}": 2e4 for car in ("up", "down") for of in ("max", "min")}
    numbers |= {f"speed_max:{car}": 8.9 for car in ("up", "down")}
    row = {"car.0.travel.stop.time": 50, "outcome": outcome, "status": "complete", **numbers}
    table = grid_table([row], motion_table_columns([row], {"car.0.travel.stop.time": "s"}))
    page.write_page("Twin", [page.Section("one", "One", table)], tmp_path / "report.html")
    browser.open(tmp_path / "report.html", width)
    cell = "document.querySelector('td[data-label=\"outcome\"]')"
    height, right = browser.run(f"const b = {cell}.getBoundingClientRect(); return [b.height, b.right]")
    assert height < 300
    assert right <= width


def test_an_error_in_a_script_would_be_found(browser, report_file, tmp_path):
    spoiled = tmp_path / "report.html"
    spoiled.write_text(report_file.read_text(encoding="utf-8").replace('"cables":[', '"ropes":['), encoding="utf-8")
    browser.open(spoiled, DESKTOP)
    assert len(browser.complaints()) == 1


def test_nothing_can_be_fetched(browser, report_file):
    browser.open(report_file, DESKTOP)
    browser.run("const i = new Image(); i.src = 'http://localhost:9/x.png'; document.body.append(i)")
    time.sleep(0.2)
    assert any("Content Security Policy" in text for text in browser.complaints())


def test_the_verdict_is_the_first_thing_to_read(browser, report_file):
    browser.open(report_file, PHONE, 844)
    browser.run("window.badge = document.querySelector('#answer .badge')")
    word, top = browser.run("return [badge.textContent, badge.getBoundingClientRect().top]")
    assert "agree" in word
    assert top < 844


def test_no_figure_leaves_half_a_page_empty(browser, report_file):
    """Figures stand in two columns of about equal length; the energy stood alone beside nothing."""
    browser.open(report_file, DESKTOP)
    ends = browser.run(
        "return [...document.querySelectorAll('.columns')].map((c) => {"
        " const parts = [...c.children].map((e) => e.getBoundingClientRect());"
        " const left = Math.min(...parts.map((p) => p.left));"
        " return [true, false].map((first) => Math.max(...parts.filter((p) => (p.left < left + 9) === first)"
        ".map((p) => p.bottom)) - c.getBoundingClientRect().top); })"
    )
    assert len(ends) == 2
    assert all(min(pair) > 0.55 * max(pair) for pair in ends)


@pytest.mark.parametrize("width", [PHONE, DESKTOP])
def test_the_player_shows_a_cable_and_its_tension(browser, report_file, width):
    browser.open(report_file, width)
    press_keys(browser, "Home")
    empty = browser.run(COLOURS, ".player .tension")
    press_keys(browser, "End")
    for canvas in (".player .cable", ".player .tension"):
        assert browser.run(COLOURS, canvas) > 20
    assert empty > 20  # the cable at rest is there too
    browser.run("document.querySelector('.player canvas').getContext('2d').reset()")
    assert browser.run(COLOURS, ".player .cable") == 1


def test_it_plays_and_pauses(browser, report_file):
    browser.open(report_file, DESKTOP)
    before, picture = browser.run(NOW), browser.run(PICTURE)
    browser.run("document.querySelector('.play').click()")
    playing = wait_for_state(
        browser, lambda state: 0 < state["time"] < before["time"]
    )  # from the entry on, not the middle
    assert playing["play"] == "Pause"
    assert browser.run(PICTURE) != picture
    press_keys(browser, " ")
    stopped = browser.run(NOW)
    time.sleep(0.2)
    assert browser.run(NOW) == stopped
    assert stopped["play"] == "Play"
    assert browser.complaints() == []


def test_it_stops_at_the_end_and_starts_again(browser, report_file):
    browser.open(report_file, DESKTOP)
    browser.run("const s = document.querySelector('.player select'); s.value = s.options[3].value")  # the fastest
    press_keys(browser, "End", "ArrowLeft", " ")
    assert wait_for_state(browser, lambda state: state["play"] == "Play")["time"] == 1000
    press_keys(browser, " ")
    wait_for_state(browser, lambda state: 0 < state["time"] < 500)


def test_keys_and_slider_choose_the_time(browser, report_file):
    browser.open(report_file, DESKTOP)
    assert press_keys(browser, "Home")["time"] == 0
    assert press_keys(browser, "ArrowRight", "ArrowRight")["time"] == 20
    assert press_keys(browser, "ArrowLeft")["time"] == 10
    assert press_keys(browser, "End")["time"] == 1000
    browser.run("const s = document.querySelector('.time input'); s.value = 300; s.dispatchEvent(new Event('input'))")
    state = browser.run(NOW)
    assert state["time"] == 300
    assert re.search(r"seconds, car at \d+\.\d metres", state["spoken"])
    unnamed = browser.run(
        "return [...document.querySelectorAll('.player button, .player input, .player select, .player canvas')]"
        ".filter(e => !(e.ariaLabel || e.textContent.trim() || e.closest('label'))).length"
    )
    assert unnamed == 0


def test_the_numbers_shown_are_the_stored_ones(browser, report_file, stored_check):
    r = Response.read(stored_check / "following-p2")
    browser.open(report_file, DESKTOP)
    end = browser.run("const s = document.querySelector('.player select'); return 5 * Number(s.options[3].value)")
    browser.run("const s = document.querySelector('.time input'); s.value = 417; s.dispatchEvent(new Event('input'))")
    shown = browser.run(NOW)["cells"]
    t = 0.417 * end
    assert shown[0] == "deflection [m]"
    # the player goes straight between frames, a hundredth of the travel apart
    assert float(shown[1]) == pytest.approx(np.interp(t, r.t, r.v), rel=0.0, abs=0.02)
    assert float(shown[4]) == pytest.approx(np.interp(t, r.t[1:], r.T_behind[1:]) / 1e3, rel=0.0, abs=1.0)


def test_it_says_when_the_rope_is_slack(browser, report_file):
    browser.open(report_file, DESKTOP)
    assert "slack" not in press_keys(browser, "Home")["now"]
    assert "slack" in press_keys(browser, "End")["now"]


def test_the_side_view_is_to_scale_and_can_be_drawn_deeper(browser, report_file):
    browser.open(report_file, DESKTOP)
    told = "return document.querySelector('.scale output').textContent"
    assert browser.run(told) == "to scale"
    picture = browser.run(PICTURE)
    browser.run("const s = document.querySelector('.scale input'); s.value = 3; s.dispatchEvent(new Event('input'))")
    assert browser.run(told) == "3 times too deep"
    assert browser.run(PICTURE) != picture


def test_whoever_wants_less_motion_gets_still_pictures(browser, report_file):
    browser.open(report_file, DESKTOP)
    wish = {"features": [{"name": "prefers-reduced-motion", "value": "reduce"}]}
    browser.driver.execute_cdp_cmd("Emulation.setEmulatedMedia", wish)
    press_keys(browser, "Home", " ")
    times: set[int] = set()
    wait_for_state(browser, lambda state: times.add(state["time"]) or len(times) >= 3)
    assert all(t % 50 == 0 for t in times)


def test_paper_shows_what_the_screen_folds(browser, report_file: Path):
    browser.open(report_file, DESKTOP)
    folded = "return document.querySelectorAll('details:not([open]):not(td details)').length"
    before = browser.run(folded)
    assert before >= 3
    browser.run("dispatchEvent(new Event('beforeprint'))")
    assert browser.run(folded) == 0
    browser.run("dispatchEvent(new Event('afterprint'))")
    assert browser.run(folded) == before
    pdf = browser.driver.execute_cdp_cmd("Page.printToPDF", {"preferCSSPageSize": True})
    assert len(pdf["data"]) > 100_000


def test_tables_fit_on_paper(browser, report_file):
    """Overflow is not scrolled on paper: it is cut, or shrinks all of the page."""
    browser.open(report_file, 680)  # A4 less its margins
    browser.run("dispatchEvent(new Event('beforeprint'))")
    browser.driver.execute_cdp_cmd("Emulation.setEmulatedMedia", {"media": "print"})
    wide = "[...document.querySelectorAll('table')].filter(t => t.getBoundingClientRect().right > 680)"
    assert browser.run(f"return {wide}.map(t => t.caption?.textContent ?? t.textContent)") == []
