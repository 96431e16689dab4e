"""The commands describe and calibrate, and baselines of a calibrated vehicle."""

import json

import pytest

from sprung.cli import main
from sprung.vehicles import read_vehicle

SHEET = ["--mass", "1350", "--wheelbase", "2.65", "--track", "1.5", "--tyre", "205/55R16"]


def test_a_data_sheet_becomes_a_vehicle_file(tmp_path, capsys) -> None:
    out = tmp_path / "car.toml"
    assert main(["describe", *SHEET, "--name", "golf", "--out", str(out)]) == 0
    vehicle = read_vehicle(out)
    assert vehicle.name == "golf"
    assert len(vehicle.learnt) > 8
    assert "guessed vehicle: bounce" in capsys.readouterr().out


def test_a_bad_size_is_refused(tmp_path, capsys) -> None:
    assert main(["describe", *SHEET[:-1], "wide", "--out", str(tmp_path / "car.toml")]) == 2
    assert "tyre='wide' is not a size" in capsys.readouterr().err


@pytest.mark.slow
def test_a_file_is_completed_and_every_command_reads_it(tmp_path) -> None:
    drive, out, json_file = tmp_path / "drive.npz", tmp_path / "complete.toml", tmp_path / "calibration.json"
    options = ["--minutes", "5", "--sampling-rate", "100", "--snr", "50", "--seed", "1"]
    assert main(["simulate", "road", "--vehicle", "zafira", *options, "--out", str(drive)]) == 0
    words = [str(drive), "--vehicle", "zafira", "--window", "5", "--mounts", "0", "--no-modes"]
    figures = tmp_path / "figures"
    end = main(["calibrate", *words, "--out", str(out), "--json", str(json_file), "--figures", str(figures)])
    assert end == 0
    assert {path.name for path in figures.iterdir()} == {"misfit.png", "learnt.png"}
    assert json.loads(json_file.read_text())["schema"] == "sprung.calibration/1"
    assert read_vehicle(out).learnt
    assert main(["corners", str(drive), "--vehicle", str(out)]) == 0
