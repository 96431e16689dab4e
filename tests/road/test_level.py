"""Level of a simulated track under a metro car against the rails that it ran on."""

import csv
import json
from dataclasses import dataclass
from functools import partial

import numpy as np
import pytest

from sprung.cli import main
from sprung.excitation import Crossings, surface
from sprung.formats import write
from sprung.results.documents import road_document
from sprung.results.figures import road_figure
from sprung.results.tables import road_table, road_tables
from sprung.road import (
    RoadProfile,
    RoadSurvey,
    Stretch,
    TrackLevel,
    averaged,
    road_profile,
    survey,
    survey_road,
    track_of,
    write_survey,
)
from sprung.road.level import RANGES, in_range
from sprung.road.profile import Inverse
from sprung.simulation import RailDrive, WheelOrders, simulate_drive
from sprung.vehicles import parse_fault, read_vehicle, write_vehicle
from sprung.vehicles.window import window_of

METRO = read_vehicle("metro")
METRO = METRO.model_copy(update={"sensor": tuple(one for one in METRO.sensor if one.channel.startswith("bogie1"))})


@pytest.mark.parametrize(("name", "wavelengths"), [("D1", (3.0, 25.0)), ("D2", (25.0, 70.0))])
def test_a_range_passes_half_of_the_power_at_its_ends(name, wavelengths, conforms) -> None:
    """The ends [m] are those that the standard prints."""
    own = RANGES[("D1", "D2").index(name)]
    x = np.arange(0.0, 8000.0, 0.25)
    inside = slice(8000, 24000)
    middle = np.sqrt(np.prod(wavelengths))

    def gain(wavelength: float) -> float:
        wave = np.sin(2 * np.pi * x / wavelength)
        return float(in_range(wave, own, spacing=0.25)[inside].std() / wave[inside].std())

    ends = [gain(wavelength) for wavelength in wavelengths]
    what = f"gain at the ends of {name}, {wavelengths[0]:g} and {wavelengths[1]:g} m, -3 dB"
    conforms("EN 13848-1:2019", "wavelength ranges", what, ends, [np.sqrt(0.5)] * 2, rel=0.03)
    assert gain(middle) > 0.9
    assert gain(wavelengths[0] / 2) < 1 / 16 + 1e-3  # 24 dB in the first octave beyond
    assert gain(2 * wavelengths[1]) < 1 / 16 + 1e-3


def driven(vehicle, **settings):
    """Return a drive on a bad track, and the profiles of its rails: height, alignment, cross level."""
    with pytest.MonkeyPatch.context() as patch:
        profiles, make = [], surface.random_profile

        def kept(*arguments, **options):
            profiles.append(make(*arguments, **options))
            return profiles[-1]

        patch.setattr(surface, "random_profile", kept)
        drive = RailDrive(sampling_rate=100.0, snr=30.0, quality="bad", **settings)
        return simulate_drive(vehicle, drive, seed=3).recording, profiles


@pytest.fixture
def _no_errors_of_fits(monkeypatch) -> None:
    """Leave out what errors of the fitted vehicle change, two thirds of the work: only standard deviations have it."""
    monkeypatch.setattr(Inverse, "sensitivity", lambda own, _: np.zeros((1, len(own.missing), own.frequencies.size)))


@dataclass(frozen=True)
class Dip(Crossings):
    """A place of the right rail where its bed has sunk."""

    place: float = 700.0
    depth: float = 0.02
    length: float = 6.0

    def heights(self, positions, _generator):
        return np.outer([0, -self.depth], np.exp(-np.pi * ((positions - self.place) / self.length) ** 2))


@pytest.mark.slow
@pytest.mark.usefixtures("_no_errors_of_fits")
def test_a_defect_of_the_track_is_where_every_vehicle_finds_it() -> None:
    """Its depth in D1 is that of the filter and up to 15 % of other level; spring and wheels are of one vehicle."""
    x = np.arange(0.0, 1400.0, 0.05)
    seen = in_range(Dip().heights(x, None), RANGES[0], spacing=0.05)[1].min()
    drive = partial(RailDrive, duration=60.0, sampling_rate=100.0, snr=30.0, speed=(20.0, 24.0), welded=True)
    weak, uneven = parse_fault("bogie1_left.secondary_spring=-0.3"), WheelOrders(run_out=(2e-4,), radius=0.46)
    drives = drive(crossings=Dip()), drive(crossings=Dip(), faults=(weak,), wheel_orders=uneven)
    runs = (simulate_drive(METRO, each, seed=seed).recording for seed, each in enumerate(drives, start=1))
    surveys = [survey_road(run, METRO) for run in runs]
    found = averaged(surveys, vehicles=["metro-1", "metro-2"])
    (defect,) = found.events
    assert (defect.side, defect.kind, defect.n_passes) == ("right", "dip", 2)
    assert defect.at == pytest.approx(700.0, abs=2.0)
    assert -defect.depth == pytest.approx(seen, rel=0.15)
    tables = [table.title for table in road_tables(found)]
    assert "Isolated defects" in tables
    assert len(road_figure(found).axes) == 2
    assert road_document(found).model_dump()["events"][0]["kind"] == "dip"


@pytest.mark.slow
def test_the_command_prints_levels_that_are_those_of_the_rails(tmp_path, monkeypatch, capsys) -> None:
    recording, (rails,) = driven(METRO, duration=120.0, speed=(20.0, 24.0))
    profiles: list[RoadProfile] = []

    def kept(*given):
        profiles.append(road_profile(*given))
        return profiles[-1]

    monkeypatch.setattr(survey, "road_profile", kept)
    write(recording, tmp_path / "run.parquet")
    write_vehicle(METRO, tmp_path / "metro.toml")
    document = tmp_path / "road.json"
    command = ["road", str(tmp_path / "run.parquet"), "--vehicle", str(tmp_path / "metro.toml")]
    assert main([*command, "--json", str(document)]) == 0
    assert "left D1 [mm]" in capsys.readouterr().out
    stretches = json.loads(document.read_text(encoding="utf-8"))["stretches"]
    assert set(stretches[0]["left"]) == {"d1", "d1_std", "d2", "d2_std"}
    assert {stretch["to"] - stretch["from"] for stretch in stretches} == {200.0}
    assert not any("alignment" in stretch for stretch in stretches)  # it has no lateral sensors
    assert len(stretches) >= 8
    (profile,) = profiles
    true = np.array([rails.height(side, profile.distances) for side in (True, False)])
    for wavelengths, name, most in zip(RANGES, ("d1", "d2"), (0.05, 0.1), strict=True):
        of_rails = in_range(true, wavelengths, spacing=profile.spacing)
        errors = in_range(profile.heights, wavelengths, spacing=profile.spacing) - of_rails
        inner = slice(round(150 / profile.spacing), -round(150 / profile.spacing))
        assert 1e3 * errors[:, inner].std() < 0.5  # mm, of levels with a standard deviation of 2 to 4 mm
        assert 1e3 * np.abs(errors[:, inner]).max() < 1.5
        for stretch in stretches[1:-1]:
            part = slice(*np.searchsorted(profile.distances, [stretch["from"], stretch["to"]]))
            for side, level in enumerate((stretch["left"], stretch["right"])):
                assert level[name] == pytest.approx(of_rails[side, part].std(), rel=most)


@pytest.mark.slow
@pytest.mark.usefixtures("_no_errors_of_fits")
def test_the_alignment_is_that_of_the_rails(coach) -> None:
    recording, (_, rails, _) = driven(coach, duration=90.0, speed=(35.0, 37.0))
    found = survey_road(recording, coach)
    travelled = track_of([window_of(recording, coach)]).distances[-1]
    x = np.arange(0.0, travelled, 0.25)
    centre = np.mean([rails.height(side, x) for side in (True, False)], axis=0)
    assert len(found.stretches) >= 8
    for wavelengths, name, most in zip(RANGES, ("d1", "d2"), (0.05, 0.1), strict=True):
        of_rails = in_range(centre, wavelengths, spacing=0.25)
        for stretch in found.stretches[1:-1]:
            part = slice(*np.searchsorted(x, [stretch.begin, stretch.end]))
            assert getattr(stretch.alignment, name) == pytest.approx(of_rails[part].std(), rel=most)
    assert [table.columns[2:] for table in road_tables(found)] == [
        ("left D1 [mm]", "right D1 [mm]", "left D2 [mm]", "right D2 [mm]"),
        ("alignment D1 [mm]", "alignment D2 [mm]"),
    ]


@pytest.mark.slow
def test_a_slow_vehicle_does_not_feel_long_waves() -> None:
    settings = RailDrive(duration=150.0, sampling_rate=50.0, speed=(5.0, 6.0), snr=30.0, welded=True)
    found = survey_road(simulate_drive(METRO, settings, seed=1).recording, METRO)
    assert {stretch.left.d2 for stretch in found.stretches} == {None}
    assert "–" in str(road_table(found).rows[0])


def test_passes_are_averaged_and_written(tmp_path) -> None:
    def passed(d1, d2):
        level = TrackLevel(d1, 1e-5, d2, None if d2 is None else 2e-5)
        ends = (48.0, 11.0), (48.001, 11.001)
        alignment = None if d2 is None else level  # measured in one pass
        return RoadSurvey((Stretch(0.0, 200.0, 0.0, 9.0, level, level, 1, *ends, alignment),), ())

    mean = averaged([passed(1.00e-3, 2.0e-3), passed(1.04e-3, None)])
    level = mean.stretches[0].left
    assert (level.d1, level.d2) == pytest.approx((1.02e-3, 2.0e-3))
    assert level.d1_scatter == pytest.approx(0.04e-3 / np.sqrt(2))
    assert mean.stretches[0].lines["alignment"].d1 == 1.00e-3
    write_survey(mean, tmp_path / "t.csv")
    with (tmp_path / "t.csv").open(encoding="utf-8") as file:
        (row,) = csv.DictReader(file)
    assert (row["left_d1_mm"], row["right_d2_mm"], row["passes"]) == ("1.02", "2.0", "2")
    assert (row["alignment_d1_mm"], row["alignment_d1_scatter_mm"]) == ("1.0", "")
    write_survey(mean, tmp_path / "t.geojson")
    (line,) = json.loads((tmp_path / "t.geojson").read_text(encoding="utf-8"))["features"]
    assert line["properties"]["left_d1_mm"] == 1.02
    assert [axes.get_ylabel() for axes in road_figure(mean).axes][:1] == ["D1 [mm]"]
