"""What each type of value is published, tabulated, shown and drawn as: one table.

Functions stand here by their dotted names, and are imported when a value is first rendered.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from pkgutil import resolve_name
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

from sprung.errors import ParameterError

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from sprung.results.documents.document import Document


@dataclass(frozen=True, slots=True)
class Renderings:
    """Functions from a value of one type to its renderings, below `sprung.results`; empty: there is none.

    Parameters
    ----------
    document
        Published document.
    columns
        Columns of the data frame, by names with their unit in brackets.
    parts
        Headings, tables and lists of sentences.
    picture
        The one picture.
    """

    document: str = ""
    columns: str = ""
    parts: str = ""
    picture: str = ""


def _tabulated(name: str, *, document: str = "", picture: str = "") -> Renderings:
    """Return the renderings of a type that has columns and tables."""
    return Renderings(document, f"tables.frames:{name}_columns", f"tables.frames:{name}_parts", picture)


#: Renderings by the name of the type.
RENDERINGS: Mapping[str, Renderings] = MappingProxyType(
    {
        "Baseline": _tabulated("baseline", document="documents.baseline:baseline_document"),
        "Bounce": Renderings(
            "documents.bounce:bounce_document",
            "tables.bounce:bounce_columns",
            "tables.bounce:bounce_parts",
            "figures.bounce:bounce_figure",
        ),
        "Calibration": _tabulated(
            "calibration",
            document="documents.corners:calibration_document",
            picture="figures.corners:misfit_figure",
        ),
        "CornerFit": _tabulated(
            "corners", document="documents.corners:corners_document", picture="figures.corners:corners_figure"
        ),
        "Diagnosis": _tabulated(
            "diagnosis",
            document="documents.diagnosis:diagnosis_document",
            picture="figures.diagnosis:corner_changes_figure",
        ),
        "Document": Renderings(document="renderings:_itself"),
        "Finding": _tabulated("finding"),
        "Findings": _tabulated("findings"),
        "Identification": _tabulated(
            "identification",
            document="documents.identification:identification_document",
            picture="figures.stabilisation:stabilisation_figure",
        ),
        "Inspection": _tabulated("inspection", document="documents.recordings:one_inspection_document"),
        "Modes": _tabulated("modes", picture="figures.shapes:plain_shapes_figure"),
        "Observation": _tabulated("observation"),
        "Observations": _tabulated("observations"),
        "KitPlan": Renderings("documents.measured:plan_document", picture="figures.measured:kit_figure"),
        "Ride": Renderings("documents.measured:ride_document", picture="figures.measured:ride_figure"),
        "RoadSurvey": Renderings("documents.measured:road_document", picture="figures.measured:road_figure"),
        "Recording": _tabulated("recording", picture="figures.signals:recording_figure"),
        "StabilisationDiagram": _tabulated("diagram"),
        "TrackedModes": _tabulated(
            "tracks",
            document="documents.tracking:plain_tracking_document",
            picture="figures.history:plain_tracks_figure",
        ),
        "TypeBaseline": Renderings(document="documents.baseline:type_baseline_document"),
    }
)


def save(result: object, path: str | PathLike[str]) -> None:
    """Write a result as its published JSON document.

    Parameters
    ----------
    result
        Result of any analysis, or a document.
    path
        File to write; an existing one is replaced.

    Raises
    ------
    ParameterError
        If a value of this type has no document.

    Examples
    --------
    >>> from pathlib import Path
    >>> from tempfile import TemporaryDirectory
    >>> import numpy as np
    >>> import sprung
    >>> parts = tuple(sprung.structure(sprung.read_vehicle("zafira")).components())
    >>> values = 0.02 * np.random.default_rng(1).standard_normal((12, 12))
    >>> C = 0.02**2 * np.eye(12)
    >>> windows = [sprung.Observation(600.0 * k, parts, x, C, {}, {}, ()) for k, x in enumerate(values)]
    >>> baseline = sprung.learn(windows)
    >>> with TemporaryDirectory() as folder:
    ...     path = Path(folder, "car.json")
    ...     save(baseline, path)
    ...     again = sprung.read_document(path)
    >>> again.schema_name
    'sprung.baseline/1'
    """
    resolve_name("sprung.results.documents:write_document")(document_of(result), Path(path))


def document_of(result: object) -> "Document":
    """Return the published document of a result.

    Raises
    ------
    ParameterError
        If a value of this type has none.

    Examples
    --------
    >>> import numpy as np
    >>> from sprung.recording import Channel, Recording
    >>> tone = 3 * np.sqrt(2) * np.sin(2 * np.pi * 7 * np.arange(4000) / 100)
    >>> run = Recording(tone[None], 100.0, (Channel("acc", "acceleration"),))
    >>> import sprung
    >>> document_of(sprung.inspect(run)).schema_name
    'sprung.info/1'
    """
    document: Document = _rendered(result, "document", "document: pass a result, such as sprung.cov_ssi(recording)")
    return document


def _itself(document: "Document") -> "Document":
    return document


def data_frame(value: object) -> Any:
    """Return a value as a pandas.DataFrame.

    Parameters
    ----------
    value
        Recording, modes, or a result.

    Raises
    ------
    MissingPackageError
        If pandas is not installed.
    ParameterError
        If a value of this type has no rows.
    """
    columns = _rendered(value, "columns", "rows: pass a recording, modes or a result")
    return resolve_name("sprung.results.tables.frames:data_frame")(value, columns)


def as_html(value: object) -> str:
    """Return a value as HTML: the tables and sentences that the command line shows.

    Parameters
    ----------
    value
        Recording, modes, or a result.

    Raises
    ------
    ParameterError
        If a value of this type has no tables.
    """
    parts = _rendered(value, "parts", "tables: pass a recording, modes or a result")
    text: str = resolve_name("sprung.results.tables.frames:as_html")(parts)
    return text


def picture_of(value: object) -> "Figure":
    """Return the picture of a value.

    Parameters
    ----------
    value
        Recording: signals over time. Modes: mode shapes. Identification: stabilisation diagram. Tracked modes: modes
        over time. Corner fit: corners against nominal. Diagnosis: corners against the baseline. Calibration: misfit
        before and after.

    Raises
    ------
    ParameterError
        If a value of this type has no picture, or a diagnosis has no conclusive window.

    Examples
    --------
    >>> import numpy as np
    >>> from sprung.recording import Channel, Recording
    >>> tone = 3 * np.sqrt(2) * np.sin(2 * np.pi * 7 * np.arange(4000) / 100)
    >>> run = Recording(tone[None], 100.0, (Channel("acc", "acceleration"),))
    >>> [axes.get_ylabel() for axes in picture_of(run).axes]
    ['acceleration [m/s²]']
    """
    figure: Figure = _rendered(value, "picture", "picture of its own: see the functions of sprung.results.figures")
    return figure


def _rendered(value: object, kind: str, lack: str) -> Any:
    """Return one rendering of a value, by the first of its types that has one."""
    for each in type(value).__mro__:
        function = getattr(RENDERINGS.get(each.__name__), kind, "") if each.__module__.startswith("sprung.") else ""
        if function:
            return resolve_name(f"sprung.results.{function}")(value)
    raise ParameterError(f"a {type(value).__name__} has no {lack}")
