"""Wheels that are not round: the run-out of each, from the lines of their turns beside a fitted vehicle."""

from dataclasses import dataclass

import numpy as np

from sprung._arrays import Complex, Real
from sprung._checks import check_type, freeze
from sprung.likelihood.corners import CornerFit
from sprung.likelihood.masked_lines import SpectralLine, without_lines
from sprung.likelihood.spectra import through_window
from sprung.likelihood.transfer import transfer


@dataclass(frozen=True, slots=True)
class RunOutSettings:
    """What counts as turns of the wheels, and how their run-out is estimated."""

    #: Smallest and largest circumference of a wheel [m].
    circumferences: tuple[float, float] = (1.5, 4.0)
    #: Distance of a line from a whole number of periods in a turn, in periods, within which it is one of the wheels.
    whole: float = 0.05
    #: Largest number of steps, and relative change of every power at which they end.
    max_steps: int = 500
    settled: float = 1e-3
    #: Relative error of the fitted vehicle's response to the ground.
    response: float = 0.08


SETTINGS = RunOutSettings()


@dataclass(frozen=True, eq=False, slots=True)
class RunOut:
    """Run-out of the wheels of a vehicle.

    Parameters
    ----------
    circumference
        Distance of a turn [m].
    wheels
        Names of the wheels.
    values, stds
        RMS of the motion of the ground that acts as each wheel does once, twice ... in a turn, and its standard
        deviation [m], shape (wheels,).
    """

    circumference: float
    wheels: tuple[str, ...]
    values: Real
    stds: Real

    def __post_init__(self) -> None:
        freeze(self, values=1, stds=1)


def run_out(fit: CornerFit) -> RunOut | None:
    """Return the run-out of each wheel; None where no line of the wheels stands out of the fitted spectra.

    Parameters
    ----------
    fit
        Fitted vehicle, on a road or track.

    Raises
    ------
    ParameterError
        If this is no fit.

    Notes
    -----
    A wheel with a run-out of the mean square P_w in a line adds P_w H_w H_w^H to the spectral matrix, H_w the response
    to the ground under it at the line. Wheels of different radii turn against each other, so that their contributions
    are independent over a drive. With the whitened matrix Y of the data in the bins of the line, I + sum P_w h_w h_w^H
    is fitted to it in all speed classes by maximum likelihood: P_w grows by the root of (u^H Y u) / (u^H h_w), u = (I +
    sum P h h^H)^-1 h_w, which keeps it positive. Deviations are those of the scores of the speed classes (sandwich) and
    of errors of 8 % of the fitted vehicle's response. An unbalance U of a wheel on a tyre of stiffness k acts as a
    run-out of U (v / R)^2 / k.

    References
    ----------
    D. D. Lee and H. S. Seung, Algorithms for non-negative matrix factorization, Advances in Neural Information
    Processing Systems 13 (2001), 556-562 (multiplicative updates).
    H. White, Maximum likelihood estimation of misspecified models, Econometrica 50 (1982), 1-25.

    Examples
    --------
    Wheels of 5 to 30 g m unbalance and 0.3 to 1.7 mm run-out:

    >>> from sprung.likelihood import fit_corners
    >>> from sprung.simulation import RoadDrive, WheelOrders, simulate_drive
    >>> from sprung.vehicles import read_vehicle
    >>> vehicle, wheels = read_vehicle("zafira"), WheelOrders(run_out=(1e-3,))
    >>> drive = RoadDrive(duration=120.0, sampling_rate=60.0, speed=(10.0, 20.0), snr=50.0, wheel_orders=wheels)
    >>> found = run_out(fit_corners(simulate_drive(vehicle, drive, seed=1).recording, vehicle))
    >>> round(found.circumference, 1), found.wheels
    (1.9, ('front_left', 'front_right', 'rear_left', 'rear_right'))
    """
    check_type("fit", fit, CornerFit)
    low, high = SETTINGS.circumferences
    of_wheels = [line for line in fit.lines if line.follows_speed]
    first = min((line.place for line in of_wheels if 1 / high <= line.place <= 1 / low), default=None)
    if first is None:
        return None
    # One line for each number of periods: wheels of different radii may show as two, whose bins are the same.
    periods = {round(line.place / first): line for line in reversed(of_wheels)}
    turns = [line for n, line in periods.items() if n and abs(line.place / first - n) < SETTINGS.whole]
    model = fit.model
    response = transfer(model.terms(fit.parameters))
    fitted = through_window(response.spectral_matrix)
    ground = response.matrix[1:-1, :, : response.terms.inputs.shape[-1]]
    powers, variances = np.zeros((2, ground.shape[-1]))
    for line in turns:
        power, variance = _powers(fit, line, fitted, ground)
        powers, variances = powers + power, variances + variance
    values, stds = np.sqrt(powers), np.sqrt(variances)
    stds = np.minimum(stds / (2 * np.maximum(values, 1e-300)), np.sqrt(stds))
    wheels = tuple(name.removeprefix("road_") for name in model.structure.inputs)
    return RunOut(1 / first, wheels, values, stds)


def _powers(fit: CornerFit, line: SpectralLine, fitted: Complex, ground: Complex) -> tuple[Real, Real]:
    """Return the mean square of each wheel in a line [m^2] and its variance, both shape (wheels,)."""
    spectra = fit.model.spectra
    near = ~without_lines(spectra, (line,))
    places = line.place * spectra.speeds
    rows = [row for row in np.flatnonzero(near.any(axis=1)) if places[row] <= spectra.frequencies[-1]]
    if not rows:
        return np.zeros(ground.shape[-1]), np.zeros(ground.shape[-1])
    counts = spectra.counts[rows]
    of_fit, of_data = (
        np.array([matrices[row, near[row]].sum(axis=0) for row in rows]) / spectra.segment_length
        for matrices in (fitted, spectra.matrices)
    )
    whitening = np.linalg.inv(np.linalg.cholesky(of_fit))
    Y = whitening @ of_data @ whitening.conj().swapaxes(1, 2)
    h = whitening @ ground[[np.argmin(np.abs(spectra.frequencies - places[row])) for row in rows]]
    excess = np.average(np.einsum("cii->c", Y).real - Y.shape[-1], weights=counts)
    powers = np.full(h.shape[-1], max(excess, 1e-6) / np.average(np.sum(np.abs(h) ** 2, axis=(1, 2)), weights=counts))
    for _ in range(SETTINGS.max_steps):
        u = np.linalg.solve(np.eye(Y.shape[-1]) + (h * powers) @ h.conj().swapaxes(1, 2), h)
        pulls = np.einsum("ciw,cij,cjw->cw", u.conj(), Y, u).real
        pushes = np.einsum("ciw,ciw->cw", u.conj(), h).real
        grown = powers * np.sqrt((counts @ pulls) / (counts @ pushes))
        is_settled = np.all(np.abs(grown - powers) < SETTINGS.settled * grown.max())
        powers = grown
        if is_settled:
            break
    information = np.einsum("c,cwv->wv", counts, np.abs(u.conj().swapaxes(1, 2) @ h) ** 2)
    scores = counts[:, None] * (pulls - pushes)
    bread = np.linalg.pinv(information)
    of_response = np.diag((2 * SETTINGS.response * information @ powers) ** 2)
    return powers, np.diag(bread @ (scores.T @ scores + of_response) @ bread)
