"""/metrics and /health."""

import json
import urllib.error
import urllib.request

import pytest

from sprung.errors import ParameterError
from sprung.monitor import FIGURES, Serving


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
        try:
            with urllib.request.urlopen(f"http://127.0.0.1:{one.port}{path}") as answer:
                return answer.status, answer.read().decode()
        except urllib.error.HTTPError as error:
            with error:
                return error.code, error.read().decode()

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
