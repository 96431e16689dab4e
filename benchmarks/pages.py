"""Weight of the monitor's pages and time to their first paint, in Debian's Chromium on this machine.

    python benchmarks/pages.py

A depot of 214 vehicles. Weight and requests: all that a page loads but for the library of charts; each load with an
empty cache. First paint: first contentful paint, median of five loads.
"""

import statistics
import sys
import tempfile
import time
import types
from contextlib import closing
from pathlib import Path

from playwright.sync_api import sync_playwright

from sprung.online.store import open_store

N_LOADS = 5


def main() -> None:
    # By its path: packages of others bring folders called tests, too.
    tests = types.ModuleType("tests")
    tests.__path__ = [str(Path(__file__).parents[1] / "tests")]
    sys.modules["tests"] = tests
    from tests.journeys import depot
    from tests.journeys.conftest import CHROMIUM, FLAGS, PEOPLE, serving
    from tests.journeys.routes import addresses, load

    with tempfile.TemporaryDirectory() as folder, sync_playwright() as driver:
        url = f"sqlite:///{folder}/depot.sqlite"
        with open_store(url) as store:
            depot.fill(store, now=time.time_ns())
        browser = driver.chromium.launch(executable_path=CHROMIUM, args=FLAGS)
        with closing(browser), serving(url, tuple(PEOPLE)) as monitor:
            cookies = {
                role: [{"name": "sprung_session", "value": monitor.session_of(role), "url": monitor.url}]
                for role in PEOPLE
            }
            print(f"{'page':<22}{'kB':>8}{'requests':>10}{'first paint [ms]':>18}")
            for name, (address, role) in addresses(monitor).items():
                loads = []
                for _ in range(N_LOADS):
                    with closing(browser.new_context(base_url=monitor.url)) as context:
                        context.add_cookies(cookies.get(role, []))
                        loads.append(load(context.new_page(), address))
                paint = statistics.median(each.paint for each in loads)
                print(f"{name:<22}{loads[0].n_bytes / 1000:>8.0f}{loads[0].n_requests:>10}{paint:>18.0f}", flush=True)


if __name__ == "__main__":
    main()
