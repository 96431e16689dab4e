"""The pages of the demonstration, and that its drives end in the present."""

import socket
import urllib.request

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


@pytest.mark.slow
def test_a_run_that_is_stopped_finds_nothing() -> None:
    with open_demo(pace=60.0) as demonstration:
        assert demonstration.find_faults(60.0, is_stopped=lambda: True) == []


def test_drives_end_in_the_present() -> None:
    ago = 3 * 3600.0
    assert waiting_time(3600.0, 60.0) == 60.0
    assert waiting_time(ago + 500.0, 60.0) == 500.0
    assert waiting_time(0.0, 1.0) == 0.0
