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
        Headings (texts), tables, lists of tables and sentences, or tuples of all these, in the order in which they are
        shown; after a dot, an attribute of the value.
    picture
        The one picture.
    """

    document: str = ""
    columns: str = ""
    parts: tuple[str, ...] = ()
    picture: str = ""


def _of(document: str = "", columns: str = "", parts: str = "", picture: str = "") -> Renderings:
    """Return renderings by names below `documents`, `tables.frames`, `tables` and `figures`."""
    names = tuple(name if name.startswith(".") else f"tables.{name}" for name in parts.split())
    columns = columns and f"tables.frames:{columns}_columns"
    return Renderings(document and f"documents.{document}", columns, names, picture and f"figures.{picture}")


_BOUNCE = "corners:describe_bounce corners:bounce_tables"
_CALIBRATION = "corners:calibration_table corners:describe_calibration"
_CORNERS = "corners:components_table corners:fitted_modes_table corners:describe_payload"
_DIAGNOSED, _DIAGNOSIS = "diagnosis:diagnosis_document", "diagnosis:describe_diagnosis diagnosis:diagnosis_tables"
_IDENTIFIED = "identification:identification_document"
_MODES = "identification:describe_identification identification:identification_tables"
_INSPECTION = "recordings:describe_inspection recordings:inspection_table"
_TRACKS = "identification:describe_tracks identification:tracks_table"
_FINDINGS = _of("", "findings", "diagnosis:findings_table")
_OBSERVATIONS = _of("", "observations", "diagnosis:observations_table")

#: Renderings by the name of the type.
RENDERINGS: Mapping[str, Renderings] = MappingProxyType(
    {
        "Baseline": _of(
            "diagnosis:baseline_document", "baseline", "diagnosis:baseline_table diagnosis:describe_baseline"
        ),
        "Bounce": _of("bounce:bounce_document", "bounce", f"{_BOUNCE} .notes", "measured:bounce_figure"),
        "Calibration": _of("corners:calibration_document", "calibration", _CALIBRATION, "diagnosis:misfit_figure"),
        "CornerFit": _of("corners:corners_document", "corners", f"{_CORNERS} .notes", "diagnosis:corners_figure"),
        "Diagnosis": _of(_DIAGNOSED, "findings", f"{_DIAGNOSIS} .notes", "diagnosis:corner_changes_figure"),
        "Document": Renderings("renderings:_itself"),
        "Finding": _FINDINGS,
        "Findings": _FINDINGS,
        "Identification": _of(_IDENTIFIED, "identification", f"{_MODES} .notes", "stabilisation:stabilisation_figure"),
        "Inspection": _of("recordings:one_inspection_document", "inspection", _INSPECTION),
        "KitPlan": _of("measured:plan_document", picture="measured:kit_figure"),
        "LateralFit": _of(
            "measured:stability_document",
            parts="measured:stability_tables measured:describe_stability",
            picture="measured:stability_figure",
        ),
        "Modes": _of("", "modes", "identification:modes_table", "shapes:plain_shapes_figure"),
        "Observation": _OBSERVATIONS,
        "Observations": _OBSERVATIONS,
        "Recording": _of("", "recording", "recordings:recording_parts", "signals:recording_figure"),
        "Ride": _of("measured:ride_document", picture="measured:ride_figure"),
        "RoadSurvey": _of("measured:road_document", picture="measured:road_figure"),
        "StabilisationDiagram": _of("", "diagram", "identification:diagram_table"),
        "TrackedModes": _of("identification:plain_tracking_document", "tracks", _TRACKS, "history:plain_tracks_figure"),
        "TypeBaseline": _of("diagnosis:type_baseline_document"),
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
    names = _found(value, "parts", "tables: pass a recording, modes or a result")
    parts = [
        list(getattr(value, name[1:])) if name.startswith(".") else resolve_name(f"sprung.results.{name}")(value)
        for name in names
    ]
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


def _found(value: object, kind: str, lack: str) -> Any:
    """Return the names of the functions for one rendering of a value, by the first of its types that has one."""
    for each in type(value).__mro__:
        names = getattr(RENDERINGS.get(each.__name__), kind, "") if each.__module__.startswith("sprung.") else ""
        if names:
            return names
    raise ParameterError(f"a {type(value).__name__} has no {lack}")


def _rendered(value: object, kind: str, lack: str) -> Any:
    return resolve_name(f"sprung.results.{_found(value, kind, lack)}")(value)
