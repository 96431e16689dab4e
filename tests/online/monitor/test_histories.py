"""What is left of a vehicle in the store when its state is lost, from frames to the next window."""

import pytest

from sprung.online.monitor.engine import write_state
from sprung.online.monitor.histories import history_of
from sprung.online.store import Progress, StoredFrame, open_store

NOW = 1_795_219_200_000_000_000
WATCH = {"watch": {"learning_windows": 2, "window_minutes": 2, "identify_every_minutes": 0, "calibrate": False}}


@pytest.fixture
def store(sqlite_url):
    with open_store(sqlite_url) as opened:
        opened.inbox.add_frames([StoredFrame("car-1", 1, 0, NOW, b"")], now=NOW)
        yield opened


def commit(store, times, **fields):
    entries = tuple((number, NOW, {"time": time}) for number, time in enumerate(times))
    store.results.commit(Progress("car-1", 1, done_seq=0, observations=entries, **fields))


def test_a_new_vehicle_has_none(store) -> None:
    store.results.commit(Progress("car-1", 1, done_seq=-1, modes=((0, NOW, {}), (1, NOW, {}))))
    history = history_of(store, "car-1", max_windows=9)
    assert (history.baseline, history.observations, history.n_windows, history.n_identified) == (None, (), 0, 0)


def test_windows_since_the_baseline_are_kept_and_numbers_continue(store) -> None:
    baselines = tuple((version, NOW, "", {"learning_times": [0.0, float(version)]}) for version in (1, 2))
    commit(store, [0.0, 1.0, 2.0, 3.0, 4.0, 5.0], baselines=baselines, modes=((7, NOW, {}),))
    history = history_of(store, "car-1", max_windows=2)
    assert history.baseline == {"learning_times": [0.0, 2.0]}
    assert [document["time"] for document in history.observations] == [4.0, 5.0]
    assert (history.n_windows, history.n_identified, history.relearning) == (6, 8, "")
    assert len(history_of(store, "car-1", max_windows=9).observations) == 3


def test_a_learning_under_way_keeps_its_reason(store) -> None:
    commit(store, [0.0], baselines=((1, NOW, "", {"learning_times": [0.0]}),), status={"is_learning": True})
    assert history_of(store, "car-1", max_windows=9).relearning == "maintenance"
    for vehicle, reason in (("car-1", "new dampers"), ("car-2", "new springs")):
        store.requests.add_command("anna", vehicle, "learn", reason, now=NOW)
    assert history_of(store, "car-1", max_windows=9).relearning == "new dampers"


@pytest.mark.slow
@pytest.mark.parametrize("document", [b"damaged", write_state({"schema": "sprung.vehicle-monitor/2", "more": 1}), b""])
def test_a_state_that_cannot_be_used_costs_no_frame_and_no_baseline(
    bench, drive, frames_of, tmp_path, document
) -> None:
    """Also while a request to learn is pending: the frames that were stored before are analysed with the next ones."""
    frames = frames_of(drive(0))
    one = bench(tmp_path, **WATCH)
    one.describe()
    one.send(frames[:400])
    learnt = one.store.results.baselines("car-1")
    assert len(learnt) == 1
    one.close()
    with open_store(f"sqlite:///{tmp_path}/store.sqlite") as opened:
        opened.results.commit(Progress("car-1", 1, done_seq=359, snapshot=document))
    again = bench(tmp_path, **WATCH)
    again.send(frames[400:])
    rows = again.store.results.observations("car-1")
    assert [(row.number, row.t0) for row in rows] == [(number, NOW + number * 120 * 10**9) for number in range(5)]
    assert again.store.results.baselines("car-1") == learnt
    assert not again.station.statuses["car-1"].is_learning
    (kept,) = again.store.quarantine.find("car-1")
    assert (kept.kind, kept.seq, kept.payload) == ("state", 359, document)
    (alert,) = again.store.alerts.find(vehicle="car-1")
    assert (alert.cause, alert.is_active) == ("monitor:state", False)
    assert again.station.figures()["sprung_failures_total"] == 1
