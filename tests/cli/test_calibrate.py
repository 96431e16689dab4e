"""The commands describe and calibrate, and baselines of a calibrated vehicle."""

import json
import re

import pytest

from sprung.calibration.draft import explicit
from sprung.calibration.fitting import with_mount
from sprung.cli import main
from sprung.vehicles import MountedMass, Vehicle, read_vehicle, vehicle_from_text, write_vehicle


@pytest.mark.slow
def test_a_baseline_learns_an_engine_that_the_file_lacks_and_diagnose_uses_it(tmp_path) -> None:
    car = read_vehicle("zafira")
    assert isinstance(car, Vehicle)
    engine = MountedMass(mass=180.0, x=1.2, frequency=11.0, damping_ratio=0.08)
    with_engine, file = tmp_path / "true.toml", tmp_path / "car.toml"
    write_vehicle(with_mount(explicit(car), engine).vehicle, with_engine)
    write_vehicle(car, file)
    fault = ["--fault", "front_left.spring=-0.4"]
    drives = {"healthy": ["--minutes", "15", "--seed", "1"], "faulty": ["--minutes", "10", "--seed", "2", *fault]}
    for name, words in drives.items():
        options = ["--sampling-rate", "100", "--snr", "50", *words]
        assert (
            main(["simulate", "road", "--vehicle", str(with_engine), *options, "--out", f"{tmp_path / name}.npz"]) == 0
        )
    window, out = ["--window", "5"], tmp_path / "B.json"
    words = [f"{tmp_path / 'healthy'}.npz", "--vehicle", str(file), *window]
    assert main(["baseline", *words, "--windows", "3", "--out", str(out)]) == 0
    completed = vehicle_from_text(json.loads(out.read_text())["vehicle_file"], source="baseline")
    assert isinstance(completed, Vehicle)
    (mount,) = completed.mounted_mass
    assert mount.frequency == pytest.approx(11.0, abs=0.3)
    assert mount.mass == pytest.approx(180.0, rel=0.15)
    said = tmp_path / "diagnosis.json"
    words = [f"{tmp_path / 'faulty'}.npz", "--vehicle", str(file), *window, "--baseline", str(out)]
    assert main(["diagnose", *words, "--json", str(said)]) in {0, 3}
    diagnosis = json.loads(said.read_text())
    assert [finding["component"] for finding in diagnosis["findings"]] == ["spring"]


@pytest.mark.slow
def test_a_calibration_says_which_drive_a_baseline_needs(sprung, tmp_path) -> None:
    drive, out = tmp_path / "slow.npz", tmp_path / "v.toml"
    slow = ("--minutes", "5", "--sampling-rate", "60", "--speed", "3.5", "6.5", "--snr", "50")
    assert sprung("simulate", "road", *slow, "--out", drive).code == 0
    outcome = sprung("calibrate", drive, "--vehicle", "zafira", "--mounts", "0", "--no-modes", "--out", out)
    assert outcome.code == 0
    said = " ".join(outcome.out.split())
    shares = [float(share) for share in re.findall(r"s: (\d+) %", said.partition("for a baseline: ")[2])]
    assert len(shares) == 3
    assert " and 3 others up to " in said
    assert 0 <= max(shares) < 100 / 12  # of twelve windows that are twice as long and faster
    assert "of what 12 ordinary windows give; drive faster, about" in said
