"""Identification on the vehicle: correlations and modes are sent, samples stay in a ring until requested."""

import json
from collections.abc import Iterator, Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any

from sprung._checks import check_number
from sprung.errors import SprungError
from sprung.identification import IdentificationSettings, modes_of_summary, summarise
from sprung.link import Header, Key, Spool, checked_map, joined
from sprung.link.summaries import summary_document
from sprung.recording import Recording
from sprung.results.documents import mode_documents
from sprung.vehicles import Vehicle

#: Number, start and end (UTC ns) of a request for samples.
Request = tuple[int, int, int]
#: Largest number of answers that are remembered.
_MAX_ANSWERS = 100


class Answers:
    """Answers to requests for samples: a repeated request is answered again, and no samples are sent twice.

    Parameters
    ----------
    path
        File that keeps the answers across restarts; None: answers are not kept.
    """

    def __init__(self, path: Path | None = None) -> None:
        self._path = path
        self._known: dict[Request, dict[str, Any]] = {}
        if path is not None and path.exists():
            with suppress(OSError, ValueError, TypeError):  # a damaged file: samples are sent once more
                self._known = {(number, *times): answer for (number, *times), answer in json.loads(path.read_bytes())}

    def get(self, request: Request) -> dict[str, Any] | None:
        """Return the answer to a request; None if it is new."""
        return self._known.get(request)

    def keep(self, request: Request, answer: dict[str, Any]) -> None:
        """Remember an answer, in memory only if the disk is full."""
        self._known[request] = answer
        if len(self._known) > _MAX_ANSWERS:
            self._known.pop(next(iter(self._known)))
        if self._path is not None:
            part = self._path.with_name(f"{self._path.name}.part")
            with suppress(OSError):
                part.write_text(json.dumps(list(self._known.items())), encoding="ascii")
                part.rename(self._path)


class OnBoard:
    """Turns windows of samples into correlations and modes.

    Parameters
    ----------
    vehicle
        Vehicle with its sensors.
    ring
        Spool that keeps the samples and drops the oldest first.
    window
        Length of a window [s].
    answers
        Answers to requests for samples; None: remembered until the box stops.
    """

    def __init__(
        self,
        vehicle: Vehicle,
        ring: Spool,
        *,
        window: float = 600.0,
        answers: Answers | None = None,
    ) -> None:
        check_number("window", window, at_least=60)
        self._vehicle = vehicle
        self._ring = ring
        self._window = window
        self._answers = Answers() if answers is None else answers
        self._blocks: list[Recording] = []
        self._number = 0

    @property
    def ring(self) -> Spool:
        """Spool that keeps the samples, as frames."""
        return self._ring

    @property
    def answers(self) -> Answers:
        """Answers to requests for samples."""
        return self._answers

    def take(self, block: Recording) -> list[tuple[str, dict[Any, Any]]]:
        """Take in a block, and return the reports of a window that it completes: kind and contents."""
        if self._blocks and self._blocks[-1].channels != block.channels:
            self._blocks = []
        self._blocks.append(block)
        n_samples = sum(part.n_samples for part in self._blocks)
        if n_samples < self._window * block.sampling_rate:
            return []
        whole = joined(self._blocks)
        self._blocks = []
        place = {
            Key.START: whole.start or 0,
            Key.INTERVAL: round(1e9 / whole.sampling_rate),
            Key.N_SAMPLES: n_samples,
            "number": self._number,
        }
        self._number += 1
        try:
            settings = IdentificationSettings(allow_missing=True)  # the box that takes the blocks has decided
            summary = summarise("cov", whole, settings=settings, vehicle=self._vehicle)
            modes = modes_of_summary(summary, vehicle=self._vehicle)
        except SprungError as error:
            return [("modes", {**place, "modes": [], "reason": str(error)})]
        identified = {**place, "modes": mode_documents(modes), "reason": ""}
        return [("corr", {**place, "summary": summary_document(summary)}), ("modes", identified)]

    def frames_between(self, begin: int, end: int) -> Iterator[Mapping[Any, Any]]:
        """Yield the frames in the ring that overlap a span of time (UTC ns), as maps."""
        for _, _, payload in self._ring.frames():
            document = checked_map(payload)
            header = Header.of(document)
            if header.start < end and header.end > begin:
                yield document


def on_board_in(folder: Path, vehicle: Vehicle, *, max_bytes: int) -> OnBoard:
    """Return identification on a vehicle that keeps its samples, and its answers to requests, in a folder.

    Parameters
    ----------
    folder
        Folder, created if it does not exist.
    vehicle
        Vehicle with its sensors.
    max_bytes
        Largest size of the samples.
    """
    ring = Spool(folder, max_bytes=max_bytes)
    return OnBoard(vehicle, ring, answers=Answers(folder / "answers.json"))
