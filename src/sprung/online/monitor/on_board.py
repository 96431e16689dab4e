"""Results of on-board identification: modes, and the correlations behind them."""

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from sprung.errors import FormatError
from sprung.link import Key
from sprung.link.archive import write_archive
from sprung.link.messages import count
from sprung.link.summaries import summary_from_document


def reported_modes(document: Mapping[Any, Any]) -> dict[str, Any]:
    """Return the modes in a report of a box, in the form of the store.

    Raises
    ------
    FormatError
        If they cannot be written as JSON.
    """
    modes = {"modes": document.get("modes"), "reason": document.get("reason"), "is_on_board": True}
    try:
        json.dumps(modes, allow_nan=False)  # a report that the store cannot hold would be sent repeatedly
    except (TypeError, ValueError) as error:
        raise FormatError(f"modes that cannot be stored: {error}") from None
    return modes


def archive_correlations(document: Mapping[Any, Any], folder: Path, vehicle: str) -> None:
    """Write the correlations in a report of a box to an archive.

    Raises
    ------
    FormatError
        If they are incomplete.
    StoreError
        If the archive cannot be written.
    """
    summary = document.get("summary")
    if not isinstance(summary, Mapping):
        raise FormatError("a report of correlations without a summary")
    average = summary_from_document(summary).average
    write_archive(
        folder,
        vehicle,
        count(document, Key.BOOT),
        count(document, "number"),
        count(document, Key.START),
        samples=average.values.reshape(-1, average.values.shape[-1]),
        channels=[f"{name}:{reference}" for name in average.channels for reference in average.references],
        sampling_rate=average.sampling_rate,
    )
