"""Saved states of vehicles, and the restart after a state is lost."""

import zlib
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, ValidationError

from sprung._checks import required
from sprung.errors import ParameterError
from sprung.link import Block
from sprung.recording import Channel, Gap, Recording

#: Reason of the first baseline of a vehicle.
FIRST = "first learning"
#: Name and version of the documents.
SCHEMA = "sprung.vehicle-monitor/1"
_N_CHECKSUM = 4

#: Errors of values of other types, or that do not fit together.
UNUSABLE = (ValueError, TypeError, LookupError, AttributeError, ArithmeticError)


class StateError(ParameterError):
    """A saved state that this program cannot continue from."""


class _Samples(BaseModel):
    """A block of samples: float64, little-endian, channel by channel."""

    model_config = ConfigDict(strict=True, extra="forbid")

    samples: bytes
    channels: list[list[Any]]
    sampling_rate: float = Field(gt=0)
    start: int | None
    gaps: list[list[Any]]


class _State(BaseModel):
    """A state."""

    model_config = ConfigDict(strict=True, extra="forbid")

    schema_name: str = Field(alias="schema")
    vehicle: str
    settings: dict[str, Any]
    reason: str
    is_learning: bool
    baseline: dict[str, Any] | None
    type: dict[str, Any] | None
    n_windows: int = Field(ge=0, lt=2**63)
    n_identified: int = Field(ge=0, lt=2**63)
    observations: list[dict[str, Any]]
    residuals: list[dict[str, Any] | None]
    evidence: list[float]
    modes: list[dict[str, Any]]
    note: str
    completed: str
    completion: dict[str, Any]
    harmonics: list[dict[str, Any]] | None
    blocks: list[_Samples]
    repeats: dict[str, Any]


@dataclass(frozen=True, eq=False, slots=True)
class History:
    """Stored results of a vehicle without a usable state.

    Parameters
    ----------
    baseline
        Document of the present baseline; None if none was learnt.
    observations
        Documents of the windows since the baseline, oldest first.
    n_windows, n_identified
        Number of windows and of identifications so far: the next ones are numbered from there.
    relearning
        Reason for learning a new baseline, if that was in progress; empty otherwise.
    """

    baseline: Mapping[str, Any] | None = None
    observations: tuple[Mapping[str, Any], ...] = ()
    n_windows: int = 0
    n_identified: int = 0
    relearning: str = ""


def write_state(state: Mapping[str, Any]) -> bytes:
    """Return a state as bytes: CBOR, followed by 4 bytes CRC-32 of it, little-endian."""
    body: bytes = _cbor().dumps(dict(state))
    return body + _checksum(body)


def read_state(document: bytes) -> dict[str, Any]:
    """Return the state encoded in bytes.

    Raises
    ------
    StateError
        If they are not a state of this version, or damaged. No other error is raised.
    """
    cbor = _cbor()
    body = document[:-_N_CHECKSUM]
    if document[-_N_CHECKSUM:] != _checksum(body):
        raise StateError("the saved state is damaged, as its checksum does not match: start from scratch")
    try:
        state = cbor.loads(body)
    except (cbor.CBORError, *UNUSABLE, RecursionError, MemoryError) as error:
        raise StateError(f"the saved state is not CBOR ({type(error).__name__}): start from scratch") from None
    return checked_state(state)


def checked_state(state: Any) -> dict[str, Any]:
    """Return a state whose parts are there and of their types.

    Raises
    ------
    StateError
        If it is not a state of this version, or incomplete.
    """
    schema = str(state.get("schema") if isinstance(state, Mapping) else None)[:60]
    if schema != SCHEMA:
        raise StateError(
            f"the saved state has the schema {schema!r}, and this program uses {SCHEMA}: install the sprung that wrote "
            "it, or start from scratch"
        )
    try:
        _State.model_validate(dict(state))
    except ValidationError as error:
        first = error.errors()[0]
        place = ".".join(map(str, first["loc"]))
        raise invalid_state(f"{place}: {first['msg']}") from None
    except UNUSABLE as error:
        raise invalid_state(error) from None
    return dict(state)


def _checksum(body: bytes) -> bytes:
    return zlib.crc32(body).to_bytes(_N_CHECKSUM, "little")


def invalid_state(reason: object) -> StateError:
    """Return the error of a state that is incomplete or invalid."""
    return StateError(f"the saved state is incomplete or invalid ({str(reason)[:200]}): start from scratch")


def state_of_history(vehicle: str, history: History, settings: Mapping[str, Any]) -> dict[str, Any]:
    """Return the state of a vehicle that starts again from its stored results.

    Parameters
    ----------
    vehicle
        Name in the vehicle file.
    history
        Stored results of the vehicle.
    settings
        Settings of the monitoring.

    Notes
    -----
    The evidence is computed again from the windows since the baseline. Statistics of the residual test, samples of an
    incomplete window and the memory of repeated samples are not in the store: they begin with the next samples, and
    so does learning in progress, whose windows may be in terms of a calibrated file that only the lost state had.
    """
    is_learning = history.baseline is None or bool(history.relearning)
    observations = [] if is_learning else [dict(document) for document in history.observations]
    baseline = history.baseline
    return {
        "schema": SCHEMA,
        "vehicle": vehicle,
        "settings": dict(settings),
        "reason": history.relearning or FIRST,
        "is_learning": is_learning,
        "baseline": None if baseline is None else dict(baseline),
        "type": None,
        "n_windows": history.n_windows,
        "n_identified": history.n_identified,
        "observations": observations,
        "residuals": [None] * len(observations),
        "evidence": [],
        "modes": [],
        "note": "",
        "completed": "" if baseline is None else str(baseline.get("vehicle_file") or ""),
        "completion": {"is_open": settings["calibrate"] is not False, "model_errors": [], "windows": []},
        "harmonics": None,
        "blocks": [],
        "repeats": {"file": "", "reached": {}, "run": None, "place": 0.0, "end": None, "repeated": 0.0},
    }


def stored_block(block: Block) -> dict[str, Any]:
    """Return a block as plain values and bytes."""
    return {
        "samples": np.ascontiguousarray(block.samples, dtype="<f8").tobytes(),
        "channels": [[c.name, c.quantity, c.position, c.direction] for c in block.channels],
        "sampling_rate": block.sampling_rate,
        "start": block.start,
        "gaps": [[gap.index, gap.duration] for gap in block.gaps],
    }


def restored_block(stored: Mapping[str, Any]) -> Recording:
    """Return the block of plain values and bytes."""
    channels = tuple(
        Channel(name, quantity, tuple(position) if position else None, tuple(direction) if direction else None)
        for name, quantity, position, direction in stored["channels"]
    )
    samples = np.frombuffer(stored["samples"], dtype="<f8").reshape(len(channels), -1)
    gaps = tuple(Gap(index, duration) for index, duration in stored["gaps"])
    return Recording(samples, stored["sampling_rate"], channels, stored["start"], gaps)


def _cbor() -> Any:
    """Return the package that encodes states."""
    return required("cbor2", purpose="the state of a vehicle", extra="online")
