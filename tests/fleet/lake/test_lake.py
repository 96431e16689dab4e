"""Lakes give back the samples that were written, once each, and stay whole."""

from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from sprung.errors import DataError
from sprung.fleet.lake import AddedFile, Lake, Table, file_name, recording_of, window_of_recording
from sprung.fleet.lake.windows import MAX_ROUNDING, packed, quantised, unpacked, values_of
from sprung.recording import Channel, Gap, Recording

START = 1_767_225_600 * 10**9  # 2026-01-01
DAY = 86_400 * 10**9


def drive(seed=0, *, start=START, step=None, n_samples=3000):
    rng = np.random.default_rng(seed)
    samples = rng.normal(size=(3, n_samples)) * np.array([[2.0], [0.1], [5.0]])
    samples[2] += 15.0
    if step is not None:
        samples = np.rint(samples / step) * step
    channels = (
        Channel("acc_fl", "acceleration", (1.0, 0.7, 0.0), (0.0, 0.0, 1.0)),
        Channel("pitch_rate", "angular_velocity"),
        Channel("speed", "speed"),
    )
    return Recording(samples, 100.0, channels, start, (Gap(1200, 2.5),))


class TestPacking:
    @pytest.mark.parametrize("kind", [np.int16, np.int32])
    def test_integers_come_back_over_the_whole_range(self, kind):
        limits = np.iinfo(kind)
        counts = np.random.default_rng(1).integers(limits.min, limits.max, size=(3, 500), dtype=kind, endpoint=True)
        counts[:, :2] = limits.min, limits.max
        np.testing.assert_array_equal(unpacked(packed(counts), n_channels=3, n_samples=500), counts)

    def test_other_samples_are_rounded_well_below_their_scatter(self):
        samples = drive().samples
        error = values_of(*quantised(samples)) - samples
        assert np.all(error.std(axis=1) < MAX_ROUNDING * samples.std(axis=1))

    def test_a_spike_asks_for_four_bytes(self):
        samples = np.array(drive().samples)
        samples[0, 7] = 1e4
        counts, scale = quantised(samples)
        assert counts.dtype == np.int32
        assert np.std(values_of(counts, scale) - samples, axis=1)[0] < 1e-5

    def test_missing_dead_and_empty_channels_come_back(self):
        samples = np.array(drive().samples)
        samples[0, 3:9] = np.nan
        samples[1] = 0.25
        samples[2] = np.nan
        np.testing.assert_allclose(values_of(*quantised(samples)), samples, rtol=1e-2, atol=1e-3)
        assert np.isnan(values_of(*quantised(samples))[2]).all()

    def test_bytes_that_do_not_fit_are_refused(self):
        with pytest.raises(ValueError, match="11 bytes are not 2 channels of 3 samples"):
            unpacked(b"x" * 11, n_channels=2, n_samples=3)


class TestWindows:
    def test_a_recording_comes_back_with_channels_gaps_and_time(self):
        recording = drive(step=0.001)
        back = recording_of(window_of_recording("car", recording).row)
        np.testing.assert_allclose(back.samples, recording.samples, rtol=1e-13)
        assert (back.channels, back.gaps, back.start) == (recording.channels, recording.gaps, recording.start)

    def test_digests_differ_with_samples_time_and_vehicle_only(self):
        first = window_of_recording("car", drive(), source="a.csv").row["digest"]
        assert window_of_recording("car", drive(), source="b.csv").row["digest"] == first
        others = [
            window_of_recording("van", drive()),
            window_of_recording("car", drive(1)),
            window_of_recording("car", drive(start=START + 1)),
        ]
        assert len({first, *(window.row["digest"] for window in others)}) == 4

    def test_conditions_are_means(self):
        conditions = dict(window_of_recording("car", drive()).row["conditions"])
        assert conditions == {"speed": pytest.approx(drive().samples[2].mean())}

    def test_a_window_without_time_is_refused(self):
        with pytest.raises(DataError, match="no start time"):
            window_of_recording("car", drive(start=None))


class TestLake:
    def test_windows_are_added_once(self, tmp_path):
        lake = Lake(tmp_path / "lake")
        windows = [window_of_recording(f"car{k % 2}", drive(k, start=START + k * DAY // 2)) for k in range(4)]
        assert lake.write(windows[:3]) == 3
        assert lake.write(windows) == 1
        assert lake.write([*windows, *windows]) == 0
        assert (lake.facts.n_windows, lake.facts.first, lake.facts.last) == (4, "2026-01-01", "2026-01-02")

    def test_a_batch_counts_once_from_the_first_on(self, tmp_path):
        table = Table(tmp_path / "table", pa.schema([("name", pa.string())]))
        table.create()
        assert table.last_batch("stream") == -1
        for number in (0, 0, 1, 0, 1):
            path = Path(table.location) / file_name({})
            pq.write_table(pa.table({"name": [f"batch {number}"]}), path)
            table.commit([AddedFile(path.name, path.stat().st_size, 1)], application=("stream", number))
        assert sorted(table.rows()["name"].to_pylist()) == ["batch 0", "batch 1"]
        assert (table.last_batch("stream"), table.last_batch("another")) == (1, -1)

    def test_compaction_keeps_the_rows_by_vehicle(self, tmp_path):
        lake = Lake(tmp_path / "lake")
        for k in range(6):
            lake.write([window_of_recording(f"car{k % 3}", drive(k, start=START + k * 60 * 10**9))])
        before = {row["digest"]: row for row in lake.table.rows().to_pylist()}
        assert lake.facts.n_files == 6
        assert lake.compact(max_bytes=lake.facts.n_bytes - 1) == 0
        assert lake.compact(max_bytes=lake.facts.n_bytes) == 1
        assert lake.compact() == 0
        rows = lake.table.rows().to_pylist()
        assert lake.facts.n_files == 1
        assert {row["digest"]: row for row in rows} == before
        assert [row["vehicle"] for row in rows] == sorted(row["vehicle"] for row in rows)

    def test_files_of_a_period_are_those_of_its_dates(self, tmp_path):
        lake = Lake(tmp_path / "lake")
        lake.write(window_of_recording("car", drive(k, start=START + k * DAY)) for k in range(3))
        days = [str(file.partition["date"]) for file in lake.files(since=START + DAY, until=START + 2 * DAY - 1)]
        assert days == ["2026-01-02"]
        assert len(lake.files()) == 3

    def test_old_dates_are_deleted_from_the_disk(self, tmp_path):
        lake = Lake(tmp_path / "lake")
        lake.write(window_of_recording("car", drive(k, start=START + k * DAY)) for k in range(3))
        lake.prune(before=START + 2 * DAY + 1, hours=0)
        assert (lake.facts.n_windows, lake.facts.first) == (1, "2026-01-03")
        assert len(list((tmp_path / "lake").rglob("*.parquet"))) == 1

    def test_compaction_names_a_damaged_file_and_loses_nothing(self, tmp_path):
        lake = Lake(tmp_path)
        for k in range(3):
            lake.write([window_of_recording("car-1", drive(k, start=START + k * 600 * 10**9))])
        file = tmp_path / lake.files()[0].path
        whole = file.read_bytes()
        file.write_bytes(b"damaged")
        with pytest.raises(DataError, match=f"{tmp_path} cannot be compacted: "):
            lake.compact()
        file.write_bytes(whole)
        assert lake.compact() == 1
        assert lake.facts.n_windows == 3
