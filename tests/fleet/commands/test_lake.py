"""Lakes from the command line: recordings in, the same recordings out."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from sprung.diagnosis import windows
from sprung.fleet.jobs.recordings import export_windows
from sprung.fleet.lake import Lake, recording_of, window_of_recording
from sprung.formats import read, write
from sprung.link.archive import write_archive
from sprung.recording import Channel, Gap, Recording

START = 1_767_225_600 * 10**9 + 250_000_000  # 2026-01-01
MINUTE = 60 * 10**9
CHANNELS = (Channel("acc_fl", "acceleration"), Channel("pitch_rate", "angular_velocity"), Channel("speed", "speed"))


def drive(seed, *, minutes=2.0, start: int | None = START, gaps=()):
    samples = np.random.default_rng(seed).integers(-2000, 2000, (3, round(6000 * minutes))).astype(np.float64) * 0.01
    return Recording(samples, 100.0, CHANNELS, start, gaps)


@pytest.fixture
def runs(tmp_path):
    """Function of a path below the folder of the test and a recording that writes it there."""

    def put(name, recording) -> Path:
        path = tmp_path / name
        path.parent.mkdir(exist_ok=True)
        write(recording, path)
        return path

    return put


def imported(sprung, *words):
    return sprung("fleet", "import", *words, "--window", 1, "--json", "-")


@pytest.mark.slow
def test_files_become_the_windows_that_diagnose_uses(sprung, runs, tmp_path) -> None:
    gap = (Gap(7000, 12.5),)
    files = [runs("car-a/1.parquet", drive(1)), runs("car-a/2.csv", drive(2, minutes=3.6, start=START + 5 * MINUTE))]
    files.append(runs("car-b/1.npz", drive(3, gaps=gap)))
    lake = tmp_path / "lake"
    document = imported(sprung, *files, "--lake", lake).document()
    entries = {own["vehicle"]: (own["files"], own["added"], own["known"]) for own in document["vehicles"]}
    assert entries == {"car-a": (2, 6, 0), "car-b": (1, 2, 0)}
    for vehicle, paths in (("car-a", files[:2]), ("car-b", files[2:])):
        kept = [recording_of(each.row) for each in Lake(lake).windows(vehicle=vehicle)]
        kept.sort(key=lambda recording: recording.start or 0)
        expected = [part for _, part in windows(map(read, paths), length=60.0)]
        assert [part.start for part in kept] == [part.start for part in expected]
        assert [part.channels for part in kept] == [part.channels for part in expected]
        for part, other in zip(kept, expected, strict=True):
            np.testing.assert_allclose(part.samples, other.samples, rtol=1e-12)
            assert [(each.index, round(each.duration, 6)) for each in part.gaps] == [
                (each.index, round(each.duration, 6)) for each in other.gaps
            ]
    again = imported(sprung, *files, "--lake", lake).document()
    assert [(own["added"], own["known"]) for own in again["vehicles"]] == [(0, 6), (0, 2)]


def test_a_bad_file_leaves_the_others(sprung, runs, tmp_path) -> None:
    good, bad = runs("car/1.csv", drive(1)), tmp_path / "car" / "2.csv"
    bad.write_text("nothing\nof use\n")
    outcome = sprung("fleet", "import", bad, good, tmp_path / "missing.csv", "--lake", tmp_path / "lake")
    assert outcome.code == 0
    assert all(str(path) in outcome.out.replace("\n  ", "") for path in (bad, tmp_path / "missing.csv"))
    outcome = sprung("fleet", "import", bad, "--lake", tmp_path / "other", "--json", tmp_path / "import.json")
    assert outcome.code == 2
    assert "no file could be imported" in outcome.err
    document = json.loads((tmp_path / "import.json").read_text())
    assert [entry["file"] for entry in document["bad_files"]] == [str(bad)]


def test_files_without_start_follow_each_other(sprung, runs, tmp_path) -> None:
    files = [
        runs("a/1.csv", drive(1, start=None, gaps=(Gap(500, 30.0),))),
        runs("a/2.csv", drive(2, start=None)),
        runs("b/1.csv", drive(3, start=None)),
    ]
    outcome = imported(sprung, *files, "--lake", tmp_path / "lake")
    assert outcome.code == 2
    assert "has no start time: state that of the first sample with --start TIME" in outcome.err
    assert imported(sprung, *files, "--lake", tmp_path / "lake", "--start", "2026-01-02T08:00+01:00").code == 0
    begin = 1_767_337_200 * 10**9
    starts = {
        name: sorted(w.row["start"] - begin for w in Lake(tmp_path / "lake").windows(vehicle=name)) for name in "ab"
    }
    second = round(2.5 * MINUTE)
    assert starts == {"a": [0, round(1.5 * MINUTE), second, second + MINUTE], "b": [0, MINUTE]}


def test_files_of_the_archive_state_their_vehicle(sprung, tmp_path) -> None:
    run = drive(5, gaps=(Gap(300, 2.5),))
    path = write_archive(
        tmp_path / "raw",
        "tram-7",
        1,
        4,
        START,
        samples=run.samples,
        channels=run.names,
        sampling_rate=100.0,
        gaps=[(300, 2.5)],
        quantities=[channel.quantity for channel in run.channels],
    )
    lake = tmp_path / "lake"
    assert imported(sprung, path, "--lake", lake).document()["vehicles"][0]["vehicle"] == "tram-7"
    first, second = sorted(Lake(lake).windows(), key=lambda window: window.row["start"])
    kept = recording_of(first.row)
    assert (kept.start, kept.gaps, kept.channels) == (START, run.gaps, CHANNELS)
    assert second.row["start"] == START + MINUTE + 2_500_000_000
    np.testing.assert_allclose(kept.samples, run.samples[:, :6000], atol=1e-3)
    named = imported(sprung, path, "--lake", lake, "--vehicle-id", "tram-8", "--channels", "acc_fl").document()
    assert named["vehicles"] == [{"vehicle": "tram-8", "files": 1, "added": 2, "known": 0}]
    refused = imported(sprung, path, "--lake", lake, "--from", "1")
    assert "is read whole: leave out --from and --to" in refused.err


def test_windows_come_out_as_they_went_in(sprung, runs, tmp_path) -> None:
    """With noise that is not in steps, and a rate that no step of nanoseconds gives exactly."""
    noise = replace(
        drive(1, gaps=(Gap(7000, 12.5),)),
        samples=np.random.default_rng(2).normal(size=(3, 12000)),
        sampling_rate=128.3,
    )
    lake, out = tmp_path / "lake", tmp_path / "out"
    imported(sprung, runs("car/1.parquet", noise), runs("van/1.parquet", drive(2)), "--lake", lake)
    words = ("fleet", "archive", lake, "--export", out, "--vehicle-id", "car", "--json", "-")
    paths = [Path(path) for path in sprung(*words).document()["exported"]]
    kept = sorted(Lake(lake).windows(vehicle="car"), key=lambda window: window.row["start"])
    assert paths == sorted(out.rglob("*.parquet"))
    for path, window in zip(paths, kept, strict=True):
        recording, expected = read(path), recording_of(window.row)
        np.testing.assert_array_equal(recording.samples, expected.samples)
        assert (recording.start, recording.channels) == (expected.start, expected.channels)
        assert recording.sampling_rate == pytest.approx(expected.sampling_rate, rel=1e-10)
        durations = {each.index: pytest.approx(each.duration, abs=1e-8) for each in expected.gaps}
        assert {each.index: each.duration for each in recording.gaps} == durations
    (facts,) = sprung("info", paths[0], "--json", "-").document()["files"]
    assert (facts["start"], facts["n_gaps"]) == (kept[0].row["start"], 1)
    assert facts["gap_duration"] == pytest.approx(12.5)
    assert imported(sprung, *paths, "--lake", lake).document()["vehicles"][0]["added"] == 0
    since = sprung("fleet", "archive", lake, "--export", tmp_path / "new", "--since", "2026-01-02")
    assert since.code == 2
    assert "contains no window in that period" in since.err


@pytest.mark.slow
def test_facts_compaction_and_retention(sprung, runs, tmp_path) -> None:
    lake = tmp_path / "lake"
    days = [runs(f"car/{k}.parquet", drive(k, start=START + k * 720 * MINUTE)) for k in range(4)]
    for path in days:
        imported(sprung, path, "--lake", lake)
    document = sprung("fleet", "archive", lake, "--compact", "--json", "-").document()
    assert (document["windows"], document["files"], document["compacted"]) == (8, 2, 2)
    assert (document["first"], document["last"]) == ("2026-01-01", "2026-01-02")
    last = START + 3 * 720 * MINUTE + MINUTE
    assert document["vehicles"] == [{"vehicle": "car", "windows": 8, "first": START, "last": last}]
    shown = sprung("fleet", "archive", lake, "--keep-days", "1").out
    assert "0 windows of 0 vehicles" in shown
    assert "deleted 8 windows" in shown


def test_what_is_no_lake_is_refused(sprung, tmp_path) -> None:
    outcome = sprung("fleet", "archive", tmp_path)
    assert outcome.code == 3
    assert "holds no table: give the folder of a lake" in outcome.err
    outcome = sprung("fleet", "archive", tmp_path, "--since", "2026-01-01")
    assert "add --export DIR" in outcome.err
    damaged = tmp_path / "lake" / "_delta_log"
    damaged.mkdir(parents=True)
    (damaged / f"{0:020}.json").write_text("{")
    outcome = sprung("fleet", "archive", tmp_path / "lake")
    assert (outcome.code, "cannot be read" in outcome.err) == (3, True)


@pytest.mark.parametrize(("vehicle", "folder"), [("..", "%2E%2E"), ("a/../b", "a%2F..%2Fb"), ("Bus 7", "Bus 7")])
def test_names_of_vehicles_stay_in_the_folder(tmp_path, vehicle, folder) -> None:
    (path,) = export_windows([window_of_recording(vehicle, drive(1, minutes=0.1))], tmp_path / "out")
    assert path.parent == tmp_path / "out" / folder
    assert path.is_file()
