"""The road under a simulated vehicle against the profile that it drove on."""

import json
from dataclasses import replace

import numpy as np
import pytest

import sprung
from sprung.errors import DataError, ParameterError
from sprung.excitation import surface
from sprung.formats import write
from sprung.road import averaged, roughness_index, survey_road, write_survey
from sprung.simulation import RoadConditions, RoadDrive, simulate_drive
from sprung.vehicles import read_vehicle

CAR = read_vehicle("zafira")


@pytest.fixture
def profiles(monkeypatch):
    """Profiles of simulated drives, in their order."""
    made = []
    make = surface.random_profile

    def kept(*arguments, **options):
        made.append(make(*arguments, **options))
        return made[-1]

    monkeypatch.setattr(surface, "random_profile", kept)
    return made


def truth(profile, recording, survey, side):
    """Return the index of each stretch from the profile itself."""
    speed = recording.samples[recording.index("speed")]
    travelled = np.concatenate([[0.0], np.cumsum((speed[1:] + speed[:-1]) / 2)]) / recording.sampling_rate
    first = np.interp(survey.stretches[0].begin_time, np.arange(speed.size) / recording.sampling_rate, travelled)
    places = np.arange(first, travelled[-1], 0.05)
    return roughness_index(profile.height(side == "left", places), spacing=0.05)


def drive(seed, road_class="B", speed=(12.0, 18.0), **settings):
    road = RoadConditions(road_class, **settings)
    return simulate_drive(
        CAR, RoadDrive(duration=150.0, sampling_rate=100.0, speed=speed, road=road, snr=50.0), seed=seed
    )


@pytest.mark.slow
@pytest.mark.parametrize(("road_class", "speed"), [("A", (20.0, 28.0)), ("C", (8.0, 10.0)), ("E", (11.0, 15.0))])
def test_the_index_is_that_of_the_profile(profiles, road_class, speed) -> None:
    recording = drive(7, road_class, speed).recording
    survey = survey_road(recording, CAR)
    assert {stretch.left.road_class for stretch in survey.stretches} == {road_class}
    for side in ("left", "right"):
        true = truth(profiles[-1], recording, survey, side)[1 : len(survey.stretches)]
        tracks = [getattr(stretch, side) for stretch in survey.stretches[1:]][: true.size]
        index, std = (np.array([getattr(track, name) for track in tracks]) for name in ("iri", "iri_std"))
        assert np.sqrt(np.mean((index / true - 1) ** 2)) < 0.05
        assert np.mean(np.abs(index - true) < 2.58 * std) > 0.9  # the vehicle's error is common to a drive
        assert np.mean(std / index) < 0.04


@pytest.mark.slow
def test_intervals_hold_where_a_drive_contradicts_its_file(profiles) -> None:
    """The car's tyres do not hold its body sideways, but those of the data sheet's file do."""
    sheet = sprung.DataSheet(mass=1642.0, wheelbase=2.8, track=1.404, tyre="195/65R15")
    recording = drive(7, "B", (10.0, 14.0)).recording
    survey = survey_road(recording, sprung.described(sheet))
    index = np.array([[each.left.iri, each.right.iri] for each in survey.stretches[1:]])
    std = np.array([[each.left.iri_std, each.right.iri_std] for each in survey.stretches[1:]])
    true = [truth(profiles[-1], recording, survey, side)[1 : len(survey.stretches)] for side in ("left", "right")]
    assert np.mean(np.abs(index / np.transpose(true) - 1)) < 0.1
    assert np.mean(np.abs(index - np.transpose(true)) < 1.96 * std) > 0.9


@pytest.mark.slow
def test_a_pothole_is_found_where_it_is(profiles) -> None:
    recording = drive(
        3, "A", potholes=sprung.Potholes(per_kilometre=4.0, depth=(0.02, 0.04), length=(0.8, 1.2))
    ).recording
    survey = survey_road(recording, CAR)
    assert survey.events
    smooth = profiles[-1].heights[:, :-1].max() - profiles[-1].heights[:, :-1].min()
    assert all(0.008 < event.depth < smooth for event in survey.events)
    assert {event.kind for event in survey.events} <= {"pothole", "bump", "joint"}


@pytest.mark.slow
def test_events_have_their_kind_place_and_size() -> None:
    """Steps, dips across the lane as of a bridge's joint, and potholes on the left, in a road of class A."""
    spacing = surface.SPACING
    smooth = surface.random_profile(surface.road_class("A"), first=0, last=2000, generator=np.random.default_rng(1))
    x, heights = spacing * np.arange(smooth.heights.shape[1]), smooth.heights.copy()
    truth: list[tuple[str, float]] = []
    for at in np.arange(300.0, 1800.0, 100.0):
        kind = ("step", "dip", "hole")[len(truth) % 3]
        if kind == "step":
            heights += 0.025 * (x > at)
        elif kind == "dip":
            heights -= 0.035 * np.exp(-10 * np.abs(x - at))
        else:
            heights[0] -= 0.03 * np.where(np.abs(x - at) < 0.5, 1 + np.cos(2 * np.pi * (x - at)), 0.0) / 2
        truth.append((kind, at))
    way = sprung.excitation.MeasuredSurface("made", heights)
    settings = RoadDrive(duration=130.0, sampling_rate=200.0, speed=(12.0, 18.0), surface=way, snr=50.0)
    survey = survey_road(simulate_drive(CAR, settings, seed=3).recording, CAR)
    last = survey.stretches[-1].end
    expected = [(kind, at) for kind, at in truth if at < last]
    assert len(expected) >= 12
    assert [event.at for event in survey.events] == pytest.approx([at for _, at in expected], abs=0.2)
    for event, (kind, _) in zip(survey.events, expected, strict=True):
        assert (event.kind, event.side) == (("pothole", "left") if kind == "hole" else ("joint", "both"))
        assert (event.length == 0) == (kind == "step")
        size = {"step": 0.025, "dip": 0.018, "hole": 0.03}[kind]  # a dip is seen at its area, 0.7 m long
        assert event.depth == pytest.approx(size, rel=0.25)


@pytest.mark.slow
def test_places_lead_to_maps(tmp_path) -> None:
    recording = drive(1).recording
    time = np.arange(recording.n_samples) / recording.sampling_rate
    channels = (*recording.channels, sprung.Channel("latitude"), sprung.Channel("longitude"))
    samples = np.vstack([recording.samples, 50 + 1e-4 * time, 8 + 1e-4 * time])
    survey = survey_road(replace(recording, samples=samples, channels=channels), CAR)
    write_survey(survey, tmp_path / "road.geojson")
    features = json.loads((tmp_path / "road.geojson").read_text())["features"]
    longitude, latitude = features[0]["geometry"]["coordinates"][0]
    assert longitude == pytest.approx(8 + 1e-4 * survey.stretches[0].begin_time)
    assert latitude == pytest.approx(50 + 1e-4 * survey.stretches[0].begin_time)
    write_survey(survey, tmp_path / "road.gpx")
    assert (tmp_path / "road.gpx").read_text().startswith("<?xml")


def test_what_has_no_road_or_place_is_refused_at_once(tmp_path, request) -> None:
    rig = CAR.model_copy(update={"kind": "rig"})
    short = simulate_drive(CAR, RoadDrive(duration=20.0, sampling_rate=60.0)).recording
    with pytest.raises(ParameterError, match="no road is"):
        survey_road(short, rig)
    write(short, tmp_path / "short.npz")
    run, drawn = request.getfixturevalue("sprung"), tmp_path / "drawn"
    for name, code in (("road.geojson", 3), ("road.kml", 2)):
        out = ("--out", tmp_path / name, "--figures", drawn)
        assert run("road", tmp_path / "short.npz", "--vehicle", "zafira", *out).code == code
        assert not (drawn / "road.png").exists()


@pytest.mark.slow
def test_passes_are_averaged(tmp_path) -> None:
    surveys = [survey_road(drive(seed).recording, CAR) for seed in (1, 2)]
    mean = averaged(surveys)
    pair = [survey.stretches[2].left.iri for survey in surveys]
    assert min(pair) <= mean.stretches[2].left.iri <= max(pair)
    assert mean.stretches[2].n_passes == 2
    assert mean.stretches[2].left.iri_std >= np.std(pair, ddof=1) / np.sqrt(2) - 1e-12
    with pytest.raises(DataError, match="latitude and longitude"):
        write_survey(mean, tmp_path / "road.geojson")
    with pytest.raises(ParameterError, match=r"\.geojson, \.gpx or \.csv"):
        write_survey(mean, tmp_path / "road.txt")
    write_survey(mean, tmp_path / "road.csv")
    assert len((tmp_path / "road.csv").read_text().splitlines()) == 1 + len(mean.stretches)


@pytest.mark.slow
def test_a_drive_without_speed_is_refused() -> None:
    recording = drive(1).recording
    with pytest.raises(DataError, match="needs the speed"):
        survey_road(recording.select([name for name in recording.names if name != "speed"]), CAR)
