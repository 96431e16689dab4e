"""Modes of one vehicle every minute: of the window so far, and of the complete window."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, replace
from typing import Any

from sprung.errors import SprungError
from sprung.identification import METHODS, IdentificationSettings, RunningSummary, modes_of_summary, rate_for_body
from sprung.link import Block, joined
from sprung.modal import Modes
from sprung.online.monitor.events import Identified, MonitorSettings
from sprung.recording import Recording
from sprung.results.documents import mode_documents
from sprung.signals.harmonics import Harmonic, harmonic_from_dict
from sprung.vehicles import Vehicle

#: Shortest stretch of a window that modes are identified from [s].
_SHORTEST = 120.0
#: Length of the segments of a window that is not complete [s]: short enough for many of them after two minutes.
_SEGMENT = 10.0
#: Identification of a complete window, also for its page, and what that of an incomplete one has in common with it.
IDENTIFICATION = IdentificationSettings(has_road_modes=False, refine=False, allow_missing=True, kind="random")


class ModeIdentifier:
    """Identifies modes as the window of a vehicle grows.

    Parameters
    ----------
    settings
        Settings of the monitoring.

    Notes
    -----
    Modes of a complete window are those of the batch method. Until then a cheaper identification serves: the samples
    between one identification and the next are one record (`RunningSummary`), prepared and correlated once, at a rate
    for the modes of the body alone (`rate_for_body`). Lines of wheels and engine are sought once per window, when it is
    complete; until then those of the previous window are used.
    """

    def __init__(self, settings: MonitorSettings) -> None:
        self._settings = settings
        self._running: RunningSummary | None = None
        self._modes: tuple[dict[str, Any], ...] = ()
        self._harmonics: tuple[Harmonic, ...] | None = None
        self.n_identified = 0

    def is_due(self, before: int, after: int, sampling_rate: float) -> bool:
        """Return whether modes are identified where the window has grown from one number of samples to another."""
        step = self._settings.identify_every * sampling_rate
        return bool(step) and after // step > before // step

    def begin(self) -> None:
        """Begin a new window."""
        self._running = None

    def identify(self, blocks: Sequence[Block], whole: Recording | None, vehicle: Vehicle) -> Identified:
        """Identify the modes of the whole window, or of the blocks of it so far."""
        self.n_identified += 1
        self._modes = ()
        reason = ""
        if sum(block.n_samples for block in blocks) < _SHORTEST * blocks[0].sampling_rate:
            reason = f"the window is shorter than {_SHORTEST:.0f} s"
        else:
            try:
                modes = self._so_far(blocks, vehicle) if whole is None else self._of_window(whole, vehicle)
                self._modes = tuple(mode_documents(modes))
            except SprungError as error:
                reason = str(error)
        return Identified(self.n_identified - 1, blocks[0].start, self._modes, reason)

    def state(self) -> dict[str, Any]:
        """Return everything that is needed to continue, as plain values."""
        return {
            "n_identified": self.n_identified,
            "modes": list(self._modes),
            "harmonics": None if self._harmonics is None else [asdict(line) for line in self._harmonics],
        }

    @classmethod
    def from_state(cls, settings: MonitorSettings, state: Mapping[str, Any]) -> "ModeIdentifier":
        """Return what continues from a state."""
        identifier = cls(settings)
        identifier.n_identified = state["n_identified"]
        identifier._modes = tuple(state["modes"])
        lines = state["harmonics"]
        identifier._harmonics = None if lines is None else tuple(map(harmonic_from_dict, lines))
        return identifier

    def _of_window(self, recording: Recording, vehicle: Vehicle) -> Modes:
        """Return the modes of the complete window, and keep the lines that it shows."""
        identification = METHODS[self._settings.method](recording, settings=IDENTIFICATION, vehicle=vehicle)
        self._harmonics = identification.harmonics
        return identification.modes

    def _so_far(self, blocks: Sequence[Block], vehicle: Vehicle) -> Modes:
        """Return the modes of the body from the samples between one identification and the next, as records."""
        if self._running is None:
            settings = replace(
                IDENTIFICATION,
                harmonics=self._harmonics,
                decimate_to=rate_for_body(vehicle, blocks[0].sampling_rate),
                segment=_SEGMENT,
            )
            self._running = RunningSummary(
                self._settings.method, settings=settings, vehicle=vehicle, duration=self._settings.window
            )
        for record in self._records(blocks)[self._running.n_records :]:
            self._running.update(joined(record))
        return modes_of_summary(self._running.summary, vehicle=vehicle)

    def _records(self, blocks: Sequence[Block]) -> list[list[Block]]:
        """Return the blocks between one identification of the window and the next; a state holds no more of them."""
        records: list[list[Block]] = []
        record: list[Block] = []
        after = 0
        for block in blocks:
            record.append(block)
            before, after = after, after + block.n_samples
            if after >= _SHORTEST * block.sampling_rate and self.is_due(before, after, block.sampling_rate):
                records.append(record)
                record = []
        return records
