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
        np.asarray(np.linalg.inv(baseline.covariance_of(observation)), dtype=np.float64),
    )
