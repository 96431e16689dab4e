"""From the text that names a source to its blocks: files, a folder, standard input, CAN, MQTT or a simulator."""

import sys
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from sprung.errors import ParameterError
from sprung.formats import ReadSettings
from sprung.formats.can import can_database
from sprung.online.box.can import can_bus, from_can
from sprung.online.box.folder import from_folder
from sprung.online.box.mqtt_source import from_mqtt
from sprung.online.box.sources import after, from_files, from_simulator, paced
from sprung.online.box.standard_input import from_lines
from sprung.recording import Recording
from sprung.vehicles import Vehicle

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
    """

    vehicle: Vehicle
    folder: Path
    files: Sequence[Path] = ()
    channels: Sequence[str] | None = None
    sampling_rate: float | None = None
    pace: float | None = None
    resume: int | None = None


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
