"""The command `sprung compare`: two sets of drives, with and without a change between them."""

import json
import shlex

import numpy as np
import pytest

import sprung
from sprung import diagnosis
from sprung.cli import main


@pytest.fixture(autouse=True)
def _windows_once(fits_once, monkeypatch: pytest.MonkeyPatch) -> None:
    """Fit windows of equal samples once: comparisons have the first drive in common."""
    monkeypatch.setattr(diagnosis, "observe_window", fits_once["observe_window"])


@pytest.fixture(scope="module")
def drives(tmp_path_factory):
    """Two healthy drives, and one with a soft spring."""
    folder = tmp_path_factory.mktemp("compare")
    car = sprung.read_vehicle("zafira")
    for name, seed, faults in (("first", 1, ()), ("second", 2, ()), ("soft", 3, ("front_left.spring=-0.3",))):
        settings = sprung.RoadDrive(
            duration=900.0, sampling_rate=100.0, snr=50.0, faults=tuple(sprung.parse_fault(fault) for fault in faults)
        )
        sprung.write(sprung.simulate_drive(car, settings, seed=seed).recording, folder / f"{name}.parquet")
    return folder


@pytest.mark.slow
@pytest.mark.parametrize(("second", "verdict"), [("second", "no_change_detected"), ("soft", "change")])
def test_two_sets_of_drives(drives, second, verdict) -> None:
    arguments = ["--vehicle", "zafira", "--window", "3", "--json", str(drives / f"{second}.json")]
    assert (
        main(["compare", str(drives / "first.parquet"), "--with", str(drives / f"{second}.parquet"), *arguments]) == 0
    )
    document = json.loads((drives / f"{second}.json").read_text())
    assert (document["schema"], document["verdict"]) == ("sprung.compare/1", verdict)
    assert document["n_windows"] == [5, 5]
    assert set(document["detectable"]) >= {"front_left.spring"}
    if verdict == "change":
        (finding,) = document["findings"]
        assert (finding["corner"], finding["component"]) == ("front_left", "spring")
        assert finding["interval"][0] < -0.3 < finding["interval"][1]


@pytest.fixture(scope="module")
def pushes(tmp_path_factory):
    """Two recordings of a drop: two seconds of rest, and bounce and pitch that die away."""
    folder = tmp_path_factory.mktemp("pushes")
    time = np.arange(800) / 100
    shapes = {"acc_fl": (1.0, 0.7), "acc_fr": (1.0, 0.6), "acc_rl": (0.9, -0.8), "acc_rr": (0.9, -0.7)}
    for seed, name in enumerate(("before run", "after")):
        swings = [
            np.exp(-2 * np.pi * f * xi * time) * np.sin(2 * np.pi * f * time) for f, xi in ((1.3, 0.2), (1.6, 0.25))
        ]
        moved = np.array(list(shapes.values())) @ np.array(swings)
        samples = np.hstack([np.zeros((4, 200)), moved]) + 0.01 * np.random.default_rng(seed).standard_normal((4, 1000))
        channels = tuple(sprung.Channel(name, "acceleration") for name in shapes)
        sprung.write(sprung.Recording(samples, 100.0, channels), folder / f"{name}.csv")
    return folder


@pytest.mark.slow
def test_pushes_are_compared_by_another_command(pushes, drives, capsys, monkeypatch) -> None:
    """It asked for the speed of a standing car."""
    monkeypatch.chdir(pushes)
    assert main(["compare", "before run.csv", "--with", "after.csv", "--vehicle", "zafira"]) == 3
    shown = capsys.readouterr().err
    command = shlex.split(shown[shown.index("sprung bounce") :])
    assert command == ["sprung", "bounce", "after.csv", "--before", "before run.csv", "--vehicle", "zafira"]
    assert main(command[1:]) == 0
    # What is no free motion, or cannot be judged, keeps the reason of the comparison.
    run = sprung.read("after.csv")
    sprung.write(sprung.read(drives / "first.parquet").part(0, 3000), "drive.csv")
    sprung.write(sprung.Recording(0 * run.samples, 100.0, run.channels), "dead.csv")
    for name in ("drive.csv", "dead.csv"):
        assert main(["compare", name, "--with", "after.csv", "--vehicle", "zafira"]) == 3
        assert "windows can be learnt from" in capsys.readouterr().err
