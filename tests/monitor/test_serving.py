"""/metrics and /health."""

import json
import re
import threading
import urllib.error
import urllib.request
from functools import partial
from pathlib import Path

import pytest

from sprung.errors import ParameterError
from sprung.monitor import FIGURES, Serving
from sprung.monitor.serving import exposition, labelled
from sprung.storage import StoreError


def answer_of(serving, path):
    """Status and text."""
    try:
        with urllib.request.urlopen(f"http://127.0.0.1:{serving.port}{path}") as answer:
            return answer.status, answer.read().decode()
    except urllib.error.HTTPError as error:
        with error:
            return error.code, error.read().decode()


def test_names_follow_the_conventions_of_prometheus() -> None:
    """Counters, and nothing else, end with _total; units are whole words at the end; no name has its kind in it."""
    for name, (kind, meaning) in FIGURES.items():
        assert re.fullmatch(r"sprung(_[a-z]+)+", name)
        assert name.endswith("_total") == (kind == "counter")
        assert not re.search(r"gauge|counter|_(ms|us|min|mb|gb|percent)(_|$)", name)
        assert meaning.endswith(".")


def test_figures_with_labels_stand_together() -> None:
    refusals = {labelled("sprung_refusals_total", vehicle=name, reason="invalid"): 3.0 for name in ("car-1", "car-2")}
    assert exposition({"sprung_vehicles": 2.0, **refusals}) == (
        "# HELP sprung_vehicles Vehicles known.\n"
        "# TYPE sprung_vehicles gauge\n"
        "sprung_vehicles 2\n"
        "# HELP sprung_refusals_total Messages refused, by vehicle and reason.\n"
        "# TYPE sprung_refusals_total counter\n"
        'sprung_refusals_total{vehicle="car-1",reason="invalid"} 3\n'
        'sprung_refusals_total{vehicle="car-2",reason="invalid"} 3\n'
    )


@pytest.fixture
def never():
    """An event that is set after the test."""
    event = threading.Event()
    yield event
    event.set()


def test_a_store_that_hangs_or_fails_costs_only_what_it_has(never) -> None:
    """More requests than wait for the store together are answered, too."""

    def ask(stored, _number):
        return stored()

    def fail():
        raise StoreError("the store does not answer")

    def wait():
        never.wait()

    for stored in (wait, fail):
        one = Serving(
            ("127.0.0.1", 0),
            figures=lambda: {"sprung_store_writable": 1.0, "sprung_frames_total": 5.0},
            troubles=list,
            stored=stored,
            alert=partial(ask, stored),
            patience=0.05,
        )
        one.open()
        for _ in range(6):
            status, text = answer_of(one, "/metrics")
            assert status == 200
            assert "\nsprung_store_writable 0\n" in text
            assert "\nsprung_frames_total 5\n" in text
            sentence = "the store does not answer: try again later, and look at /health\n"
            assert answer_of(one, "/alerts/7") == (503, sentence)
        assert answer_of(one, "/health")[0] == 200
        one.close()


def test_figures_of_the_store_are_among_the_others() -> None:
    one = Serving(
        ("127.0.0.1", 0),
        figures=lambda: {"sprung_store_writable": 1.0},
        troubles=list,
        stored=lambda: {"sprung_alerts_active": 4.0},
    )
    one.open()
    text = answer_of(one, "/metrics")[1]
    assert "\nsprung_store_writable 1\n" in text
    assert "\nsprung_alerts_active 4\n" in text
    one.close()


def test_metrics_and_health() -> None:
    troubles: list[str] = []
    one = Serving(
        ("127.0.0.1", 0),
        figures=lambda: dict.fromkeys(FIGURES, 2.5),
        troubles=lambda: troubles,
        alert={7: "Alert 7 of car-1 – soft\n"}.get,
    )
    one.open()

    def ask(path):
        return answer_of(one, path)

    status, text = ask("/metrics")
    assert status == 200
    assert "# TYPE sprung_frames_total counter\nsprung_frames_total 2.5\n" in text
    assert ask("/health") == (200, json.dumps({"healthy": True, "troubles": []}))
    troubles.append("the store cannot write")
    assert ask("/health")[0] == 503
    assert ask("/alerts/7") == (200, "Alert 7 of car-1 – soft\n")
    assert {ask(path)[0] for path in ("/else", "/alerts/8", "/alerts/x", "/alerts/7/")} == {404}
    one.close()


def test_an_address_in_use_is_refused() -> None:
    first = Serving(("127.0.0.1", 0), figures=dict, troubles=list)
    assert first.port is None
    first.open()
    assert first.port is not None
    second = Serving(("127.0.0.1", first.port), figures=dict, troubles=list)
    with pytest.raises(ParameterError, match=rf"cannot listen at 127.0.0.1:{first.port} .*: give another --http"):
        second.open()
    second.close()
    first.close()
    assert not first.is_open


def test_every_figure_is_documented() -> None:
    text = (Path(__file__).parents[2] / "docs" / "monitor.md").read_text(encoding="utf-8")
    assert [name for name in FIGURES if f"| `{name}" not in text] == []
