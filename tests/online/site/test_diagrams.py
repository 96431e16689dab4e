"""Diagrams of a window: computed one at a time in a process of their own, kept, refused where samples are gone."""

import json
import sys
import time

import pytest
from tests.online.site.conftest import NOW

from sprung.link.archive import write_archive
from sprung.online.monitor import Site
from sprung.online.site.vehicles.diagrams import BusyError, DiagramDesk

MODE = {
    "natural_frequency": 1.4,
    "natural_frequency_std": 0.05,
    "damping_ratio": 0.2,
    "damping_ratio_std": None,
    "label": "bounce",
    "stable_rate": 0.6,
}
LINE = {
    "kind": "constant",
    "frequency": 7.3,
    "band": [7.2, 7.4],
    "prominence": 21.0,
    "channels": ["acc_fl"],
    "order": 2,
}
OWN = {name: value for name, value in MODE.items() if name not in {"label", "stable_rate"}}
VALUES = {
    "spectra": {
        "frequencies": [0.0, 0.5],
        "segment_length": 25.0,
        "n_segments": 46,
        "channels": [{"channel": "acc_<fl>", "unit": "m/s^2", "density": [0.1, None], "edited": None}],
    },
    "fit": {
        "frequencies": [0.5],
        "n_segments": 90,
        "model_error": 0.031,
        "coordinates": [
            {"coordinate": "bounce", "unit": "(m/s²)²/Hz", "measured": [0.1], "fitted": [0.1], "misfit": [0.0]}
        ],
    },
    "stabilisation": {
        "rung": "model order",
        "band": [0.4, 18.0],
        "poles": [
            {"natural_frequency": [1.4], "damping_ratio": [0.2], "rung": [4], "status": ["selected"]},
        ],
        "statuses": {"selected": "part of a mode"},
    },
    "identification": {"modes": [MODE], "harmonics": [LINE], "notes": ["band 0.4 to 18 Hz"]},
    "levels": {
        "subsets": [{"level": [0.5, 0.9], "n_segments": 18}, {"level": [0.9, 1.4], "n_segments": 16}],
        "modes": [MODE | {"subsets": [OWN, None]}],
        "notes": ["no dependence on the level detected"],
    },
    "notes": [],
}
PICTURES = {name: f"<svg><title>{name}</title></svg>" for name in ("spectra", "fit", "stabilisation", "levels")}


def program(body):
    """A program that has read the request and does something else than computing."""
    return (sys.executable, "-c", f"import json, sys, time\nrequest = json.load(sys.stdin)\n{body}")


GIVES = program(f"sys.stdout.write({json.dumps({'values': VALUES, 'pictures': PICTURES})!r})")
#: Waits for the file that the request names, and gives no values.
WAITS = program(
    "from pathlib import Path\nwhile not Path(request['file']).exists():\n    time.sleep(0.01)\n"
    "print(json.dumps({'error': request['file']}))"
)


def taken(desk, request, **options):
    """What a desk gives in the end."""
    for _ in range(3000):
        try:
            return desk.take(request, **options)
        except BusyError:
            options = {}
            time.sleep(0.01)
    raise AssertionError("the desk is always busy")


def computed(client, address, *, busy):
    """The answer at an address when it is no longer busy."""
    for _ in range(3000):
        answer = client.get(address)
        if not busy(answer):
            return answer
        time.sleep(0.01)
    raise AssertionError(f"{address} is always busy")


def test_a_result_is_kept(tmp_path) -> None:
    desk = DiagramDesk(command=GIVES)
    with pytest.raises(BusyError, match="are being computed from the samples: try again in 5 s"):
        desk.take({"window": 1})
    computed = taken(desk, {"window": 1})
    assert (computed.values, computed.pictures, computed.error) == (VALUES, PICTURES, None)
    assert desk.take({"window": 1}) is computed


def test_one_at_a_time(tmp_path) -> None:
    desk = DiagramDesk(command=WAITS)
    first, second = ({"file": str(tmp_path / name)} for name in ("first", "second"))
    for _ in range(2):
        with pytest.raises(BusyError, match="the diagrams are being computed"):
            desk.take(first)
    with pytest.raises(BusyError, match="diagrams of another window are being computed"):
        desk.take(second)
    (tmp_path / "first").touch()
    assert taken(desk, first).error.endswith("first")
    (tmp_path / "second").touch()
    assert taken(desk, second).error.endswith("second")


@pytest.mark.parametrize(
    ("command", "limit", "words"),
    [
        (program("sys.exit(3)"), 60.0, "their process failed (exit code 3)"),
        (program("print('{\"neither\": 1}')"), 60.0, "their process failed (exit code 0)"),
        (program("time.sleep(60)"), 0.2, "they took longer than 0.2 s"),
    ],
)
def test_a_program_that_fails_or_hangs(command, limit, words) -> None:
    desk = DiagramDesk(command=command, limit=limit)
    computed = taken(desk, {"window": 1})
    assert (computed.values, computed.error) == ({}, words)
    assert desk.take({"window": 1}) is computed
    assert taken(desk, {"window": 1}, again=True) is not computed


def test_only_the_last_results_are_kept() -> None:
    desk = DiagramDesk(command=GIVES)
    first = taken(desk, {"window": 0})
    for number in range(1, 9):
        taken(desk, {"window": number})
    assert taken(desk, {"window": 0}) is not first


def test_a_server_that_stops_ends_the_program(tmp_path) -> None:
    desk = DiagramDesk(command=WAITS)
    request = {"file": str(tmp_path / "never")}
    with pytest.raises(BusyError):
        desk.take(request)
    desk.close()
    assert taken(desk, request).error in {"the server is stopping", "their process failed (exit code -9)"}


@pytest.fixture
def site(tmp_path):
    return Site(store=f"sqlite:///{tmp_path}/store.sqlite")


@pytest.fixture
def served(serve, site):
    """A client of a server whose program gives the values above."""
    return serve(figures={}, diagrams=DiagramDesk(command=GIVES), store=site.store)[1]


def archive(site, number=0, t0=NOW):
    return write_archive(
        site.archive, "bus-1", 1, number, t0, samples=[[0.0, 1.0]], channels=["acc_fl"], sampling_rate=100.0
    )


def test_samples_that_are_not_kept(served, store) -> None:
    client = served
    page = client.get("/vehicles/bus-1/windows/1/0/diagrams", headers={"accept": "text/html"})
    assert page.status_code == 200
    assert "for 2 days (keep.raw_days) and up to 20 GB" in page.text
    assert "Compute again" not in page.text
    assert "raw_days = 8" in client.get("/vehicles/bus-1/diagrams").text
    assert "The first one needs 10 minutes of driving" in client.get("/vehicles/bus-3/diagrams").text
    for path in ("diagrams", "figures/spectra"):
        answer = client.get(f"/api/v1/vehicles/bus-1/windows/1/0/{path}")
        assert (answer.status_code, answer.json()["detail"][:11]) == (404, "The samples")
    assert client.get("/api/v1/vehicles/bus-1/windows/1/77/diagrams").status_code == 404


def test_diagrams_that_failed_can_be_computed_again(serve, site) -> None:
    archive(site)
    desk = DiagramDesk(command=(sys.executable, "-c", "raise SystemExit(3)"))
    _, client = serve(diagrams=desk, store=site.store)
    page = computed(client, "/vehicles/bus-1/windows/1/0/diagrams", busy=lambda answer: "data-busy" in answer.text)
    assert "exit code 3" in page.text
    assert "/vehicles/bus-1/windows/1/0/diagrams?again=true" in page.text


def test_a_site_that_keeps_no_samples(store, serve) -> None:
    _, client = serve(keep={"raw_days": 0})
    assert "this monitor keeps none" in client.get("/vehicles/bus-1/diagrams").text
    answer = client.get("/api/v1/vehicles/bus-1/windows/1/0/diagrams")
    assert (answer.status_code, "set keep.raw_days" in answer.json()["detail"]) == (404, True)


def test_the_last_window_with_samples_is_shown(served, site) -> None:
    client = served
    archive(site)
    archive(site, number=2, t0=NOW + 2 * 600 * 10**9)
    answer = client.get("/vehicles/bus-1/diagrams", follow_redirects=False)
    assert (answer.status_code, answer.headers["location"]) == (303, "/vehicles/bus-1/windows/1/2/diagrams")


def test_page_and_interface_show_the_same_diagrams(served, site) -> None:
    client = served
    archive(site)
    address = "/api/v1/vehicles/bus-1/windows/1/0"
    answer = client.get(f"{address}/diagrams")
    assert (answer.status_code, answer.headers["retry-after"]) == (503, "5")
    page = client.get("/vehicles/bus-1/windows/1/0/diagrams")
    assert page.status_code == 200
    given = computed(client, f"{address}/diagrams", busy=lambda answer: answer.status_code == 503).json()
    assert (given["vehicle"], given["boot"], given["number"], given["t0"]) == ("bus-1", 1, 0, NOW)
    for name in ("fit", "stabilisation", "identification", "levels"):
        assert given[name] == VALUES[name]
    text = client.get("/vehicles/bus-1/windows/1/0/diagrams").text
    assert "<h1>One mode and one line of the excitation in the window of " in text
    assert "1.40 (1.30 to 1.50)" in text
    assert "model error is 3.1 %" in text
    assert "data-busy" not in text
    for name, picture in PICTURES.items():
        assert f'src="{address}/figures/{name}"' in text
        shown = client.get(f"{address}/figures/{name}")
        assert shown.headers["content-encoding"] == "gzip"
        plain = client.get(f"{address}/figures/{name}", headers={"accept-encoding": "identity"})
        assert (plain.text, "content-encoding" in plain.headers) == (shown.text, False)
        assert (shown.headers["content-type"], shown.text) == ("image/svg+xml", picture)
    assert client.get(f"{address}/figures/other").status_code == 422
