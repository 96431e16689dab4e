"""Documents of modes."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from sprung._arrays import Complex, Real
from sprung.modal import Modes
from sprung.results.documents.document import Document, Number
from sprung.vehicles import ExactModes


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
            **row_of(modes, ModeValues, k),
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


def row_of(values: object, model: type[Document], k: int) -> dict[str, Any]:
    """Return the fields of a model at one index of the arrays of the same names."""
    return {name: getattr(values, name)[k] for name in model.model_fields}
