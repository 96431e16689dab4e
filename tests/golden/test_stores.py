"""Pages, the interface and commands of a monitor show what they did when it was frozen."""

from collections.abc import Callable, Iterator
from contextlib import ExitStack
from typing import Any

import pytest
from tests.golden.commands import run_command
from tests.golden.freezing import check, html_lines, text_lines
from tests.golden.inner import STORES, Opened, opened

pytestmark = [
    pytest.mark.slow,
    pytest.mark.filterwarnings("ignore:AutoDateLocator was unable to pick"),  # of a figure that nobody reads here
]

#: Addresses of pages and of the interface; {vehicle}, {alert} and {window} stand for those of a store.
PAGES = (
    "/",
    "/?text=tram",
    "/?step=high",
    "/?state=silent",
    "/alerts",
    "/alerts?all=true",
    "/alerts/{alert}",
    "/vehicles/{vehicle}",
    "/vehicles/{vehicle}/windows",
    "/vehicles/{vehicle}/windows/{window}",
    "/vehicles/{vehicle}/windows/{window}/diagrams",
    "/vehicles/{vehicle}/data",
    "/vehicles/{vehicle}/baseline",
    "/vehicles/{vehicle}/diagrams",
    "/vehicles/{first}/report",
    "/runs",
    "/site",
    "/people",
    "/audit",
    "/log-in",
    "/vehicles/nobody",
    "/alerts/77",
    "/nowhere",
)
INTERFACE = (
    "/health",
    "/metrics",
    "/api/v1/vehicles",
    "/api/v1/counts",
    "/api/v1/vehicles/{vehicle}",
    "/api/v1/vehicles/{vehicle}/windows?limit=1",
    "/api/v1/vehicles/{vehicle}/modes?limit=1",
    "/api/v1/vehicles/{vehicle}/findings?limit=1",
    "/api/v1/vehicles/{vehicle}/changes",
    "/api/v1/vehicles/{vehicle}/trends",
    "/api/v1/vehicles/{vehicle}/body-modes",
    "/api/v1/vehicles/{vehicle}/data-quality",
    "/api/v1/vehicles/{vehicle}/baseline",
    "/api/v1/vehicles/{vehicle}/windows/{window}",
    "/api/v1/vehicles/{vehicle}/windows/{window}/diagrams",
    "/api/v1/vehicles/{vehicle}/windows/{window}/figures/fit",
    "/api/v1/vehicles/{first}/export?what=windows&format=csv",
    "/api/v1/vehicles/{first}/export?what=modes&format=csv",
    "/api/v1/vehicles/{first}/export?what=findings&format=json",
    "/api/v1/vehicles/{first}/export?what=alerts&format=json",
    "/api/v1/alerts",
    "/api/v1/alert-counts",
    "/api/v1/alerts/{alert}",
    "/api/v1/alerts/{alert}/evidence",
    "/api/v1/alerts/{alert}/work-order",
    "/api/v1/precision",
    "/api/v1/runs",
    "/api/v1/session",
    "/api/v1/audit",
    "/api/v1/accounts",
    "/api/v1/tokens",
    "/api/v1/site",
    "/api/v1/vehicles/nobody",
    "/api/v1/alerts/77",
)
#: Commands about alerts and people, which need no documents of vehicles.
COMMANDS_OF_PEOPLE = (
    "alerts {store}",
    "alerts --all {store} --json -",
    "alerts history {alert} {store}",
    "alerts history {alert} {store} --json -",
    "accounts {store}",
    "tokens {store} --json -",
)
COMMANDS = (
    "vehicles {store}",
    "vehicles {store} --json -",
    "vehicles rank {store} --json -",
    "vehicles quarantine {store}",
    "vehicles export {first} --what windows {store} --out windows.csv",
    "vehicles export {first} --what alerts {store} --json -",
    "report {first} {store} --json -",
    "report nobody {store} --json -",
    *COMMANDS_OF_PEOPLE,
)


@pytest.fixture(scope="module")
def store(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Callable[[str], Opened]]:
    """Return a function from a name to a filled store."""
    found: dict[str, Opened] = {}
    with ExitStack() as stack:

        def get(name: str) -> Opened:
            if name not in found:
                found[name] = stack.enter_context(opened(name, tmp_path_factory.mktemp(name)))
            return found[name]

        yield get


def _filled(patterns: tuple[str, ...], seen: Opened) -> list[str]:
    """Return the addresses or commands of patterns for what a store holds."""
    lines = []
    first = seen.vehicles[0] if seen.vehicles else ""
    for pattern in patterns:
        if "{first}" in pattern and not first:
            continue
        for vehicle in seen.vehicles if "{vehicle}" in pattern else ("",):
            if "{window}" in pattern and vehicle not in seen.windows:
                continue
            window = "/".join(map(str, seen.windows.get(vehicle, ())))
            for alert in seen.alerts if "{alert}" in pattern else (0,):
                store = "--store sqlite:///store.sqlite"
                lines.append(pattern.format(vehicle=vehicle, window=window, alert=alert, store=store, first=first))
    return lines


def _answers(seen: Opened, addresses: list[str], accept: str) -> dict[str, Any]:
    """Return what a person reads at addresses."""
    answers: dict[str, Any] = {}
    for address in addresses:
        answer = seen.client.get(address, headers={"Accept": accept}, follow_redirects=False)
        kind = answer.headers.get("content-type", "").partition(";")[0]
        content: Any = text_lines(answer.text)
        if kind == "application/json":
            content = answer.json()
            if address == "/api/v1/site":
                content["store"] |= {"free": 0, "size": 0}
        elif kind == "text/html":
            content = html_lines(answer.text)
        elif kind == "text/csv":
            content = [*content[:4], f".. {len(content)} lines"]
        answers[f"{answer.status_code} {address}"] = content
    return answers


@pytest.mark.parametrize(
    ("name", "part"),
    [
        pytest.param(name, part, id=f"store-{name}-{part}")
        for name in STORES
        for part in ("pages", "interface", "commands", "description")
        if part != "description" or name == "empty"
    ],
)
def test_store(store, name, part) -> None:
    seen: Opened = store(name)
    if part == "commands":
        lines = _filled(COMMANDS if seen.is_real else COMMANDS_OF_PEOPLE, seen)
        shown: Any = [run_command(line, seen.folder, now=seen.now) for line in lines]
    elif part == "interface":
        shown = _answers(seen, _filled(INTERFACE, seen), "application/json")
    else:
        shown = _answers(seen, _filled(PAGES, seen) if part == "pages" else ["/api"], "text/html")
    check(f"store-{name}-{part}", shown, digits=seen.digits)
