"""What the documents show works: vehicle files parse, commands exist, examples run."""

import itertools
import json
import os
import re
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

from sprung.vehicles import Vehicle, parse_vehicle

REPOSITORY = Path(__file__).parents[2]
DOCUMENTS = [REPOSITORY / "README.md", *sorted((REPOSITORY / "docs").glob("*.md"))]


def blocks(path, language):
    """Return the fenced blocks of one language."""
    return re.findall(rf"```{language}\n(.*?)```", path.read_text(encoding="utf-8"), flags=re.DOTALL)


def test_vehicle_file_of_the_documentation_parses() -> None:
    on_axles, on_bogies, on_air = map(tomllib.loads, blocks(REPOSITORY / "docs" / "vehicle-file.md", "toml"))
    vehicle = parse_vehicle(on_axles)
    assert vehicle.name == "zafira"
    assert vehicle.sensor[0].channel == "acc_fl"
    (front,) = on_bogies["bogie"]
    body = {"mass": 27000.0, "pitch_inertia": 850e3, "roll_inertia": 42e3}
    bogies = [front, front | {"x": -7.2}]
    metro = parse_vehicle(on_bogies | {"name": "metro", "kind": "rail", "body": body, "bogie": bogies})
    assert isinstance(metro, Vehicle)
    assert metro.bogie[1].secondary_stiffness == 2.9e5
    assert metro.sensor[0].on == "bogie1"
    steel = {name: value for name, value in front.items() if not name.startswith("secondary_")}
    bogies = [steel | on_air["bogie"], steel | on_air["bogie"] | {"x": -7.2}]
    airy = parse_vehicle(on_bogies | {"name": "metro", "kind": "rail", "body": body, "bogie": bogies})
    assert isinstance(airy, Vehicle)
    assert airy.bogie[0].air_spring is not None


def commands():
    """Return the sprung commands that the documents show, without comments."""
    lines = [line for path in DOCUMENTS for block in blocks(path, "console") for line in block.splitlines()]
    return [line.split("#")[0].split("sprung ", 1)[1].split() for line in lines if ".venv/bin/sprung " in line]


@pytest.mark.slow
@pytest.mark.parametrize("words", commands(), ids=" ".join)
def test_commands_of_the_documents_have_their_options(words) -> None:
    command = itertools.takewhile(lambda word: not word.startswith("-"), words)
    shown = subprocess.run(
        [sys.executable, "-c", "from sprung.cli import main; raise SystemExit(main())", *command, "--help"],
        capture_output=True,
        text=True,
        check=True,
        env={**os.environ, "COLUMNS": "200"},
    ).stdout
    for word in words[1:]:
        if word.startswith("--"):
            assert word in shown


def test_links_of_the_documents_lead_somewhere() -> None:
    for path in DOCUMENTS:
        for target in re.findall(r"\]\(([^)#:]+)\)", path.read_text(encoding="utf-8")):
            assert (path.parent / target).exists(), f"{path.name}: {target}"


#: What each example prints, and the documents that it writes.
EXAMPLES = {
    "modes_of_a_car.py": ("true bounce: 1.52 Hz", []),
    "corners_of_a_drive.py": ("front-left spring: -2", ["corners.json"]),
    "change_of_a_car.py": ("rear-right spring", ["baseline.json", "diagnosis.json"]),
    "own_csv.py": ("12000 samples at 100 Hz, 0 gaps", ["modes.json"]),
}


def test_every_example_is_run() -> None:
    assert EXAMPLES.keys() == {path.name for path in (REPOSITORY / "examples").glob("*.py")}


@pytest.mark.slow
@pytest.mark.parametrize("name", EXAMPLES)
def test_examples_run(name, tmp_path, check_document) -> None:
    words = [sys.executable, str(REPOSITORY / "examples" / name)]
    outcome = subprocess.run(words, capture_output=True, text=True, check=True, cwd=tmp_path)
    text, documents = EXAMPLES[name]
    assert outcome.stderr == ""
    assert text in outcome.stdout
    for document in documents:
        check_document(json.loads((tmp_path / document).read_text()))
