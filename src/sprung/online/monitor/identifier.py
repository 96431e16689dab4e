"""Modes of one vehicle every minute: of the window so far, and of the complete window."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, replace
from typing import Any

from sprung.errors import SprungError
from sprung.identification import METHODS, IdentificationSettings, RunningSummary, modes_of_summary, rate_for_body
from sprung.identification.records import lines_of
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
#: Time after which lines proportional to speed are sought again [s].
_LINES_KNOWN = 3600.0
#: Damping ratio of a mode that may be an unknown line.
_NARROW = 0.05
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
    for the modes of the body alone (`rate_for_body`). Lines are sought once per window, when it is complete; until then
    those of the previous window are used. Lines proportional to speed, whose search takes half the time of an
    identification, are taken over for an hour, unless a line over time appears that was not known, or a mode is damped
    by at most 5 %, as a line would be: then they are sought, and modes of the complete window are identified with them.
    """

    def __init__(self, settings: MonitorSettings) -> None:
        self._settings = settings
        self._running: RunningSummary | None = None
        self._modes: tuple[dict[str, Any], ...] = ()
        self._harmonics: tuple[Harmonic, ...] | None = None
        self._lines_known = 0.0
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
            "lines_known": self._lines_known,
        }

    @classmethod
    def from_state(cls, settings: MonitorSettings, state: Mapping[str, Any]) -> "ModeIdentifier":
        """Return what continues from a state."""
        identifier = cls(settings)
        identifier.n_identified = state["n_identified"]
        identifier._modes = tuple(state["modes"])
        lines = state["harmonics"]
        identifier._harmonics = None if lines is None else tuple(map(harmonic_from_dict, lines))
        identifier._lines_known = float(state["lines_known"])
        return identifier

    def _of_window(self, recording: Recording, vehicle: Vehicle) -> Modes:
        """Return the modes of the complete window, and keep the lines that it shows."""
        method = METHODS[self._settings.method]
        if self._harmonics is not None and self._lines_known > 0:
            lines = lines_of(recording, self._harmonics, settings=IDENTIFICATION, vehicle=vehicle)
            known = method(recording, settings=replace(IDENTIFICATION, harmonics=lines), vehicle=vehicle)
            if not _has_narrow(known.modes):
                self._harmonics = lines
                self._lines_known -= self._settings.window
                return known.modes
        sought = method(recording, settings=IDENTIFICATION, vehicle=vehicle)
        self._harmonics = sought.harmonics
        self._lines_known = 0.0 if _has_narrow(sought.modes) else _LINES_KNOWN - self._settings.window
        return sought.modes

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
        modes = modes_of_summary(self._running.summary, vehicle=vehicle)
        if _has_narrow(modes):
            self._lines_known = 0.0
        return modes

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


def _has_narrow(modes: Modes) -> bool:
    """Return whether a mode is damped so little that it may be a line."""
    return bool((modes.damping_ratio <= _NARROW).any())
