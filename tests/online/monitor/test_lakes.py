"""Windows of a monitor reach the lake of its site; what fails is an alert, and is tried again."""

import time
from dataclasses import replace

import numpy as np
import pytest

from sprung.fleet.lake import Lake, recording_of
from sprung.online.monitor import Site, ledger
from sprung.online.monitor.alert_book import Context
from sprung.online.monitor.ledger import LakeWriter
from sprung.recording import Channel, Recording

BEGUN = 1_795_219_200 * 10**9
DAY = 86400 * 10**9


def run(k):
    samples = np.random.default_rng(k).normal(size=(1, 200))
    return Recording(samples, 100.0, (Channel("a"),), BEGUN + k * 10**9)


class Clock:
    """A clock and a timer that are set by hand."""

    def __init__(self) -> None:
        self.seconds = 0.0

    def time(self) -> int:
        return BEGUN + round(1e9 * self.seconds)


@pytest.fixture
def clock():
    return Clock()


@pytest.fixture
def writer(tmp_path, clock, store):
    site = Site.model_validate({"store": f"sqlite:///{tmp_path}/store.sqlite", "keep": {"lake_days": 30.0}})
    return LakeWriter(Context(site, store, clock.time, lambda: clock.seconds), str(tmp_path / "lake"))


def written(tmp_path):
    return Lake(tmp_path / "lake").facts.n_windows


def test_windows_are_written_every_ten_minutes(writer, clock, tmp_path) -> None:
    for seconds, n_written in ((0.0, 0), (599.0, 0), (600.0, 1)):
        if not seconds:
            writer.step()
            writer.keep("car", run(1))
        clock.seconds = seconds
        writer.step()
        assert written(tmp_path) == n_written
    assert writer.figures == {
        "sprung_lake_windows_total": 1,
        "sprung_lake_windows_waiting": 0,
        "sprung_lake_failures_total": 0,
    }


def test_many_windows_do_not_wait(writer, tmp_path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(ledger, "_MANY", 4)
    for k in range(4):
        writer.step()
        assert written(tmp_path) == 0
        writer.keep("car", run(k))
    writer.step()
    assert written(tmp_path) == 4


def test_a_failure_is_tried_again_after_ten_minutes(writer, clock, tmp_path) -> None:
    (tmp_path / "lake").write_text("in the way")
    clock.seconds = 3600.0
    writer.keep("car", run(1))
    writer.step()
    assert "windows are not written to the lake: " in writer.problem
    assert writer.figures["sprung_lake_windows_waiting"] == 1
    n_failures = writer.figures["sprung_lake_failures_total"]
    writer.step()
    assert writer.figures["sprung_lake_failures_total"] == n_failures
    (tmp_path / "lake").unlink()
    clock.seconds += 86400.0
    writer.step()
    assert (writer.problem, written(tmp_path)) == ("", 1)


def test_a_window_that_the_disk_does_not_take_is_an_alert_until_the_next_one(writer, tmp_path) -> None:
    (tmp_path / "outbox").write_text("in the way")
    writer.keep("car", run(1))
    assert "outbox" in writer.problem
    (tmp_path / "outbox").unlink()
    writer.keep("car", replace(run(2), start=None))
    assert "no start time" in writer.problem
    writer.keep("car", run(2))
    assert writer.problem == ""


def test_old_dates_go_and_small_files_become_large_ones_once_a_day(writer, clock, tmp_path) -> None:
    for k in range(3):
        writer.keep("car", run(k))
        clock.seconds += 700.0
        writer.step()
    lake = Lake(tmp_path / "lake")
    assert lake.facts.n_files == 3
    clock.seconds += 86400.0
    writer.step()
    assert (lake.facts.n_files, lake.facts.n_windows) == (1, 3)
    clock.seconds += 31 * 86400.0
    writer.step()
    assert lake.facts.n_windows == 0


def test_windows_stay_in_a_lake_as_long_as_results() -> None:
    keep = Site.model_validate({"keep": {"lake": "x", "results_days": 3.0}}).keep
    assert keep.days_in_lake == 3.0
    assert keep.model_copy(update={"lake_days": 1.0}).days_in_lake == 1.0


def test_a_monitor_writes_its_windows(bench, drive, frames_of, tmp_path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(ledger, "_LOOK", 0.01)
    watch = {"learning_windows": 2, "window_minutes": 2, "identify_every_minutes": 0, "calibrate": False}
    one = bench(tmp_path, watch=watch, keep={"lake": str(tmp_path / "lake"), "raw_days": 0})
    one.describe()
    one.send(frames_of(drive(0))[:121])
    assert one.station.figures()["sprung_lake_windows_waiting"] == 1
    one.seconds += 601.0
    end = time.monotonic() + 60.0
    while not one.station.figures()["sprung_lake_windows_total"] and time.monotonic() < end:
        time.sleep(0.01)
    one.close()
    (window,) = Lake(tmp_path / "lake").windows()
    assert window.vehicle == "car-1"
    kept, sent = recording_of(window.row), drive(0)
    rate = sent.sampling_rate
    assert (kept.start, kept.n_samples, kept.names) == (BEGUN, round(120 * rate), sent.names)
    assert [channel.quantity for channel in kept.channels] != ["unknown"] * len(kept.channels)
    deviation = (kept.samples - sent.samples[:, : kept.n_samples]).std(axis=1)
    assert np.all(deviation < 2e-3 * sent.samples.std(axis=1))
    assert window.row["source"] == "monitor Site"


def test_problem_with_the_lake_is_an_alert(bench, tmp_path, monkeypatch: pytest.MonkeyPatch) -> None:
    one = bench(tmp_path, keep={"lake": str(tmp_path / "lake")})
    for problem in ("windows are not written to the lake: full", ""):
        monkeypatch.setattr(LakeWriter, "problem", problem)
        one.look(61.0)
        texts = {row.cause: row.text for row in one.store.alerts.find(is_active=True)}
        assert texts.get("monitor:lake", "") == problem
