"""What boxes have identified themselves: modes, and the correlations behind them."""

import json
import logging
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from sprung.errors import SprungError
from sprung.link.summaries import summary_from_document
from sprung.storage import write_archive

LOG = logging.getLogger("sprung.monitor")


def received(kind: str, document: Mapping[Any, Any], archive: Path | None, vehicle: str) -> dict[str, Any] | None:
    """Return modes as the store keeps them, or put correlations into the archive and return None.

    Parameters
    ----------
    kind
        "modes" or "corr".
    document
        The message.
    archive
        Folder of samples, beside which correlations are kept; None: they are not.
    vehicle
        Its name.
    """
    try:
        if kind == "modes":
            found = {"modes": document.get("modes"), "reason": document.get("reason"), "is_on_board": True}
            json.dumps(found, allow_nan=False)  # what the store cannot hold would come again and again
            return found
        average = summary_from_document(document["summary"]).average
        if archive is not None:
            write_archive(
                archive.with_name("correlations"),
                vehicle,
                document[2],
                document["number"],
                document[4],
                samples=average.values.reshape(-1, average.values.shape[-1]),
                channels=[f"{one}:{other}" for one in average.channels for other in average.references],
                sampling_rate=average.sampling_rate,
            )
    except (SprungError, KeyError, TypeError, ValueError) as error:
        LOG.warning("what a box identified was not kept", extra={"vehicle": vehicle, "reason": str(error)})
    return None
