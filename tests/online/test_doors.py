"""Files for other programs in `deploy` name what the monitor states."""

import json
import re
from pathlib import Path

from sprung.state import Verdict

DEPLOY = Path(__file__).parents[2] / "deploy"


def test_signals_are_the_verdict_and_what_is_known_of_each_part() -> None:
    text = (DEPLOY / "sprung.vspec").read_text(encoding="utf-8")
    assert f"allowed: {[str(verdict) for verdict in Verdict]}" in text
    names = {"", ".Change", ".ChangeLow", ".ChangeHigh", ".Detectable"}
    kinds = ("Spring", "Damper", "Tyre")
    signals = {f"Vehicle.Chassis.Axle.Wheel.{kind}{name}" for kind in kinds for name in names}
    assert set(re.findall(r"^(Vehicle\S+):$", text, re.MULTILINE)) == {"Vehicle.Chassis.SuspensionVerdict", *signals}


def test_the_dashboard_asks_for_figures_of_the_monitor() -> None:
    panels = json.loads((DEPLOY / "grafana.json").read_text(encoding="utf-8"))["panels"]
    asked = {name for panel in panels for name in re.findall(r"sprung_\w+", panel["targets"][0]["expr"])}
    documented = Path(DEPLOY.parent, "docs", "monitor.md").read_text(encoding="utf-8")
    assert all(f"| `{name}" in documented for name in asked)
    assert len(asked) == len(panels)
