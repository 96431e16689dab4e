"""Jobs of one vehicle: what a worker is given, what it returns, and the analysis in between."""

import math
import resource
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from enum import StrEnum
from pathlib import Path

from sprung.diagnosis import Baseline, TypeBaseline
from sprung.errors import SprungError
from sprung.link import FrameBlock, decode, frame_block
from sprung.online.monitor.assessment import History
from sprung.online.monitor.engine import VehicleMonitor, read_state, write_state
from sprung.online.monitor.events import Event, MonitorSettings, Observed, Restored
from sprung.state import VehicleStatus
from sprung.vehicles import vehicle_from_text

#: Bytes of a sample in an analysis.
_SAMPLE = 8
#: Sizes of the memory of this process [pages], on Linux.
_STATM = Path("/proc/self/statm")


class Failure(StrEnum):
    """Part that a job failed on, which decides what is left out, if anything."""

    STATE = "state"  # the saved state: the vehicle starts again
    VEHICLE = "vehicle"  # anything else that a vehicle is opened with: its frames wait
    FRAME = "frame"  # the frame that follows the consumed ones, or the window that it completes
    QUOTA = "quota"  # the frames that were consumed: their window needs too much memory


@dataclass(frozen=True, slots=True)
class Limits:
    """Limits of a job.

    Parameters
    ----------
    seconds
        Processor time after which a job ends with the frame at hand [s].
    vehicle_bytes
        Largest size of the samples of a window, and of the state, of one vehicle [bytes].
    job_bytes
        Largest memory that a job may take in addition to what its process holds [bytes].
    """

    seconds: float = math.inf
    vehicle_bytes: float = math.inf
    job_bytes: float = math.inf


@dataclass(frozen=True, eq=False, slots=True)
class Opening:
    """Description, state and settings with which a worker opens a vehicle.

    Parameters
    ----------
    vehicle
        Name of the vehicle.
    description
        Text of its vehicle file.
    quantities
        Quantity of each channel, by name.
    state
        State to continue from, as `write_state` writes it; None: begin from the history.
    settings
        Settings of a vehicle that begins from its history.
    type_baseline
        Baseline of the vehicle's type; None: that of the state, if it has one.
    history
        Stored results of a vehicle without a state.
    """

    vehicle: str
    description: str
    quantities: Mapping[str, str]
    state: bytes | None
    settings: MonitorSettings
    type_baseline: TypeBaseline | None = None
    history: History = field(default_factory=History)


@dataclass(frozen=True, eq=False, slots=True)
class Outcome:
    """Outcome of a job.

    Parameters
    ----------
    vehicle
        Name of the vehicle.
    n_consumed
        Number of frames consumed: all, or up to the one that completed a window, or before the one that failed.
    events
        Events in order of time.
    state
        State after a complete window, a request for a new or an earlier baseline or a job without frames; None
        otherwise.
    status
        Status after the job.
    error
        Reason of a failure; empty if there was none.
    failure
        Part that failed, if there is a reason.
    seconds
        Processor time that the job took [s].
    """

    vehicle: str
    n_consumed: int
    events: tuple[Event | Restored, ...]
    state: bytes | None
    status: VehicleStatus
    error: str = ""
    failure: Failure = Failure.FRAME
    seconds: float = 0.0


def failed(vehicle: str, reason: str, failure: Failure, *, n_consumed: int = 0) -> Outcome:
    """Return the outcome of a job that failed, or of a vehicle that cannot be opened."""
    return Outcome(vehicle, n_consumed, (), None, VehicleStatus(note=reason), reason, failure)


def open_monitor(opening: Opening) -> tuple[VehicleMonitor, dict[str, str]]:
    """Return the monitor of a vehicle, and the quantities of its channels.

    Raises
    ------
    StateError
        If the state cannot be used, or, without one, the history.
    SprungError
        If the description cannot be used.
    """
    vehicle = vehicle_from_text(opening.description, source=f"the vehicle file of {opening.vehicle}")
    of_type = opening.type_baseline
    if opening.state is None:
        monitor = VehicleMonitor.from_history(
            vehicle, opening.history, settings=opening.settings, type_baseline=of_type
        )
    else:
        monitor = VehicleMonitor.from_state(vehicle, read_state(opening.state), type_baseline=of_type)
    return monitor, dict(opening.quantities)


def analyse(
    vehicle: str,
    opened: tuple[VehicleMonitor, dict[str, str]],
    frames: Sequence[bytes],
    *,
    learn: str | Baseline = "",
    limits: Limits | None = None,
    report: Callable[[int], None] = lambda n_consumed: None,
) -> Outcome:
    """Return the outcome of a job.

    Parameters
    ----------
    vehicle
        Name of the vehicle.
    opened
        Monitor of the vehicle and quantities of its channels, from `open_monitor`.
    frames
        Frames in order.
    learn
        As for `Workers.submit`.
    limits
        Limits of the job; None: none.
    report
        Function called before each frame with the number of frames consumed.
    """
    monitor, quantities = opened
    limits = limits or Limits()
    begun = time.process_time()
    events: list[Event | Restored] = []
    consumed, is_changed = 0, bool(learn) or not frames
    try:
        with limited_memory(limits.job_bytes):
            if isinstance(learn, Baseline):
                events.append(monitor.restore(learn))
            elif learn:
                monitor.learn_again(learn)
            for payload in frames:
                report(consumed)
                block = frame_block(decode(payload), quantities)
                excess = _excess(block, monitor.settings.window, limits.vehicle_bytes)
                if excess and not consumed and not is_changed:
                    return failed(vehicle, excess, Failure.QUOTA, n_consumed=_n_alike(frames, block, quantities))
                if excess:
                    break
                events += monitor.update(block)
                consumed += 1
                is_changed = is_changed or monitor.repeated > 0  # nothing else would ever remove these frames
                if any(isinstance(event, Observed) for event in events):
                    is_changed = True
                    break
                if time.process_time() - begun > limits.seconds:
                    break
            state = write_state(monitor.state()) if is_changed else None
    except Exception as error:  # an error in one vehicle must not stop the others
        return failed(vehicle, _reason(error, limits), Failure.FRAME, n_consumed=consumed)
    if state is not None and len(state) > limits.vehicle_bytes:
        size, most = _megabytes(len(state)), _megabytes(limits.vehicle_bytes)
        excess = f"its state takes {size}, more than the {most} allowed per vehicle: send fewer channels"
        return failed(vehicle, excess, Failure.FRAME, n_consumed=max(consumed - 1, 0))
    status = VehicleStatus(
        monitor.buffered,
        *monitor.learning,
        monitor.note,
        monitor.is_learning,
        monitor.settings.window,
        monitor.until,
        monitor.repeated,
        monitor.coverage,
    )
    return Outcome(vehicle, consumed, tuple(events), state, status, seconds=time.process_time() - begun)


def _reason(error: Exception, limits: Limits) -> str:
    """Return why a job failed."""
    if isinstance(error, MemoryError):
        return f"its analysis needs more memory than {_megabytes(limits.job_bytes)}"
    return str(error) if isinstance(error, SprungError) else f"{type(error).__name__}: {error}"


def _excess(block: FrameBlock, window: float, most: float) -> str:
    """Return the sentence about a window that would take too much memory; empty if it does not."""
    size = len(block.channels) * block.sampling_rate * window * _SAMPLE
    if size <= most:
        return ""
    return (
        f"a window of {window / 60:g} min of {len(block.channels)} channels at {block.sampling_rate:g} Hz takes "
        f"{_megabytes(size)}, more than the {_megabytes(most)} allowed per vehicle: send fewer channels or a lower rate"
    )


def _n_alike(frames: Sequence[bytes], first: FrameBlock, quantities: Mapping[str, str]) -> int:
    """Return the number of leading frames with the channels and the rate of the first."""
    for n_alike, payload in enumerate(frames):
        block = frame_block(decode(payload), quantities)
        if (block.channels, block.sampling_rate) != (first.channels, first.sampling_rate):
            return n_alike
    return len(frames)


def _megabytes(size: float) -> str:
    return f"{size / 1e6:.0f} MB"


@contextmanager
def limited_memory(most: float) -> Iterator[None]:
    """Let allocations fail beyond a size in addition to what the process holds.

    Parameters
    ----------
    most
        The size [bytes]; infinite: no limit.

    Notes
    -----
    The limit is RLIMIT_DATA, where Linux has it. Writable private memory counts; libraries and reserved address space,
    of which numerical libraries have gigabytes and which RLIMIT_AS would count, do not.
    """
    if math.isinf(most) or not _STATM.exists():
        yield
        return
    soft, hard = resource.getrlimit(resource.RLIMIT_DATA)
    pages = int(_STATM.read_text(encoding="ascii").split()[5])
    limit = pages * resource.getpagesize() + int(most)
    resource.setrlimit(resource.RLIMIT_DATA, (limit if hard == resource.RLIM_INFINITY else min(limit, hard), hard))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_DATA, (soft, hard))
