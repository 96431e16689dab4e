"""Streams from the command line: which source, and where it is."""

import pytest

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
