import json
import re

import pytest

from sprung import diagnosis
from sprung.formats import write
from sprung.simulation import RoadDrive, dead, simulate_drive
from sprung.vehicles import MountedMass, parse_fault, read_vehicle

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def drives(tmp_path_factory):
    """Half an hour of a healthy car, and ten minutes with a stiff rear-right spring."""
    folder = tmp_path_factory.mktemp("drives")
    car = read_vehicle("zafira")
    settings = RoadDrive(duration=1800.0, snr=50.0)
    write(simulate_drive(car, settings, seed=1).recording, folder / "healthy.parquet")
    faults = (parse_fault("rear_right.spring=0.25"),)
    broken = simulate_drive(car, RoadDrive(snr=50.0, faults=faults), seed=2).recording
    write(broken, folder / "broken.parquet")
    write(dead(broken, channel="acc_fl"), folder / "dead.parquet")
    return folder


@pytest.fixture(autouse=True)
def _windows_once(fits_once, monkeypatch: pytest.MonkeyPatch) -> None:
    """Fit windows of equal samples once: most commands read the same drives."""
    monkeypatch.setattr(diagnosis, "observe_window", fits_once["observe_window"])


@pytest.fixture
def baseline(sprung, drives):
    path = drives / "baseline.json"
    if not path.exists():
        words = ("--vehicle", "zafira", "--windows", "3", "--out", path, "--reason", "new springs")
        outcome = sprung("baseline", drives / "healthy.parquet", *words)
        assert outcome.code == 0, outcome.err
        assert "version 1 (new springs): learnt from 3 of 3 windows" in outcome.out
    return path


def test_mistakes_are_one_sentence(sprung, drives, tmp_path):
    run = drives / "broken.parquet"
    no_json = tmp_path / "b.json"
    no_json.write_text("x")
    for words, code, part in (
        (("--vehicle", "chain3"), 2, "must be a body on axles"),
        (("--vehicle", "zafira", "--baseline", tmp_path / "no.json"), 2, "no.json cannot be read (No such file"),
        (("--vehicle", "zafira", "--baseline", no_json), 2, "is not valid JSON"),
        (("--vehicle", "zafira", "--false-alarms", "0"), 2, "false_alarms=0 must be above 0"),
        (("--vehicle", "zafira", "--window", "0.1"), 2, "--window=0.1 must be at least 1"),
    ):
        outcome = sprung("diagnose", run, *words)
        assert (outcome.code, outcome.err.count("\n")) == (code, 1)
        assert part in outcome.err
    outcome = sprung("baseline", run, "--vehicle", "zafira", "--out", tmp_path / "out.json")
    assert outcome.code == 3
    assert "1 of 1 windows can be learnt from, and 6 are needed" in outcome.err
    assert re.search(r"; .* % of what 12 ordinary windows give; drive ", outcome.err)


def test_an_inconclusive_drive_is_not_called_healthy(sprung, drives, baseline, tmp_path):
    short = simulate_drive(read_vehicle("zafira"), RoadDrive(duration=60.0), seed=3).recording
    write(short, tmp_path / "short.parquet")
    words = ("--vehicle", "zafira", "--baseline", baseline, "--json", tmp_path / "d.json")
    outcome = sprung("diagnose", tmp_path / "short.parquet", *words)
    assert outcome.code == 3
    assert "inconclusive: no window was usable" in outcome.out
    assert "segments of steady speed are too few, 40 are needed: give longer windows" in outcome.err
    assert json.loads((tmp_path / "d.json").read_text())["verdict"] == "inconclusive"


def test_excluded_windows_are_explained(sprung, baseline, tmp_path):
    """An engine on soft mounts that the file does not have."""
    car = read_vehicle("zafira")
    engine = MountedMass(mass=180.0, x=1.1, frequency=8.0, damping_ratio=0.08)
    run = simulate_drive(car.model_copy(update={"mounted_mass": (engine,)}), RoadDrive(snr=50.0), seed=2)
    write(run.recording, tmp_path / "engine.parquet")
    outcome = sprung("diagnose", tmp_path / "engine.parquet", "--vehicle", "zafira", "--json", "-")
    assert outcome.code == 3
    reason = "the model fits 1 of 1 windows too poorly for a comparison with the vehicle file: learn a baseline"
    assert f"no window was usable: {reason}" in outcome.err
    assert reason in outcome.document()["notes"]
    # Windows with other components than the baseline's.
    document = json.loads(baseline.read_text())
    names = [name.replace("rear", "middle") for name in document["components"]]
    (tmp_path / "other.json").write_text(json.dumps({**document, "components": names}))
    words = ("--vehicle", "zafira", "--baseline", tmp_path / "other.json", "--json", "-")
    outcome = sprung("diagnose", tmp_path / "engine.parquet", *words)
    assert outcome.code == 3
    assert "no window was usable: their components differ from those of the baseline" in outcome.err


def test_a_baseline_of_another_vehicle_is_refused(sprung, drives, baseline, tmp_path):
    again = ("--out", tmp_path / "b.json", "--reason", "new springs", "--previous", baseline)
    for command, words in (("diagnose", ("--baseline", baseline)), ("baseline", again)):
        outcome = sprung(command, drives / "broken.parquet", "--vehicle", "zafira-printed", *words)
        assert (outcome.code, outcome.err.count("\n")) == (2, 1)
        assert (
            f"{baseline} is the baseline of the vehicle 'zafira', but the vehicle file describes 'zafira-printed'"
            in outcome.err
        )


def test_a_baseline_learnt_again_counts_up_and_says_why(sprung, drives, baseline, tmp_path):
    words = ("--vehicle", "zafira", "--windows", "3", "--out", tmp_path / "b.json", "--previous", baseline)
    outcome = sprung("baseline", drives / "healthy.parquet", *words)
    assert (outcome.code, outcome.err.count("\n")) == (2, 1)
    assert "--previous requires --reason TEXT" in outcome.err
    outcome = sprung("baseline", drives / "healthy.parquet", *words, "--reason", "new dampers")
    assert "version 2 (new dampers): learnt from 3 of 3 windows" in outcome.out
    document = json.loads((tmp_path / "b.json").read_text())
    assert (document["version"], document["reason"]) == (2, "new dampers")
