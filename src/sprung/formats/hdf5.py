"""HDF5 files: datasets in folders, each channel with its unit as an attribute; read in pieces."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from sprung.errors import FormatError
from sprung.formats.arrays import Arrays, array_groups
from sprung.formats.settings import ReadSettings
from sprung.formats.table import Group, reported, written
from sprung.recording import Recording

NAME, EXTRA = "HDF5", None
ENDINGS = (".h5", ".hdf5", ".hdf")

SIGNATURE = b"\x89HDF\r\n\x1a\n"
#: Where it may stand, after a block of the user's [bytes].
OFFSETS = (0, 512, 1024, 2048)
#: Attributes that state what is known of a channel.
_FACTS = {
    "unit": ("unit", "units", "Unit", "Units"),
    "comment": ("comment", "description", "Comment", "Description"),
    "calibration": ("calibration", "Calibration", "sensitivity", "Sensitivity"),
}
_RATES = ("sampling_rate", "fs", "fs_Hz", "rate")


@dataclass(frozen=True, slots=True)
class _Limits:
    """What a recording does not exceed."""

    datasets: int = 10_000  # folders and datasets
    depth: int = 20  # folders within folders
    compression: int = 1100  # ratio of a block to its compressed bytes: that of deflate is at most 1032
    small: int = 1 << 20  # bytes below which the ratio does not matter


_LIMITS = _Limits()


def recognises(head: bytes) -> bool:
    """Return whether a file has the signature of HDF5."""
    return any(head.startswith(SIGNATURE, offset) for offset in OFFSETS)


def groups(path: Path, settings: ReadSettings) -> tuple[Group, ...]:
    """Return a group for each folder of an HDF5 file that holds channels.

    Raises
    ------
    FormatError
        If a dataset lies outside the file, or is larger than its bytes can hold.
    """
    import h5py

    with reported(path, "HDF5"), h5py.File(path, "r") as file:
        containers: dict[str, Arrays] = {"": _arrays(path, file)}
        for name, item in _folders(path, file):
            containers[name] = _arrays(path, item)
    return array_groups(path, containers, time=settings.time)


@dataclass(frozen=True, eq=False, slots=True)
class Stored:
    """Dataset of a file, read in part: the file is opened for each part."""

    path: Path
    name: str
    shape: tuple[int, ...]
    dtype: np.dtype[Any]

    def __getitem__(self, key: Any) -> Any:
        """Return some of the values."""
        import h5py

        with h5py.File(self.path, "r") as file:
            return file[self.name][key]


def stored(path: Path, dataset: Any) -> Stored:
    """Return a dataset of numbers, checked: it lies in the file, and its bytes can hold it.

    Raises
    ------
    FormatError
        If the values lie in another file, or are more than the bytes of the dataset can hold.
    """
    if dataset.external or dataset.is_virtual:
        raise FormatError(f"{path}: dataset {dataset.name!r} lies in another file: copy the values into this one")
    declared, present = dataset.size * dataset.dtype.itemsize, dataset.id.get_storage_size()
    if declared > _LIMITS.compression * present + _LIMITS.small:
        raise FormatError(
            f"{path}: dataset {dataset.name!r} declares {declared} bytes of values, but stores {present}: check that "
            "the file is complete"
        )
    return Stored(path, dataset.name, dataset.shape, dataset.dtype)


def own_items(path: Path, folder: Any) -> Iterator[tuple[str, Any]]:
    """Yield the items of a folder that lie in the file.

    Raises
    ------
    FormatError
        If an item is a link to another file.
    """
    import h5py

    for name in folder:
        if isinstance(folder.get(name, getlink=True), h5py.ExternalLink):
            raise FormatError(f"{path}: {name!r} is a link to another file: copy the values into this one")
        item = folder.get(name)
        if item is not None:
            yield name, item


def _folders(path: Path, file: Any) -> Iterator[tuple[str, Any]]:
    """Yield all folders of a file with their paths, each once."""
    import h5py

    waiting = [("", file, 0)]
    seen = 0
    while waiting:
        prefix, folder, depth = waiting.pop(0)
        for name, item in own_items(path, folder):
            seen += 1
            if seen > _LIMITS.datasets or depth > _LIMITS.depth:
                raise FormatError(f"{path} holds more than {_LIMITS.datasets} folders: this is not a recording")
            if isinstance(item, h5py.Group):
                yield f"{prefix}{name}", item
                waiting.append((f"{prefix}{name}/", item, depth + 1))


def _arrays(path: Path, folder: Any) -> Arrays:
    """Return the datasets of a folder with what their attributes state."""
    import h5py

    values: dict[str, Any] = {}
    facts: dict[str, dict[str, str]] = {}
    rates = {float(rate) for rate in [_number(folder.attrs, _RATES)] if rate}
    for link, item in own_items(path, folder):
        if not isinstance(item, h5py.Dataset):
            continue
        name = _text(item.attrs, ("name",)) or link
        if item.dtype.kind in "biuf":
            values[name] = stored(path, item)
        elif item.dtype.kind in "OSU" and item.size < _LIMITS.datasets:
            values[name] = _texts(item)
        stated = {key: _text(item.attrs, names) for key, names in _FACTS.items()}
        facts[name] = {key: text for key, text in stated.items() if text}
        rate = _number(item.attrs, _RATES)
        rates |= {rate} if rate else set()
    if len(rates) == 1 and not any(name.lower() in _RATES for name in values):
        values["sampling_rate"] = rates.pop()
    start = _number(folder.attrs, ("start_ns",))
    return Arrays(values, facts, None if start is None else int(start), _text(folder.attrs, _FACTS["comment"]))


def _texts(dataset: Any) -> np.ndarray:
    """Return a dataset of texts."""
    values = np.ravel(np.asarray(dataset[()], dtype=object))
    return np.array([value.decode("utf-8", "replace") if isinstance(value, bytes) else str(value) for value in values])


def _text(attributes: Mapping[str, Any], names: tuple[str, ...]) -> str:
    """Return the first attribute of these names as text; empty without one."""
    for name in names:
        if name in attributes:
            value = np.ravel(np.asarray(attributes[name], dtype=object))
            if value.size:
                return value[0].decode("utf-8", "replace") if isinstance(value[0], bytes) else str(value[0])
    return ""


def _number(attributes: Mapping[str, Any], names: tuple[str, ...]) -> float | int | None:
    """Return the first attribute of these names that is one number; None without one."""
    for name in names:
        value = np.asarray(attributes[name]) if name in attributes else np.empty(0)
        if value.size == 1 and value.dtype.kind in "iuf":
            number: float | int = value.ravel()[0].item()
            return number
    return None


def write(recording: Recording, path: Path) -> None:
    """Write a recording as HDF5: a dataset for each channel and one of times, with units and comments as attributes."""
    import h5py

    columns = written(recording, has_units=False)
    stamps = columns.stamps
    with h5py.File(path, "w", track_order=True) as file:
        if recording.start is not None:
            file.attrs["start_ns"] = np.int64(recording.start)
        if recording.comment:
            file.attrs["comment"] = recording.comment
        seconds = stamps.view(np.int64) - (recording.start or 0) if stamps.dtype.kind == "M" else stamps
        dataset = file.create_dataset("time", data=seconds, compression="gzip", shuffle=True)
        dataset.attrs["unit"] = "ns" if stamps.dtype.kind == "M" else "s"
        each = zip(recording.channels, columns.units, columns.values, strict=True)
        for number, (channel, unit, values) in enumerate(each, 1):
            is_path = "/" in channel.name or channel.name == "."
            link = f"channel_{number}" if is_path else channel.name
            dataset = file.create_dataset(link, data=values, compression="gzip", shuffle=True)
            for name, text in (
                ("name", channel.name if is_path else ""),
                ("unit", unit),
                ("comment", channel.comment),
                ("calibration", channel.calibration),
            ):
                if text:
                    dataset.attrs[name] = text
