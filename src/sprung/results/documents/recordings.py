"""The documents of recordings: facts about them, `sprung.info/1`, and the truth of simulations, `sprung.truth/1`."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any, Literal

from pydantic import ConfigDict, Field

from sprung._arrays import Complex
from sprung._checks import check_type
from sprung.results.documents.document import Document, Number, Pair, checked, read_fields, write_document
from sprung.signals.inspection import ChannelFacts, Inspection, doubts


class InspectionDocument(Document):
    """Facts about recordings."""

    schema_name: Literal["sprung.info/1"] = Field(alias="schema")
    files: "tuple[FileFacts, ...]"


class FileFacts(Document):
    """Facts about a recording: an `Inspection` with the path of its file."""

    path: str
    channels: tuple[ChannelFacts, ...]
    sampling_rate: Number
    n_samples: int
    duration: Number
    n_gaps: int
    gap_duration: float
    start: int | None
    history: tuple[str, ...]
    doubts: tuple[str, ...] = ()
    group: str | None = None


class TrueValue(Document):
    """The value of a component in SI units."""

    value: float


class SpeedFacts(Document):
    """Mean and range of the speed of a drive [m/s]."""

    mean: float
    lowest: float
    highest: float


class ModesAtTime(Document):
    """Exact modes at an instant of a recording."""

    time: float
    modes: "tuple[LabelledMode, ...]"


class LabelledMode(Document):
    """Natural frequency [Hz], damping ratio and label of a mode."""

    natural_frequency: float
    damping_ratio: float
    label: str | None


class ExactMode(Document):
    """A mode of a vehicle whose parameters are known."""

    natural_frequency: float
    damping_ratio: float
    mode_shape: Complex
    label: str | None


class TruthDocument(Document):
    """Truth of a simulated recording; settings of the simulation are further keys."""

    model_config = ConfigDict(extra="allow")

    schema_name: Literal["sprung.truth/1"] = Field(alias="schema")
    channels: tuple[str, ...]
    modes: tuple[ExactMode, ...]
    components: dict[str, dict[str, TrueValue]]
    speed: SpeedFacts | None
    faults: dict[str, float]
    seed: int | None
    modes_over_time: tuple[ModesAtTime, ...] | None = None
    speeds: tuple[SpeedFacts, ...] | None = None
    files: tuple[str, ...] | None = None
    duration: float | None = None
    sampling_rate: float | None = None
    snr: float | None = None
    noise_band: Pair | None = None
    fmu: str | None = None


#: Facts about a file that are not those of an `Inspection`.
_ADDED = {"path", "doubts"}


def group_label(group: str | None) -> str:
    """Return what follows the path of a file in the name of one of its groups; nothing for the whole file."""
    return "" if group is None else f", group {group!r}"


def inspection_document(inspections: Mapping[str, Inspection]) -> InspectionDocument:
    """Return facts about recordings as `sprung.info/1`.

    Parameters
    ----------
    inspections
        Facts by the path of the file, followed by `group_label`.

    Examples
    --------
    >>> import numpy as np
    >>> from sprung.recording import Channel, Recording
    >>> tone = 3 * np.sqrt(2) * np.sin(2 * np.pi * 7 * np.arange(4000) / 100)
    >>> run = Recording(tone[None], 100.0, (Channel("acc", "acceleration"),))
    >>> import sprung
    >>> document = inspection_document({"run.csv": sprung.inspect(run)})
    >>> document.schema_name, [file.path for file in document.files]
    ('sprung.info/1', ['run.csv'])
    """
    check_type("inspections", inspections, Mapping, advice="{'run.csv': sprung.inspect(recording)}")
    files = [
        {
            "path": name.removesuffix(group_label(inspection.group)),
            "doubts": doubts(inspection),
            **{key: getattr(inspection, key) for key in FileFacts.model_fields if key not in _ADDED},
        }
        for name, inspection in inspections.items()
    ]
    return InspectionDocument.model_validate({"schema": "sprung.info/1", "files": files})


def write_inspections(inspections: Mapping[str, Inspection], path: str | Path) -> None:
    """Write facts about recordings as a JSON file, `sprung.info/1`.

    Parameters
    ----------
    inspections
        Facts by the path of the recording, followed by `group_label`.
    path
        File to write; an existing one is replaced.

    Examples
    --------
    >>> from pathlib import Path
    >>> from tempfile import TemporaryDirectory
    >>> import sprung
    >>> import numpy as np
    >>> from sprung.recording import Channel, Recording
    >>> tone = 3 * np.sqrt(2) * np.sin(2 * np.pi * 7 * np.arange(4000) / 100)
    >>> run = Recording(tone[None], 100.0, (Channel("acc", "acceleration"),))
    >>> with TemporaryDirectory() as folder:
    ...     path = Path(folder, "info.json")
    ...     write_inspections({"run.csv": sprung.inspect(run)}, path)
    ...     again = sprung.read_inspections(path)
    >>> again["run.csv"].n_samples
    4000
    """
    write_document(inspection_document(inspections), path)


def read_inspections(path: str | Path) -> dict[str, Inspection]:
    """Read facts about recordings from a JSON file.

    Parameters
    ----------
    path
        File that `write_inspections` or `sprung info --json` wrote.

    Returns
    -------
    dict
        Facts by the path of the recording, followed by `group_label`.

    Raises
    ------
    ParameterError
        If the file cannot be read.
    FormatError
        If it contains something else.

    Examples
    --------
    >>> from pathlib import Path
    >>> from tempfile import TemporaryDirectory
    >>> import sprung
    >>> import numpy as np
    >>> from sprung.recording import Channel, Recording
    >>> tone = 3 * np.sqrt(2) * np.sin(2 * np.pi * 7 * np.arange(4000) / 100)
    >>> run = Recording(tone[None], 100.0, (Channel("acc", "acceleration"),))
    >>> with TemporaryDirectory() as folder:
    ...     path = Path(folder, "info.json")
    ...     sprung.write_inspections({"run.csv": sprung.inspect(run)}, path)
    ...     again = read_inspections(path)
    >>> again["run.csv"].sampling_rate, again["run.csv"].channels[0].name
    (100.0, 'acc')
    """
    document = checked(InspectionDocument, read_fields(path), source=str(path))
    return {
        f"{file.path}{group_label(file.group)}": Inspection(**{key: value for key, value in file if key not in _ADDED})
        for file in document.files
    }


def truth_document(truth: Mapping[str, Any]) -> TruthDocument:
    """Return the truth of a simulated recording, checked, as `sprung.truth/1`.

    Parameters
    ----------
    truth
        Fields that `sprung.simulation.truth` gives, and the settings of the simulation.

    Raises
    ------
    FormatError
        If a key is missing or holds something else.

    Examples
    --------
    >>> import sprung
    >>> settings = sprung.RoadDrive(duration=10.0, sampling_rate=60.0)
    >>> drive = sprung.simulate_drive(sprung.read_vehicle("zafira"), settings, seed=1)
    >>> document = truth_document(drive.truth)
    >>> document.schema_name, [mode.label for mode in document.modes][:3]
    ('sprung.truth/1', ['bounce', 'pitch', 'roll'])
    """
    check_type("truth", truth, Mapping, advice="the truth of a sprung.SimulatedDrive")
    return checked(TruthDocument, truth, source="the truth of a simulation")


def write_truth(truth: Mapping[str, Any], path: str | Path) -> None:
    """Write the truth of a simulated recording as a JSON file, `sprung.truth/1`.

    Parameters
    ----------
    truth
        Truth of a simulation, such as that of a `SimulatedDrive`.
    path
        File to write; an existing one is replaced.

    Examples
    --------
    >>> from pathlib import Path
    >>> from tempfile import TemporaryDirectory
    >>> import sprung
    >>> settings = sprung.RoadDrive(duration=10.0, sampling_rate=60.0)
    >>> drive = sprung.simulate_drive(sprung.read_vehicle("zafira"), settings, seed=1)
    >>> with TemporaryDirectory() as folder:
    ...     path = Path(folder, "truth.json")
    ...     write_truth(drive.truth, path)
    ...     again = sprung.read_truth(path)
    >>> [mode.label for mode in again.modes][:3]
    ['bounce', 'pitch', 'roll']
    """
    write_document(truth_document(truth), path)


def read_truth(path: str | Path) -> TruthDocument:
    """Read the truth of a simulated recording from a JSON file.

    Parameters
    ----------
    path
        File that `write_truth` or `sprung simulate` wrote.

    Raises
    ------
    ParameterError
        If the file cannot be read.
    FormatError
        If it contains something else.

    Examples
    --------
    >>> from pathlib import Path
    >>> from tempfile import TemporaryDirectory
    >>> import sprung
    >>> settings = sprung.RoadDrive(duration=10.0, sampling_rate=60.0)
    >>> drive = sprung.simulate_drive(sprung.read_vehicle("zafira"), settings, seed=1)
    >>> with TemporaryDirectory() as folder:
    ...     path = Path(folder, "truth.json")
    ...     sprung.write_truth(drive.truth, path)
    ...     again = read_truth(path)
    >>> again.seed, [round(mode.natural_frequency, 2) for mode in again.modes][:3]
    (1, [1.52, 1.76, 2.2])
    """
    return checked(TruthDocument, read_fields(path), source=str(path))


def one_inspection_document(inspection: Inspection) -> InspectionDocument:
    """Return the document of one inspection, whose recording has no name."""
    return inspection_document({"": inspection})
