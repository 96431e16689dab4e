"""Times and periods as people write them."""

from datetime import UTC, datetime

import pytest

from sprung.errors import ParameterError
from sprung.results.tables.wording import Period, parse_period, parse_time

NOON = round(datetime(2026, 11, 21, 12, tzinfo=UTC).timestamp()) * 10**9


@pytest.mark.parametrize(
    "text", ["2026-11-21T12:00", "2026-11-21 12:00:00Z", "2026-11-21T13:00+01:00", str(NOON), " 20261121T12 "]
)
def test_a_time_has_many_forms(text) -> None:
    assert parse_time("since", text) == NOON


def test_a_last_day_belongs_to_a_period_as_a_whole() -> None:
    period = parse_period("2026-11-21", "2026-11-21")
    assert (period.since, period.until) == (NOON - 12 * 3600 * 10**9, NOON + 12 * 3600 * 10**9 - 1)
    assert parse_period(None, "2026-11-21T12:00") == Period(None, NOON)
    assert parse_period("", None) == Period()


@pytest.mark.parametrize("text", ["yesterday", "2026-13-01", "1969-12-31", "9" * 30, "-1", "2026-11-21T12:00+99:00"])
def test_what_is_no_time_is_refused(text) -> None:
    with pytest.raises(ParameterError, match=r"since=.* must be a date or time since 1970"):
        parse_time("since", text)


def test_a_period_ends_after_it_begins() -> None:
    with pytest.raises(ParameterError, match="swap since and until"):
        Period(NOON, NOON - 1)


def test_what_overlaps_a_period() -> None:
    period = Period(10, 20)
    assert [period.overlaps(*span) for span in ((0, 9), (0, 10), (20, 30), (21, None), (0, None))] == [
        False,
        True,
        True,
        False,
        True,
    ]
    assert Period().overlaps(0, 1)
