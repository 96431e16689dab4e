"""Passes over one road: compared by place or distance, averaged with their scatter."""

import csv
from dataclasses import replace

import numpy as np
import pytest

import sprung
from sprung.errors import DataError
from sprung.excitation import surface
from sprung.recording import Gap
from sprung.road import (
    RoadEvent,
    RoadSurvey,
    Stretch,
    TrackRoughness,
    Ways,
    averaged,
    drives_of,
    survey_passes,
    survey_road,
    suspension_slope,
    track_of,
    write_survey,
)
from sprung.simulation import RoadDrive, simulate_drive
from sprung.vehicles import read_vehicle
from sprung.vehicles.window import window_of

CAR = read_vehicle("zafira")
SPEEDS = ((10.0, 13.0), (14.0, 18.0), (18.0, 24.0))


@pytest.fixture(scope="module")
def profile():
    """A road of 3 km, whose roughness changes along the way."""
    road = surface.road_class("B")
    made = surface.random_profile(
        road, first=-400.0, last=3000.0, generator=np.random.default_rng(2), contact_length=0.1
    )
    places = np.arange(made.heights.shape[1])
    return surface.Profile(made.first, made.heights * (1 + 0.8 * np.sin(places * surface.SPACING / 110)))


@pytest.fixture(scope="module")
def passes(profile):
    """Three drives over it at different speeds."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(surface, "random_profile", lambda *_, **__: profile)
        settings = [RoadDrive(duration=110.0, sampling_rate=100.0, speed=speed, snr=50.0) for speed in SPEEDS]
        return [simulate_drive(CAR, own, seed=seed).recording for seed, own in enumerate(settings)]


def with_places(recording, *, error=0.0, seed=0):
    """Return a drive with the places of a winding road, and errors of a receiver [m]."""
    track = track_of([window_of(recording, CAR)])
    at = track.distances
    metres = np.array([at * 0.8, 300 * np.sin(at / 400)]) / 6_371_000.0
    noise = np.repeat(np.random.default_rng(seed).normal(0, error, (2, at.size // 100 + 1)), 100, axis=1)[:, : at.size]
    places = np.degrees(np.array([0.85, 0.2])[:, None] + metres / np.array([[1], [np.cos(0.85)]])) + noise / 111_000
    channels = (*recording.channels, sprung.Channel("latitude"), sprung.Channel("longitude"))
    return replace(recording, samples=np.vstack([recording.samples, places]), channels=channels)


def true_index(profile, side, begin):
    """Return the index of a stretch of 100 m."""
    heights = profile.height(side == "left", np.arange(begin - 40.0, begin + 100.0, 0.05))
    slopes = suspension_slope(heights, spacing=0.05)[round(40 / 0.05) :]
    return 1000 * np.abs(slopes).mean()


@pytest.mark.slow
def test_passes_of_one_road_agree_by_distance(passes, profile) -> None:
    mean = survey_passes([[recording] for recording in passes], CAR)
    threefold = [stretch for stretch in mean.stretches if stretch.n_passes == 3]
    assert len(threefold) >= 8
    for stretch in threefold:
        for side in ("left", "right"):
            track, true = getattr(stretch, side), true_index(profile, side, stretch.begin)
            assert track.iri == pytest.approx(true, rel=0.1 if true < 2 else 0.04)
            assert track.iri_scatter < 0.04 * track.iri
            assert track.iri_std >= track.iri_scatter / np.sqrt(3)


@pytest.mark.slow
def test_passes_of_one_road_agree_by_place(passes) -> None:
    placed = [with_places(recording, error=2.0, seed=seed) for seed, recording in enumerate(passes)]
    late = placed[1].part(1500, placed[1].n_samples)  # enters the road after 15 s
    by_place = survey_passes([[placed[0]], [late], [placed[2]]], CAR)
    by_distance = {stretch.begin: stretch for stretch in survey_passes([[each] for each in passes], CAR).stretches}
    shared = [stretch for stretch in by_place.stretches if stretch.n_passes == 3]
    assert len(shared) >= 6
    for stretch in shared:
        assert stretch.left.iri == pytest.approx(by_distance[stretch.begin].left.iri, rel=0.04)
        assert stretch.begin_place is not None
    assert sum(stretch.n_passes for stretch in by_place.stretches) > 30


def test_lost_satellites_leave_no_places_and_no_ways(passes) -> None:
    """A receiver holds its last place for 30 s under way; the ways are those of the places before and after."""
    placed = with_places(passes[0])
    samples = placed.samples.copy()
    samples[-2:, 3000:6000] = samples[-2:, 3000:3001]
    lost = replace(placed, samples=samples)
    track, whole = (track_of([window_of(each, CAR)]) for each in (lost, placed))
    assert (track.place(31.0), track.place(59.0)) == (None, None)
    assert track.place(29.0) == pytest.approx(whole.place(29.0), abs=1e-6)
    ways = Ways(stretch=100.0)
    ways.add(whole)
    begins = [section.begin for section in ways.sections(track)]
    at = np.interp([30.0, 60.0], whole.times, whole.distances)
    assert begins
    assert not [begin for begin in begins if at[0] < begin + 50 < at[1]]
    assert set(begins) <= {section.begin for section in ways.sections(whole)}


def test_places_in_radians_are_the_same(passes) -> None:
    """Channels whose unit is stated as degrees are angles, in radians."""
    placed = with_places(passes[0])
    names = {"latitude", "longitude"}
    channels = [sprung.Channel(each.name, "angle") if each.name in names else each for each in placed.channels]
    samples = np.vstack([placed.samples[:-2], np.radians(placed.samples[-2:])])
    angles = replace(placed, samples=samples, channels=tuple(channels))
    of_angles, given = (track_of([window_of(each, CAR)]) for each in (angles, placed))
    assert of_angles.places == pytest.approx(given.places, abs=1e-9)


def test_the_other_direction_is_another_way(passes) -> None:
    track = track_of([window_of(with_places(passes[0]), CAR)])
    assert track.places is not None
    back = replace(track, places=track.places[:, ::-1])
    ways = Ways(stretch=100.0)
    ways.add(track)
    assert not ways.sections(back)
    ways.add(back)
    there, again = ways.sections(track), ways.sections(back)
    assert len(there) == len(again) >= 10
    assert not {section.begin for section in there} & {section.begin for section in again}


def test_a_lap_comes_back_to_the_addresses_of_the_first(passes) -> None:
    track = track_of([window_of(with_places(passes[0]), CAR)])
    angle = track.distances * 2 * np.pi / 600.0  # laps of 600 m
    circle = np.degrees(np.array([[0.85], [0.2]]) + 95.0 / 6_371_000.0 * np.array([np.sin(angle), np.cos(angle)]))
    laps = replace(track, places=circle)
    ways = Ways(stretch=100.0)
    ways.add(laps)
    begins = [section.begin for section in ways.sections(laps)]
    assert len(begins) > len(set(begins))
    assert max(begins) < 1300


def test_distance_goes_on_through_gaps_and_stops(passes) -> None:
    whole = passes[0]
    gone = np.ones(whole.n_samples, bool)
    gone[4000:5000] = False
    cut = replace(whole, samples=whole.samples[:, gone], gaps=(Gap(4000, 10.0),))
    ends = [track_of([window_of(each, CAR)]).distances[-1] for each in (whole, cut)]
    assert ends[1] == pytest.approx(ends[0], abs=5.0)
    halves = [whole.part(0, 5000), whole.part(5000, whole.n_samples)]
    windows = [window_of(each, CAR) for each in halves]
    assert track_of(windows).distances[-1] == pytest.approx(ends[0], abs=1e-6)


@pytest.mark.slow
def test_a_stop_does_not_shift_the_road(passes) -> None:
    """Samples while the vehicle stands are no part of the motion that is fitted, but of the time."""
    whole = passes[1]
    still = np.zeros((len(whole.channels), 2000))
    still[:-1] = 1e-3 * np.random.default_rng(1).standard_normal((len(whole.channels) - 1, 2000))
    stopped = replace(whole, samples=np.hstack([whole.samples[:, :5500], still, whole.samples[:, 5500:]]))
    assert whole.names[-1] == "speed"
    plain, other = (survey_road(each, CAR) for each in (whole, stopped))
    at = {stretch.begin: stretch for stretch in other.stretches}
    last = plain.stretches[-1]
    assert at[last.begin].left.iri == pytest.approx(last.left.iri, rel=0.03)
    assert at[last.begin].begin_time == pytest.approx(last.begin_time + 20.0, abs=0.5)


def test_drives_in_several_files_are_one_where_they_continue() -> None:
    run = sprung.Recording(np.zeros((1, 6000)), 100.0, (sprung.Channel("acc"),), start=10**18)
    later = replace(run, start=10**18 + 60 * 10**9)
    unknown = replace(run, start=None)
    sizes = [len(drive) for drive in drives_of([[run], [later], [unknown], [unknown, unknown], [run]])]
    assert sizes == [2, 1, 2, 1]


def survey(iri, *, events=()):
    own = TrackRoughness(iri, 0.1, 64e-6, 2.0, "B")
    return RoadSurvey((Stretch(0.0, 100.0, 0.0, 5.0, own, own),), tuple(events))


def test_means_of_vehicles_are_more_precise_than_of_passes() -> None:
    surveys = [survey(value) for value in (3.95, 4.0, 4.05, 4.0)]
    (own,), (others,) = (averaged(surveys, vehicles=names).stretches for names in (None, "abcd"))
    assert own.left.iri == others.left.iri == pytest.approx(4.0)
    assert own.left.iri_std == pytest.approx(0.1)
    assert others.left.iri_std == pytest.approx(0.05)
    assert own.left.iri_scatter == pytest.approx(np.std([3.95, 4.0, 4.05, 4.0], ddof=1))
    (wide,) = averaged([survey(3.0), survey(5.0)]).stretches
    assert wide.left.iri_std == pytest.approx(np.sqrt(2) / np.sqrt(2))
    assert wide.n_passes == 2


def test_events_at_one_place_are_one() -> None:
    def pothole(at, depth):
        return RoadEvent(at, 1.0, "left", "pothole", depth, 0.5)

    mean = averaged(
        [survey(4.0, events=[pothole(50.0, 0.02), pothole(80.0, 0.03)]), survey(4.0, events=[pothole(53.0, 0.03)])]
    )
    assert [(event.at, event.n_passes) for event in mean.events] == [(51.5, 2), (80.0, 1)]
    assert mean.events[0].depth == pytest.approx(0.025)


@pytest.mark.slow
def test_the_command_averages_files(sprung, passes, tmp_path) -> None:
    from sprung.formats import write

    files = [tmp_path / f"pass-{number}.parquet" for number in range(2)]
    for number, file in enumerate(files):
        write(with_places(passes[number], error=1.0, seed=number), file)
    table = tmp_path / "road.csv"
    result = sprung("road", *files, "--vehicle", "zafira", "--out", table, "--json", "-")
    stretches = result.document()["stretches"]
    assert {stretch["n_passes"] for stretch in stretches} == {1, 2}
    twice = next(stretch for stretch in stretches if stretch["n_passes"] == 2)
    assert 0 < twice["left"]["iri_scatter"] < 0.1 * twice["left"]["iri"]
    rows = list(csv.DictReader(table.read_text().splitlines()))
    assert [int(row["passes"]) for row in rows] == [stretch["n_passes"] for stretch in stretches]
    maps = tmp_path / "road.geojson"
    sprung("road", *files, "--vehicle", "zafira", "--out", maps)
    assert '"stroke": "#' in maps.read_text()


@pytest.mark.slow
def test_drives_without_a_stretch_are_named(passes) -> None:
    short = passes[0].part(0, 1500)
    mean = survey_passes([[passes[0]], [short]], CAR)
    assert mean.notes[-1].startswith("drive 2: ")
    with pytest.raises(DataError):
        survey_passes([[short]], CAR)


def test_scatter_is_in_tables_only_for_passes(tmp_path) -> None:
    write_survey(survey(4.0), tmp_path / "road.csv")
    (row,) = csv.DictReader((tmp_path / "road.csv").read_text().splitlines())
    assert (row["passes"], row["left_iri_scatter"]) == ("1", "")
