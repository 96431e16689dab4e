"""Journeys of people through the pages of a depot, in a real browser."""

import re
import time
from urllib.parse import urlsplit

import pytest
from playwright.sync_api import expect
from tests.journeys import depot
from tests.online.site.conftest import PASSWORD

from sprung.online.alerts import AlertSettings, Report, reported
from sprung.online.monitor.alert_book import AlertBook

pytestmark = pytest.mark.slow


def test_after_a_repair_one_form_closes_an_alert(serve, visit) -> None:
    monitor = serve()
    number = monitor.number_of(depot.SOFT)
    page = visit(monitor)
    page.goto(f"/alerts/{number}")
    page.get_by_label("confirmed").check()
    page.get_by_label("What was done").fill("spring renewed")
    page.get_by_label("learn a new baseline").check()
    page.get_by_role("button", name="Save verdict").click()
    expect(page.locator("#alert-verdicts")).to_contain_text("confirmed; spring renewed; new baseline requested")
    expect(page.locator("#alert-head")).to_contain_text("normal")
    row = monitor.store.alerts.row(number)
    assert (row.is_active, row.is_acknowledged) == (False, True)
    page.goto("/alerts")
    expect(page.locator(".precision")).to_contain_text("Of 13 alerts inspected by the workshop, 12 were right")
    expect(page.locator("#alert-list")).not_to_contain_text(depot.SOFT)


def test_another_part_and_its_name_stand_with_the_verdict(serve, visit) -> None:
    monitor = serve()
    page = visit(monitor)
    page.goto(f"/alerts/{monitor.number_of(depot.WEAK)}")
    page.get_by_label("another part").check()
    page.get_by_label("Other part", exact=True).fill("strut mount")
    page.get_by_role("button", name="Save verdict").click()
    expect(page.locator("#alert-verdicts")).to_contain_text("another part: strut mount")


def test_a_sensor_fault_is_seen_as_one(serve, visit) -> None:
    page = visit(serve())
    page.goto("/alerts")
    page.get_by_role("link", name="sensor acc_fr is dead").click()
    expect(page.get_by_role("heading", level=1)).to_contain_text("acc_fr is dead")
    expect(page.get_by_role("heading", name="What may have changed")).to_have_count(0)
    page.locator("#alert-head").get_by_role("link", name=depot.DEAD).click()
    expect(page.get_by_role("heading", level=1)).to_contain_text("acc_fr")
    page.get_by_role("link", name="3 of 4 channels good").click()
    expect(page.get_by_role("row", name=re.compile("acc_fr")).first).to_contain_text("dead")
    expect(page.get_by_role("row", name=re.compile("acc_rl")).first).to_contain_text("good")


def test_an_alert_appears_without_a_reload(serve, visit) -> None:
    monitor = serve()
    pages = [visit(monitor), visit(monitor)]
    for page, address in zip(pages, ("/", "/vehicles/bus-100"), strict=True):
        page.goto(address)
        page.evaluate("window.isTheSame = true")
        expect(page.locator("#live")).to_have_text("live")
    title = pages[0].get_by_role("heading", level=1)
    n_before = int(title.inner_text().partition(" ")[0])
    report = Report("bus-100", "rear_left.tyre", 900, "rear-left tyre 40 % (37 to 43 %) softer", {})
    now = time.time_ns()
    AlertBook(monitor.store, AlertSettings()).put(reported(None, report, AlertSettings(raise_after=1), now), now=now)
    for page in pages:
        expect(page.get_by_text("tyre 40 % (37 to 43 %) softer").first).to_be_visible(timeout=30_000)
        assert page.evaluate("window.isTheSame")
    expect(title).to_contain_text(f"{n_before + 1} of 214 vehicles need attention.")


def test_log_in_and_out(serve, visit, watch) -> None:
    watch.expected = {401}
    page = visit(serve("viewer", "engineer", "admin"))
    page.goto("/alerts?step=high")
    expect(page).to_have_url(re.compile("/log-in"))
    page.get_by_label("Name").fill("Eve")
    page.get_by_label("Password").fill("wrong password")
    page.get_by_role("button", name="Log in").click()
    expect(page.get_by_role("alert")).to_contain_text("name or password is wrong")
    expect(page.get_by_label("Name")).to_have_value("Eve")
    page.get_by_label("Password").fill(PASSWORD)
    page.get_by_role("button", name="Log in").click()
    expect(page).to_have_url(re.compile(r"/alerts\?step=high"))
    expect(page.locator(".who")).to_contain_text("Eve (engineer)")
    page.get_by_role("button", name="Log out").click()
    page.goto("/")
    expect(page).to_have_url(re.compile("/log-in"))


def test_a_viewer_cannot_act(serve, visit, watch) -> None:
    watch.expected = {403}
    monitor = serve("viewer", "engineer")
    number = monitor.number_of(depot.SOFT)
    page = visit(monitor, role="viewer")
    page.goto(f"/alerts/{number}")
    expect(page.locator("main form")).to_have_count(0)
    expect(page.locator(".acts")).to_contain_text("Actions on it require the role engineer.")
    mark = page.evaluate("document.body.dataset.csrfToken")
    forged = {"csrf_token": mark, "comment": "forged"}
    assert page.request.post(f"/alerts/{number}/acknowledge", form=forged).status == 403
    assert page.request.post(f"/vehicles/{depot.SOFT}/baseline", form={**forged, "reason": "x"}).status == 403
    for address in ("/people", "/audit"):
        page.goto(address)
        expect(page.get_by_role("heading", level=1)).to_have_text("Not allowed")
    engineer = visit(monitor, role="engineer")
    engineer.goto("/")
    assert engineer.request.post(f"/alerts/{number}/acknowledge", form=forged).status == 403  # mark of another session
    assert not monitor.store.alerts.row(number).is_acknowledged


def test_fleet_to_acknowledgement_without_a_mouse(serve, visit) -> None:
    monitor = serve()
    number = monitor.number_of(depot.SOFT)
    page = visit(monitor)
    page.goto("/")
    page.keyboard.press("Tab")
    assert focused(page) == ("A", "Skip to content")
    tab_to(page, "A", "Front-left spring")
    page.keyboard.press("Enter")
    expect(page).to_have_url(re.compile(f"/alerts/{number}$"))
    tab_to(page, "INPUT", "Comment")
    page.keyboard.type("on my way")
    tab_to(page, "BUTTON", "Acknowledge")
    page.keyboard.press("Enter")
    expect(page.locator("#alert-history")).to_contain_text("on my way")
    assert monitor.store.alerts.row(number).is_acknowledged


def test_pages_work_without_scripts(serve, visit) -> None:
    monitor = serve()
    page = visit(monitor, java_script_enabled=False)
    page.goto("/")
    expect(page.locator("#live")).to_have_text("not live: reload to update")
    page.get_by_label("Vehicle").fill("bus-01")
    page.get_by_role("button", name="Search").click()
    expect(page.locator("tbody tr")).to_have_count(10)
    page.get_by_role("link", name=depot.SOFT, exact=True).click()
    expect(page.get_by_role("row", name=re.compile("front left spring")).first).to_contain_text("−4")
    expect(page.get_by_text("The charts need JavaScript")).to_be_visible()
    page.get_by_role("link", name=re.compile("evidence, acknowledge, verdict")).click()
    page.locator(".quick").get_by_label("Comment").fill("no scripts here")
    page.get_by_role("button", name="Acknowledge").click()
    expect(page.locator("#alert-history")).to_contain_text("no scripts here")
    page.locator("summary", has_text="Assign").click()
    page.get_by_label("Assignee").fill("Bert")
    page.get_by_role("button", name="Assign").click()
    expect(page.locator("#alert-head")).to_contain_text("Bert")


def tab_to(page, tag: str, name: str) -> None:
    """Press Tab until an element has the focus, which is visible all the way."""
    page.wait_for_load_state()  # styles apply from then on
    for _ in range(80):
        page.keyboard.press("Tab")
        assert page.evaluate(
            "() => { const style = getComputedStyle(document.activeElement);"
            " return style.outlineStyle !== 'none' && parseFloat(style.outlineWidth) >= 2; }"
        ), focused(page)
        own_tag, own_name = focused(page)
        if own_tag == tag and own_name.startswith(name):
            return
    raise AssertionError(f"no {tag} {name} is reached by Tab")


def focused(page) -> tuple[str, str]:
    """Return tag and label of the element that has the focus."""
    tag, name = page.evaluate(
        "() => { const own = document.activeElement; return [own.tagName, (own.labels?.[0] ?? own).textContent]; }"
    )
    return tag, name.strip()


def test_charts_come_after_a_poor_connection(shown, visit, watch) -> None:
    watch.expected = {503}
    refused = []

    def refuse_once(route):
        if (path := urlsplit(route.request.url).path) in refused:
            route.fallback()
        else:
            refused.append(path)
            route.fulfill(status=503, json={"detail": "the store does not answer"})

    page = visit(shown, role="viewer")
    for pattern in ("**/static/plotly.js", "**/trends?*"):
        page.route(pattern, refuse_once)
    page.goto(f"/vehicles/{depot.SOFT}")
    expect(page.locator("#part-trends")).to_contain_text("the store does not answer")
    page.wait_for_selector("#part-trends .main-svg")
    assert len(refused) == 2
