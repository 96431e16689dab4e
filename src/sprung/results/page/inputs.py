"""What a report states about its files: their channels, gaps and faults, and the versions of the programs."""

import platform
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from importlib.metadata import version
from pathlib import Path

from sprung import __version__
from sprung.formats import ReadSettings, read_records
from sprung.results.page.page import Block, Paragraph, Section, Sentences
from sprung.results.tables import counted, inspection_in_words, inspection_table
from sprung.signals.inspection import Inspection, inspect_blocks

#: Most files whose channels are listed.
_MOST_LISTED = 3


@dataclass(frozen=True, eq=False, slots=True)
class Inputs:
    """Files behind a result.

    Parameters
    ----------
    files
        Files that were analysed.
    inspections
        Facts about each recording, by the path of its file; empty where the files are not recordings.
    others
        Purpose and name of further files, such as the vehicle file.
    """

    files: tuple[Path, ...]
    inspections: Mapping[str, Inspection]
    others: Mapping[str, str]

    @property
    def title(self) -> str:
        """Name of the file, or number of files."""
        return self.files[0].name if len(self.files) == 1 else counted(len(self.files), "file")


def inspected(
    files: Sequence[Path],
    *,
    settings: ReadSettings | None = None,
    others: Mapping[str, str] | None = None,
) -> Inputs:
    """Return the facts about recordings for a report.

    Parameters
    ----------
    files
        Recordings, which are read once more, one after the other.
    settings
        As for `sprung.read`.
    others
        Purpose and name of further files, such as the vehicle file.

    Raises
    ------
    SprungError
        As raised by `sprung.read`.

    Examples
    --------
    >>> from pathlib import Path
    >>> from tempfile import TemporaryDirectory
    >>> import numpy as np
    >>> import sprung
    >>> run = sprung.Recording(np.sin(np.arange(500.0))[None], 100.0, (sprung.Channel("acc_fl", "acceleration"),))
    >>> with TemporaryDirectory() as folder:
    ...     path = Path(folder, "run.csv")
    ...     sprung.write(run, path)
    ...     inputs = inspected([path], others={"vehicle file": "zafira.toml"})
    >>> inputs.title, [inspection.n_samples for inspection in inputs.inspections.values()]
    ('run.csv', [500])
    """
    inspections = {str(path): inspect_blocks(read_records([path], settings=settings)) for path in files}
    return Inputs(tuple(files), inspections, others or {})


def data_section(inputs: Inputs) -> Section:
    """Return the section on the quality of the data."""
    blocks: list[Block] = []
    for number, (name, inspection) in enumerate(inputs.inspections.items()):
        blocks.append(Paragraph(f"{name}: {inspection_in_words(inspection)}"))
        if number < _MOST_LISTED:
            blocks.append(inspection_table(inspection))
        elif faults := _faults(inspection):
            blocks.append(Sentences(faults))
        if inspection.history and number < _MOST_LISTED:
            blocks.append(Sentences(inspection.history))
    healthy = [not _faults(inspection) for inspection in inputs.inspections.values()]
    if healthy and all(healthy):
        blocks.insert(0, Paragraph("No channel shows a fault, and no value is missing."))
    elif healthy:
        blocks.insert(0, Sentences(tuple(dict.fromkeys(_all_faults(inputs)))))
    return Section("Data", tuple(blocks))


def footer(inputs: Inputs) -> str:
    """Return files, command, versions and time of a report in a line."""
    parts = [f"{purpose}: {name}" for purpose, name in inputs.others.items()]
    packages = ", ".join(f"{name} {version(name)}" for name in ("numpy", "scipy"))
    parts.append(f"sprung {__version__} (Python {platform.python_version()}, {packages})")
    return "; ".join([*parts, f"written {datetime.now(UTC):%Y-%m-%d %H:%M} UTC"])


def _faults(inspection: Inspection) -> tuple[str, ...]:
    """Return a sentence for each faulty channel."""
    table = inspection_table(inspection)
    return tuple(f"{row[0]}: {row[-1]}" for row in table.rows if row[-1])


def _all_faults(inputs: Inputs) -> list[str]:
    """Return a sentence for each faulty channel of all files."""
    several = len(inputs.inspections) > 1
    return [
        f"{name}, {fault}" if several else fault
        for name, inspection in inputs.inspections.items()
        for fault in _faults(inspection)
    ]
