from dataclasses import replace

import numpy as np
import pytest

from sprung.cli import explained
from sprung.errors import DataError, FormatError, IdentificationError, MissingPackageError, ParameterError
from sprung.formats import write
from sprung.simulation import RoadDrive, simulate_drive
from sprung.vehicles import read_vehicle


@pytest.fixture
def hostile(tmp_path, monkeypatch):
    """The folder of the process, with a record of two channels, long or short."""
    monkeypatch.chdir(tmp_path)
    rows = [f"{0.01 * k:.2f},{(k * 7919) % 101},{(k * 104729) % 97}\n" for k in range(2000)]
    for name, n_rows in (("good.csv", 2000), ("short.csv", 90)):
        (tmp_path / name).write_text("time,a,b\n" + "".join(rows[:n_rows]))
    return tmp_path


@pytest.mark.parametrize(
    ("words", "code", "part"),
    [
        (["good.csv", "--bnad", "1", "2"], 2, "--band"),
        (["good.csv", "--band", "1"], 2, "requires 2 arguments"),
        (["good.csv", "--segment", "nan"], 2, "segment=nan"),
        (["good.csv", "--decimate-to", "1000"], 2, "decimate_to=1000"),
        (["good.csv", "--subsets", "2"], 2, "--method coss"),
        (["good.csv", "--block-rows", "x"], 2, "--block-rows"),
        (["good.csv", "--references", "a,,b"], 2, "'a,,b'"),
        (["good.csv", "--references", "a,a"], 2, "'a,a'"),
        (["good.csv", "--references", ""], 2, "''"),
        (["good.csv", "--sampling-rate", "7"], 2, "sampling_rate=7"),
        (["good.csv", "--thesis", "--max-order", "20"], 2, "--max-order 20"),
        (["good.csv", "--thesis", "--block-rows", "12"], 2, "--block-rows 12"),
        (["good.csv", "--pick", "7,x"], 2, "--pick 7,x must be frequencies"),
        (["good.csv", "--json", "."], 2, "folder"),
        (["good.csv", "--figures", "good.csv"], 2, "--figures good.csv"),
        (["short.csv"], 3, "samples"),
        (["."], 2, "not a file"),
        (["good.csv", "missing.csv"], 2, "missing.csv"),
        ([], 2, "FILE"),
    ],
)
def test_identify_explains_what_it_cannot_use(sprung, hostile, words, code, part):
    outcome = sprung("identify", *words)
    assert (outcome.code, outcome.out) == (code, "")
    assert outcome.err.startswith("sprung: ")
    assert outcome.err.count("\n") == 1
    assert part in outcome.err


@pytest.mark.parametrize(
    ("words", "part"),
    [
        (["chain"], "--out"),
        (["chain", "--out", "nowhere/a.csv"], "nowhere"),
        (["chain", "--out", "."], "folder"),
        (["chain", "--out", "a.csv", "--noise-band", "1", "2"], "--noise-band needs --snr"),
        (["chain", "--out", "a.csv", "--case", "2"], "No such option: --case"),
        (["rail", "--out", "a.csv", "--road", "C"], "No such option: --road"),
        (["road", "--out", "a.csv", "--noise-band", "1", "9"], "No such option: --noise-band"),
        (["road", "--out", "a.csv", "--road", "K"], "road class 'K' is not one of A, B"),
        (["road", "--out", "a.csv", "--sampling-rate", "0"], "--sampling-rate=0"),
        (["road", "--out", "a.csv", "--speed", "20", "10"], "highest speed=10 must be at least 20"),
        (["road", "--out", "a.csv", "--fault", "front_left.spring"], "is not of the form CORNER.COMPONENT=CHANGE"),
        (["quarter", "--out", "a.csv", "--fault", "corner.spring=-0.1@5"], "as only faults of drives can"),
        (["quarter", "--out", "a.csv", "--case", "5"], "--case"),
        (["road", "--out", "a.csv", "--vehicle", "chain3"], "vehicle 'chain3' is of kind chain, not road"),
        (["chain", "--out", "a.csv", "--vehicle", "zafira"], "kind road"),
        (["chain", "--out", "a.csv", "--vehicle", "quarter"], "kind quarter"),
        (["chain", "--out", "a.csv", "--minutes", "nan"], "--minutes=nan"),
        (["chain", "--out", "a.csv", "--minutes", "1e9"], "--minutes"),
        (["chain", "--out", "a.csv", "--sampling-rate", "0"], "--sampling-rate=0"),
        (["chain", "--out", "a.csv", "--snr", "0", "--minutes", "0.1"], "snr=0"),
        (["chain", "--out", "a.csv", "--records", "0"], "--records"),
    ],
)
def test_simulate_explains_what_it_cannot_do(sprung, tmp_path, monkeypatch, words, part):
    monkeypatch.chdir(tmp_path)
    outcome = sprung("simulate", *words)
    assert (outcome.code, outcome.out) == (2, "")
    assert outcome.err.count("\n") == 1
    assert part in outcome.err
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("lacking", "command"),
    [(lacking, command) for lacking in ("speed", "acc_rl", "values") for command in ("road", "corners", "calibrate")]
    + [("acc_rl", "baseline")],
)
def test_the_bad_one_of_several_files_is_named(sprung, tmp_path, monkeypatch, command, lacking):
    monkeypatch.chdir(tmp_path)
    drive = simulate_drive(read_vehicle("zafira"), RoadDrive(duration=30.0, sampling_rate=60.0, snr=50.0)).recording
    write(drive, "good one.npz")
    dead = replace(drive, samples=np.vstack([np.full_like(drive.samples[:1], np.nan), drive.samples[1:]]))
    less = drive.select([name for name in drive.names if name != lacking])
    write(dead if lacking == "values" else less, "bad one.npz")
    out = ["--out", "out.toml"] if command in {"calibrate", "baseline"} else []
    outcome = sprung(command, "good one.npz", "bad one.npz", "--vehicle", "zafira", *out)
    said = outcome.err + outcome.out  # a road goes on with the other drive, and notes why not with this one
    assert (said.count("bad one.npz: "), "good one.npz: " in said) == (1, False)


def test_unknown_commands_are_refused(sprung):
    for words in ([], ["fly"], ["--fly"]):
        outcome = sprung(*words)
        assert (outcome.code, outcome.out) == (2, "")
        assert outcome.err.count("\n") == 1
        assert "sprung --help" in outcome.err


@pytest.mark.parametrize(
    ("error", "code"),
    [
        (ParameterError("a\nb"), 2),
        (FormatError("a\nb"), 2),
        (MissingPackageError("a\nb"), 2),
        (DataError("a\nb"), 3),
        (IdentificationError("a\nb"), 3),
        (FileNotFoundError(2, "a\nb", "c"), 2),
        (OSError("a\nb"), 2),
    ],
)
def test_errors_have_their_exit_code_and_one_line(capsys, error, code):
    def run():
        raise error

    assert explained(run) == code
    assert "a b" in capsys.readouterr().err


def test_lack_of_memory_is_explained(capsys):
    def run():
        return bytearray(1 << 62)

    assert explained(run) == 2
    assert "memory" in capsys.readouterr().err


def test_interruption_is_silent(capsys):
    def run():
        raise KeyboardInterrupt

    assert explained(run) == 130
    assert capsys.readouterr() == ("", "")


def test_mistakes_of_the_program_are_not_hidden():
    def run():
        raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        explained(run)


def test_nothing_that_is_read_is_written_over(sprung, tmp_path):
    out = tmp_path / "run.csv"
    assert sprung("simulate", "chain", "--minutes", 1, "--out", out).code == 0
    before = out.read_bytes()
    vehicle = tmp_path / "run.csv.vehicle.toml"
    for words in (
        ("info", out, "--json", out),
        ("identify", out, "--json", tmp_path / "." / "run.csv"),
        ("identify", out, "--vehicle", vehicle, "--json", vehicle),
        ("simulate", "chain", "--out", out, "--json", out),
    ):
        outcome = sprung(*words)
        assert outcome.code == 2
        assert "would overwrite" in outcome.err
    assert out.read_bytes() == before
    assert vehicle.read_text().startswith("schema")


@pytest.mark.parametrize(
    ("road", "message"),
    [
        ("A:0.3,B:0.3", "add up to 0.6"),
        ("A:x,B:0.3", "such as A:0.3,B:0.5,C:0.2"),
        ("A,B", "such as A:0.3,B:0.5,C:0.2"),
        ("K:1", "road class 'K'"),
    ],
)
def test_a_mix_of_roads_has_classes_and_shares(sprung, road, message) -> None:
    outcome = sprung("plan", "zafira", "--road", road)
    assert (outcome.code, outcome.err.count("\n")) == (2, 1)
    assert message in outcome.err


def test_more_places_than_there_are_name_the_option(sprung) -> None:
    outcome = sprung("plan", "zafira", "--best", "9")
    assert (outcome.code, outcome.err) == (2, "sprung: --best=9 must be at least 1 and at most 7\n")
