"""Reports of boxes that identify on board."""

from pathlib import Path

import cbor2
import numpy as np
import pytest

from sprung.errors import FormatError
from sprung.formats import read
from sprung.identification import summarise
from sprung.link import Key
from sprung.link.summaries import summary_document
from sprung.online.monitor.ledger import archive_correlations, reported_modes
from sprung.simulation import simulate, usual_excitation
from sprung.vehicles import chain

PLACE = {Key.BOOT: 3, Key.START: 1_795_219_200_000_000_000, "number": 8}


def test_modes_are_kept_as_they_were_sent() -> None:
    modes = [{"natural_frequency": 1.4}]
    report = {**PLACE, "modes": modes, "reason": "", "more": 5}
    assert reported_modes(report) == {"modes": modes, "reason": "", "is_on_board": True}


@pytest.mark.parametrize("modes", [[{"natural_frequency": float("nan")}], b"bytes", {1: {2j}}])
def test_modes_that_json_cannot_hold_are_refused(modes) -> None:
    with pytest.raises(FormatError, match="modes that cannot be stored"):
        reported_modes({**PLACE, "modes": modes})


def test_archived_correlations_are_those_of_the_box(tmp_path: Path) -> None:
    """In 32 bits, which keep 7 digits of the largest."""
    vehicle = chain()
    run = simulate(vehicle, usual_excitation(vehicle), duration=60.0, sampling_rate=200.0, seed=3)
    summary = summarise("cov", run)
    document = cbor2.loads(cbor2.dumps({**PLACE, "summary": summary_document(summary)}))
    archive_correlations(document, tmp_path, "car-1")
    (path,) = tmp_path.rglob("*.parquet")
    assert path.relative_to(tmp_path).as_posix() == "car-1/2026-11-21/3-8.parquet"
    archived, average = read(path), summary.average
    assert archived.names[1] == f"{average.channels[0]}:{average.references[1]}"
    expected = average.values.reshape(len(archived.channels), -1)
    np.testing.assert_allclose(archived.samples, expected, atol=1e-6 * np.abs(expected).max())


@pytest.mark.parametrize("change", [{}, {"summary": 5}, {"summary": {}}])
def test_reports_without_a_summary_are_refused(tmp_path: Path, change) -> None:
    with pytest.raises(FormatError):
        archive_correlations({**PLACE, **change}, tmp_path, "car-1")
    assert list(tmp_path.iterdir()) == []
