"""Windows against the baseline: residuals with what is certain of them."""

from dataclasses import dataclass

import numpy as np

from sprung._arrays import Real
from sprung.diagnosis.baseline import Baseline
from sprung.diagnosis.observation import Observation


@dataclass(frozen=True, eq=False, slots=True)
class Compared:
    """A window against the baseline.

    Parameters
    ----------
    time
        Time of its first sample [s].
    model_error
        Model error of its fit.
    residual
        Deviation from the normal state under its conditions, ln values, shape (components,).
    units
        1, then its conditions in units away from the middle of the baseline's, shape (1 + conditions,).
    information
        Inverse covariance of the residual, shape (components, components).
    """

    time: float
    model_error: float
    residual: Real
    units: Real
    information: Real


def compare(baseline: Baseline, observation: Observation) -> Compared:
    """Return a window against the baseline.

    Parameters
    ----------
    baseline
        Normal state of the vehicle.
    observation
        Window with the baseline's components.
    """
    return Compared(
        observation.time,
        observation.conditions.get("model_error", 0.0),
        baseline.residual(observation),
        np.concatenate([[1.0], baseline.units(observation)]),
        np.asarray(np.linalg.inv(own_covariance(baseline, observation)), dtype=np.float64),
    )


def information_of(baseline: Baseline) -> Real:
    """Return the information of a baseline about its own means and slopes.

    Parameters
    ----------
    baseline
        Normal state of the vehicle.

    Returns
    -------
    numpy.ndarray
        Inverse of their covariance, shape (units x components, units x components), units first.
    """
    return np.kron(baseline.design, np.linalg.inv(baseline.covariance + baseline.nuisance))


def own_covariance(baseline: Baseline, observation: Observation) -> Real:
    """Return the covariance of one window's residual, at least as wide as that of the baseline's windows.

    Parameters
    ----------
    baseline
        Normal state of the vehicle.
    observation
        Window with the baseline's components.

    Returns
    -------
    numpy.ndarray
        Covariance including common changes of components, shape (components, components).
    """
    if baseline.n_windows == 0:
        return observation.covariance + baseline.nuisance
    own = np.sqrt(np.maximum(np.diag(observation.covariance) / np.diag(baseline.covariance), 1.0))
    return baseline.covariance * np.outer(own, own) + baseline.nuisance
