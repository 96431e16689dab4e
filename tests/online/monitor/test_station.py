"""From frames to the store: each once, in order, whatever the order they come in."""

import time
import zlib
from functools import partial
from pathlib import Path

import cbor2
import numpy as np
import pytest

from sprung.link import checked_map, message, topic
from sprung.online.alerts import AlertSettings
from sprung.online.monitor.alert_book import AlertBook

pytestmark = pytest.mark.slow

#: 2026-11-21, UTC ns.
BEGUN = 1_795_219_200_000_000_000

WATCH = {"watch": {"learning_windows": 2, "window_minutes": 10, "identify_every_minutes": 5}}


def contents(store, vehicle="car-1"):
    """What the store holds of a vehicle in the end, whatever boots it came in."""
    return {
        "observations": [(entry.t0, entry.document) for entry in store.results.observations(vehicle)],
        "modes": [(entry.t0, entry.document) for entry in store.results.modes(vehicle)],
        "findings": [(entry.t0, entry.document) for entry in store.results.findings(vehicle)],
        "baselines": [(row.version, row.reason, row.document) for row in store.results.baselines(vehicle)],
    }


@pytest.fixture(scope="module")
def run_frames(drive, frames_of):
    """Half an hour: two windows that teach, and one with a soft spring."""
    runs = [drive(0), drive(1), drive(2, "front_left.spring=-0.3")]
    return [payload for k, run in enumerate(runs) for payload in frames_of(run, first=600 * k)]


@pytest.fixture(scope="module")
def expected(run_frames, car, drive, tmp_path_factory: pytest.TempPathFactory, new_bench):
    bench = new_bench(tmp_path_factory.mktemp("in-order"), car, drive(0), **WATCH)
    bench.describe()
    bench.send(run_frames)
    found = contents(bench.store)
    alerts = [(row.cause, row.is_active) for row in bench.store.alerts.find(vehicle="car-1")]
    bench.close()
    assert alerts == [("front_left.spring", True)]
    return found


def test_a_run_is_stored(expected) -> None:
    assert len(expected["observations"]) == 3
    assert len(expected["modes"]) == 6
    assert len(expected["baselines"]) == 1
    ((t0, finding),) = expected["findings"]
    assert t0 == BEGUN + 1200 * 10**9
    assert (finding["corner"], finding["component"]) == ("front_left", "spring")


@pytest.mark.parametrize("seed", [0, 1, 2, 3])
def test_any_order_with_duplicates_gives_the_same_store(bench, alike, run_frames, expected, seed) -> None:
    generator = np.random.default_rng(seed)
    one = bench(**WATCH)
    order = generator.permutation(np.concatenate([np.arange(len(run_frames)), generator.integers(0, 1800, 600)]))
    if seed:
        one.describe()
    for part in np.array_split(order, 7):
        one.send([run_frames[k] for k in part])
    one.describe()
    if not seed:  # beyond the quota of a vehicle without a description, none is acknowledged: its box sends it again
        one.send([run_frames[k] for k in order])
    one.work()
    assert alike(contents(one.store), expected)
    assert one.store.inbox.boots("car-1") == []


def test_a_restart_anywhere_gives_the_same_store(bench, alike, run_frames, expected, tmp_path: Path) -> None:
    first = bench(tmp_path, **WATCH)
    first.describe()
    first.send(run_frames[:700])
    first.close()
    second = bench(tmp_path, **WATCH)
    second.send(run_frames[650:1300])
    second.close()
    third = bench(tmp_path, **WATCH)
    third.send(run_frames[1200:])
    assert alike(contents(third.store), expected)


def test_a_restarted_box_goes_on_in_the_same_window(bench, alike, drive, frames_of, expected) -> None:
    runs = [drive(0), drive(1), drive(2, "front_left.spring=-0.3")]
    whole = [payload for run in runs for payload in frames_of(run)]
    first = [payload for run in runs[:1] for payload in frames_of(run)] + frames_of(runs[1], first=600)[:250]
    rest = [decoded_again(payload, boot=2, seq=k, previous=(1, 850)) for k, payload in enumerate(whole[850:])]
    one = bench(**WATCH)
    one.describe()
    one.send(rest[100:])
    one.send(rest[:100])
    assert contents(one.store)["observations"] == []
    one.send(first)
    assert alike(contents(one.store), expected)


def decoded_again(payload, **changes):
    """A frame with other keys."""
    document = checked_map(payload) | {{"boot": 2, "seq": 3, "previous": 15}[k]: v for k, v in changes.items()}
    body = cbor2.dumps({key: list(v) if isinstance(v, tuple) else v for key, v in document.items()})
    return body + zlib.crc32(body).to_bytes(4, "little")


def test_learning_again_is_asked_for_in_the_store(bench, run_frames) -> None:
    one = bench(**WATCH)
    one.describe()
    one.send(run_frames[:1200])
    one.store.requests.add_command("anna", "car-1", "learn", "new springs", now=BEGUN)
    one.look()
    one.work()
    assert one.store.requests.open_commands() == []
    assert one.station.statuses["car-1"][1:3] == (0, 2)


def test_silence_is_an_alert_unless_the_vehicle_is_parked(bench, run_frames) -> None:
    one = bench(**WATCH)
    one.describe()
    one.send(run_frames[:3])
    one.now += 2 * 3600 * 10**9
    one.look()
    (row,) = one.store.alerts.find(vehicle="car-1")
    assert (row.cause, row.is_active) == ("silent", True)
    one.send(run_frames[3:4])
    one.look()
    assert not one.store.alerts.find(vehicle="car-1")[0].is_active
    one.link.on_message(topic("car-1", "state"), message({0: 1, 2: 1, "boots": [], "is_leaving": True}))
    one.work()
    one.now += 10 * 3600 * 10**9
    one.look()
    assert not one.store.alerts.find(vehicle="car-1")[0].is_active


def test_a_monitor_that_stopped_unexpectedly_says_so(bench, tmp_path: Path) -> None:
    first = bench(tmp_path)
    first.store.requests.audit("monitor", "started", "monitor", now=BEGUN)
    first.store.reservation.release()  # as the end of a process does
    second = bench(tmp_path)
    (row,) = second.store.alerts.find(vehicle="monitor")
    assert "stopped unexpectedly" in row.text


def test_a_monitor_that_cannot_read_the_store_as_it_takes_over_tries_again(bench, monkeypatch) -> None:
    """It once worked on without a connection to the broker."""
    from sprung.online.monitor.dispatch import Dispatch
    from sprung.online.store import StoreError
    from sprung.online.store.database import Reservation

    takes = iter([False, True, True])
    follow, failures = Dispatch.follow, [StoreError("the store does not answer")]
    opened, released = [], []
    monkeypatch.setattr(Reservation, "take", lambda _self, _monitor: next(takes))
    monkeypatch.setattr(Reservation, "release", lambda self: released.extend([self]))
    monkeypatch.setattr(Dispatch, "follow", lambda self: fail(failures.pop()) if failures else follow(self))
    one = bench()
    monkeypatch.setattr(one.link, "open", lambda **_: opened.append(one.seconds))
    for one.seconds in (1.0, 2.1, 3.0, 4.2):
        one.station.step()
    assert opened == [4.2]
    assert released == [one.store.reservation]
    assert one.station.figures()["sprung_active"] == 1.0


def fail(error):
    raise error


def test_vehicles_take_turns(bench, run_frames, monkeypatch: pytest.MonkeyPatch) -> None:
    one = bench(**WATCH)
    workers, served = one.workers, list[str]()
    monkeypatch.setattr(type(workers), "is_busy", property(lambda self: bool(self.done)))
    monkeypatch.setattr(workers, "submit", partial(noted, workers.submit, served))
    vehicles = ["car-1", "car-2", "car-3"]
    for vehicle in vehicles:
        one.describe(vehicle)
    for payload in run_frames[:6]:
        for vehicle in vehicles:
            one.link.on_message(topic(vehicle, "raw"), message(checked_map(payload) | {1: vehicle}))
        one.station.step()
    assert served == 2 * vehicles


def noted(submit, served, vehicle, frames, *, learn=""):
    """Remember whose turn it was."""
    served.append(vehicle)
    submit(vehicle, frames, learn=learn)


def test_a_box_that_identifies_itself(bench, car, drive, tmp_path: Path) -> None:
    """Modes and correlations arrive in line with requested samples, which are analysed as ever."""
    from sprung.link import Spool, decode, topic
    from sprung.link.summaries import summary_from_document
    from sprung.online.box import blocks_of
    from sprung.online.box.onboard import OnBoard

    ring = Spool(tmp_path / "ring", is_synced=False)
    on_board = OnBoard(car, ring)
    messages = [found for block in blocks_of(drive(0), length=5.0) for found in on_board.take(block)]
    assert [kind for kind, _ in messages] == ["corr", "modes"]
    assert summary_from_document(messages[0][1]["summary"]).average.channels == drive(0).names[:4]
    one = bench(tmp_path / "store", **WATCH)
    one.describe()
    for seq, (kind, document) in enumerate(messages):
        whole = {0: 1, 1: "car-1", 2: 1, 3: seq, 16: kind, **document}
        one.link.on_message(topic("car-1", kind), message(whole))
    one.work()
    (entry,) = one.store.results.modes("car-1")
    assert entry.document == {"modes": messages[1][1]["modes"], "reason": "", "is_on_board": True}
    assert len(list((tmp_path / "store" / "correlations").rglob("*.parquet"))) == 1
    assert one.store.results.observations("car-1") == []
    assert decode(frames_after(drive(0), seq=2)[0]).seq == 2
    one.send(frames_after(drive(0), seq=2))
    assert len(one.store.results.observations("car-1")) == 1


def frames_after(recording, *, seq):
    """Frames of a recording from a sequence number on, as maps from a ring become."""
    from sprung.link import Frame, encode, quantised
    from sprung.online.box import blocks_of

    found = []
    for number, block in enumerate(blocks_of(recording, length=5.0), start=seq):
        assert block.start is not None, "a frame has a time"
        counts, scale, flags = quantised(block.samples)
        interval = round(1e9 / block.sampling_rate)
        found.append(encode(Frame("car-1", 1, number, block.start, interval, block.names, scale, counts, 2, flags)))
    return found


def test_room_on_the_boxes_disks_is_a_figure(bench) -> None:
    one = bench(**WATCH)
    for vehicle, free in (("car-1", 5e9), ("car-2", 3e9), ("car-3", "much")):
        one.link.on_message(topic(vehicle, "health"), message({"free": free}))
    one.work()
    assert one.station.figures()["sprung_boxes_free_bytes"] == 3e9
    assert one.station.figures()["sprung_messages_refused_total"] == 1


def test_a_box_of_another_version_is_named_which_to_speak(bench, run_frames) -> None:
    one = bench(**WATCH)
    document = checked_map(run_frames[0]) | {0: 2}
    for _ in range(3):
        one.link.on_message(topic("car-1", "raw"), message(document))
    one.work()
    (wish,) = [checked_map(payload) for name, payload in one.link.published if name == topic("car-1", "cmd")]
    assert (wish["do"], wish["versions"]) == ("speak", [1])
    assert one.station.figures()["sprung_messages_refused_total"] == 3


def test_modes_from_a_box_amid_samples_lose_none_of_them(bench, run_frames, expected, tmp_path: Path, alike) -> None:
    """A report in the middle of a window, and a restart of the monitor after it."""
    report = {0: 1, 1: "car-1", 2: 1, 3: 250, 4: BEGUN, 16: "modes", "number": 900, "modes": [], "reason": "none"}
    rest = [decoded_again(payload, boot=1, seq=251 + k) for k, payload in enumerate(run_frames[250:])]
    one = bench(tmp_path, **WATCH)
    one.describe()
    one.send(run_frames[:250])
    one.link.on_message(topic("car-1", "modes"), message(report))
    one.work()
    assert one.store.inbox.boots("car-1") == []
    one.close()
    again = bench(tmp_path, **WATCH)
    again.send(rest)
    found = contents(again.store)
    found["modes"] = [entry for entry in found["modes"] if "is_on_board" not in entry[1]]
    assert alike(found, expected)


def test_mail_that_is_not_delivered_is_a_problem_at_once(bench) -> None:
    mail = {"host": "127.0.0.1", "port": 1, "sender": "a@example.org", "recipients": ["b@example.org"]}
    one = bench(send={"mail": [mail]})
    assert one.station.problems() == []
    AlertBook(one.store, AlertSettings()).report("car-1", "silent", "car-1 has sent nothing", now=one.now)
    end = time.monotonic() + 30.0
    while not one.station.problems() and time.monotonic() < end:
        time.sleep(0.05)
    (problem,) = one.station.problems()
    assert problem.startswith("alerts are not delivered by mail 1: mail server 127.0.0.1:1 cannot be reached (")
    assert "undelivered" in [row.what for row in one.store.alerts.history(1)]
