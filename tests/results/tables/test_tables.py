"""Tables of documents, cell by cell."""

from datetime import UTC, datetime

from sprung.results.tables import alert_history_table, alerts_table, span_in_words, true_modes_table, vehicles_table

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


def test_true_modes_keep_their_digits():
    modes = [{"natural_frequency": 12.0, "damping_ratio": 0.24, "label": "wheel_hop"}]
    assert true_modes_table({"modes": modes}).rows == (("12.00", "24.00", "wheel hop"),)


def test_a_span_names_its_day_once():
    assert span_in_words(NOON, NOON + 10 * MINUTE) == "2026-11-21 12:00 to 12:10 UTC"
    assert span_in_words(NOON, NOON + 1440 * MINUTE) == "2026-11-21 12:00 to 2026-11-22 12:00 UTC"
