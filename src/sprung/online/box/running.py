"""A box at work: a source by its name, live until it ends or is stopped, or recordings until they are acknowledged."""

import sys
import threading
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from sprung._checks import check_number
from sprung._display import counted
from sprung.errors import DataError, ParameterError
from sprung.formats import ReadSettings
from sprung.formats.can import can_database
from sprung.link import TIME_SET, Address, Loss, Spool, span_of
from sprung.online.box.box import Box, BoxSettings
from sprung.online.box.can import can_bus, from_can
from sprung.online.box.mqtt_source import from_mqtt
from sprung.online.box.sources import after, from_files, from_folder, from_lines, from_simulator, paced
from sprung.recording import Recording
from sprung.results.tables.wording import format_span
from sprung.vehicles import Vehicle, vehicle_text
from sprung.vehicles.sensor_layout import quantities_of

if TYPE_CHECKING:
    from sprung.online.box.onboard import OnBoard

#: Length of a frame of samples, unless stated otherwise [s].
FRAME_SECONDS = 10.0
#: Time between steps of the link while samples come in [s].
_STEP = 0.05
#: Forms of the text that names a source.
SOURCES = ("files", "folder:DIR", "stdin", "can:INTERFACE:CHANNEL:DATABASE.dbc", "mqtt:URL#TOPIC", "simulator")


@dataclass(frozen=True, slots=True)
class SourceSettings:
    """Settings of a source besides its name.

    Parameters
    ----------
    vehicle
        Vehicle that the simulator drives.
    folder
        Folder that keeps, across restarts, the start time of a replay and the files of a watched folder that were read.
    files
        Recordings, for the source "files".
    channels
        Channels to read; needed for CAN and MQTT. None: all.
    sampling_rate
        Sampling rate [Hz]; needed where values come one by one, and for files without time.
    pace
        Speed of a replay of files, times that of the recording; None: as fast as possible.
    resume
        End of the samples that were read before a restart, UTC ns; None: start from scratch.

    Raises
    ------
    ParameterError
        If the sampling rate or the pace is not above 0.
    """

    vehicle: Vehicle
    folder: Path
    files: Sequence[Path] = ()
    channels: Sequence[str] | None = None
    sampling_rate: float | None = None
    pace: float | None = None
    resume: int | None = None

    def __post_init__(self) -> None:
        for name in ("sampling_rate", "pace"):
            if getattr(self, name) is not None:
                check_number(name, getattr(self, name), above=0)


@dataclass(frozen=True, slots=True)
class Listener:
    """Connection to a running source: it can be stopped, and reports events.

    Parameters
    ----------
    stopping
        Set when the source is to stop.
    on_problem
        Function called with a sentence about data that cannot be used.
    on_read
        Function called with the name of each file of a watched folder that was read.
    """

    stopping: threading.Event
    on_problem: Callable[[str], None] = lambda _sentence: None
    on_read: Callable[[str], None] = lambda _name: None

    def sleep(self, seconds: float) -> None:
        """Wait for a time, or until the source is to stop."""
        self.stopping.wait(seconds)


def open_source(text: str, settings: SourceSettings, listener: Listener) -> Iterator[Recording]:
    r"""Return the blocks of a source; sources that can be replayed continue where they stopped.

    Parameters
    ----------
    text
        Name of the source, in one of the forms of `SOURCES`.
    settings
        Settings of the source besides its name.
    listener
        Connection that stops the source and takes its reports.

    Raises
    ------
    ParameterError
        If the source is unknown, or something that it needs is missing.

    Examples
    --------
    >>> import threading
    >>> from pathlib import Path
    >>> from tempfile import TemporaryDirectory
    >>> from sprung.vehicles import read_vehicle
    >>> with TemporaryDirectory() as name:
    ...     folder = Path(name)
    ...     _ = (folder / "run.csv").write_text("t,acc_fl" + "".join(f"\n{k / 100},0.5" for k in range(300)))
    ...     settings = SourceSettings(read_vehicle("zafira"), folder, files=[folder / "run.csv"])
    ...     blocks = list(open_source("files", settings, Listener(threading.Event())))
    >>> sum(block.n_samples for block in blocks), blocks[0].names
    (300, ('acc_fl',))
    """
    kind, _, rest = text.partition(":")
    if kind not in _OPENERS or (rest and kind in {"stdin", "simulator"}):
        raise ParameterError(f"--source {text!r} must be {', '.join(SOURCES[:-1])} or {SOURCES[-1]}")
    return _OPENERS[kind](rest, settings, listener)


def _open_files(rest: str, settings: SourceSettings, listener: Listener) -> Iterator[Recording]:
    if rest or not settings.files:
        raise ParameterError("--source files reads recordings: give files or another source")
    blocks = from_files(
        settings.files,
        start=_beginning(settings.folder / "begun"),
        settings=_reading(settings),
    )
    return paced(after(blocks, settings.resume), settings.pace, clock=time.monotonic, sleep=listener.sleep)


def _open_simulator(_rest: str, settings: SourceSettings, listener: Listener) -> Iterator[Recording]:
    from sprung.simulation import RoadConditions, RoadDrive

    blocks = from_simulator(
        settings.vehicle,
        lambda number: RoadDrive(snr=50.0, road=RoadConditions("BCD"[number % 3])),
        start=_beginning(settings.folder / "begun"),
    )
    return paced(after(blocks, settings.resume), 1.0, clock=time.monotonic, sleep=listener.sleep)


def _open_folder(rest: str, settings: SourceSettings, listener: Listener) -> Iterator[Recording]:
    if not rest:
        raise ParameterError("--source folder needs the folder to watch: write folder:DIR")
    if not Path(rest).is_dir():
        raise ParameterError(f"{rest} is not a folder: give the one in which files appear")
    done = settings.folder / "done"

    def finish(name: str, problem: str) -> None:
        if problem:
            listener.on_problem(f"{name} was not read completely: {problem}")
        else:
            listener.on_read(name)
        with done.open("a", encoding="utf-8") as file:
            file.write(name + "\n")

    return from_folder(
        Path(rest),
        start=time.time_ns,
        is_done=listener.stopping.is_set,
        sleep=listener.sleep,
        done=finish,
        known=done.read_text(encoding="utf-8").splitlines() if done.exists() else (),
        settings=_reading(settings),
    )


def _open_lines(_rest: str, settings: SourceSettings, _listener: Listener) -> Iterator[Recording]:
    return from_lines(sys.stdin, sampling_rate=_rate("stdin", settings), start=time.time_ns)


def _open_can(rest: str, settings: SourceSettings, listener: Listener) -> Iterator[Recording]:
    rate, names = _rate("can", settings), _names("can", settings)
    parts = rest.split(":")
    if len(parts) != 3:
        raise ParameterError(f"--source can:{rest} must be {SOURCES[3]}, such as can:socketcan:can0:car.dbc")
    interface, channel, database = parts
    bus = can_bus(interface, channel)
    return from_can(bus, can_database(database), names=names, sampling_rate=rate, on_problem=listener.on_problem)


def _open_mqtt(rest: str, settings: SourceSettings, listener: Listener) -> Iterator[Recording]:
    rate, names = _rate("mqtt", settings), _names("mqtt", settings)
    address, mark, topic = rest.partition("#")
    if not mark:
        raise ParameterError(f"--source mqtt:{rest} must be {SOURCES[4]}, such as mqtt:mqtt://host:1883#sensors/+")
    return from_mqtt(
        address,
        [topic],
        names=names,
        sampling_rate=rate,
        is_done=listener.stopping.is_set,
        on_problem=listener.on_problem,
    )


def _reading(settings: SourceSettings) -> ReadSettings:
    """Return what is read of files."""
    return ReadSettings(sampling_rate=settings.sampling_rate, channels=settings.channels)


def _rate(kind: str, settings: SourceSettings) -> float:
    if settings.sampling_rate is None:
        raise ParameterError(f"--source {kind} needs --sampling-rate HZ: values come one by one")
    return settings.sampling_rate


def _names(kind: str, settings: SourceSettings) -> Sequence[str]:
    if settings.channels is None:
        raise ParameterError(f"--source {kind} needs --channels A,B,..: the names of what to send")
    return settings.channels


def _beginning(path: Path) -> int:
    """Return the start of a replay, UTC ns, kept in a file so that a restarted box continues on the same time base."""
    if not path.exists():
        part = path.with_name(f"{path.name}.part")
        part.write_text(str(time.time_ns()), encoding="ascii")
        part.rename(path)
    return int(path.read_text(encoding="ascii"))


_OPENERS: dict[str, Callable[[str, SourceSettings, Listener], Iterator[Recording]]] = {
    "files": _open_files,
    "folder": _open_folder,
    "stdin": _open_lines,
    "can": _open_can,
    "mqtt": _open_mqtt,
    "simulator": _open_simulator,
}


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
    box: Box, blocks: Iterable[Recording], *, stopping: threading.Event, on_problem: Callable[[str], None]
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
        lost = describe_losses(box.losses)
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
    box: Box,
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
    is_drained, lost = box.drain(timeout=patience), describe_losses(box.losses)
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


def describe_losses(losses: Sequence[Loss]) -> str:
    """Return the sentence about frames that a box dropped before the monitor had them; empty if there are none."""
    if not losses:
        return ""
    begin, end = span_of(losses)
    span = f", {format_span(begin, end)}," if begin else ""
    n_frames = sum(loss.n_frames for loss in losses)
    dropped = f"{counted(n_frames, 'frame')}{span} {'was' if n_frames == 1 else 'were'} dropped"
    return (
        f"{dropped} before the monitor had acknowledged them, as the spool was full or its disk failed: give it more "
        "space, and send again what is still available"
    )


def _step(box: Box, stopping: threading.Event, on_problem: Callable[[str], None]) -> None:
    """Send while samples come in, and report each new problem."""
    problem = ""
    while not stopping.wait(_STEP):
        box.step()
        if box.problem != problem:
            problem = box.problem
            on_problem(problem)
