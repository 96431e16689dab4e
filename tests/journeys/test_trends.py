"""The charts of a vehicle: one range, that of its windows, and zoom."""

import pytest
from tests.journeys import depot

pytestmark = pytest.mark.slow

_RANGES = """() => ["part-trends", "mode-trends"].map((id) => document.getElementById(id).layout.xaxis.range.map(
  (end) => new Date(end.replace(" ", "T")).getTime()))"""


def test_charts_have_the_range_of_the_windows_and_zoom_together(shown, visit, watch) -> None:
    page = visit(shown, role="engineer", viewport={"width": 1280, "height": 900}, timezone_id="UTC")
    page.goto(f"/vehicles/{depot.WEAK}")
    page.wait_for_selector("#part-trends .main-svg")
    page.wait_for_selector("#mode-trends .main-svg")
    starts = [entry.t0 / 1e6 for entry in shown.store.results.observations(depot.WEAK)]
    parts, modes = page.evaluate(_RANGES)
    length = starts[-1] - starts[0]
    assert parts == modes
    assert 0 < starts[0] - parts[0] < 0.05 * length
    assert 0 < parts[1] - starts[-1] < 0.05 * length
    chart = page.locator("#part-trends .nsewdrag").first
    chart.scroll_into_view_if_needed()
    box = chart.bounding_box()
    page.mouse.move(box["x"] + 0.25 * box["width"], box["y"] + 40)
    page.mouse.down()
    page.mouse.move(box["x"] + 0.5 * box["width"], box["y"] + 40, steps=5)
    page.mouse.up()
    page.wait_for_timeout(500)
    zoomed, followed = page.evaluate(_RANGES)
    assert zoomed == followed
    assert zoomed[1] - zoomed[0] == pytest.approx(0.25 * (parts[1] - parts[0]), rel=0.1)
