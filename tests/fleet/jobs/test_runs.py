"""Runs on Spark: results are a function of windows and vehicle files, however they arrive."""

import json
from types import SimpleNamespace

import pytest

from sprung.errors import DataError, ParameterError
from sprung.fleet.jobs import FleetSettings, Results, assessing, explain, run, summarise
from sprung.fleet.jobs.analysis import WindowSettings, Work, analyse
from sprung.fleet.jobs.assessment import AssessmentSettings
from sprung.fleet.jobs.results import SCHEMAS
from sprung.fleet.lake import Lake, LakeWindow, recording_of

pytestmark = pytest.mark.slow

FAULT = "rear_left.damper=-0.5"
SETTINGS = FleetSettings(
    steps=("baseline", "diagnose"), assessment=AssessmentSettings(learning_windows=3), windows_in_task=4
)


@pytest.fixture(scope="module")
def fleet(tmp_path_factory, window, car_text):
    """Three vehicles with six windows, the first of which changes; one without a file, one with a bad one."""
    folder = tmp_path_factory.mktemp("fleet")
    (folder / "vehicles").mkdir()
    for number in range(3):
        (folder / "vehicles" / f"car{number}.toml").write_text(car_text)
    (folder / "vehicles" / "car8.toml").write_text("schema = 'sprung.vehicle/1'\n")
    windows = [window(f"car{v}", k, FAULT if v == 0 and k >= 3 else None) for v in range(3) for k in range(6)]
    windows += [window("car8", 0), window("car9", 0)]
    damaged = dict(window("car2", 6).row)
    windows.append(LakeWindow("car2", {**damaged, "samples": damaged["samples"][:-5], "digest": "damaged"}))
    return SimpleNamespace(folder=folder, vehicles=folder / "vehicles", windows=windows)


@pytest.fixture(scope="module")
def whole(spark, fleet):
    """A run over all windows at once."""
    lake, results = Lake(fleet.folder / "lake"), Results(fleet.folder / "results")
    lake.write(fleet.windows)
    plan, cost = explain(spark, lake, fleet.vehicles, results, settings=SETTINGS)
    done = run(spark, lake, fleet.vehicles, results, settings=SETTINGS)
    return SimpleNamespace(lake=lake, results=results, plan=plan, cost=cost, done=done)


def test_a_plan_counts_windows_and_measures_their_cost(whole):
    assert (whole.plan.n_windows, whole.plan.n_new, whole.plan.n_vehicles) == (21, {"observe": 21}, 5)
    assert whole.plan.n_without_file == 2
    assert whole.cost.seconds["observe"] > 0


def test_every_window_is_analysed_as_one_alone(whole, fleet, car_text):
    rows = {(row["vehicle"], row["start"]): row for row in whole.results["windows"].rows().to_pylist()}
    assert len(rows) == len(fleet.windows)
    for made in fleet.windows[4:10:5]:
        alone, _ = analyse(made.row, Work(car_text, steps=["observe"]), WindowSettings())
        assert rows[made.vehicle, made.row["start"]]["document"] == alone["windows"]["document"]


def test_the_changed_vehicle_is_found(spark, whole):
    rows = {row["vehicle"]: row for row in whole.results["diagnoses"].rows().to_pylist()}
    assert {name: row["verdict"] for name, row in rows.items() if row["is_discovery"]} == {"car0": "change"}
    assert all(row["verdict"] != "change" for name, row in rows.items() if name != "car0")
    (finding,) = whole.results["findings"].rows().to_pylist()
    assert (finding["vehicle"], finding["corner"], finding["component"]) == ("car0", "rear_left", "damper")
    assert finding["lower"] < -0.5 < finding["upper"]
    summary = summarise(spark, whole.results)
    assert (summary.windows["windows"], summary.failed["windows"], summary.n_discoveries) == (21, 3, 1)
    assert sum(summary.verdicts.values()) == 5


def test_bad_windows_and_vehicles_are_rows_with_reasons(whole):
    reasons = {row["vehicle"]: row["reason"] for row in whole.results["diagnoses"].rows().to_pylist()}
    assert reasons["car9"] == "the vehicle has no vehicle file: add one"
    assert reasons["car8"].startswith("car8.toml")
    (damaged,) = [row for row in whole.results["windows"].rows().to_pylist() if row["digest"] == "damaged"]
    assert damaged["reason"].startswith("a row of the lake cannot be read")
    assert damaged["document"] is None


def test_running_again_changes_nothing(spark, whole, fleet):
    before = {name: whole.results[name].version for name in SCHEMAS}
    again = run(spark, whole.lake, fleet.vehicles, whole.results, settings=SETTINGS)
    assert (again.n_windows, again.n_vehicles) == ({}, 0)
    assert {name: whole.results[name].version for name in SCHEMAS} == before


def test_late_and_repeated_windows_lead_to_the_same_tables(*, spark, tables, whole, fleet, monkeypatch, tmp_path):
    """A last window of a vehicle leads to a diagnosis, for which no window of a baseline is read again.

    What a vehicle that joins shows of the scatter of its type leads to diagnoses of the others.
    """

    def refuse(*_, **__):
        raise AssertionError("learnt again")

    lake, results = Lake(tmp_path / "lake"), Results(tmp_path / "results")
    last = fleet.windows[11]
    late = [
        made
        for number, made in enumerate(fleet.windows)
        if made.vehicle == "car2" or (made.vehicle == "car1" and number % 3 == 1)
    ]
    lake.write(made for made in fleet.windows if made not in late and made is not last)
    first = run(spark, lake, fleet.vehicles, results, settings=SETTINGS)
    lake.write(late)
    lake.table.append(lake.table.rows().slice(0, 5))  # stored twice
    lake.compact()
    second = run(spark, lake, fleet.vehicles, results, settings=SETTINGS)
    assert first.n_windows["windows"] + second.n_windows["windows"] == len(fleet.windows) - 1
    lake.write([last])
    monkeypatch.setattr(assessing, "learnt", refuse)
    monkeypatch.setattr(assessing, "type_of", refuse)
    third = run(spark, lake, fleet.vehicles, results, settings=SETTINGS)
    assert (third.n_windows, third.n_vehicles) == ({"windows": 1}, 1)
    assert tables(results) == tables(whole.results)
    assert all(len(results[name].files()) <= 1 for name in SCHEMAS if name not in {"runs"})


def test_a_corrected_vehicle_file_is_taken_in(spark, whole, fleet, car_text, tmp_path):
    vehicles, results = tmp_path / "vehicles", Results(tmp_path / "results")
    vehicles.mkdir()
    lake = Lake(tmp_path / "lake")
    lake.write(made for made in fleet.windows if made.vehicle in {"car8", "car9"})
    assert run(spark, lake, fleet.vehicles, results, settings=SETTINGS).n_vehicles == 2
    for name in ("car8", "car9"):
        (vehicles / f"{name}.toml").write_text(car_text)
    assert run(spark, lake, vehicles, results, settings=SETTINGS).n_vehicles == 2
    rows = results["diagnoses"].rows(["n_valid", "reason"]).to_pylist()
    assert [row["n_valid"] for row in rows] == [1, 1]


def test_a_table_names_the_files_of_vehicles(spark, whole, fleet, car_text, tmp_path):
    (tmp_path / "files").mkdir()
    (tmp_path / "files" / "one.toml").write_text(car_text)
    table = tmp_path / "vehicles.csv"
    table.write_text("vehicle,file\ncar0,files/one.toml\ncar1,files/none.toml\n")
    plan, _ = explain(spark, whole.lake, table, Results(tmp_path / "results"), settings=SETTINGS)
    assert plan.n_without_file == 21 - 6
    table.write_text("name,file\n")
    with pytest.raises(ParameterError, match="lacks the column 'vehicle'"):
        explain(spark, whole.lake, table, Results(tmp_path / "results"), settings=SETTINGS)


def test_a_period_limits_the_windows(spark, whole, fleet, tmp_path):
    starts = sorted({made.row["start"] for made in fleet.windows})
    settings = FleetSettings(steps=("identify",), since=starts[1], until=starts[1], windows_in_task=2)
    results = Results(tmp_path / "results")
    assert run(spark, whole.lake, fleet.vehicles, results, settings=settings).n_windows == {"identifications": 3}
    rows = results["identifications"].rows().to_pylist()
    assert {row["start"] for row in rows} == {starts[1]}
    assert all("bounce" in {mode["label"] for mode in json.loads(row["document"])["modes"]} for row in rows)
    assert recording_of(fleet.windows[0].row).n_samples == 12000


def test_places_without_a_lake_or_vehicles_are_refused(spark, fleet, whole, tmp_path):
    with pytest.raises(DataError, match="holds no table"):
        run(spark, Lake(tmp_path / "none"), fleet.vehicles, Results(tmp_path / "results"))
    with pytest.raises(ParameterError, match="has no vehicle files"):
        run(spark, whole.lake, tmp_path / "none", Results(tmp_path / "results"))


def test_unknown_steps_are_refused():
    with pytest.raises(ParameterError, match="guess"):
        FleetSettings(steps=("guess",))
