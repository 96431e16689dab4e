"""Identification on the vehicle: correlations and modes go out, samples stay in a ring and can be asked for."""

import json
from collections.abc import Iterator, Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any

from sprung._checks import check_number
from sprung.errors import SprungError
from sprung.identification import modes_of_summary, summarise
from sprung.link import Spool, checked_map, joined
from sprung.link.summaries import mode_documents, summary_document
from sprung.recording import Recording
from sprung.vehicles import Vehicle

#: Number, begin and end (UTC ns) of a request for samples.
Request = tuple[int, int, int]
#: Answers that are remembered.
_MOST_ANSWERS = 100


class Answers:
    """What was sent at each request for samples: one that comes again is answered, and nothing is sent twice.

    Parameters
    ----------
    path
        Of the file that outlasts the box; None: they are forgotten with it.
    """

    def __init__(self, path: Path | None = None) -> None:
        self._path = path
        self._known: dict[Request, dict[str, Any]] = {}
        if path is not None and path.exists():
            with suppress(OSError, ValueError, TypeError):  # damaged: samples are sent once more
                self._known = {(number, *times): answer for (number, *times), answer in json.loads(path.read_bytes())}

    def get(self, request: Request) -> dict[str, Any] | None:
        """Return what a request was answered; None where it is new."""
        return self._known.get(request)

    def keep(self, request: Request, answer: dict[str, Any]) -> None:
        """Remember an answer; a disk that is full stops nothing."""
        self._known[request] = answer
        if len(self._known) > _MOST_ANSWERS:
            self._known.pop(next(iter(self._known)))
        if self._path is not None:
            part = self._path.with_name(f"{self._path.name}.part")
            with suppress(OSError):
                part.write_text(json.dumps(list(self._known.items())), encoding="ascii")
                part.rename(self._path)


class OnBoard:
    """Makes windows of samples into correlations and modes.

    Parameters
    ----------
    vehicle
        As its file says.
    ring
        Where the samples stay, the oldest dropped first.
    window
        Length [s].
    method
        "cov", "acs" or "coss".
    answers
        To requests for samples; None: remembered until the box stops.
    """

    def __init__(
        self,
        vehicle: Vehicle,
        ring: Spool,
        *,
        window: float = 600.0,
        method: str = "cov",
        answers: Answers | None = None,
    ) -> None:
        check_number("window", window, at_least=60)
        self._vehicle, self._ring, self._window, self._method = vehicle, ring, window, method
        self._answers = Answers() if answers is None else answers
        self._blocks: list[Recording] = []
        self._number = 0

    @property
    def ring(self) -> Spool:
        """Samples as frames."""
        return self._ring

    @property
    def answers(self) -> Answers:
        """To requests for samples."""
        return self._answers

    def take(self, block: Recording) -> list[tuple[str, dict[Any, Any]]]:
        """Take in a block, and return the messages of a window that it completes: kind and what is in them."""
        if self._blocks and self._blocks[-1].channels != block.channels:
            self._blocks = []
        self._blocks.append(block)
        n_samples = sum(one.n_samples for one in self._blocks)
        if n_samples < self._window * block.sampling_rate:
            return []
        whole = joined(self._blocks)
        self._blocks = []
        place = {4: whole.start or 0, 5: round(1e9 / whole.sampling_rate), 7: n_samples, "number": self._number}
        self._number += 1
        try:
            summary = summarise(self._method, whole, vehicle=self._vehicle)
            modes = modes_of_summary(summary, vehicle=self._vehicle)
        except SprungError as error:
            return [("modes", {**place, "modes": [], "reason": str(error)})]
        found = {**place, "modes": mode_documents(modes), "reason": ""}
        return [("corr", {**place, "summary": summary_document(summary)}), ("modes", found)]

    def asked_for(self, begin: int, end: int) -> Iterator[Mapping[Any, Any]]:
        """Yield the frames in the ring that lie between two times (UTC ns), as maps."""
        for _, _, payload in self._ring.frames():
            document = checked_map(payload)
            if document[4] < end and document[4] + document[5] * document[7] > begin:
                yield document
