import pytest

from sprung.cli import explained
from sprung.errors import (
    DataError,
    FormatError,
    IdentificationError,
    MissingPackageError,
    ParameterError,
)


@pytest.fixture
def hostile(tmp_path, monkeypatch):
    """The folder of the process, with files that hold no usable recording."""
    monkeypatch.chdir(tmp_path)
    rows = "".join(f"{0.01 * k:.2f},{(k * 7919) % 101},{(k * 104729) % 97}\n" for k in range(2000))
    texts = {
        "empty.csv": "",
        "heading.csv": "time,a,b\n",
        "one.csv": "time,a,b\n0,1,2\n",
        "words.csv": "time,a,b\n0,1,2\n0.01,x,3\n0.02,1,3\n",
        "constant.csv": "time,a,b\n" + "".join(f"{0.01 * k:.2f},5,{(k * 7919) % 101}\n" for k in range(2000)),
        "unit.csv": "time,a [furlong],b [g]\n" + rows,
        "double.csv": "time,a,a\n" + rows,
        "short.csv": "time,a,b\n" + "".join(rows.splitlines(keepends=True)[:100]),
        "good.csv": "time,a,b\n" + rows,
        "notes.doc": "\0\1" + rows,
        "vehicle.toml": 'schema = "sprung.vehicle/1"\nkind = "road"\n',
    }
    for name, text in texts.items():
        (tmp_path / name).write_text(text)
    return tmp_path


@pytest.mark.parametrize(
    ("name", "code", "part"),
    [
        ("missing.csv", 2, "no such file"),
        ("empty.csv", 2, "empty"),
        ("notes.doc", 2, "unknown format"),
        ("words.csv", 2, "line 3"),
        ("unit.csv", 2, "furlong"),
        ("double.csv", 2, "'a'"),
        ("heading.csv", 2, "no samples"),
        ("one.csv", 3, "one sample"),
        (".", 2, "not a file"),
    ],
)
def test_files_that_cannot_be_read(sprung, hostile, name, code, part):
    for command in ("info", "identify"):
        outcome = sprung(command, hostile / name, "--json", "-")
        assert (outcome.code, outcome.out) == (code, "")
        assert outcome.err.startswith("sprung: ")
        assert outcome.err.count("\n") == 1
        assert part in outcome.err


@pytest.mark.parametrize(
    ("words", "code", "part"),
    [
        (["good.csv", "--frobnicate"], 2, "--frobnicate"),
        (["good.csv", "--bnad", "1", "2"], 2, "--band"),
        (["good.csv", "--band", "1"], 2, "requires 2 arguments"),
        (["good.csv", "--band", "low", "high"], 2, "--band"),
        (["good.csv", "--band", "5", "2"], 2, "band 5 to 2"),
        (["good.csv", "--band", "nan", "2"], 2, "band nan"),
        (["good.csv", "--segment", "-1"], 2, "segment=-1"),
        (["good.csv", "--segment", "nan"], 2, "segment=nan"),
        (["good.csv", "--decimate-to", "0"], 2, "decimate_to=0"),
        (["good.csv", "--decimate-to", "1000"], 2, "decimate_to=1000"),
        (["good.csv", "--method", "magic"], 2, "'cov', 'acs', 'coss'"),
        (["good.csv", "--subsets", "2"], 2, "--method coss"),
        (["good.csv", "--subsets", "0", "--method", "coss"], 2, "--subsets"),
        (["good.csv", "--block-rows", "1"], 2, "--block-rows"),
        (["good.csv", "--block-rows", "x"], 2, "--block-rows"),
        (["good.csv", "--block-rows", "100000"], 3, "block_rows=100000"),
        (["good.csv", "--max-order", "100000"], 2, "max_order=100000"),
        (["good.csv", "--stable-rate", "2"], 2, "stable_rate=2"),
        (["good.csv", "--cepstrum", "0"], 2, "lifter=0"),
        (["good.csv", "--references", "z"], 2, "'z'"),
        (["good.csv", "--references", "a,,b"], 2, "'a,,b'"),
        (["good.csv", "--references", "a,a"], 2, "'a,a'"),
        (["good.csv", "--references", ""], 2, "''"),
        (["good.csv", "--channels", "a,z"], 2, "'z'"),
        (["good.csv", "--vehicle", "nothing"], 2, "'nothing'"),
        (["good.csv", "--vehicle", "vehicle.toml"], 2, "missing"),
        (["good.csv", "--vehicle", "zafira"], 2, "acc_fl"),
        (["good.csv", "--sampling-rate", "7"], 2, "sampling_rate=7"),
        (["good.csv", "--sampling-rate", "-7"], 2, "sampling_rate=-7"),
        (["good.csv", "--thesis", "--max-order", "20"], 2, "--max-order 20"),
        (["good.csv", "--thesis", "--block-rows", "12"], 2, "--block-rows 12"),
        (["good.csv", "--json", "nowhere/modes.json"], 2, "nowhere"),
        (["good.csv", "--json", "."], 2, "folder"),
        (["good.csv", "--figures", "good.csv"], 2, "--figures good.csv"),
        (["constant.csv"], 3, "constant at 5"),
        (["short.csv"], 3, "samples"),
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
        (["boat", "--out", "a.csv"], "No such command 'boat'"),
        (["chain"], "--out"),
        (["chain", "--out", "a.xyz", "--minutes", "0.1"], ".csv, .parquet, .npz, .mat"),
        (["chain", "--out", "nowhere/a.csv"], "nowhere"),
        (["chain", "--out", "."], "folder"),
        (["chain", "--out", "a.csv", "--noise-band", "1", "2"], "--snr"),
        (["chain", "--out", "a.csv", "--case", "2"], "No such option: --case"),
        (["road", "--out", "a.csv", "--sampling-rate", "0"], "sampling_rate"),
        (["rail", "--out", "a.csv", "--road", "C"], "No such option: --road"),
        (["road", "--out", "a.csv", "--fault", "front_left.spring"], "front_left.spring"),
        (["road", "--out", "a.csv", "--fault", "front_left.tire=-0.2"], "tire"),
        (["quarter", "--out", "a.csv", "--case", "5"], "--case"),
        (["chain", "--out", "a.csv", "--vehicle", "zafira"], "kind road"),
        (["chain", "--out", "a.csv", "--vehicle", "quarter"], "kind quarter"),
        (["chain", "--out", "a.csv", "--minutes", "0"], "--minutes=0"),
        (["chain", "--out", "a.csv", "--minutes", "nan"], "--minutes=nan"),
        (["chain", "--out", "a.csv", "--minutes", "1e9"], "--minutes"),
        (["chain", "--out", "a.csv", "--sampling-rate", "0"], "--sampling-rate=0"),
        (["chain", "--out", "a.csv", "--snr", "0", "--minutes", "0.1"], "snr=0"),
        (["chain", "--out", "a.csv", "--snr", "1", "--noise-band", "5", "1", "--minutes", "0.1"], "above 5"),
        (["chain", "--out", "a.csv", "--seed", "-1"], "--seed"),
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
