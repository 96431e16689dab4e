"""The rows of a window are what the functions behind the commands make of it."""

import json
import threading
import time
from concurrent.futures import ThreadPoolExecutor
from contextlib import closing

import numpy as np
import pyarrow as pa
import pytest

from sprung.diagnosis import observe_window
from sprung.diagnosis.observation import fit_drive
from sprung.fleet.jobs.analysis import Analyst, Task, WindowSettings, Work, analyse, failed, rows_of
from sprung.fleet.jobs.results import OF_STEP, SCHEMAS, Results
from sprung.fleet.jobs.spark import filesystem
from sprung.fleet.lake import Lake, recording_of
from sprung.identification import cov_ssi
from sprung.results.documents import (
    corners_document,
    identification_document,
    observation_document,
    restored_statistics,
)


def plain(document):
    return json.loads(json.dumps(document))


class TestAnalysis:
    @pytest.mark.slow
    def test_rows_are_the_documents_of_the_commands(self, window, car, car_text):
        row = window("car1", 0).row
        recording = recording_of(row)
        rows, seconds = analyse(row, Work(car_text, "abc", has_segments=True), WindowSettings())
        modes = cov_ssi(recording, vehicle=car)
        assert json.loads(rows["identifications"]["document"]) == identification_document(modes, vehicle=car).as_json()
        assert json.loads(rows["corners"]["document"]) == corners_document(fit_drive(recording, car)).as_json()
        observed = observe_window(recording, car, time=row["start"] / 1e9)
        assert json.loads(rows["windows"]["document"]) == plain(observation_document(observed))
        kept, computed = restored_statistics(rows["windows"]["residuals"]), observed.residuals
        assert kept is not None
        assert computed is not None
        np.testing.assert_array_equal(kept.segments, computed.segments)
        assert rows["windows"]["is_valid"]
        assert [mode["label"] for mode in rows["identifications"]["modes"]] == list(modes.modes.labels)
        assert set(seconds) == set(OF_STEP.values())
        for table, own in rows.items():
            assert own["reason"] == ""
            assert own["vehicle_file"] == "abc"
            pa.Table.from_pylist([own], schema=SCHEMAS[table])

    def test_statistics_of_segments_are_kept_for_learning_only(self, window, car_text):
        rows, _ = analyse(window("car1", 0).row, Work(car_text, steps=["observe"]), WindowSettings())
        assert rows["windows"]["residuals"]["segments"] is None
        assert rows["windows"]["residuals"]["mean"]

    @pytest.mark.parametrize(
        ("change", "work", "reason"),
        [
            ({"samples": b"x"}, {}, "a row of the lake cannot be read"),
            ({}, {"reason": "no vehicle file"}, "no vehicle file"),
            ({}, {"vehicle_text": "schema = 1"}, "the vehicle file"),
            ({"channels": None}, {}, "a row of the lake cannot be read"),
        ],
    )
    def test_a_window_that_cannot_be_analysed_is_a_row_with_its_reason(self, window, car_text, change, work, reason):
        row = {**window("car1", 0).row, **change}
        rows, _ = analyse(row, Work(**{"vehicle_text": car_text, **work}), WindowSettings())
        assert all(reason in own["reason"] for own in rows.values())
        assert set(rows) == set(OF_STEP.values())
        for table, own in rows.items():
            pa.Table.from_pylist([own], schema=SCHEMAS[table])

    def test_an_unexpected_error_is_a_reason(self, window, car_text):
        rows, _ = analyse(window("car1", 0).row, Work(car_text, steps=["identify"]), WindowSettings(method="none"))
        assert "KeyError" in rows["identifications"]["reason"]


class TestTasks:
    @pytest.fixture
    def lake(self, tmp_path, window):
        lake = Lake(tmp_path / "lake")
        lake.write(window("car1", number) for number in range(3))
        return lake

    def items(self, lake, car_text, steps=("observe",)):
        (file,) = lake.files()
        rows = lake.table.rows(["date", "vehicle", "start", "digest", "duration"]).to_pylist()
        common = {"path": lake.table.uri(file), "vehicle_text": car_text, "vehicle_file": "f", "reason": ""}
        return [
            {**row, **common, "row": number, "steps": list(steps), "has_segments": True}
            for number, row in enumerate(rows)
        ]

    def task(self, tmp_path, **settings):
        results = Results(tmp_path / "results")
        return results, Task({name: results[name].location for name in OF_STEP.values()}, WindowSettings(**settings))

    def test_files_hold_the_results_and_are_in_no_table_before_their_commit(self, tmp_path, lake, car_text):
        results, task = self.task(tmp_path)
        (batch,) = task.analysed(iter([pa.RecordBatch.from_pylist(self.items(lake, car_text))]))
        (report,) = batch.to_pylist()
        assert (report["table"], report["n_rows"], report["date"]) == ("windows", 3, "2026-01-01")
        assert results["windows"].rows().num_rows == 0
        system, place = filesystem(f"{results['windows'].location}/{report['path']}")
        assert system.get_file_info(place).size == report["n_bytes"]

    def test_rows_are_found_by_their_place(self, lake, car_text):
        items = self.items(lake, car_text)
        found = {item["start"]: row for item, row in rows_of([items[2], items[0]])}
        assert {start: row and row["start"] for start, row in found.items()} == {
            items[0]["start"]: items[0]["start"],
            items[2]["start"]: items[2]["start"],
        }

    def test_a_file_that_cannot_be_read_or_holds_another_window_has_no_rows(self, tmp_path, lake, car_text):
        items = self.items(lake, car_text)
        damaged = tmp_path / "damaged.parquet"
        damaged.write_bytes(b"PAR1" + bytes(100))
        places = [{**items[0], "path": str(damaged)}, {**items[1], "path": "/nowhere"}, {**items[2], "digest": "other"}]
        assert [row for _, row in rows_of(places)] == [None, None, None]

    def test_an_unreadable_file_is_tried_again_before_it_is_a_reason(self, tmp_path, lake, car_text):
        _, task = self.task(tmp_path)
        items = [{**self.items(lake, car_text)[0], "path": "/nowhere"}]
        with pytest.raises(OSError, match="/nowhere cannot be read"):
            list(task.analysed(iter([pa.RecordBatch.from_pylist(items)])))

    def test_a_window_that_takes_too_long_is_a_row_with_its_reason(self, window, car_text):
        work = {"vehicle_text": car_text, "vehicle_file": "", "reason": "", "steps": ["observe"], "has_segments": False}
        with closing(Analyst(is_apart=False)) as analyst:
            rows, _ = analyst({**work}, window("car1", 0).row, WindowSettings(seconds=0.02))
        assert "took longer than" in rows["windows"]["reason"]

    @pytest.mark.slow
    def test_a_window_that_ends_its_process_is_a_row_with_its_reason(self, window, car_text):
        work = {"vehicle_text": car_text, "vehicle_file": "", "reason": "", "steps": ["observe"], "has_segments": False}
        with closing(Analyst(is_apart=True)) as analyst, ThreadPoolExecutor(1) as pool:
            pool.submit(kill_processes_of, analyst)
            rows, _ = analyst(work, window("car1", 0).row, WindowSettings())
            assert "the process that analysed the window ended unexpectedly" in rows["windows"]["reason"]
            rows, _ = analyst(work, window("car1", 1).row, WindowSettings())
        assert rows["windows"]["reason"] == ""

    def test_rows_of_failures_fit_their_tables(self, window):
        for table, row in failed(window("car1", 0).row, Work(""), "a reason").items():
            assert pa.Table.from_pylist([row], schema=SCHEMAS[table]).num_rows == 1


def kill_processes_of(analyst):
    """Kill the process of an analysis once there is one."""
    end = time.monotonic() + 60
    while time.monotonic() < end:
        processes = analyst.processes
        if processes:
            processes[0].kill()
            return
        threading.Event().wait(0.005)
