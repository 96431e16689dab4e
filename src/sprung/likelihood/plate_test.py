"""Figures of the suspension tests of periodic inspections, from a vehicle fitted to a drive."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from sprung._arrays import Complex, Real
from sprung._checks import check_type
from sprung.likelihood.corners import CornerFit, fitted_structure, is_structural
from sprung.likelihood.surface import RoadInputs
from sprung.vehicles import Component, Structure
from sprung.vehicles.structure import Element

#: Acceleration of gravity [m/s^2].
_GRAVITY = 9.80665


@dataclass(frozen=True, slots=True)
class PlateSettings:
    """Motion of the plate of a suspension tester, and what its figures are judged by."""

    #: Amplitude of the plate [m]: 6 mm from end to end.
    amplitude: float = 0.003
    #: Highest frequency of the plate [Hz], from which it slows down.
    highest: float = 25.0
    #: Step of the frequencies [Hz].
    step: float = 0.05
    #: Smallest phase shift of a suspension that passes [degrees].
    phase_limit: float = 35.0
    #: Smallest adhesion that is called fair.
    adhesion_limit: float = 0.4
    #: Largest difference of left and right, of the larger one.
    asymmetry_limit: float = 0.3


PLATE = PlateSettings()


@dataclass(frozen=True, slots=True)
class PlateTest:
    """What a suspension tester would measure at one corner; standard deviations by the covariance of the fit.

    Parameters
    ----------
    phase_shift, phase_shift_std
        Smallest phase between the position of the plate and the contact force [degrees], SPECSUS.
    adhesion, adhesion_std
        Smallest contact force over the static one, EUSAMA: 0 to 1.
    damping_ratio, damping_ratio_std
        Damping ratio of the body on this corner.
    wheel_damping_ratio, wheel_damping_ratio_std
        Damping ratio of the wheel.
    asymmetry
        Difference of the damping ratio from the other side of the axle, of the larger one; NaN without other side.
    """

    phase_shift: float
    phase_shift_std: float
    adhesion: float
    adhesion_std: float
    damping_ratio: float
    damping_ratio_std: float
    wheel_damping_ratio: float
    wheel_damping_ratio_std: float
    asymmetry: float = float("nan")


def plate_tests(fit: CornerFit) -> dict[str, PlateTest]:
    """Return what a suspension tester would measure at each corner of a fitted road vehicle.

    Parameters
    ----------
    fit
        Vehicle fitted to a drive.

    Returns
    -------
    dict
        By corner; empty on rails and rigs, or where masses are not known.

    Notes
    -----
    The plate under one wheel moves as u = a e^(i w t) while the others stand still. With the fitted structure the
    contact force is F = k (u - z), z the motion of the wheel. *Phase shift* (EGEA SPECSUS2018): smallest angle of F/u
    between the natural frequency of the body on its spring k_s and that of the wheel on the same spring,
    sqrt(k_s / m_u) / 2 pi, 4 to 7 Hz. There spring and damper carry the force, F = (k_s - m_u w^2 + i w c) u nearly,
    and more damping is more phase. Below, the angle is that of the body's inertia; above, it is larger with less
    damping and falls to that of the tyre, 0, for any damper. *Adhesion* (EUSAMA):
    (F0 - a max |F/u|) / F0 with the static load F0, up to 25 Hz. It is unfair to light axles and stiff tyres, which
    have less adhesion with the same damper. *Damping ratios*: c / (2 sqrt(k m)) of the body's share of mass on its
    spring, and of the wheel between spring and tyre.

    The figures are those of damper and friction at the amplitudes of the road. A plate of 6 mm moves a suspension with
    dry friction less than it sticks: with 25 N a corner a tester reads 14 degrees more phase (`benchmarks/plate.py`),
    and passes dampers that these figures fail.

    Standard deviations by the delta method; at the extremes of phase and force, the frequency may be held (envelope
    theorem).

    References
    ----------
    EGEA SPECSUS2018, Suspension tester specification (minimum phase shift, limit 35 degrees).
    A. Tsymberov, An improved non-intrusive automotive suspension testing apparatus with means to determine the
    condition of the dampers, SAE Technical Paper 960735 (1996).
    EUSAMA TS-02-76, Recommendations for a performance test specification of an on-car vehicle suspension testing
    system (1976).

    Examples
    --------
    >>> from sprung.likelihood import fit_corners
    >>> from sprung.simulation import RoadDrive, simulate_drive
    >>> from sprung.vehicles import parse_fault, read_vehicle
    >>> vehicle, weak = read_vehicle("zafira"), parse_fault("rear_left.damper=-0.6")
    >>> settings = RoadDrive(duration=60.0, sampling_rate=60.0, snr=50.0, faults=(weak,))
    >>> tests = plate_tests(fit_corners(simulate_drive(vehicle, settings, seed=2).recording, vehicle))
    >>> [round(tests[corner].phase_shift, -1) for corner in ("rear_left", "rear_right")]
    [40.0, 70.0]
    """
    check_type("fit", fit, CornerFit)
    nominal = fit.structure()
    standing = tyres(nominal)
    is_on_road = any(isinstance(block, RoadInputs) for block in fit.model.blocks)
    if not is_on_road or not standing or fit.model.structure.mass[0, 0] <= 1:  # per kilogram of body: no loads
        return {}
    corners = [Corner(nominal, tyre) for tyre in standing.values()]
    extremes = [corner.extremes() for corner in corners]
    values = np.array([corner.figures(*found) for corner, found in zip(corners, extremes, strict=True)])
    derivatives = np.zeros((len(corners), values.shape[1], fit.parameters.size))
    for row in np.flatnonzero(is_structural(fit.model)):
        step = 1e-3 * float(fit.model.prior_std[row])
        parameters = fit.parameters.copy()
        parameters[row] += step
        changed = fitted_structure(fit.model, parameters)
        moved = [
            Corner(changed, tyre).figures(*found) for tyre, found in zip(tyres(changed).values(), extremes, strict=True)
        ]
        derivatives[:, :, row] = (np.array(moved) - values) / step
    stds = np.sqrt(np.einsum("cfp,pq,cfq->cf", derivatives, fit.covariance, derivatives))
    dampings = dict(zip(standing, values[:, 2].tolist(), strict=True))
    tests = {}
    for corner, own, own_stds in zip(standing, values.tolist(), stds.tolist(), strict=True):
        test = PlateTest(*(number for pair in zip(own, own_stds, strict=True) for number in pair))
        end, _, side = corner.rpartition("_")
        other = dampings.get(f"{end}_{'right' if side == 'left' else 'left'}", float("nan"))
        larger = max(test.damping_ratio, other)
        tests[corner] = replace(test, asymmetry=abs(test.damping_ratio - other) / larger) if larger else test
    return tests


def tyres(structure: Structure) -> dict[str, Element]:
    """Return the tyre of each corner that stands on the road."""
    return {element.owner: element for element in structure.elements if element.part == "tyre" and element.foot}


class Corner:
    """One corner of a structure whose wheel stands on a moving plate.

    Parameters
    ----------
    structure
        Vehicle with masses.
    tyre
        Tyre of the corner.
    """

    def __init__(self, structure: Structure, tyre: Element) -> None:
        self._structure = structure
        self._tyre = tyre
        parts: Mapping[Component, float] = structure.components()
        self.spring = parts[Component(tyre.owner, "spring")]
        self._damper = parts[Component(tyre.owner, "damper")]
        wheel = np.flatnonzero(tyre.elongation)
        self.unsprung = float(structure.mass[wheel[0], wheel[0]])
        upwards = [name == "bounce" or name.startswith(("wheel", "mass")) for name in structure.coordinates]
        weight = _GRAVITY * structure.mass @ np.array(upwards, dtype=np.float64)
        at_rest = np.linalg.lstsq(structure.system.stiffness, -weight, rcond=1e-12)[0]  # sway has no spring
        #: Static contact force [N].
        self.load: Final = float(-tyre.stiffness * (tyre.elongation @ at_rest))
        self.sprung = max(self.load / _GRAVITY - self.unsprung, 1e-3 * self.unsprung)

    def force(self, frequencies: Real) -> Complex:
        """Return the contact force for one metre of the plate [N/m], shape of the frequencies [Hz]."""
        s = np.asarray(2j * np.pi * frequencies, dtype=np.complex128)
        D = self._structure.elongations
        stiffness = np.array([element.dynamic_stiffness(s) for element in self._structure.elements])
        A = s[:, None, None] ** 2 * self._structure.mass + np.einsum("ei,ef,ej->fij", D, stiffness, D)
        by_plate = self._tyre.dynamic_stiffness(s)[:, None] * self._tyre.elongation
        motion = np.linalg.solve(A, by_plate[..., None])[..., 0]
        return np.asarray(self._tyre.dynamic_stiffness(s) * (1 - motion @ self._tyre.elongation))

    def extremes(self) -> tuple[float, float]:
        """Return the frequencies [Hz] of the smallest phase shift and of the largest contact force."""
        body, wheel = (np.sqrt(self.spring / mass) / (2 * np.pi) for mass in (self.sprung, self.unsprung))
        frequencies = np.arange(min(body, wheel), PLATE.highest + PLATE.step, PLATE.step)
        force = self.force(frequencies)
        smallest = int(np.argmin(np.abs(np.angle(force[frequencies <= wheel]))))
        return float(frequencies[smallest]), float(frequencies[np.argmax(np.abs(force))])

    def figures(self, of_phase: float, of_force: float) -> list[float]:
        """Return phase shift [degrees], adhesion, and damping ratios of body and wheel."""
        at_phase, at_force = self.force(np.array([of_phase, of_force]))
        return [
            float(np.degrees(np.abs(np.angle(at_phase)))),
            max(0.0, 1 - PLATE.amplitude * float(np.abs(at_force)) / self.load),
            self._damper / (2 * float(np.sqrt(self.spring * self.sprung))),
            self._damper / (2 * float(np.sqrt((self.spring + self._tyre.stiffness) * self.unsprung))),
        ]
