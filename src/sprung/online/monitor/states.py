"""Saved states of vehicles: CBOR with a checksum."""

import zlib
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import Any

import numpy as np

from sprung._checks import required
from sprung.errors import ParameterError, SprungError
from sprung.link import Block
from sprung.link.blocks import plain_channels, restored_channels
from sprung.recording import Gap, Recording

#: Name and version of the documents.
SCHEMA = "sprung.vehicle-monitor/1"
_N_CHECKSUM = 4

#: Errors of values of other types, or that do not fit together.
_UNUSABLE = (ValueError, TypeError, LookupError, AttributeError, ArithmeticError)


class StateError(ParameterError):
    """A saved state that this program cannot continue from."""


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
    except (cbor.CBORError, *_UNUSABLE, RecursionError, MemoryError) as error:
        raise StateError(f"the saved state is not CBOR ({type(error).__name__}): start from scratch") from None
    return checked_state(state)


def checked_state(state: Any) -> dict[str, Any]:
    """Return a state if it is one of this version.

    Raises
    ------
    StateError
        If it is not.
    """
    schema = str(state.get("schema") if isinstance(state, Mapping) else None)[:60]
    if schema != SCHEMA:
        raise StateError(
            f"the saved state has the schema {schema!r}, and this program uses {SCHEMA}: install the sprung that wrote "
            "it, or start from scratch"
        )
    return dict(state)


def _checksum(body: bytes) -> bytes:
    return zlib.crc32(body).to_bytes(_N_CHECKSUM, "little")


@contextmanager
def unusable_as_state_error() -> Iterator[None]:
    """Raise errors of parts that are missing, of other types, or that do not fit together, as `StateError`."""
    try:
        yield
    except (*_UNUSABLE, SprungError) as error:
        raise StateError(f"the saved state is incomplete or invalid ({str(error)[:200]}): start from scratch") from None


def stored_block(block: Block) -> dict[str, Any]:
    """Return a block as plain values and bytes."""
    return {
        "samples": np.ascontiguousarray(block.samples, dtype="<f8").tobytes(),
        "channels": plain_channels(block.channels),
        "sampling_rate": block.sampling_rate,
        "start": block.start,
        "gaps": [[gap.index, gap.duration] for gap in block.gaps],
    }


def restored_block(stored: Mapping[str, Any]) -> Recording:
    """Return the block of plain values and bytes."""
    channels = restored_channels(stored["channels"])
    samples = np.frombuffer(stored["samples"], dtype="<f8").reshape(len(channels), -1)
    gaps = tuple(Gap(index, duration) for index, duration in stored["gaps"])
    return Recording(samples, stored["sampling_rate"], channels, stored["start"], gaps)


def _cbor() -> Any:
    """Return the package that encodes states."""
    return required("cbor2", purpose="the state of a vehicle", extra="online")
