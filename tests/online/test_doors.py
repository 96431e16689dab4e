"""Files for other programs in `deploy` name what the monitor states, and the programs' own readers take them."""

import json
import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from sprung.state import Verdict

DEPLOY = Path(__file__).parents[2] / "deploy"
#: Where `make setup` installs programs whose requirements contradict ours.
CHECKERS = Path(sys.prefix, "checkers", "bin")
needs_checkers = pytest.mark.skipif(
    not (CHECKERS / "vspec").exists(), reason="vss-tools and Grafana's SDK are absent: make setup installs them"
)
#: The branches of the COVESA specification below which the signals hang, as its release of June 2026 divides them.
TREE = """
Vehicle: {type: branch, description: The vehicle.}
Vehicle.Chassis: {type: branch, description: Below the body.}
Vehicle.Chassis.Axle: {type: branch, description: Axles., instances: ["Row[1,2]"]}
Vehicle.Chassis.Axle.Wheel: {type: branch, description: Wheels of an axle., instances: [Left, Right]}
"""
QUANTITIES = "relation: {definition: Ratio of two values.}"
UNITS = "percent: {definition: Hundredths., unit: percent, quantity: relation, allowed-datatypes: [numeric]}"
#: Grafana's data model of dashboards reads a document and writes what it understood.
REWRITE = """
import json, sys
from grafana_foundation_sdk.cog import encoder, plugins
from grafana_foundation_sdk.models.dashboard import Dashboard
plugins.register_default_plugins()
print(encoder.JSONEncoder().encode(Dashboard.from_json(json.load(sys.stdin))))
"""


def test_signals_are_the_verdict_and_what_is_known_of_each_part() -> None:
    text = (DEPLOY / "sprung.vspec").read_text(encoding="utf-8")
    assert f"allowed: {[str(verdict) for verdict in Verdict]}" in text
    names = {"", ".Change", ".ChangeLow", ".ChangeHigh", ".Detectable"}
    kinds = ("Spring", "Damper", "Tyre")
    signals = {f"Vehicle.Chassis.Axle.Wheel.{kind}{name}" for kind in kinds for name in names}
    assert set(re.findall(r"^(Vehicle\S+):$", text, re.MULTILINE)) == {"Vehicle.Chassis.SuspensionVerdict", *signals}


def merged(folder: Path, overlay: str) -> dict[str, Any]:
    """Return the tree with an overlay as vss-tools merge them by the command of the manual; empty where they refuse."""
    files = {"quantities.yaml": QUANTITIES, "units.yaml": UNITS, "sprung.vspec": overlay}
    for name, text in (files | {"VehicleSignalSpecification.vspec": TREE}).items():
        (folder / name).write_text(text, encoding="utf-8")
    manual = Path(DEPLOY.parent, "docs", "monitor.md").read_text(encoding="utf-8")
    (command,) = re.findall(r"`vspec (export [^`]+)`", manual)
    done = subprocess.run([str(CHECKERS / "vspec"), *command.split()], cwd=folder, capture_output=True, check=False)
    return json.loads((folder / "merged.json").read_text(encoding="utf-8")) if done.returncode == 0 else {}


@needs_checkers
@pytest.mark.slow
def test_vss_tools_merge_the_signals_at_every_wheel(tmp_path: Path) -> None:
    chassis = merged(tmp_path, (DEPLOY / "sprung.vspec").read_text(encoding="utf-8"))["Vehicle"]["children"]["Chassis"]
    assert chassis["children"]["SuspensionVerdict"]["allowed"] == [str(verdict) for verdict in Verdict]
    for row in ("Row1", "Row2"):
        wheels = chassis["children"]["Axle"]["children"][row]["children"]["Wheel"]["children"]
        for side in ("Left", "Right"):
            parts = wheels[side]["children"]
            signals = [signal for part in parts.values() for signal in part["children"].values()]
            assert (list(parts), len(signals)) == (["Damper", "Spring", "Tyre"], 12)
            kinds = {(each["type"], each["datatype"], each["unit"]) for each in signals}
            assert kinds == {("sensor", "float", "percent")}


@needs_checkers
@pytest.mark.slow
@pytest.mark.parametrize(
    ("right", "wrong"),
    [
        ("unit: percent", "unit: percents"),
        ("datatype: float", "datatype: floats"),
        ("datatype: float", "datatype: string"),
    ],
)
def test_vss_tools_refuse_a_misspelt_signal(tmp_path: Path, right: str, wrong: str) -> None:
    """So that the test above can fail."""
    assert not merged(tmp_path, (DEPLOY / "sprung.vspec").read_text(encoding="utf-8").replace(right, wrong, 1))


def test_the_dashboard_asks_for_figures_of_the_monitor() -> None:
    panels = json.loads((DEPLOY / "grafana.json").read_text(encoding="utf-8"))["panels"]
    asked = {name for panel in panels for name in re.findall(r"sprung_\w+", panel["targets"][0]["expr"])}
    documented = Path(DEPLOY.parent, "docs", "monitor.md").read_text(encoding="utf-8")
    assert all(f"| `{name}" in documented for name in asked)
    assert len(asked) == len(panels)


def not_understood(stated: Any, read: Any, place: str = "") -> Iterator[str]:
    """Yield the places of a document that are missing or different in what was read."""
    if isinstance(stated, dict) and isinstance(read, dict):
        for key, value in stated.items():
            yield from not_understood(value, read.get(key), f"{place}.{key}")
    elif isinstance(stated, list) and isinstance(read, list) and len(stated) == len(read):
        for k, (one, other) in enumerate(zip(stated, read, strict=True)):
            yield from not_understood(one, other, f"{place}[{k}]")
    elif stated != read:
        yield place


@needs_checkers
@pytest.mark.slow
def test_grafana_reads_the_whole_dashboard() -> None:
    stated = json.loads((DEPLOY / "grafana.json").read_text(encoding="utf-8"))
    misspelt = json.loads(
        json.dumps(stated).replace('"gridPos"', '"gridPosition"', 1).replace('"expr"', '"expresion"', 1)
    )
    found = []
    for document in (stated, misspelt):
        command = [str(CHECKERS / "python"), "-c", REWRITE]
        done = subprocess.run(command, input=json.dumps(document), capture_output=True, text=True, check=True)
        found.append(list(not_understood(document, json.loads(done.stdout))))
    assert found == [[], [".panels[0].gridPosition", ".panels[0].targets[0].expresion"]]
