"""Findings in words."""

from dataclasses import replace

import pytest

from sprung.diagnosis import Diagnosis, Finding, diagnose
from sprung.diagnosis.findings import detectable_in_words, time_in_words
from sprung.vehicles import Component


def test_sentences_of_intervals_and_axles(faulty, baseline) -> None:
    (finding,) = diagnose(faulty(5, {"rear_left.damper": -0.2, "rear_right.damper": -0.2}), baseline).findings
    assert finding.sentence.startswith("both rear dampers ")
    doubtful = replace(finding, change=-0.01, interval=(-0.03, 0.01))
    assert "1 % (-3 to +1 %) weaker" in doubtful.sentence


SOFT = Finding(
    corner="front_left",
    component="spring",
    change=-0.2,
    interval=(-0.23, -0.17),
    score=12.0,
    severity="medium",
    severity_number=500,
    advice="inspect at the next service",
    since=1200.0,
    since_interval=(600.0, 1200.0),
    runner_up="",
    trend=None,
)


@pytest.mark.parametrize(
    ("fields", "sentence"),
    [
        ({}, "front-left spring 20 % (17 to 23 %) softer, since 20 min; inspect at the next service"),
        (
            {"corner": "all", "component": "damper", "change": 0.5, "interval": (0.4, 0.6)},
            "all dampers 50 % (40 to 60 %) stronger, since 20 min; inspect at the next service",
        ),
        (
            {"interval": (-0.205, -0.195), "runner_up": "rear-left tyre by -9 %", "since": 1_795_219_200.0},
            "front-left spring 20.0 % (19.5 to 20.5 %) softer (or rear-left tyre by -9 %), since 2026-11-21 00:00 UTC; "
            "inspect at the next service",
        ),
        (
            {"corner": "vehicle", "component": "unmodelled", "change": None, "interval": None, "score": None},
            "the suspension differs from the baseline in a way that no single part explains: "
            "inspect at the next service",
        ),
    ],
)
def test_a_finding_is_one_sentence(fields, sentence) -> None:
    assert replace(SOFT, **fields).sentence == sentence


def test_a_finding_names_its_hypothesis() -> None:
    assert SOFT.hypothesis == "front_left.spring"
    assert replace(SOFT, corner="vehicle", component="unmodelled").hypothesis == "unmodelled"


def test_times_in_words() -> None:
    """Minutes of a recording, or the date where a time counts from 1970."""
    assert time_in_words(90.0) == "2 min"
    assert time_in_words(1_000_000_000.0) == "2001-09-09 01:46 UTC"


def test_a_vehicle_is_healthy_only_where_a_window_was_compared(healthy, baseline, silent) -> None:
    assert diagnose(healthy(3, seed=2), baseline).is_healthy
    assert diagnose([silent("standing")], baseline).is_healthy is None
    assert Diagnosis((), (), None, (), ()).is_healthy is None


def test_the_smallest_changes_are_one_clause() -> None:
    parts = [Component("front_left", kind) for kind in ("spring", "damper", "tyre")]
    clause = "a change of {} % of any part would have been found"
    assert detectable_in_words(dict(zip(parts, (0.07, 0.12, 0.1), strict=True))) == clause.format("7 to 12")
    assert detectable_in_words(dict.fromkeys(parts, 0.071)) == clause.format("7")
    assert detectable_in_words({}) == ""
