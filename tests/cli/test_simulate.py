import json
from dataclasses import fields
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from sprung.cli import simulate
from sprung.cli.conditions import RailDriveConditions, RigRunConditions, RoadDriveConditions
from sprung.formats import read
from sprung.simulation import RailDrive, RigRun, RoadDrive
from sprung.vehicles import read_description, read_vehicle

SHORT = ("--minutes", "0.2", "--sampling-rate", "200")


def test_truth_and_vehicle_stand_beside_the_recording(sprung, tmp_path):
    path = tmp_path / "run.csv"
    document = sprung("simulate", "chain", *SHORT, "--seed", "7", "--out", path, "--json", "-").document()
    assert document == json.loads(Path(f"{path}.truth.json").read_text(encoding="utf-8"))
    assert document["schema"] == "sprung.truth/1"
    # F. Liu (2020), table 4-1
    assert [mode["natural_frequency"] for mode in document["modes"]] == pytest.approx([7.01, 19.65, 28.39], abs=0.005)
    assert [100 * mode["damping_ratio"] for mode in document["modes"]] == pytest.approx([1.12, 3.15, 4.55], abs=0.005)
    assert document["components"]["mass_1"]["spring"]["value"] == 9800.0
    assert (document["seed"], document["speed"], document["faults"]) == (7, None, {})
    assert document["files"] == [str(path)]
    assert read_description(f"{path}.vehicle.toml") == read_description("chain3")


def test_noise_has_the_stated_ratio(sprung, tmp_path):
    words = ("simulate", "chain", *SHORT, "--seed", "2")
    sprung(*words, "--out", tmp_path / "clean.npz")
    sprung(*words, "--snr", "0.5", "--out", tmp_path / "noisy.npz")
    clean, noisy = (read(tmp_path / f"{name}.npz").samples for name in ("clean", "noisy"))
    ratio = np.sqrt(np.mean(clean**2, axis=1) / np.mean((noisy - clean) ** 2, axis=1))
    np.testing.assert_allclose(ratio, 0.5, rtol=1e-6)


def test_noise_is_in_its_band(sprung, tmp_path):
    words = ("simulate", "chain", "--minutes", "1", "--sampling-rate", "200")
    sprung(*words, "--out", tmp_path / "clean.npz")
    sprung(*words, "--snr", "1", "--noise-band", "20", "30", "--out", tmp_path / "noisy.npz")
    noise = read(tmp_path / "noisy.npz").samples - read(tmp_path / "clean.npz").samples
    power = np.abs(np.fft.rfft(noise)).sum(axis=0) ** 2
    frequency = np.fft.rfftfreq(noise.shape[1], 1 / 200)
    assert power[(frequency > 10) & (frequency < 50)].sum() > 0.99 * power.sum()
    assert power[(frequency > 20) & (frequency < 30)].sum() > 0.5 * power.sum()


def test_cases_of_the_quarter_vehicle_differ_by_their_lines(sprung, tmp_path):
    levels = []
    for case in (1, 4):
        path = tmp_path / f"case{case}.npz"
        assert sprung("simulate", "quarter", "--minutes", "1", "--case", case, "--out", path).code == 0
        body = read(path).samples[0]
        spectrum = np.abs(np.fft.rfft(body * np.hanning(body.size)))
        levels.append(spectrum[round(17.0 * 60)] / np.median(spectrum[round(15.5 * 60) : round(16.5 * 60)]))
    assert levels[0] < 5
    assert levels[1] > 20


def test_records_differ_and_repeat_with_their_seed(sprung, tmp_path):
    for name in ("a", "b"):
        words = ("simulate", "chain", *SHORT, "--records", "2", "--seed", "4", "--out", tmp_path / f"{name}.npz")
        assert sprung(*words).code == 0
    first, second = (read(tmp_path / f"a-0{k}.npz").samples for k in (1, 2))
    assert np.abs(np.corrcoef(first[0], second[0])[0, 1]) < 0.2
    np.testing.assert_array_equal(second, read(tmp_path / "b-02.npz").samples)
    truth = json.loads((tmp_path / "a.npz.truth.json").read_text())
    assert truth["files"] == [str(tmp_path / "a-01.npz"), str(tmp_path / "a-02.npz")]


@pytest.mark.parametrize(("kind", "vehicle"), [("road", "zafira"), ("rail", "y25"), ("rig", "scale-bogie")])
def test_drives_have_speed_truth_and_vehicle(sprung, tmp_path, kind, vehicle):
    path = tmp_path / "run.parquet"
    words = ("simulate", kind, "--minutes", "0.2", "--fault", "front_left.spring=-0.2", "--out", path, "--json", "-")
    document = sprung(*words).document()
    recording = read(path)
    assert recording.channels[recording.index("speed")].quantity == "speed"
    nominal = read_vehicle(vehicle).axle[0].spring_stiffness
    assert document["components"]["front_left"]["spring"]["value"] == pytest.approx(0.8 * nominal)
    assert document["components"]["front_right"]["spring"]["value"] == nominal
    assert document["faults"] == {"front_left.spring": -0.2}
    speed = document["speed"]
    assert 0 < speed["lowest"] * 0.999 < speed["mean"] < speed["highest"] * 1.001
    assert read_vehicle(f"{path}.vehicle.toml") == read_vehicle(vehicle).model_copy(update={"kind": kind})


@pytest.mark.parametrize(
    ("options", "settings"),
    [(simulate._Road, RoadDrive()), (simulate._Rail, RailDrive()), (simulate._Rig, RigRun())],
)
def test_defaults_of_a_drive_are_those_of_its_settings(options, settings):
    defaults: dict[str, Any] = {field.name: field.default for field in fields(options)}
    assert 60 * defaults["minutes"] == settings.duration
    assert (defaults["sampling_rate"], defaults["speed"]) == (settings.sampling_rate, settings.speed)
    assert defaults["snr"] == settings.snr


@pytest.mark.parametrize(
    ("model", "settings"),
    [(RoadDriveConditions, RoadDrive()), (RailDriveConditions, RailDrive()), (RigRunConditions, RigRun())],
)
def test_defaults_of_conditions_are_those_of_the_settings(model, settings):
    stated = model().settings(read_vehicle("zafira"))
    assert stated.pop("payload") == ()
    assert sum(payload.mass for payload in settings.payloads) == 0
    assert stated == {name: getattr(settings, name) for name in stated}


EVERYTHING = """
payload = [{ mass = 80, x = -0.9, y = -0.4 }, { mass = 20 }]
suspension = { tyre_temperature = 40.0 }
driving = { braking = 3, cornering = 2, cross_slope = 0.03, height = 0.5 }
wheel_orders = { unbalance = 2e-3, run_out = [3e-4, 1e-4], radius = 0.3 }
accelerometers = { noise_density = 1.5e-3, bits = 12, full_scale = 39.2 }
speed_channel = { delay = 1, rate = 1, scale = 1.02 }
[road]
right_rougher_db = 2.5
potholes = { per_kilometre = 10, side = "right" }
[deviations]
individual = 2
values = { mass = 0.07, roll_inertia = -0.1 }
mounted_masses = [{ mass = 180, x = 1.1, frequency = 11, damping_ratio = 0.08 }]
flexible_modes = [{ shape = "torsion", frequency = 24, damping_ratio = 0.03 }]
scatter = { spring = 0.04, damper = 0.05, tyre = 0.03 }
sensors = { tilt = 0.03, places = 0.05, gain = 0.01, lag = 0.003, moved.acc_fl = [0.39, 0, 0] }
"""


@pytest.fixture
def conditions(tmp_path):
    """Write a file of conditions."""

    def write(text):
        path = tmp_path / "conditions.toml"
        path.write_text(text, encoding="utf-8")
        return path

    return write


def test_all_conditions_are_in_the_truth_and_none_in_the_vehicle_file(sprung, tmp_path, conditions):
    path = tmp_path / "run.parquet"
    words = ("simulate", "road", "--minutes", "0.2", "--conditions", conditions(EVERYTHING), "--out", path)
    document = sprung(*words, "--fault", "front_left.spring=-0.2", "--json", "-").document()
    conditions = document["conditions"]
    assert conditions["payload"] == [{"mass": 80.0, "x": -0.9, "y": -0.4}, {"mass": 20.0, "x": 0.0, "y": 0.0}]
    assert document["payload"] == 100.0
    assert conditions["road"]["right_rougher_db"] == 2.5
    assert (conditions["road"]["potholes"]["per_kilometre"], conditions["road"]["potholes"]["side"]) == (10, "right")
    assert conditions["driving"] == {"braking": 3.0, "cornering": 2.0, "cross_slope": 0.03, "height": 0.5}
    assert [line["order"] for line in conditions["wheel_orders"]["front_left"]] == pytest.approx(
        [0.53, 0.53, 1.06], abs=0.01
    )
    deviations = conditions["deviations"]
    assert deviations["values"] == {"mass": 0.07, "roll_inertia": -0.1}
    assert deviations["mounted_masses"][0]["frequency"] == 11.0
    assert deviations["flexible_modes"][0]["shape"] == "torsion"
    assert deviations["scatter"] == {"spring": 0.04, "damper": 0.05, "tyre": 0.03}
    assert len(deviations["factors"]) == 12
    nominal = read_vehicle("zafira")
    place = np.array(conditions["sensors"]["acc_fl"]["position"]) - np.array(nominal.sensor[0].position)
    assert np.hypot(*(place - [0.39, 0, 0])[:2]) == pytest.approx(0.05)
    names = [part["function"] for part in conditions["imperfections"]]
    assert names[-4:] == ["with_density", "quantised", "scaled", "held"]
    assert document["faults"] == {"front_left.spring": -0.2}
    assert read_vehicle(f"{path}.vehicle.toml") == nominal


@pytest.mark.parametrize(
    "case",
    [
        ("y25", "nonlinear = true", {"front_left.spring", "front_left.damper"}),
        ("metro", "nonlinear = true", {"bogie1_front_left.primary_spring", "bogie2_right.secondary_damper"}),
        ("y25", "force_laws.suspension = { load_friction = 0.1 }", {"rear_right.spring", "rear_right.damper"}),
        ("metro", 'force_laws."bogie1_left.secondary" = { gap = 0.01, stop_stiffness = 1e6 }', None),
    ],
)
def test_force_laws_of_rail_vehicles_are_stated_with_the_values_nearest_to_them(sprung, tmp_path, conditions, case):
    vehicle, text, parts = case
    words = ("simulate", "rail", "--vehicle", vehicle, "--minutes", "0.05", "--out", tmp_path / "r.npz", "--json", "-")
    suspension = sprung(*words, "--conditions", conditions(f"[suspension]\n{text}")).document()["conditions"][
        "suspension"
    ]
    assert suspension["nonlinear"] is True
    found = suspension["equivalents"]
    if parts is None:
        assert set(found) == {"bogie1_left.secondary_spring", "bogie1_left.secondary_damper"}
    else:
        assert parts <= set(found)
    if vehicle == "y25":
        assert 3500 < found["rear_right.damper"] < 20_000  # 3000 in the file


def test_a_force_law_of_a_part_that_the_vehicle_lacks_is_refused(sprung, tmp_path, conditions):
    file = conditions("[suspension.force_laws]\nprimary = { load_friction = 0.1 }")
    outcome = sprung("simulate", "rail", "--minutes", "0.05", "--conditions", file, "--out", tmp_path / "a.npz")
    assert outcome.code == 2
    assert "force law of 'primary' is not one of" in outcome.err


def test_the_road_of_the_command_line_is_rougher_than_that_of_the_file(sprung, tmp_path, conditions):
    file = conditions('[road]\nroad_class = "A"\nright_rougher_db = 1.0')
    words = ("simulate", "road", "--minutes", "0.05", "--conditions", file, "--out", tmp_path / "r.npz", "--json", "-")
    roads = [sprung(*words, *more).document()["conditions"]["road"] for more in ((), ("--road", "E"))]
    assert [(road["road_class"], road["right_rougher_db"]) for road in roads] == [("A", 1.0), ("E", 1.0)]


def test_a_part_wears_from_record_to_record(sprung, tmp_path, conditions):
    file = conditions('[[deviations.wear]]\ncomponent = "rear_left.damper"\nper_drive = -0.1')
    words = ("simulate", "road", "--minutes", "0.05", "--conditions", file, "--records", "3")
    document = sprung(*words, "--out", tmp_path / "r.npz", "--json", "-").document()
    changes = [faults["rear_left.damper"] for faults in document["faults_by_record"]]
    assert changes == pytest.approx([0.0, -0.1, -0.19])


@pytest.mark.parametrize(
    ("kind", "text", "message"),
    [
        ("road", "payload = [{ mass = 80, z = 1 }]", "[[payload]] 1, z is not known here"),
        ("road", "[deviations]\nmounted_masses = [{ mass = -8, x = 1, frequency = 9, damping_ratio = 0 }]", "mass=-8"),
        ("road", "[deviations]\nflexible_modes = [{ shape = 'twist', frequency = 9, damping_ratio = 0 }]", "'twist'"),
        ("road", "[deviations.values]\nmass = 'x'", "must be"),
        ("road", "[deviations.values]\nweight = 0.1", "'weight' is not one of anti_roll_stiffness, mass"),
        ("road", "[deviations.sensors.moved]\nacc_fl = [0.1]", "moved"),
        ("road", "[[deviations.wear]]\ncomponent = 'damper'\nper_drive = -0.1", "is not of the form CORNER.KIND"),
        ("road", "[accelerometers]\nbits = 33", "bits=33"),
        ("road", "[speed_channel]\nrate = nan", "rate"),
        ("road", "[raod]\nroad_class = 'C'", "did you mean road?"),
        ("rail", "[road]\nroad_class = 'C'", "road is not known here"),
        ("rail", "driven = 'front'", "driven is not known here"),
        ("rail", "[suspension.force_laws]\nsuspension = { load_friction = -1 }", "load_friction=-1"),
        ("rail", "quality = 'low'", "quality='low' must be"),
        ("rig", "driven = 'rear'", "driven='rear'"),
        ("road", "n_stops = -1", "n_stops=-1"),
        ("road", "n_stops", "is not a TOML file"),
    ],
)
def test_conditions_that_cannot_be_are_refused(sprung, tmp_path, kind, text, message):
    file = tmp_path / "conditions.toml"
    file.write_text(text, encoding="utf-8")
    words = ("simulate", kind, "--minutes", "0.1", "--conditions", file, "--out", tmp_path / "a.csv")
    outcome = sprung(*words)
    assert outcome.code == 2
    assert message in " ".join(outcome.err.split())
    assert str(file) in outcome.err
    assert list(tmp_path.iterdir()) == [file]


def test_records_follow_one_another_from_a_stated_start(sprung, tmp_path):
    words = ("simulate", "chain", *SHORT, "--records", "2", "--start", "2026-11-21T08:30")
    sprung(*words, "--out", tmp_path / "run.csv")
    first, second = (read(tmp_path / f"run-0{k}.csv") for k in (1, 2))
    assert first.start == 1_795_249_800_000_000_000
    assert (second.start, first.n_samples) == (first.start + 12 * 10**9, 2400)
    assert first.sampling_rate == 200
    refused = sprung("simulate", "chain", *SHORT, "--start", "noon", "--out", tmp_path / "other.csv")
    assert (refused.code, "--start" in refused.err) == (2, True)


@pytest.mark.parametrize(
    ("seed", "day"), [(0, "2025-01-01"), (1, "2025-01-02"), (364, "2025-12-31"), (365, "2025-01-01")]
)
def test_each_seed_starts_on_a_day_of_its_own(sprung, tmp_path, seed, day):
    file = tmp_path / "run.csv"
    assert sprung("simulate", "chain", *SHORT, "--seed", seed, "--out", file).code == 0
    assert np.datetime64(read(file).start, "ns") == np.datetime64(f"{day}T08:00", "ns")
