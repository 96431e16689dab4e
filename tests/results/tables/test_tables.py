"""Tables and the words in them."""

import math
from dataclasses import replace
from datetime import UTC, datetime
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from sprung.diagnosis import Trend
from sprung.recording import Channel, Recording
from sprung.results.tables import (
    alert_history_table,
    alerts_table,
    describe_payload,
    describe_ride,
    describe_road,
    describe_shapes,
    describe_trend,
    format_orders,
    vehicles_table,
)
from sprung.results.tables.wording import format_estimate
from sprung.ride import assess_ride, weighted
from sprung.road import RoadEvent, RoadSurvey, Stretch, TrackRoughness

MINUTE = 60 * 10**9
NOON = round(datetime(2026, 11, 21, 12, tzinfo=UTC).timestamp()) * 10**9


def test_alerts_have_their_state_and_the_end_of_their_shelf():
    alert = {
        "number": 3,
        "vehicle": "bus-17",
        "state": "shelved",
        "shelved_until": NOON + 90 * MINUTE,
        "raised": NOON,
        "severity": 700,
        "assignee": None,
        "text": "front-left spring 25 % softer",
    }
    until = "shelved until 2026-11-21 13:30 UTC"
    assert alerts_table({"alerts": [alert]}).rows == (
        ("3", "bus-17", until, "2026-11-21 12:00", "700", "", "front-left spring 25 % softer"),
    )


def test_history_says_who_did_what():
    entries = [
        {"time": NOON, "what": "raised", "who": "", "comment": "", "assignee": None, "shelved_until": None},
        {"time": NOON, "what": "assigned", "who": "anna", "comment": "x", "assignee": "bert", "shelved_until": None},
        {"time": NOON, "what": "assigned", "who": "anna", "comment": "", "assignee": None, "shelved_until": None},
    ]
    assert alert_history_table({"history": entries}).rows == (
        ("2026-11-21 12:00", "raised", "the monitor", ""),
        ("2026-11-21 12:00", "assigned to bert", "anna", "x"),
        ("2026-11-21 12:00", "assigned to nobody", "anna", ""),
    )


def test_vehicles_have_their_baseline_health_and_age():
    vehicle = {"vehicle": "bus-17", "windows": 9, "health_index": 100.0, "last_seen": NOON, "summary": "no alert"}
    vehicles = [
        {**vehicle, "baseline": None, "health_index": None, "data_until": None},
        {**vehicle, "baseline": 2, "data_until": NOON - 72 * 60 * MINUTE},
        {**vehicle, "baseline": None, "health_index": 87.4, "data_until": NOON},
    ]
    rows = vehicles_table({"vehicles": vehicles}, now=NOON + 90 * MINUTE).rows
    assert rows[0] == ("bus-17", "9", "none", "unknown", "90 min ago", "", "no alert")
    assert rows[1] == ("bus-17", "9", "version 2", "100", "90 min ago", "2026-11-18 12:00\n3 days ago", "no alert")
    assert rows[2][3] == "87"


def test_values_have_the_digits_that_their_uncertainty_leaves():
    assert format_estimate(7.01234, 0.0123) == "7.012 ± 0.012"
    assert format_estimate(1234.5, 67.0) == "1234 ± 67"
    assert format_estimate(44279.6, 723.4) == "44280 ± 720"
    assert format_estimate(0.1882345, 0.00024) == "0.18823 ± 0.00024"
    assert format_estimate(19.6543, math.nan) == "19.65"
    assert format_estimate(19.6543, 0.0) == "19.65"


def test_shapes_in_words():
    shapes = np.array([[1.0, 0.9 + 0.1j, -0.8, 0.1], [0.2, 0.5j, 1.0, -0.6]])
    channels = ("acc_fl", "acc_fr", "acc_rl", "acc_rr")
    assert describe_shapes(channels, shapes) == ["fl+ fr+ rl-", "fr~ rl+ rr-"]
    assert describe_shapes(("a_1", "b_1", "c", "d"), shapes)[0] == "a_1+ b_1+ c-"
    assert describe_shapes(("only",), np.ones((1, 1), dtype=complex)) == ["only+"]
    many = [f"s{k}" for k in range(8)]
    assert describe_shapes(many, np.linspace(0.3, 1, 8, dtype=complex)[None]) == ["s2+ s3+ s4+ s5+ s6+ s7+ ..."]


def test_orders_inorders_in_words():
    assert format_orders([1]) == ""
    assert format_orders([1, 2, 3, 5, 7, 8]) == "1 to 3, 5, 7 to 8"
    assert format_orders([2]) == "2"


@pytest.mark.parametrize(
    ("trend", "words"),
    [
        (None, "trend not estimated: it needs a single part and at least four windows since the onset"),
        (Trend(0.01, (-0.01, 0.03), None), "no trend detected: -1.0 to +3.0 % per hour of driving"),
        (Trend(0.02, (0.01, 0.03), None), "trend: +2.0 % (+1.0 to +3.0) per hour of driving"),
        (
            Trend(-0.02, (-0.03, -0.01), (2.0, 6.0)),
            "trend: -2.0 % (-3.0 to -1.0) per hour of driving, 30 % in 2.0 to 6.0 hours",
        ),
        (Trend(-0.02, (-0.03, -0.01), (0.0, 0.0)), "trend: -2.0 % (-3.0 to -1.0) per hour of driving, 30 % is reached"),
    ],
)
def test_a_trend_in_words(trend, words):
    assert describe_trend(trend) == words


def test_numbers_that_round_to_nothing_have_no_sign() -> None:
    fit: Any = SimpleNamespace(payload={"payload_mass": {"value": -0.4, "std": 3.0}})
    assert describe_payload(fit) == ["payload: 0 ± 3 kg"]


def test_surveys_and_rides_begin_with_what_was_found() -> None:
    tracks = [TrackRoughness(iri, 0.1, 6e-5, 2.0, "B") for iri in (3.0, 4.0, 5.0, 6.0)]
    pairs = (tracks[0], tracks[1]), (tracks[2], tracks[3])
    stretches = tuple(Stretch(100.0 * k, 100.0 * k + 100, 0.0, 5.0, *pair) for k, pair in enumerate(pairs))
    survey = RoadSurvey(stretches, (RoadEvent(50.0, 2.5, "left", "pothole", 0.03, 0.6),), ("a note",))
    head = "2 stretches of 100 m: IRI 3.00 to 6.00 m/km, median 4.50; potholes, bumps and joints: 1"
    assert describe_road(survey) == [head, "a note"]
    run = np.sin(2 * np.pi * 5 * np.arange(4000) / 200)
    shaken = Recording(np.array([run, 2 * run, 0.03 * run]), 200.0, (*map(Channel, ("a", "b")), Channel("fork")))
    quantities = ("acceleration", "acceleration", "displacement")
    channels = tuple(replace(each, quantity=kind) for each, kind in zip(shaken.channels, quantities, strict=True))
    said = describe_ride(assess_ride(replace(shaken, channels=channels)))
    assert said[0].startswith("most at b (z), Wk: 1.4")
    assert said[1].startswith("health (ISO 2631-1) at b (z): caution after ")
    assert said[1].endswith(" h")
    assert said[2] == "travel from -30 to 30 mm"


def test_health_is_stated_where_the_dose_of_a_day_is_largest() -> None:
    """At 5 Hz, along and up: 0.4 m/s^2 by Wd, 1.4 times for health, are a larger dose than 0.5 m/s^2 by Wk."""
    run = np.sqrt(2) * np.sin(2 * np.pi * 5 * np.arange(12000) / 200)
    channels = tuple(Channel(name, "acceleration") for name in ("seat_x", "seat_z"))
    factors = [target / weighted_rms(run, name) for target, name in ((0.4, "Wd"), (0.5, "Wk"))]
    said = describe_ride(assess_ride(Recording(np.outer(factors, run), 200.0, channels)))
    assert said[0].startswith("most at seat_z (z), Wk: 0.5")
    assert said[1].startswith("health (ISO 2631-1) at seat_x (x): ")


def weighted_rms(run, weighting) -> float:
    return float(np.sqrt(np.mean(weighted(run, sampling_rate=200.0, weighting=weighting) ** 2)))
