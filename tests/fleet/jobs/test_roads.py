"""Roads of a fleet on Spark: the means are those of the same drives averaged here."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from sprung.errors import DataError
from sprung.excitation import surface
from sprung.fleet.jobs import Results
from sprung.fleet.jobs.roads import RoadSettings, survey_fleet
from sprung.fleet.lake import Lake, recording_of, window_of_recording
from sprung.recording import Channel, Recording
from sprung.road import Ways, averaged, survey_road, track_of
from sprung.simulation import RoadDrive, simulate_drive
from sprung.vehicles.window import window_of

pytestmark = pytest.mark.slow

START = 1_767_225_600 * 10**9  # 2026-01-01
HOUR = 3600 * 10**9
EARTH = 6_371_000.0


@pytest.fixture(scope="module")
def drives(car):
    """Three drives over one road of 3 km by two vehicles, the second in two windows; and one without places."""
    generator = np.random.default_rng(2)
    road = surface.random_profile(surface.road_class("B"), first=-400.0, last=3000.0, generator=generator)
    made = {}
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(surface, "random_profile", lambda *_, **__: road)
        for number, vehicle in enumerate(("car-a", "car-b", "car-b", "car-a")):
            settings = RoadDrive(
                duration=80.0, sampling_rate=100.0, speed=(12.0 + 2 * number, 15.0 + 2 * number), snr=50.0
            )
            recording = simulate_drive(car, settings, seed=number).recording
            made[vehicle, number] = replace(recording, start=START + number * HOUR, history=())
    for (vehicle, number), recording in made.items():
        if number < 3:
            at = track_of([window_of(recording, car)]).distances
            places = np.degrees(np.array([0.85 + 0.8 * at / EARTH, 0.2 + 0.9 * at / EARTH]))
            channels = (*recording.channels, Channel("latitude"), Channel("longitude"))
            whole = replace(recording, samples=np.vstack([recording.samples, places]), channels=channels)
            made[vehicle, number] = whole
    return made


@pytest.fixture(scope="module")
def fleet(tmp_path_factory, drives, car_text):
    folder = tmp_path_factory.mktemp("roads")
    (folder / "vehicles").mkdir()
    for vehicle in ("car-a", "car-b"):
        (folder / "vehicles" / f"{vehicle}.toml").write_text(car_text)
    windows = []
    for (vehicle, number), recording in drives.items():
        middle = recording.n_samples // 2
        parts = [recording.part(0, middle), recording.part(middle, recording.n_samples)] if number == 1 else [recording]
        windows += [window_of_recording(vehicle, part) for part in parts]
    windows.append(window_of_recording("car-c", drives["car-a", 0]))
    lake = Lake(folder / "lake")
    lake.write(windows[::-1])
    return SimpleNamespace(
        lake=lake, vehicles=folder / "vehicles", results=Results(folder / "results"), windows=windows
    )


@pytest.fixture(scope="module")
def survey(spark, fleet):
    return survey_fleet(spark, fleet.lake, fleet.vehicles, fleet.results)


def test_passes_are_averaged_as_on_one_machine(survey, fleet, car):
    own: dict[tuple[int, str], list[Recording]] = {}
    for window in fleet.windows[:4]:
        own.setdefault((window.row["start"] // HOUR, window.vehicle), []).append(recording_of(window.row))
    ways = Ways(stretch=100.0)
    for drive in own.values():
        ways.add(track_of([window_of(each, car) for each in drive]))
    surveys = [survey_road(drive, car, ways=ways) for drive in own.values()]
    here = averaged(surveys, vehicles=[vehicle for _, vehicle in own])
    assert [(each.begin, each.n_passes) for each in survey.stretches] == [(e.begin, e.n_passes) for e in here.stretches]
    for mine, theirs in zip(survey.stretches, here.stretches, strict=True):
        for side in ("left", "right"):
            names = ("iri", "iri_std", "iri_scatter", "roughness", "waviness")
            one, other = ({name: getattr(getattr(e, side), name) or 0.0 for name in names} for e in (mine, theirs))
            assert one == pytest.approx(other, rel=1e-6), (mine.begin, side)
    assert len(survey.events) == len(here.events)
    assert max(stretch.n_passes for stretch in survey.stretches) == 3
    assert all(
        stretch.left.iri_scatter < 0.08 * stretch.left.iri for stretch in survey.stretches if stretch.n_passes > 1
    )


def test_tables_hold_stretches_and_why_drives_have_none(survey, fleet):
    rows = sorted(fleet.results["roads"].rows().to_pylist(), key=lambda row: row["begin"])
    assert [(row["begin"], row["n_passes"]) for row in rows] == [
        (each.begin, each.n_passes) for each in survey.stretches
    ]
    assert rows[0]["begin_latitude"] == pytest.approx(survey.stretches[0].begin_place[0])
    reasons = {(row["vehicle"], row["start"]): row["reason"] for row in fleet.results["passes"].rows().to_pylist()}
    assert reasons["car-c", START] == "the vehicle has no vehicle file: add one"
    assert "give latitude and longitude" in reasons["car-a", START + 3 * HOUR]
    assert sorted(reasons.values())[:3] == ["", "", ""]
    assert any("1 of 5 drives without a survey" in note for note in survey.notes)


def test_drives_from_one_place_are_compared_by_distance(spark, fleet, tmp_path):
    settings = RoadSettings(by="distance", since=START + HOUR)
    found = survey_fleet(spark, fleet.lake, fleet.vehicles, Results(tmp_path), settings=settings)
    assert max(stretch.n_passes for stretch in found.stretches) == 3


def test_a_period_without_drives_is_refused(spark, fleet, tmp_path):
    with pytest.raises(DataError, match="the lake is empty"):
        survey_fleet(spark, fleet.lake, fleet.vehicles, Results(tmp_path), settings=RoadSettings(until=START - HOUR))


def test_the_command_prints_and_writes(sprung, fleet, tmp_path, monkeypatch, spark):
    monkeypatch.setattr("sprung.fleet.jobs.spark_session", lambda *_: spark)
    monkeypatch.setattr(type(spark), "stop", lambda _: None)
    words = ("fleet", "road", fleet.lake.location, "--vehicles", fleet.vehicles, "--out", tmp_path / "results")
    document = sprung(*words, "--map", tmp_path / "roads.geojson", "--figures", tmp_path, "--json", "-").document()
    assert (tmp_path / "road.png").is_file()
    assert {stretch["n_passes"] for stretch in document["stretches"]} >= {3}
    assert "LineString" in (tmp_path / "roads.geojson").read_text()
