"""The command line as a process of its own: what it imports, and how it ends."""

import ast
import json
import os
import socket
import subprocess
import sys

import pytest
from tests.test_bounce_tests import pushes
from typer.utils import get_params_from_function

from sprung.formats import read, write
from sprung.simulation import RoadDrive, simulate_drive
from sprung.vehicles import read_vehicle

pytestmark = pytest.mark.skipif(os.name != "posix", reason="needs the streams of POSIX")

RUN = [sys.executable, "-m", "sprung"]


def python(code):
    return subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)


#: Packages that cost time, and what each command may import of them.
ROOMS = ("calibration", "diagnosis", "identification", "kits", "likelihood", "road", "simulation", "vehicles")
OTHERS = ("h5py", "jinja2", "matplotlib", "numpy", "pandas", "pyarrow", "pydantic", "rich", "scipy", "sqlalchemy")
OF_SCIPY = {f"scipy.{name}" for name in ("cluster", "interpolate", "ndimage", "optimize", "signal", "stats")}
OF_LIKELIHOOD = {f"sprung.likelihood.{name}" for name in ("fitting", "vehicle")}
HEAVY = {"pyarrow.compute", *OF_SCIPY, *OF_LIKELIHOOD, *OTHERS, *(f"sprung.{room}" for room in ROOMS)}
ARROW = {"numpy", "pyarrow", "pydantic", "rich"}
OF_MODES = {"scipy", "sprung.identification", "sprung.likelihood", "sprung.vehicles"}
MAY_IMPORT = {
    "--help": set(),
    "--version": set(),
    "vehicles --help": {"pydantic"},
    "info --help": {"pydantic", "rich"},
    "identify --help": {"pydantic", "rich"},
    "info {run}": ARROW,
    "info {parquet}": ARROW | {"pyarrow.compute"},
    "convert {run} {out}.csv": ARROW
    | {"pandas", "pyarrow.compute"},  # Arrow's writing imports pandas where it is installed
    "identify {run} --json -": ARROW | OF_MODES | {"scipy.cluster"},
    "bounce {pushes} --vehicle zafira": ARROW | OF_MODES - {"scipy"},
    "corners {drive} --vehicle zafira": ARROW | OF_MODES | OF_LIKELIHOOD | {"sprung.calibration", "sprung.diagnosis"},
}


@pytest.mark.slow
@pytest.mark.parametrize("words", MAY_IMPORT)
def test_commands_import_what_they_use(words, chain, tmp_path):
    parquet = tmp_path / "run.parquet"
    write(read(chain), parquet)
    if "{pushes}" in words:
        write(pushes(), tmp_path / "pushes.csv")
    if "{drive}" in words:
        write(
            simulate_drive(read_vehicle("zafira"), RoadDrive(duration=120.0), seed=1).recording, tmp_path / "drive.npz"
        )
    paths = {"run": chain, "parquet": parquet, "out": tmp_path / "out"}
    paths |= {"pushes": tmp_path / "pushes.csv", "drive": tmp_path / "drive.npz"}
    given = words.format(**paths).split()
    code = (
        f"import sys; from sprung.cli import main; code = main({given!r}); print(sorted(sys.modules)); sys.exit(code)"
    )
    outcome = python(code)
    assert outcome.returncode == 0, outcome.stderr
    *shown, modules = outcome.stdout.splitlines()
    assert shown
    assert HEAVY & set(ast.literal_eval(modules)) <= MAY_IMPORT[words]


def test_import_of_the_command_line_is_light():
    heavy = python("import sys, sprung.cli; print({'numpy', 'rich', 'pydantic'} & set(sys.modules))")
    assert heavy.stdout.strip() == "set()"


@pytest.mark.parametrize("group", ["", "accounts", "alerts", "fleet", "simulate", "tokens", "vehicles"])
def test_lists_of_commands_say_in_a_line_what_each_does(sprung, group):
    lines = sprung(*group.split(), "--help").out.partition("Commands:\n")[2].splitlines()
    assert len(lines) >= 3
    assert not [line for line in lines if line.endswith("...") or not line.endswith((".", ")")) or len(line) > 80]


def test_flags_are_shown_without_a_type(sprung):
    for words in (["--help"], ["identify", "--help"], ["corners", "--help"]):
        assert "<bool>" not in sprung(*words).out


@pytest.mark.parametrize("words", [("--help",), ("vehicles", "rank", "--help"), ("info", "--help")])
def test_options_are_made_for_the_called_command_alone(sprung, monkeypatch, words):
    """Those of all commands take a while to make; what is shown is the same."""
    made: set[str] = set()

    def noted(function):
        made.update([function.__name__] * bool(parameters := get_params_from_function(function)))
        return parameters

    monkeypatch.setattr("typer.main.get_params_from_function", noted)
    shown = sprung(*words).out
    assert {"road", "verdict", "rank", "info"} & made == {"rank", "info"} & {*words}
    monkeypatch.setattr("sprung.cli._name_others", lambda application, word: None)
    assert sprung(*words).out == shown
    assert {"road", "verdict", "rank", "info"} <= made


def test_help_lists_every_option_of_the_contract(sprung):
    contract = {
        "info": "--json",
        "identify": "--vehicle --method --channels --sampling-rate --band --decimate-to --segment --subsets --json"
        " --block-rows --max-order --cepstrum --references --stable-rate --figures",
        "simulate road": "--vehicle --minutes --sampling-rate --speed --road --fault --snr --seed --out --json",
    }
    for command, options in contract.items():
        shown = sprung(*command.split(), "--help").out
        assert all(option in shown for option in options.split())


@pytest.mark.slow
def test_progress_is_shown_on_a_terminal_only(chain):
    outer, inner = os.openpty()
    with subprocess.Popen(
        [*RUN, "identify", str(chain), "--json", "-"], stdout=subprocess.PIPE, stderr=inner, text=True
    ) as process:
        os.close(inner)
        shown = b""
        try:
            while piece := os.read(outer, 4096):
                shown += piece
        except OSError:  # the other side of a terminal is closed (Linux)
            pass
        assert process.stdout is not None
        out = process.stdout.read()
    os.close(outer)
    assert len(json.loads(out)["modes"]) == 3
    assert "━".encode() in shown
    silent = subprocess.run([*RUN, "identify", str(chain), "--json", "-"], capture_output=True, text=True, check=True)
    assert silent.stderr == ""
    assert silent.stdout == out


@pytest.mark.slow
def test_broken_pipe_is_silent(chain):
    for words in (["info", str(chain)], ["identify", str(chain), "--json", "-"]):
        reading, writing = os.pipe()
        os.close(reading)
        outcome = subprocess.run([*RUN, *words], stdout=writing, stderr=subprocess.PIPE, text=True, check=False)
        os.close(writing)
        assert outcome.stderr == ""


@pytest.mark.slow
def test_closed_and_narrow_streams(chain):
    closed = subprocess.run(
        [*RUN, "info", str(chain)], preexec_fn=lambda: os.close(1), stderr=subprocess.PIPE, check=False
    )
    assert (closed.returncode, closed.stderr) == (0, b"")
    environment = {**os.environ, "PYTHONIOENCODING": "ascii"}
    ascii_only = subprocess.run([*RUN, "identify", str(chain)], env=environment, capture_output=True, check=False)
    assert (ascii_only.returncode, ascii_only.stderr) == (0, b"")
    assert b"3 modes by Cov-SSI" in ascii_only.stdout


@pytest.mark.slow
def test_files_of_a_local_monitor_are_for_its_user_alone(tmp_path):
    with socket.socket() as one:
        one.bind(("127.0.0.1", 0))
        port = one.getsockname()[1]
    words = ["monitor", "--broker", f"embedded:{port}", "--http", "127.0.0.1:0"]
    process = subprocess.Popen(
        [*RUN, *words],
        stderr=subprocess.PIPE,
        text=True,
        cwd=tmp_path,
        env={**os.environ, "XDG_STATE_HOME": str(tmp_path / "state")},
        umask=0o022,
    )
    with process:
        assert process.stderr is not None
        for line in process.stderr:
            if "next: connect a box" in line:
                break
        made = [path for name in ("sprung-data", "state") for path in (tmp_path / name, *(tmp_path / name).rglob("*"))]
        modes = {path.name: oct(path.stat().st_mode & 0o777) for path in made}
        process.terminate()
        process.stderr.read()
    assert process.returncode == 0
    assert modes == {
        "sprung-data": "0o700",
        "sprung.sqlite": "0o600",
        "sprung.sqlite-wal": "0o600",
        "sprung.sqlite-shm": "0o600",
        "sprung.sqlite.lock": "0o600",
        "state": "0o700",
        "sprung": "0o700",
        f"broker-{port}": "0o600",
    }
