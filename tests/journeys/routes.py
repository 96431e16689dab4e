"""Addresses of all pages of a depot, and what they load."""

from typing import Any, NamedTuple

from playwright.sync_api import Page
from tests.journeys import depot
from tests.journeys.conftest import Monitor


def addresses(monitor: Monitor) -> dict[str, tuple[str, str]]:
    """Return the address of each page by a short name, and the role that looks at it; none: before the log-in."""
    soft = f"/vehicles/{depot.SOFT}"
    last = monitor.store.results.observations(depot.SOFT, limit=1)[0]
    return {
        "fleet": ("/", "engineer"),
        "fleet-nothing-found": ("/?text=tram", "engineer"),
        "alerts": ("/alerts", "engineer"),
        "alert": (f"/alerts/{monitor.number_of(depot.SOFT)}", "engineer"),
        "job-card": (f"/alerts/{monitor.number_of(depot.WEAK)}/job-card", "engineer"),
        "alert-acknowledged": (f"/alerts/{monitor.number_of(depot.WEAK)}", "viewer"),
        "alert-sensor": (f"/alerts/{monitor.number_of(depot.DEAD)}", "engineer"),
        "vehicle": (soft, "engineer"),
        "vehicle-silent": (f"/vehicles/{depot.SILENT}", "engineer"),
        "vehicle-learning": (f"/vehicles/{depot.LEARNING}", "engineer"),
        "vehicle-sensor": (f"/vehicles/{depot.DEAD}/data", "engineer"),
        "vehicle-windows": (f"{soft}/windows", "engineer"),
        "vehicle-window": (f"{soft}/windows/{last.boot}/{last.number}", "engineer"),
        "vehicle-diagrams": (f"{soft}/diagrams", "engineer"),
        "window-diagrams": (f"{soft}/windows/{last.boot}/{last.number}/diagrams", "engineer"),
        "vehicle-data": (f"{soft}/data", "engineer"),
        "vehicle-baseline": (f"{soft}/baseline", "engineer"),
        "report": (f"{soft}/report", "engineer"),
        "outcomes": ("/outcomes", "engineer"),
        "runs": ("/runs", "engineer"),
        "site": ("/site", "admin"),
        "people": ("/people", "admin"),
        "audit": ("/audit", "admin"),
        "interface": ("/api", "engineer"),
        "not-allowed": ("/people", "viewer"),
        "log-in": ("/log-in", ""),
    }


class Load(NamedTuple):
    """Bytes and requests of a page without the library of charts, and the time until it shows something [ms]."""

    n_bytes: int
    n_requests: int
    paint: float


def load(page: Page, address: str) -> Load:
    """Load a page, and return what that took."""
    answers: list[Any] = []
    page.on("response", lambda answer: answers.append(answer) if not answer.url.endswith(_NOT_COUNTED) else None)
    page.goto(address, wait_until="load")
    paint = page.evaluate(_PAINT)
    return Load(sum(each.request.sizes()["responseBodySize"] for each in answers), len(answers), paint)


#: The library of charts, and the stream of events, which does not end.
_NOT_COUNTED = ("/plotly.js", "/events")
_PAINT = """() => new Promise((resolve) => new PerformanceObserver((list) => {
  for (const entry of list.getEntriesByName("first-contentful-paint")) resolve(entry.startTime);
}).observe({ type: "paint", buffered: true }))"""
