"""Completion of a vehicle file from healthy drives."""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from sprung._arrays import Real
from sprung.calibration.draft import Draft, VehicleNumber, explicit, moved
from sprung.calibration.fitting import FreeVehicle, JointFit, joint_fit
from sprung.calibration.numbers import component_numbers, file_numbers
from sprung.calibration.results import Calibration, LearntNumber
from sprung.calibration.windows import DELAY, window_spectra
from sprung.errors import ParameterError
from sprung.likelihood import CornerSettings
from sprung.vehicles import Component, Vehicle, corner_names
from sprung.vehicles.window import Window

#: A number is told by the drives if they reduce its standard deviation to this share of the prior's or less.
_TOLD = 0.5


@dataclass(frozen=True, slots=True)
class CalibrationSettings:
    """Choices of a calibration.

    Parameters
    ----------
    corners
        Choices of the fits, as for `sprung.likelihood.fit_corners`.
    """

    corners: CornerSettings = field(default_factory=CornerSettings)


def calibrate(windows: Sequence[Window], *, settings: CalibrationSettings | None = None) -> Calibration:
    """Return the vehicle file of windows, completed with what they teach.

    Parameters
    ----------
    windows
        Windows of healthy drives of one vehicle with the same channels, at least one; drives with other loads, on other
        roads and at other speeds teach more.
    settings
        Choices.

    Returns
    -------
    Calibration

    Raises
    ------
    ParameterError
        If there is no window, or a window has another vehicle or other channels.
    DataError
        If the speed is missing, or no segment of a window is long, fast and steady enough.

    Notes
    -----
    The parameters of maximum posterior probability of all windows together. A number of the file is shared by the
    windows, and its prior counts once; payload, road and noise are each window's own.

    References
    ----------
    J. L. Beck and L. S. Katafygiotis, Updating models and their uncertainties. I: Bayesian statistical framework,
    Journal of Engineering Mechanics 124 (1998), 455-461.
    """
    settings = settings or CalibrationSettings()
    _check_alike(windows)
    corners, draft = settings.corners, explicit(windows[0].vehicle)
    spectra = tuple(window_spectra(window, corners) for window in windows)
    parts = component_numbers(draft, std=corners.prior_std)
    before = joint_fit(FreeVehicle(spectra, draft, parts, corners))
    numbers = (*parts, *file_numbers(draft, spectra[0].layout.names))
    after = joint_fit(FreeVehicle(spectra, draft, numbers, corners), start=before.values())
    return _calibration(before, after)


def _check_alike(windows: Sequence[Window]) -> None:
    """Raise unless the windows are of one vehicle and have the same channels."""
    if not windows:
        raise ParameterError("no window was given, but one is needed: give drives of the vehicle")
    first = windows[0]
    for window in windows[1:]:
        if window.vehicle != first.vehicle:
            raise ParameterError(
                f"a window has the vehicle {window.vehicle.name!r}, the first one {first.vehicle.name!r}: give "
                "windows of one vehicle file"
            )
        if window.outputs != first.outputs:
            raise ParameterError(
                f"a window has the channels {', '.join(window.outputs)}, the first one {', '.join(first.outputs)}: "
                "give windows with the same channels"
            )


def _calibration(before: JointFit, after: JointFit) -> Calibration:
    """Return the result of the last fit next to that with springs, dampers, tyres and payload alone."""
    learnt = learnt_numbers(after)
    first = after.joint.models[0]
    frequencies = first.spectra.frequencies
    misfits = [_mean_misfit(fit, frequencies) for fit in (before, after)]
    errors = [tuple(error for _, error in fit.misfits()) for fit in (before, after)]
    return Calibration(
        vehicle=completed(after),
        learnt=learnt,
        channels=first.layout.coordinates,
        frequencies=frequencies,
        misfit_before=misfits[0],
        misfit_after=misfits[1],
        model_errors_before=errors[0],
        model_errors_after=errors[1],
        n_segments=tuple(model.spectra.n_segments for model in after.joint.models),
        notes=_notes(learnt),
    )


def _mean_misfit(fit: JointFit, frequencies: Real) -> Real:
    """Return the misfit of all windows, averaged by their numbers of segments, shape (channels, frequencies)."""
    models = fit.joint.models
    misfits = [
        [np.interp(frequencies, model.spectra.frequencies, row) for row in misfit]
        for model, (misfit, _) in zip(models, fit.misfits(), strict=True)
    ]
    return np.average(misfits, axis=0, weights=[model.spectra.n_segments for model in models])


def learnt_numbers(fit: JointFit) -> tuple[LearntNumber, ...]:
    """Return the numbers of the vehicle that were free in a fit, with their standard deviations."""
    joint, given = fit.joint, fit.free.draft
    std = np.sqrt(np.diag(joint.covariance(fit.parameters)))
    rows = {name: row for row, name in enumerate(joint.names)}
    learnt = [
        _learnt(number, given, fit.parameters[rows[number.name]], std[rows[number.name]]) for number in fit.free.numbers
    ]
    if DELAY in rows:
        row = rows[DELAY]
        scale, of_prior = float(np.exp(-fit.parameters[row])), float(joint.prior_std[row])
        is_told = bool(std[row] < _TOLD * of_prior)
        learnt.append(LearntNumber("speed_scale", "speed", "", 1.0, scale, scale * float(std[row]), of_prior, is_told))
    return tuple(learnt)


def _learnt(number: VehicleNumber, draft: Draft, parameter: float, std: float) -> LearntNumber:
    """Return a number with its learnt value."""
    given = number.get(draft)
    value = number.value(given, parameter)
    return LearntNumber(
        name=number.name,
        group=number.group,
        unit=number.unit,
        given=given,
        value=value,
        std=number.std_of_value(value, std),
        prior_std=number.std_of_value(given, number.std),
        is_told=std < _TOLD * number.std,
    )


def completed(fit: JointFit) -> Vehicle:
    """Return the vehicle file of a fit: each axle has the geometric mean of its corners."""
    own = fit.joint.of_window(0, fit.parameters)[: len(fit.free.numbers)]
    draft = moved(fit.free.draft, fit.free.numbers, own)
    corners = corner_names(len(draft.vehicle.axle))
    for index in range(len(draft.vehicle.axle)):
        axle, sides = draft.vehicle.axle[index], corners[2 * index : 2 * index + 2]
        for name, kind in (("spring_stiffness", "spring"), ("damping", "damper"), ("tyre_stiffness", "tyre")):
            value = getattr(axle, name)
            factors = [draft.factors.get(Component(corner, kind), 1.0) for corner in sides]
            if value:
                draft = draft.with_entry("axle", index, **{name: value * float(np.sqrt(np.prod(factors)))})
    return draft.vehicle


def _notes(learnt: Sequence[LearntNumber]) -> tuple[str, ...]:
    """Return remarks on what the drives did not tell."""
    silent = [number.name for number in learnt if not number.is_told and number.group not in {"sides", "sensors"}]
    if not silent:
        return ()
    return (f"not determined by these drives, and left near the given values: {', '.join(silent)}",)
