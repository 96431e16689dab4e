"""The pages of the demonstration, and that its drives end in the present."""

import socket
import threading
import urllib.request
from contextlib import nullcontext
from types import SimpleNamespace

import pytest

from sprung.online.demo import open_demo, waiting_time

pytest.importorskip("numba")


@pytest.mark.slow
def test_pages_move_to_a_free_port_where_the_usual_one_is_taken() -> None:
    try:
        taken = socket.create_server(("127.0.0.1", 8737))
    except OSError:  # by another program of this machine
        taken = socket.socket()
    with taken, open_demo(pace=60.0) as demonstration:
        assert not demonstration.page.endswith(":8737")
        with urllib.request.urlopen(demonstration.page, timeout=30) as answer:
            text = answer.read().decode()
        assert "Demonstration" in text
        assert "No vehicle is known yet." in text
        assert demonstration.find_faults(60.0, is_stopped=lambda: True) == []


@pytest.mark.parametrize(
    ("sentences", "code", "said"),
    [(["both alerts raised"], 0, "both alerts raised"), ([], 130, "stopped before both faults were found")],
)
def test_without_a_terminal_the_program_ends_with_what_was_found(sprung, monkeypatch, sentences, code, said) -> None:
    """A whole run of it is in `tests/journeys/test_demo_journey.py`."""
    stopping = threading.Event()
    found = SimpleNamespace(page="http://127.0.0.1:8737", find_faults=lambda *_, **__: sentences)
    monkeypatch.setattr("sprung.online.demo.open_demo", lambda *, pace: nullcontext(found))
    monkeypatch.setattr("sprung.online.commands.monitor.stop_on_signals", lambda **_: stopping)
    outcome = sprung("demo", "--minutes", "1")
    assert outcome.code == code
    assert f"pages of this monitor: {found.page}" in outcome.out
    assert said in outcome.out


def test_drives_end_in_the_present() -> None:
    ago = 3 * 3600.0
    assert waiting_time(3600.0, 60.0) == 60.0
    assert waiting_time(ago + 500.0, 60.0) == 500.0
    assert waiting_time(0.0, 1.0) == 0.0
