"""A box at work: a live source until it ends or is stopped, or recordings until they are acknowledged."""

import threading
import time
from collections.abc import Callable, Iterable, Sequence
from typing import TYPE_CHECKING, NamedTuple, Protocol

from sprung._display import counted
from sprung.errors import DataError
from sprung.link import TIME_SET, Address, Loss, Spool, span_of
from sprung.online.box.box import Box, BoxSettings
from sprung.online.box.sources import paced
from sprung.recording import Recording
from sprung.vehicles import Vehicle, vehicle_text
from sprung.vehicles.sensor_layout import quantities_of

if TYPE_CHECKING:
    from sprung.online.box.onboard import OnBoard

#: Length of a frame of samples, unless stated otherwise [s].
FRAME_SECONDS = 10.0
#: Time between steps of the link while samples come in [s].
_STEP = 0.05


class Sent(NamedTuple):
    """Samples that were sent and acknowledged.

    Parameters
    ----------
    duration
        Duration without gaps [s].
    begin, end
        Times of the first sample and after the last one, UTC ns; None without samples.
    """

    duration: float
    begin: int | None
    end: int | None


class Sender(Protocol):
    """Sender of blocks to a monitor: a `Box`."""

    @property
    def problem(self) -> str:
        """Problem with the link; empty without one."""

    @property
    def n_waiting(self) -> int:
        """Number of frames that are not acknowledged."""

    @property
    def losses(self) -> Sequence[Loss]:
        """Frames that were dropped before they were acknowledged."""

    def open(self) -> None:
        """Connect."""

    def close(self) -> None:
        """Disconnect."""

    def take(self, recording: Recording, /) -> None:
        """Accept a block of samples."""

    def step(self) -> None:
        """Send what is due."""

    def drain(self, *, timeout: float) -> bool:
        """Return whether all frames are acknowledged within `timeout` [s]."""


def box_of(
    name: str,
    vehicle: Vehicle,
    spool: Spool,
    address: Address,
    *,
    on_board: "OnBoard | None" = None,
    allow_missing: bool = False,
    time_status: int = TIME_SET,
    frame_seconds: float = FRAME_SECONDS,
) -> Box:
    """Return the box of a vehicle.

    Parameters
    ----------
    name
        Name of the vehicle at the monitor.
    vehicle
        Vehicle with its sensors.
    spool
        Spool in which frames wait.
    address
        Address of the broker.
    on_board
        Identification on the vehicle; None: samples are sent.
    allow_missing
        Whether the source may lack sensors of the vehicle file, which the monitor then reports.
    time_status
        Status of the time of its samples, as in `Frame`.
    frame_seconds
        Length of a frame, as in `BoxSettings`.

    Raises
    ------
    ParameterError
        If the vehicle cannot have that name.

    Notes
    -----
    The channels of the first block that the box takes are compared with the sensors of the vehicle file.
    """
    return Box(
        BoxSettings(name, vehicle_text(vehicle), time_status=time_status, frame_seconds=frame_seconds),
        spool,
        address,
        quantities=lambda block: quantities_of(block, vehicle.sensor, allow_missing=allow_missing),
        on_board=on_board,
    )


def send_live(
    box: Sender, blocks: Iterable[Recording], *, stopping: threading.Event, on_problem: Callable[[str], None]
) -> float | None:
    """Send the blocks of a source until it ends and all frames are acknowledged, or until it is stopped.

    Parameters
    ----------
    box
        Box that is not yet open; it is closed at the end.
    blocks
        Blocks of the source.
    stopping
        Event that stops the box. It is set at the end.
    on_problem
        Function that receives each new problem with the link, and "" once it is over; at the end the losses of a box
        that was stopped.

    Returns
    -------
    float or None
        Duration of the samples sent [s]; None if it was stopped.

    Raises
    ------
    DataError
        If frames were dropped before they were acknowledged, and the source has ended.
    """
    taken = 0.0
    try:
        box.open()
        threading.Thread(target=_step, args=(box, stopping, on_problem), daemon=True).start()
        for block in blocks:
            if stopping.is_set():
                break
            box.take(block)
            taken += block.duration
        while not stopping.is_set() and not box.drain(timeout=1.0):
            pass
        lost = losses_in_words(box.losses)
        if not stopping.is_set():
            if lost:
                raise DataError(f"{lost}; all others are acknowledged")
            return taken
        if lost:
            on_problem(lost)
        return None
    finally:
        stopping.set()
        box.close()


def replay(
    box: Sender,
    blocks: Iterable[Recording],
    *,
    pace: float | None,
    patience: float,
    on_progress: Callable[[str, float], None] = lambda step, share: None,
) -> Sent:
    """Send blocks at a pace, and wait until they are acknowledged.

    Parameters
    ----------
    box
        Open box.
    blocks
        Blocks of recordings.
    pace
        Speed as a multiple of real time; None: no limit.
    patience
        Longest wait for the last acknowledgement [s].
    on_progress
        Callback that receives the current step and the share that is done (0 to 1).

    Returns
    -------
    Sent
        Samples that were sent.

    Raises
    ------
    DataError
        If not all frames were acknowledged in time, the broker refuses them, or some were dropped before.
    """
    sent = 0.0
    begin: int | None = None
    end: int | None = None
    for block in paced(blocks, pace, clock=time.monotonic, sleep=time.sleep):
        box.take(block)
        box.step()
        sent += block.duration
        if block.start is not None:
            begin = block.start if begin is None else begin
            end = block.start + round(1e9 * block.duration)
        on_progress(f"{sent / 60:.1f} min sent", 0.5)
    on_progress("waiting for acknowledgements", 0.9)
    is_drained, lost = box.drain(timeout=patience), losses_in_words(box.losses)
    if not is_drained:
        after = f"; {lost}" if lost else ""
        waiting = counted(box.n_waiting, "frame")
        if box.problem:
            raise DataError(f"{waiting} not acknowledged: {box.problem}{after}")
        advice = "check that a monitor runs at its broker"
        raise DataError(f"{waiting} not acknowledged after {patience:g} s: {advice}{after}")
    if lost:
        raise DataError(f"{lost}; all others are acknowledged")
    return Sent(sent, begin, end)


def losses_in_words(losses: Sequence[Loss]) -> str:
    """Return the sentence about frames that a box dropped before the monitor had them; empty if there are none."""
    if not losses:
        return ""
    from sprung.results.tables import span_in_words

    begin, end = span_of(losses)
    span = f", {span_in_words(begin, end)}," if begin else ""
    n_frames = sum(loss.n_frames for loss in losses)
    dropped = f"{counted(n_frames, 'frame')}{span} {'was' if n_frames == 1 else 'were'} dropped"
    return (
        f"{dropped} before the monitor had acknowledged them, as the spool was full or its disk failed: give it more "
        "space, and send again what is still available"
    )


def _step(box: Sender, stopping: threading.Event, on_problem: Callable[[str], None]) -> None:
    """Send while samples come in, and report each new problem."""
    problem = ""
    while not stopping.wait(_STEP):
        box.step()
        if box.problem != problem:
            problem = box.problem
            on_problem(problem)
