"""From the demonstration to a report in hand: a person sees the soft spring being found, and acts.

A soft spring and a dead sensor raise alerts, and nothing else does.
"""

import os
import pty
import re
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path
from types import SimpleNamespace

import pytest
from playwright.sync_api import Page, expect
from playwright.sync_api import TimeoutError as PageTimeout

pytestmark = pytest.mark.slow

pytest.importorskip("numba")

_PROGRAM = Path(sys.executable).with_name("sprung")
#: Longest time until the spring is found [ms], which takes a minute where nothing else runs.
_PATIENCE = 480_000


class Demo:
    """The program `sprung demo` on a terminal."""

    def __init__(self) -> None:
        self._end, theirs = pty.openpty()
        words = [str(_PROGRAM), "demo", "--pace", "120", "--minutes", "9"]
        environment = {**os.environ, "OPENBLAS_NUM_THREADS": "1", "TERM": "xterm", "COLUMNS": "160"}
        self._process = subprocess.Popen(
            words, stdin=theirs, stdout=theirs, stderr=theirs, env=environment, start_new_session=True
        )
        os.close(theirs)
        self._text = ""
        self._reader = threading.Thread(target=self._read, daemon=True)
        self._reader.start()

    def _read(self) -> None:
        try:
            while piece := os.read(self._end, 65536):
                self._text += piece.decode(errors="replace")
        except OSError:
            pass  # the terminal ends with its last program

    def wait_for(self, pattern: str, *, seconds: float) -> str:
        """Wait until a pattern is printed, and return its first group."""
        end = time.monotonic() + seconds
        while (match := re.search(pattern, self._text)) is None:
            assert time.monotonic() < end, self._text[-2000:]
            assert self._process.poll() is None, self._text[-2000:]
            time.sleep(0.1)
        return match[1]

    def interrupt(self) -> tuple[int, str]:
        """Press Ctrl-C, and return exit code and text."""
        os.killpg(self._process.pid, signal.SIGINT)
        code = self._process.wait(60)
        self._reader.join(10)
        return code, self._text

    def close(self) -> None:
        """End the program, if it runs."""
        if self._process.poll() is None:
            os.killpg(self._process.pid, signal.SIGKILL)
            self._process.wait()
        os.close(self._end)


@pytest.fixture
def demo():
    running = Demo()
    yield running
    running.close()


def test_from_the_demonstration_to_a_report(demo, visit, tmp_path) -> None:
    url = demo.wait_for(r"pages of this monitor: (http://127\.0\.0\.1:\d+)", seconds=60)
    assert "alert" not in demo.wait_for(r"(pages[^\0]*)", seconds=1)
    page = visit(SimpleNamespace(url=url))
    page.goto("/")
    page.evaluate("window.isTheSame = true")
    expect(page.locator("#live")).to_have_text("live")
    expect(page.get_by_role("row", name=re.compile("car-2"))).to_contain_text("learning", timeout=_PATIENCE)
    expect(page.get_by_role("row", name=re.compile("car-2"))).to_contain_text("Front-left spring", timeout=_PATIENCE)
    assert page.evaluate("window.isTheSame")
    page.get_by_role("link", name="car-2", exact=True).click()
    expect(page.get_by_role("heading", level=1)).to_contain_text("Front-left spring")
    expect(page.get_by_role("row", name=re.compile("front left spring")).first).to_contain_text("−2")
    _wait_for_chart(page)
    page.get_by_role("link", name=re.compile("evidence, acknowledge, verdict")).click()
    expect(page.get_by_role("heading", name="What may have changed")).to_be_visible()
    expect(page.locator(".hypotheses tbody tr").first).to_contain_text("front left spring")
    page.locator(".quick").get_by_label("Comment").fill("looked at from below")
    page.get_by_role("button", name="Acknowledge").click()
    expect(page.locator("#alert-history")).to_contain_text("looked at from below")

    page.goto("/vehicles/car-2")
    page.get_by_role("button", name="Report", exact=True).click()
    expect(page.get_by_role("heading", level=1)).to_contain_text("car-2: report", timeout=180_000)
    with page.expect_download(timeout=180_000) as download:
        page.evaluate("Object.assign(document.createElement('a'), { href: location.href, download: '' }).click()")
    assert download.value.suggested_filename == "car-2-report.html"
    kept = tmp_path / "report.html"
    download.value.save_as(kept)
    assert "front-left spring" in kept.read_text(encoding="utf-8").lower()
    page.goto(kept.as_uri())
    expect(page.get_by_role("heading", level=1)).to_contain_text("car-2: report")

    demo.wait_for("Ctrl-C (ends) it", seconds=300)
    code, text = demo.interrupt()
    assert code == 0
    assert "car-1: no alert (simulated: healthy)" in text
    assert "car-2: front-left spring 2" in text
    assert "car-3: sensor acc_rr is dead" in text
    assert "Traceback" not in text


def _wait_for_chart(page: Page) -> None:
    """Wait until the trends are drawn; where they never are, show what stands there and what was loaded."""
    try:
        page.wait_for_selector("#part-trends .main-svg")
    except PageTimeout as error:
        loaded = page.evaluate(
            "performance.getEntriesByType('resource').map((e) => [e.name, e.responseEnd, e.responseStatus])"
        )
        raise AssertionError((page.locator("#part-trends").inner_html(), loaded)) from error
