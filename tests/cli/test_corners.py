import html
import json

import pytest


@pytest.fixture(scope="module")
def drive(tmp_path_factory):
    """A drive of three minutes with a soft front-left spring."""
    from sprung.formats import write
    from sprung.simulation import RoadDrive, simulate_drive
    from sprung.vehicles import parse_fault, read_vehicle, write_vehicle

    folder = tmp_path_factory.mktemp("drive")
    faults = (parse_fault("front_left.spring=-0.4"),)
    settings = RoadDrive(duration=180.0, faults=faults, snr=50.0)
    one = simulate_drive(read_vehicle("zafira"), settings, seed=1)
    write(one.recording, folder / "run.parquet")
    write_vehicle(read_vehicle("zafira"), folder / "car.toml")
    return folder / "run.parquet", folder / "car.toml"


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("--vehicle", "chain3"), "must be a body on axles"),
        (("--vehicle", "nowhere.toml"), "is neither a file nor one of"),
        (("--vehicle", "zafira", "--band", "9", "2"), "band 9 to 2 Hz must rise"),
        (("--vehicle", "zafira", "--free", "wheel"), "'wheel' is none of spring, damper, tyre"),
        (("--vehicle", "zafira", "--channels", "acc_fl,nothing"), "nothing"),
    ],
)
def test_bad_usage_is_one_sentence(sprung, drive, words, message):
    outcome = sprung("corners", drive[0], *words)
    assert outcome.code == 2
    assert message in outcome.err


@pytest.fixture(scope="module")
def misnamed(drive):
    """The vehicle file of the drive with one sensor under another name than the logger's."""
    _, car = drive
    path = car.with_name("misnamed.toml")
    path.write_text(car.read_text().replace('"acc_rr"', '"AccRR"'))
    return path


@pytest.mark.parametrize(
    "command",
    [
        ("corners",),
        ("identify",),
        ("track",),
        ("diagnose",),
        ("baseline", "--out", "b.json"),
        ("calibrate", "--out", "v.toml"),
        ("box", "--vehicle-id", "car-1", "--broker", "mqtt://127.0.0.1:1"),
    ],
    ids=lambda command: command[0],
)
def test_every_command_refuses_a_recording_that_lacks_a_sensor(sprung, drive, misnamed, command, monkeypatch) -> None:
    monkeypatch.chdir(misnamed.parent)
    outcome = sprung(command[0], drive[0], "--vehicle", misnamed, *command[1:])
    assert outcome.code == 2
    assert "lacks 1 of the vehicle file's 4 sensors: AccRR (did you mean 'acc_rr'?)" in outcome.err
    assert "--allow-missing" in outcome.err


@pytest.mark.parametrize("command", [("corners",), ("calibrate", "--out", "v.toml")], ids=lambda command: command[0])
def test_exchanged_names_are_refused(sprung, drive, command, monkeypatch) -> None:
    files, car = drive
    exchanged = car.with_name("exchanged.toml")
    text = car.read_text().replace('"acc_fl"', '"?"').replace('"acc_fr"', '"acc_fl"').replace('"?"', '"acc_fr"')
    exchanged.write_text(text)
    monkeypatch.chdir(exchanged.parent)
    outcome = sprung(command[0], files, "--vehicle", exchanged, *command[1:])
    assert outcome.code == 3
    assert "sensors are swapped, acc_fr with acc_fl or acc_rl with acc_rr: correct the names" in outcome.err


@pytest.mark.slow
def test_a_baseline_names_exchanged_sensors_and_does_not_calibrate_them_away(sprung, tmp_path) -> None:
    """Two windows, as one of them alone is not enough for a calibration to find other places."""
    from sprung.formats import write
    from sprung.simulation import RoadDrive, simulate_drive
    from sprung.vehicles import read_vehicle, vehicle_text

    files = [tmp_path / f"run-{seed}.parquet" for seed in (1, 2)]
    for seed, path in enumerate(files, start=1):
        write(simulate_drive(read_vehicle("zafira"), RoadDrive(duration=180.0, snr=30.0), seed=seed).recording, path)
    text = vehicle_text(read_vehicle("zafira"))
    car = tmp_path / "exchanged.toml"
    car.write_text(text.replace('"acc_fl"', '"?"').replace('"acc_fr"', '"acc_fl"').replace('"?"', '"acc_fr"'))
    outcome = sprung("baseline", *files, "--vehicle", car, "--window", "3", "--out", tmp_path / "b.json")
    assert outcome.code == 3
    assert "sensors are swapped, acc_fr with acc_fl or acc_rl with acc_rr: correct the names" in outcome.err


@pytest.mark.slow
def test_without_a_sensor_every_output_says_so(sprung, drive, misnamed, tmp_path) -> None:
    notes = [
        "missing sensors, which the vehicle file names: AccRR (did you mean 'acc_rr'?)",
        "left-over channels, which the vehicle file does not name: acc_rr",
    ]
    words = (drive[0], "--vehicle", misnamed, "--allow-missing", "--report", tmp_path / "report.html")
    outcome = sprung("corners", *words, "--json", tmp_path / "corners.json")
    assert outcome.code == 0, outcome.err
    assert json.loads((tmp_path / "corners.json").read_text())["notes"][:2] == notes
    printed, page = " ".join(outcome.out.split()), html.unescape((tmp_path / "report.html").read_text())
    for note in notes:
        assert note in printed
        assert note in page


def test_a_sensor_left_out_by_choice_is_named_too(sprung, drive) -> None:
    """--channels leaves out a sensor; a chosen channel that looks like one that is not chosen is a slip."""
    run, car = drive
    words = ("--channels", "acc_fl,acc_fr,acc_rl,speed")
    document = sprung("identify", run, "--vehicle", car, *words, "--no-refine", "--json", "-").document()
    assert "missing sensors, which the vehicle file names: acc_rr" in document["notes"]
