"""/metrics and /health, also of a monitor whose store hangs or fails."""

import re
import threading
from dataclasses import replace
from pathlib import Path

import pytest
from tests.online.site.conftest import NOW

from sprung.errors import ParameterError
from sprung.online.monitor import FIGURES, Site
from sprung.online.monitor.station import labelled
from sprung.online.site import Context, Server, add_token, live
from sprung.online.site.live import exposition
from sprung.online.site.shared import LIMITS
from sprung.online.store import StoreError


def test_names_follow_the_conventions_of_prometheus() -> None:
    """Counters, and nothing else, end with _total; units are whole words at the end; no name has its kind in it."""
    for name, (kind, meaning) in FIGURES.items():
        assert re.fullmatch(r"sprung(_[a-z]+)+", name)
        assert name.endswith("_total") == (kind == "counter")
        assert not re.search(r"gauge|counter|_(ms|us|min|mb|gb|percent)(_|$)", name)
        assert meaning.endswith(".")


def test_figures_with_labels_stand_together() -> None:
    refusals = {labelled("sprung_refusals_total", vehicle=name, reason="invalid"): 3.0 for name in ("car-1", "car-2")}
    assert exposition({**refusals, "sprung_vehicles": 2.0}).decode() == (
        "# HELP sprung_vehicles Vehicles known.\n"
        "# TYPE sprung_vehicles gauge\n"
        "sprung_vehicles 2.0\n"
        "# HELP sprung_refusals_total Messages refused, by vehicle and reason.\n"
        "# TYPE sprung_refusals_total counter\n"
        'sprung_refusals_total{reason="invalid",vehicle="car-1"} 3.0\n'
        'sprung_refusals_total{reason="invalid",vehicle="car-2"} 3.0\n'
    )


@pytest.mark.parametrize("hangs", [False, True])
def test_a_store_that_hangs_or_fails_costs_only_what_it_has(serve, store, monkeypatch, hangs) -> None:
    """More requests than may wait for the store are answered, too."""
    never = threading.Event()

    def size():
        if hangs:
            never.wait()
        raise StoreError("the store does not answer")

    monkeypatch.setattr(store, "size", size)
    monkeypatch.setattr(live, "LIMITS", replace(LIMITS, store_timeout=0.05))
    _, client = serve()
    for _ in range(6):
        answer = client.get("/metrics")
        assert answer.status_code == 200
        assert "\nsprung_store_writable 0.0\n" in answer.text
        assert "\nsprung_frames_total 5.0\n" in answer.text
    assert client.get("/health").status_code == 200
    never.set()


@pytest.mark.parametrize(
    ("fields", "status"), [({}, 200), ({"web": {"behind_proxy": True}}, 503), ({"http": "192.0.2.1:8737"}, 503)]
)
def test_a_store_that_hangs_keeps_figures_from_other_machines_only(serve, store, monkeypatch, fields, status) -> None:
    never = threading.Event()

    def hang(*_args, **_fields):
        never.wait()

    for name in ("n_accounts", "of_session", "of_token"):
        monkeypatch.setattr(store.accounts, name, hang)
    monkeypatch.setattr(live, "LIMITS", replace(LIMITS, store_timeout=0.05))
    _, client = serve(**fields)
    answer = client.get("/metrics", headers={"Authorization": "Bearer sprung_x"})
    assert answer.status_code == status
    never.set()


@pytest.mark.slow
def test_other_machines_need_a_token_for_figures(serve, people, store) -> None:
    _, local = serve()
    assert local.get("/metrics").status_code == 200
    _, secret = add_token(store, "prometheus", "viewer", days=None, who="test", now=NOW)
    for fields in ({"web": {"behind_proxy": True}}, {"http": "192.0.2.1:8737"}):
        _, client = serve(**fields)
        assert client.get("/metrics").status_code == 401
        assert client.get("/metrics", headers={"Authorization": f"Bearer {secret}"}).status_code == 200


@pytest.mark.slow
def test_health(serve, monkeypatch) -> None:
    context, client = serve()
    healthy = client.get("/health")
    assert (healthy.status_code, healthy.json()) == (200, {"healthy": True, "problems": []})
    monkeypatch.setitem(context.__dict__, "problems", lambda: ["the store cannot write"])
    ill = client.get("/health")
    assert (ill.status_code, ill.json()) == (503, {"healthy": False, "problems": ["the store cannot write"]})


def test_an_address_in_use_is_refused(store) -> None:
    def server(port):
        return Server(Context(store, Site(http=f"127.0.0.1:{port}"), figures=dict, problems=list))

    first = server(0)
    assert first.address == ("127.0.0.1", 0)
    first.open()
    port = first.address[1]
    second = server(port)
    with pytest.raises(ParameterError, match=rf"cannot listen at 127.0.0.1:{port} .*: give another --http"):
        second.open()
    second.close()
    first.close()
    again = server(port)
    again.open()
    again.close()


def test_every_figure_is_documented() -> None:
    text = (Path(__file__).parents[3] / "docs" / "monitor.md").read_text(encoding="utf-8")
    assert [name for name in FIGURES if f"| `{name}" not in text] == []
