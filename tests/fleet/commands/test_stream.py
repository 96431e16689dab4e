"""Streams from the command line: which source, and where it is."""

from typing import Any

import pytest

from sprung.fleet.commands.runs import takes_settings
from sprung.fleet.jobs import FleetSettings
from sprung.fleet.jobs.analysis import WindowSettings
from sprung.fleet.jobs.assessment import AssessmentSettings

PLACES = ("--vehicles", "vehicles", "--out", "results", "--checkpoint", "checkpoint")


@pytest.mark.parametrize(
    "sources", [(), ("lake", "--frames", "frames"), ("--kafka", "host:9092", "--frames", "frames")]
)
def test_a_stream_has_one_source(sprung, sources) -> None:
    outcome = sprung("fleet", "stream", *sources, *PLACES)
    assert outcome.code == 2
    assert "give a LAKE, --kafka or --frames" in outcome.err


def test_numbers_are_checked_before_spark_starts(sprung) -> None:
    outcome = sprung("fleet", "stream", "lake", *PLACES, "--every", "0")
    assert (outcome.code, "--every" in outcome.err) == (2, True)
    outcome = sprung("fleet", "stream", "--frames", "frames", *PLACES, "--steps", "guess")
    assert (outcome.code, "guess" in outcome.err) == (2, True)
    outcome = sprung("fleet", "stream", "--frames", "frames", *PLACES, "--window", "0.5")
    assert (outcome.code, "--window" in outcome.err) == (2, True)


def test_options_become_the_settings_of_a_run() -> None:
    found: list[FleetSettings] = []

    @takes_settings("since", "until")
    def command(*, settings: FleetSettings, minutes: float) -> None:
        found.append(settings)

    given: dict[str, Any] = {"steps": "identify,diagnose", "learn": 3, "method": "fdd", "allow_missing": True}
    command(**given, false_alarms=0.01, false_discoveries=0.1, hours_per_day=3.0, minutes=5.0)
    windows, assessment = WindowSettings("fdd", True), AssessmentSettings(3, false_alarms=0.01, windows_per_day=36.0)
    assert found == [FleetSettings(("identify", "diagnose"), windows, assessment, 0.1)]


def test_a_run_needs_windows_of_some_length(sprung) -> None:
    outcome = sprung("fleet", "run", "lake", *PLACES[:4], "--window", "0")
    assert (outcome.code, outcome.err.count("\n"), "--window" in outcome.err) == (2, 1, True)


@pytest.mark.parametrize("command", [("run",), ("explain",), ("stream", "--checkpoint", "progress")])
def test_a_folder_without_a_lake_is_refused_before_spark_starts(sprung, tmp_path, monkeypatch, command) -> None:
    monkeypatch.setattr("sprung.fleet.jobs.spark_session", lambda *_, **__: pytest.fail("Spark was started"))
    outcome = sprung("fleet", command[0], tmp_path, "--vehicles", "v", "--out", tmp_path / "out", *command[1:])
    assert outcome.code == 3
    assert outcome.err.strip().endswith("holds no table: give the folder of a lake, or import files into it first")
