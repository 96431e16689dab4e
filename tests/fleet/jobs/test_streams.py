"""Streams give the tables that the analysis of their windows gives, also after an interruption."""

import threading

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from tests.fleet.jobs.test_assessment import assessed, outlined

from sprung.errors import DataError, ParameterError
from sprung.fleet.jobs import FleetSettings, Results
from sprung.fleet.jobs.analysis import WindowSettings, Work, analyse
from sprung.fleet.jobs.assessment import AssessmentSettings
from sprung.fleet.jobs.plan import described
from sprung.fleet.lake import Lake, recording_of, window_of_recording
from sprung.fleet.streams import messages_in_folder, messages_in_kafka, windows_of_lake, windows_of_messages
from sprung.fleet.streams.batches import StreamBatch, StreamSettings, stream
from sprung.link import Frame, decode, encode, frame_block, joined

pytestmark = pytest.mark.slow
CAR, DURATION = "car000", 120.0
ASSESSMENT = AssessmentSettings(learning_windows=2)
SETTINGS = StreamSettings(FleetSettings(steps=("baseline", "diagnose"), assessment=ASSESSMENT), is_once=True)


def frames_of(windows):
    """Return the samples of windows as frames of 10 s."""
    frames: list[bytes] = []
    for window in windows:
        recording = recording_of(window.row)
        scale = np.array([channel["scale"] for channel in window.row["channels"]])
        for first in range(0, recording.n_samples, 1000):
            part = recording.part(first, first + 1000)
            frame = Frame(
                vehicle=CAR,
                boot=0,
                seq=len(frames),
                start=part.start or 0,
                interval=round(1e9 / part.sampling_rate),
                channels=tuple(channel.name for channel in part.channels),
                scale=scale,
                counts=np.rint(part.samples / scale[:, None]).astype(np.int64),
            )
            frames.append(encode(frame))
    return frames


def put(folder, name, frames):
    folder.mkdir(exist_ok=True)
    table = pa.table({"key": [CAR] * len(frames), "value": pa.array(frames, pa.binary())})
    pq.write_table(table, folder / f".{name}")
    (folder / f".{name}").rename(folder / name)


@pytest.fixture(scope="module")
def frames(window):
    return frames_of(window(CAR, number) for number in range(3))


@pytest.fixture(scope="module")
def windows(frames):
    parts = [frames[first : first + 12] for first in range(0, 36, 12)]
    recordings = [joined([frame_block(decode(payload), {}) for payload in part]) for part in parts]
    return [window_of_recording(CAR, recording, source="frames") for recording in recordings]


@pytest.fixture(scope="module")
def vehicles(car_text, tmp_path_factory):
    folder = tmp_path_factory.mktemp("vehicles")
    for name in (CAR, "car001"):
        (folder / f"{name}.toml").write_text(car_text)
    return folder


def rows_of(results, table):
    return sorted(results[table].rows().to_pylist(), key=lambda row: (row["vehicle"], row.get("start", 0)))


def test_an_interrupted_stream_continues_and_each_window_counts_once(
    *, spark, frames, windows, vehicles, car_text, tmp_path, monkeypatch
):
    folder, checkpoint, results = tmp_path / "frames", tmp_path / "checkpoint", Results(tmp_path / "results")
    shuffled = [frames[k] for k in np.random.default_rng(3).permutation(len(frames))]

    def take():
        batches: list[StreamBatch] = []
        source = windows_of_messages(messages_in_folder(spark, folder), duration=DURATION)
        stream(spark, source, vehicles, results, checkpoint, settings=SETTINGS, report=batches.append)
        return batches

    put(folder, "1.parquet", shuffled[:25])
    (first,) = take()
    put(folder, "2.parquet", [b"damaged", *shuffled[20:], *shuffled[:5]])
    with monkeypatch.context() as patch:
        patch.setattr("sprung.fleet.jobs.assessing.assess_vehicles", lambda *_, **__: 1 / 0)
        with pytest.raises(DataError, match="division by zero"):
            take()
    assert results["windows"].rows().num_rows == 3
    assert not results["diagnoses"].exists
    (repeated,) = take()
    assert (first.number, first.n_refused, repeated.number, repeated.n_refused) == (0, 0, 1, 1)
    assert (repeated.n_windows, repeated.n_vehicles) == ({}, 1)

    vehicle = described(CAR, car_text)
    work = Work(car_text, vehicle["vehicle_file"], steps=("observe",), has_segments=True)
    rows = [analyse(window.row, work, WindowSettings())[0]["windows"] for window in windows]
    assert [row["document"] for row in rows_of(results, "windows")] == [row["document"] for row in rows]
    stated = {name: text for name, text in vehicle.items() if name != "reason"} | {"state": ""}
    own, _ = outlined(stated, rows, ASSESSMENT)
    (diagnosis,) = rows_of(results, "diagnoses")
    assert diagnosis["document"] == assessed(stated, rows, ASSESSMENT, by_type=True)["document"]
    assert [row["document"] for row in rows_of(results, "baselines")] == [own["document"]]


def test_windows_of_a_lake_that_have_results_are_left_alone(spark, windows, window, vehicles, tmp_path):
    lake, results = Lake(tmp_path / "lake"), Results(tmp_path / "results")
    settings = StreamSettings(FleetSettings(steps=("identify",)), is_once=True)
    batches: list[StreamBatch] = []

    def take(checkpoint):
        stream(
            spark, windows_of_lake(spark, lake), vehicles, results, checkpoint, settings=settings, report=batches.append
        )

    lake.write([windows[0]])
    lake.write([window("car001", 0)])
    take(tmp_path / "checkpoint")
    lake.compact()
    take(tmp_path / "checkpoint")
    take(tmp_path / "another")
    assert [(batch.number, batch.n_windows) for batch in batches] == [(0, {"identifications": 2}), (1, {}), (0, {})]
    rows = rows_of(results, "identifications")
    assert [(row["vehicle"], row["digest"]) for row in rows] == [
        (CAR, windows[0].row["digest"]),
        ("car001", window("car001", 0).row["digest"]),
    ]
    assert all(row["modes"] for row in rows)


def test_a_stream_ends_when_it_shall(spark, windows, vehicles, tmp_path):
    lake, results, stopping = Lake(tmp_path / "lake"), Results(tmp_path / "results"), threading.Event()
    lake.write([windows[0]])
    stopping.set()
    settings = StreamSettings(FleetSettings(steps=("identify",)), every=3600)
    stream(spark, windows_of_lake(spark, lake), vehicles, results, tmp_path / "c", settings=settings, stopping=stopping)
    assert not results["identifications"].exists


def test_places_and_sources_that_do_not_exist_are_refused(spark, windows, vehicles, tmp_path):
    with pytest.raises(DataError, match="holds no table"):
        windows_of_lake(spark, Lake(tmp_path / "none"))
    with pytest.raises(ParameterError, match="spark-sql-kafka"):
        messages_in_kafka(spark, "127.0.0.1:9", "frames")
    with pytest.raises(ParameterError, match="every"):
        StreamSettings(every=0)
    lake = Lake(tmp_path / "lake")
    lake.write([windows[0]])
    with pytest.raises(ParameterError, match="no vehicle files"):
        stream(
            spark,
            windows_of_lake(spark, lake),
            tmp_path / "nothing",
            Results(tmp_path / "results"),
            tmp_path / "checkpoint",
            settings=SETTINGS,
        )
