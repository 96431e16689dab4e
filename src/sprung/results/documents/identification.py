"""Documents of modes and of an identification, `sprung.identification/1`."""

import math
from collections.abc import Sequence
from pathlib import Path
from pkgutil import resolve_name
from typing import TYPE_CHECKING, Annotated, Any, Literal

import numpy as np
from pydantic import Field

from sprung._arrays import Complex, Real
from sprung._checks import check_type
from sprung._display import counted, in_short
from sprung.identification import Identification, RovingSetups
from sprung.identification.refinement import Refinement
from sprung.modal import Modes
from sprung.recording import Channel
from sprung.results.documents.document import (
    Document,
    Number,
    Pair,
    Published,
    checked,
    plain,
    read_fields,
    write_document,
)
from sprung.signals.harmonics import Harmonic
from sprung.vehicles import ExactModes, Vehicle, structure
from sprung.vehicles.labels import MOTIONS, rigid_body_participation
from sprung.vehicles.sensor_layout import AnyVehicle

if TYPE_CHECKING:
    from matplotlib.figure import Figure


class ModeValues(Document):
    """Natural frequency [Hz] and damping ratio of a mode, with standard deviations."""

    natural_frequency: float
    natural_frequency_std: Number
    damping_ratio: float
    damping_ratio_std: Number


class FittedMode(ModeValues):
    """A mode of a fitted vehicle."""

    mode_shape: Complex
    label: str | None


class IdentifiedMode(ModeValues):
    """A mode identified in recordings; its shape has standard deviations of real and imaginary parts."""

    mode_shape: Complex
    mode_shape_std: Complex | None = None
    mpc: float
    label: str | None
    stable_rate: Number


class Participation(Document):
    """Shares of the rigid-body motions in a mode, and the share of its shape that they explain."""

    bounce: float
    pitch: float
    roll: float
    explained: float


def mode_documents(modes: Modes) -> list[dict[str, Any]]:
    """Return modes as in the document of an identification: one JSON object for each mode.

    Parameters
    ----------
    modes
        Identified modes.

    Returns
    -------
    list of dict
        Modes as in a subset of `sprung.identification/1`: without `participation` and `subsets`.

    Examples
    --------
    >>> from sprung.identification import cov_ssi
    >>> from sprung.simulation import simulate, usual_excitation
    >>> from sprung.vehicles import chain
    >>> masses = chain()
    >>> run = simulate(masses, usual_excitation(masses), duration=60.0, sampling_rate=200.0, seed=1)
    >>> identification = cov_ssi(run)
    >>> first, *others = mode_documents(identification.modes)
    >>> round(first["natural_frequency"]), len(others)
    (7, 2)
    """
    return [mode.as_json() for mode in identified_modes(modes)]


def identified_modes(modes: Modes) -> tuple[IdentifiedMode, ...]:
    """Return the documents of identified modes."""
    return tuple(
        IdentifiedMode(
            **_row(modes, ModeValues, k),
            mode_shape=modes.mode_shapes[k],
            mode_shape_std=None if np.isnan(modes.mode_shape_std[k]).any() else modes.mode_shape_std[k],
            mpc=modes.mpc[k],
            label=modes.labels[k],
            stable_rate=modes.stable_rate[k],
        )
        for k in range(len(modes))
    )


def modes_from_documents(documents: Sequence[IdentifiedMode], channels: tuple[str, ...]) -> Modes:
    """Return identified modes as arrays.

    Parameters
    ----------
    documents
        Documents of the modes.
    channels
        Names of the channels of their shapes.

    Raises
    ------
    ValueError
        If a shape has another number of channels.
    """
    frequency, ratio, frequency_std, ratio_std, stable_rate = (
        np.array([getattr(mode, name) for mode in documents], dtype=np.float64)
        for name in (
            *("natural_frequency", "damping_ratio", "natural_frequency_std", "damping_ratio_std"),
            "stable_rate",
        )
    )
    size = len(documents), len(channels)
    unknown = np.full(len(channels), complex(np.nan, np.nan))
    stds = [unknown if mode.mode_shape_std is None else mode.mode_shape_std for mode in documents]
    return Modes(
        poles=2 * np.pi * frequency * (1j * np.sqrt(1 - ratio**2) - ratio),
        mode_shapes=np.array([mode.mode_shape for mode in documents], dtype=np.complex128).reshape(size),
        channels=channels,
        natural_frequency_std=frequency_std,
        damping_ratio_std=ratio_std,
        stable_rate=stable_rate,
        labels=tuple(mode.label for mode in documents),
        mode_shape_std=np.array(stds, dtype=np.complex128).reshape(size),
    )


def fitted_modes(modes: ExactModes, deviations: tuple[Real, Real]) -> tuple[FittedMode, ...]:
    """Return the documents of the modes of a fitted vehicle; deviations of frequencies [Hz] and damping ratios."""
    frequency, damping = deviations
    return tuple(
        FittedMode(
            natural_frequency=modes.natural_frequency[k],
            natural_frequency_std=frequency[k],
            damping_ratio=modes.damping_ratio[k],
            damping_ratio_std=damping[k],
            mode_shape=modes.mode_shapes[k],
            label=modes.labels[k],
        )
        for k in range(modes.poles.size)
    )


def participations(
    modes: Modes, channels: tuple[Channel, ...], vehicle: AnyVehicle | None
) -> tuple[Participation | None, ...]:
    """Return the shares of the rigid-body motions in each mode; None if the sensors do not determine them."""
    mass = structure(vehicle).mass[:3, :3] if isinstance(vehicle, Vehicle) else None
    shares, explained = rigid_body_participation(modes, channels, mass=mass)
    return tuple(
        None if math.isnan(share[0]) else Participation(**dict(zip(MOTIONS, plain(share), strict=True)), explained=fit)
        for share, fit in zip(shares, explained, strict=True)
    )


def _row(values: object, model: type[Document], k: int) -> dict[str, Any]:
    """Return the fields of a model at one index of the arrays of the same names."""
    return {name: getattr(values, name)[k] for name in model.model_fields}


class SubsetValues(ModeValues):
    """A mode as identified from one subset of segments."""

    stable_rate: Number


class LevelTrend(Document):
    """Dependence of a mode on the level of the motion."""

    natural_frequency: float
    natural_frequency_std: float
    damping_ratio: float
    damping_ratio_std: float
    p_value: float
    level_ratio: float
    is_detected: bool


class MergedMode(IdentifiedMode):
    """A mode with the method that gave it, its share in the rigid-body motions, and its values in each subset."""

    source: Literal["ssi", "plscf", "fdd", "road_likelihood", "free_response"] = "ssi"
    participation: Participation | None
    subsets: tuple[SubsetValues | None, ...]
    level_trend: LevelTrend | None = None


class SubsetDocument(Document):
    """The modes of a subset of segments."""

    n_segments: int
    level: Pair | None
    modes: tuple[IdentifiedMode, ...]


class BandDocument(Document):
    """Fit of the modes in one band: numbers of the modes, and misfit of the spectra relative to chance."""

    band: Pair
    modes: tuple[int, ...]
    is_converged: bool
    misfit_before: Number
    misfit: Number
    misfit_excess: Number


class RefinedDocument(ModeValues):
    """Refinement of one mode: its values before, the change in standard deviations, or why there is none."""

    distance: Number
    reason: str | None


class RefinementDocument(Document):
    """Refinement of the modes, in their order, by the likelihood of the spectra."""

    modes: tuple[RefinedDocument, ...]
    bands: tuple[BandDocument, ...]


class SetUpDocument(Document):
    """A set-up of roving sensors, with its own modes."""

    number: int
    channels: tuple[str, ...]
    modes: tuple[IdentifiedMode, ...]
    members: tuple[int | None, ...]
    mac: tuple[Number, ...]


class SetUpsDocument(Document):
    """The set-ups that are merged."""

    references: tuple[str, ...]
    parts: tuple[SetUpDocument, ...]


class IdentificationDocument(Document):
    """An identification as stored in a file: without stabilisation diagrams and spectra."""

    schema_name: Literal["sprung.identification/1"] = Field(alias="schema")
    method: str
    channels: tuple[str, ...]
    sensors: tuple[Channel, ...] = ()
    sampling_rate: float
    band: tuple[Number, Number]
    modes: tuple[MergedMode, ...]
    subsets: tuple[SubsetDocument, ...]
    harmonics: tuple[Annotated[Harmonic, Published(unit=lambda line: _UNITS[line.kind])], ...]
    refinement: RefinementDocument | None = None
    settings: dict[str, Any]
    notes: tuple[str, ...]
    setups: SetUpsDocument | None = Field(default=None, exclude_if=lambda setups: setups is None)

    def __repr__(self) -> str:
        """Return method, channels and modes in words."""
        size = f"{counted(len(self.channels), 'channel')}: {counted(len(self.modes), 'mode')}"
        head = f"IdentificationDocument by {self.method} of {size}"
        return in_short(head, self.as_modes().in_words, *self.notes[:1])

    def _repr_html_(self) -> str:
        return self.as_modes()._repr_html_()

    def to_dataframe(self) -> Any:
        """Return the modes as a pandas.DataFrame, as `Modes.to_dataframe`."""
        return self.as_modes().to_dataframe()

    def plot(self) -> "Figure":
        """Return the picture of the mode shapes: on the body where the places of the sensors are known."""
        figure: Figure = resolve_name("sprung.results.figures.shapes:shapes_figure")(
            self.as_modes(), self.as_channels()
        )
        return figure

    def as_channels(self) -> tuple[Channel, ...]:
        """Return the outputs with quantity, position and direction, as far as the file states them."""
        return self.sensors or tuple(Channel(name) for name in self.channels)

    def as_modes(self) -> Modes:
        """Return the modes as arrays, for comparisons and pictures."""
        return modes_from_documents(self.modes, self.channels)


_UNITS = {"constant": "Hz", "drifting": "Hz", "speed": "1/m"}


def identification_document(
    identification: Identification, *, vehicle: AnyVehicle | None = None
) -> IdentificationDocument:
    """Return an identification as `sprung.identification/1`.

    Parameters
    ----------
    identification
        Result of any method.
    vehicle
        Vehicle of the identification, whose mass matrix weights the participation; None: equal masses.

    Examples
    --------
    >>> from sprung.identification import cov_ssi
    >>> from sprung.simulation import simulate, usual_excitation
    >>> from sprung.vehicles import chain
    >>> masses = chain()
    >>> run = simulate(masses, usual_excitation(masses), duration=60.0, sampling_rate=200.0, seed=1)
    >>> identification = cov_ssi(run)
    >>> document = identification_document(identification)
    >>> document.schema_name, [round(mode.natural_frequency) for mode in document.modes]
    ('sprung.identification/1', [7, 20, 28])
    """
    check_type("identification", identification, Identification)
    settings = identification.effective_settings
    kept = {name: value for name, value in plain(settings).items() if (name, value) != ("kind", "auto")}
    lifter = None if settings.lifter is None else {"kind": type(settings.lifter).__name__, **plain(settings.lifter)}
    setups = identification.setups
    return IdentificationDocument.of(
        identification,
        channels=[channel.name for channel in identification.channels],
        sensors=identification.channels,
        modes=_merged_modes(identification, vehicle),
        subsets=[SubsetDocument.of(subset, modes=identified_modes(subset.modes)) for subset in identification.subsets],
        refinement=None if identification.refinement is None else _refinement(identification.refinement),
        settings={**kept, "lifter": lifter},
        setups=None if setups is None else _setups(setups),
    )


def _refinement(refinement: Refinement) -> RefinementDocument:
    modes = tuple(
        RefinedDocument(**_row(refinement.start, ModeValues, k), distance=distance, reason=reason or None)
        for k, (distance, reason) in enumerate(zip(refinement.distances, refinement.reasons, strict=True))
    )
    return RefinementDocument.of(refinement, modes=modes)


def write_identification(
    identification: Identification, path: str | Path, *, vehicle: AnyVehicle | None = None
) -> None:
    """Write an identification as a JSON file, `sprung.identification/1`.

    Parameters
    ----------
    identification
        Result of any method.
    path
        File to write; an existing one is replaced.
    vehicle
        Vehicle of the identification, whose mass matrix weights the participation; None: equal masses.

    Examples
    --------
    >>> from pathlib import Path
    >>> from tempfile import TemporaryDirectory
    >>> import sprung
    >>> from sprung.identification import cov_ssi
    >>> from sprung.simulation import simulate, usual_excitation
    >>> from sprung.vehicles import chain
    >>> masses = chain()
    >>> run = simulate(masses, usual_excitation(masses), duration=60.0, sampling_rate=200.0, seed=1)
    >>> identification = cov_ssi(run)
    >>> with TemporaryDirectory() as folder:
    ...     path = Path(folder, "modes.json")
    ...     write_identification(identification, path)
    ...     again = sprung.read_identification(path)
    >>> len(again.modes), again.modes[0].natural_frequency == float(identification.modes.natural_frequency[0])
    (3, True)
    """
    write_document(identification_document(identification, vehicle=vehicle), path)


def read_identification(path: str | Path) -> IdentificationDocument:
    """Read an identification from a JSON file.

    Parameters
    ----------
    path
        File that `write_identification` or `sprung identify --json` wrote.

    Returns
    -------
    IdentificationDocument
        Modes, subsets, harmonics, settings and notes. The stabilisation diagrams and spectra of an `Identification`
        are not in the file.

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
    >>> from sprung.identification import cov_ssi
    >>> from sprung.simulation import simulate, usual_excitation
    >>> from sprung.vehicles import chain
    >>> masses = chain()
    >>> run = simulate(masses, usual_excitation(masses), duration=60.0, sampling_rate=200.0, seed=1)
    >>> identification = cov_ssi(run)
    >>> with TemporaryDirectory() as folder:
    ...     path = Path(folder, "modes.json")
    ...     sprung.write_identification(identification, path)
    ...     again = read_identification(path)
    >>> [round(mode.natural_frequency) for mode in again.modes]
    [7, 20, 28]
    """
    return checked(IdentificationDocument, read_fields(path), source=str(path))


def _setups(setups: RovingSetups) -> SetUpsDocument:
    parts = tuple(
        SetUpDocument.of(
            part,
            modes=identified_modes(part.identification.modes),
            members=tuple(None if member < 0 else int(member) for member in part.members),
            mac=tuple(part.mac.tolist()),
        )
        for part in setups.parts
    )
    return SetUpsDocument.of(setups, parts=parts)


def _merged_modes(identification: Identification, vehicle: AnyVehicle | None) -> list[dict[str, Any]]:
    return [
        {
            **dict(mode),
            "source": source,
            "participation": participation,
            "subsets": [
                _row(subset.modes, SubsetValues, int(member)) if member >= 0 else None
                for subset, member in zip(identification.subsets, members, strict=True)
            ],
            "level_trend": trend,
        }
        for mode, source, participation, members, trend in zip(
            identified_modes(identification.modes),
            identification.sources,
            participations(identification.modes, identification.channels, vehicle),
            identification.members,
            _level_trends(identification),
            strict=True,
        )
    ]


def _level_trends(identification: Identification) -> list[dict[str, Any] | None]:
    trends = identification.level_trends
    if trends is None:
        return [None] * len(identification.modes)
    return [
        _row(trends, LevelTrend, k) if np.isfinite(trends.p_value[k]) else None
        for k in range(len(identification.modes))
    ]
