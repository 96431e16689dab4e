"""Parts that a file lacks: masses on mounts, where the misfit of a fit asks for one, and flexible modes."""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import product

import numpy as np

from sprung._arrays import Real
from sprung.calibration.draft import Draft
from sprung.calibration.fitting import JointFit
from sprung.calibration.joint import JointModel
from sprung.likelihood import Model
from sprung.likelihood.hermitian import congruence, real_coordinates
from sprung.likelihood.spectra import OVERCOUNT, through_window
from sprung.likelihood.transfer import Transfer, transfer
from sprung.vehicles import MountedMass, Vehicle, body_row
from sprung.vehicles.models import modal_mass
from sprung.vehicles.sections import FlexibleMode

#: Frequencies [Hz] and damping ratio of the masses that are tried: engines are at 6 to 16 Hz, exhausts and tanks above.
_FREQUENCIES, _DAMPING = tuple(np.geomspace(5.0, 25.0, 14).tolist()), 0.08
#: Range of a new mass over that of the body, and largest share of the body's pitch inertia that it takes along.
_LEAST, _MOST, _MOST_INERTIA = 0.02, 0.2, 0.4


@dataclass(frozen=True, eq=False, slots=True)
class _Window:
    """One window at the optimum of a fit: what the derivative with respect to a further parameter needs."""

    model: Model
    response: Transfer
    whitening: Real
    whitened: Real
    excess: Real


def likely_mount(fit: JointFit) -> tuple[MountedMass | None, float]:
    """Return the mass on mounts that would lower the misfit of a fit most, and by how much; None if none would.

    Parameters
    ----------
    fit
        Fit of a vehicle without it.

    Notes
    -----
    A mass m on mounts of frequency f0 and damping ratio z at a place of the body loads it like the dynamic mass
    m T(f), T = (1 + 2 i z f/f0) / (1 - (f/f0)^2 + 2 i z f/f0). For each of a grid of places and frequencies: the score
    u, derivative of the objective with respect to m at m = 0 while the body gives up the mass m, and its information
    J, what all other parameters explain taken off. A Newton step is m = -u / J and gains u^2 / (2 J) in ln of the
    likelihood, which is corrected for the overlap of the segments.

    References
    ----------
    C. R. Rao, Large sample tests of statistical hypotheses concerning several parameters with applications to problems
    of estimation, Proceedings of the Cambridge Philosophical Society 44 (1948), 50-57 (score test).
    J. P. Den Hartog, Mechanical Vibrations, 4th edition, McGraw-Hill, 1956, section 3.3 (vibration absorber).
    """
    joint, vehicle = fit.joint, fit.free.draft.vehicle
    windows = [_at_optimum(joint, number, fit.parameters) for number in range(len(joint.models))]
    precision = joint.information(fit.parameters) + np.diag(1 / joint.prior_std**2)
    best, most = None, 0.0
    for candidate in _candidates(vehicle):
        score, own, cross = 0.0, 0.0, np.zeros(fit.parameters.size)
        for window, rows in zip(windows, joint.rows, strict=True):
            derivative = _derivative(window, candidate)
            score += float(window.excess @ derivative)
            own += float(derivative @ derivative)
            np.add.at(cross, rows, window.whitened @ derivative)
        left = own - float(cross @ np.linalg.solve(precision, cross))
        if left > 0 and score < 0 and score**2 / left > most:
            mass = float(np.clip(-score / left, _LEAST * vehicle.body.mass, _MOST * vehicle.body.mass))
            best, most = candidate.model_copy(update={"mass": mass}), score**2 / left
    return best, most / 2 / OVERCOUNT


def with_mount(draft: Draft, mount: MountedMass) -> Draft:
    """Return the draft with a mass on mounts that was part of the body: the sums of mass and inertias stay."""
    body = draft.vehicle.body
    left = body.mass - mount.mass
    centre = -mount.mass * mount.x / left  # of the body that is left
    taken = mount.mass * mount.x**2 + left * centre**2
    pitch = (body.pitch_inertia or 0.0) - min(taken, _MOST_INERTIA * (body.pitch_inertia or 0.0))
    mounted = draft.with_fields(mounted_mass=(*draft.vehicle.mounted_mass, mount))
    return mounted.ahead(centre).with_body(mass=left, pitch_inertia=pitch)


def with_mode(draft: Draft, mode: FlexibleMode) -> Draft:
    """Return the draft with a flexible mode of the body, its modal mass stated."""
    complete = mode.model_copy(update={"mass": mode.mass or modal_mass(draft.vehicle, mode)})
    return draft.with_fields(flexible_mode=(*draft.vehicle.flexible_mode, complete))


def _candidates(vehicle: Vehicle) -> Iterator[MountedMass]:
    """Yield masses of 1 kg over the places and frequencies that are tried."""
    places = (vehicle.axle[0].x, 0.0, vehicle.axle[-1].x)
    for frequency, place in product(_FREQUENCIES, places):
        yield MountedMass(mass=1.0, x=place, frequency=frequency, damping_ratio=_DAMPING)


def _at_optimum(joint: JointModel, number: int, parameters: Real) -> _Window:
    """Return a window at the optimum."""
    model, own = joint.models[number], joint.of_window(number, parameters)
    spectra = model.spectra
    factor = np.asarray(np.linalg.inv(np.linalg.cholesky(model.matrix(own))), dtype=np.complex128)
    data = factor @ spectra.matrices @ factor.conj().swapaxes(-1, -2)
    root_weights = np.sqrt(spectra.weights)[..., None]
    excess = real_coordinates(np.eye(data.shape[-1]) - data) * root_weights
    whitened = model.whitened_derivatives(own).reshape(own.size, -1)
    return _Window(
        model, transfer(model.terms(own)), congruence(factor) * root_weights[..., None], whitened, excess.ravel()
    )


def _derivative(window: _Window, mount: MountedMass) -> Real:
    """Return the whitened derivative of a window's spectral matrix with respect to the mass, in real coordinates."""
    response, model = window.response, window.model
    f = response.terms.frequencies
    ratio, damping = f / mount.frequency, 2j * mount.damping_ratio * f / mount.frequency
    dynamic = (1 + damping) / (1 - ratio**2 + damping) - 1  # the mass itself leaves the body
    row = body_row(model.structure.coordinates, x=mount.x, y=mount.y, shapes=model.structure.shapes)
    load = (2 * np.pi * f) ** 2 * dynamic
    change = load[:, None, None] * (response.force_response @ np.outer(row, row) @ response.displacements)
    derivative = through_window(response.change_by_transfer(change)[..., None])
    return np.asarray((window.whitening @ derivative).ravel(), dtype=np.float64)
