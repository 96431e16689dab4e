"""Figures of the suspension tests of periodic inspections, from a vehicle fitted to a drive."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from sprung._arrays import Complex, Real
from sprung._checks import check_type
from sprung.likelihood.corners import CornerFit, fitted_structure, is_structural
from sprung.likelihood.dry_friction import Friction, has_loads, separate_friction, static_loads
from sprung.units import STANDARD_GRAVITY
from sprung.vehicles import Component, Structure
from sprung.vehicles.structure import Element

#: Step of the numerical derivatives of the figures, over the standard deviation of a parameter before any data.
_STEP = 1e-3
#: Most rounds in which friction follows the velocities.
_ROUNDS = 20


@dataclass(frozen=True, slots=True)
class PlateSettings:
    """Motion of the plate of a suspension tester, and what its figures are judged by."""

    #: Amplitude of the plate [m]: 6 mm from end to end.
    amplitude: float = 0.003
    #: Velocity over which friction builds up [m/s], and between none and twice this.
    sliding: float = 0.005
    #: Highest frequency of the plate [Hz], from which it slows down.
    highest: float = 25.0
    #: Step of the frequencies [Hz].
    step: float = 0.05
    #: Smallest phase shift of a suspension that passes [degrees].
    phase_limit: float = 35.0
    #: Phase shift below which a window states it: well above the limit, so that its course towards it shows [degrees].
    phase_watched: float = 55.0
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
    viscous_damping, viscous_damping_std
        Damping of the damper beside friction [N s/m].
    friction, friction_std
        Dry friction of the suspension at the wheel [N].
    is_friction_identifiable
        Whether the drives determine the friction; otherwise, with less of it than stated, phase shifts are smaller.
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
    viscous_damping: float
    viscous_damping_std: float
    friction: float = 0.0
    friction_std: float = 0.0
    is_friction_identifiable: bool = False
    asymmetry: float = float("nan")


def plate_tests(fit: CornerFit, *, friction: Friction | None = None) -> dict[str, PlateTest]:
    """Return what a suspension tester would measure at each corner of a fitted road vehicle.

    Parameters
    ----------
    fit
        Vehicle fitted to a drive.
    friction
        What is known of the friction of its suspensions without this drive, such as `common_friction` of drives on
        several roads; None: usual friction.

    Returns
    -------
    dict
        By corner, without those whose damper the drive does not determine; empty on rails and rigs, or where masses are
        not known.

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

    A plate of 6 mm moves a suspension less than a road does, and dry friction counts for more: 25 N a corner add 14
    degrees of phase. So the figures are those of viscous damper and friction apart (`separate_friction`), the friction
    F by its describing function at the velocity amplitude v of the corner on the plate, 4 F / (pi v) where v is above
    the 5 mm/s over which it builds up; at once or over twice that is up to 2 degrees more or less, two standard
    deviations. Valves that differ in bump and rebound take up to a degree away, and add to the peak of the force at
    twice the frequency. The damping ratios are those of the viscous dampers. A newton of friction is up to 0.7 degrees
    of phase. From spectra, one drive on class C determines friction hardly better than what is usual, which left the
    phase uncertain by 10 degrees; its segments determine it to 2 to 4 N (`suspension_forces`).

    Standard deviations by the delta method; at the extremes of phase and force, the frequency may be held (envelope
    theorem).

    References
    ----------
    A. Gelb, W. E. Vander Velde, Multiple-Input Describing Functions and Nonlinear System Design, McGraw-Hill, 1968.
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
    [50.0, 80.0]
    """
    check_type("fit", fit, CornerFit)
    if not has_loads(fit):
        return {}
    standing = tyres(fit.model.structure)
    apart = separate_friction(fit, prior=friction)
    forces = dict(zip(apart.friction.corners, apart.friction.forces.tolist(), strict=True))
    vehicle = fitted_structure(fit.model, apart.parameters)
    uneven = dict(zip(apart.friction.corners, apart.uneven.tolist(), strict=True))
    corners = {name: Corner(vehicle, tyre, friction=forces, uneven=uneven) for name, tyre in tyres(vehicle).items()}
    extremes = {name: corner.extremes() for name, corner in corners.items()}

    def figures(changed: Structure, friction: Mapping[str, float], sliding: float = PLATE.sliding) -> Real:
        tested = [
            Corner(changed, t, friction=friction, uneven=uneven, sliding=sliding) for t in tyres(changed).values()
        ]
        return np.array([each.figures(*extremes[name]) for name, each in zip(extremes, tested, strict=True)])

    values = figures(vehicle, forces)
    n = fit.parameters.size
    derivatives = np.zeros((len(corners), values.shape[1], len(apart.covariance)))
    for row in np.flatnonzero(is_structural(fit.model)).tolist():
        step = _STEP * float(fit.model.prior_std[row])
        parameters = apart.parameters.copy()
        parameters[row] += step
        derivatives[:, :, row] = (figures(fitted_structure(fit.model, parameters), forces) - values) / step
    for row, (rubbing, step) in enumerate(zip(forces, (_STEP * apart.friction.prior_std).tolist(), strict=True)):
        derivatives[:, :, n + row] = (figures(vehicle, forces | {rubbing: forces[rubbing] + step}) - values) / step
    softness = (figures(vehicle, forces, sliding=2 * PLATE.sliding) - values) / 2
    stds = np.sqrt(np.einsum("cfp,pq,cfq->cf", derivatives, apart.covariance, derivatives) + softness**2)
    known = zip(fit.components, fit.is_identifiable.tolist(), strict=True)
    unknown = {part.corner for part, is_known in known if part.kind == "damper" and not is_known}
    dampings = {name: ratio for name, ratio in zip(standing, values[:, 2].tolist(), strict=True) if name not in unknown}
    tests = {}
    for corner, own, own_stds in zip(standing, values.tolist(), stds.tolist(), strict=True):
        if corner in unknown:
            continue
        test = PlateTest(*(number for pair in zip(own, own_stds, strict=True) for number in pair))
        if corner in forces:
            row = apart.friction.corners.index(corner)
            test = replace(
                test,
                friction=forces[corner],
                friction_std=float(apart.friction.std[row]),
                is_friction_identifiable=bool(apart.friction.is_identifiable[row]),
            )
        end, _, side = corner.rpartition("_")
        other = dampings.get(f"{end}_{'right' if side == 'left' else 'left'}", float("nan"))
        larger = max(test.damping_ratio, other)
        tests[corner] = replace(test, asymmetry=abs(test.damping_ratio - other) / larger) if larger else test
    return tests


def low_phase_shifts(fit: CornerFit) -> dict[str, tuple[float, float]]:
    """Return the phase shift [degrees] and its standard deviation of each corner that is not far above the limit.

    Parameters
    ----------
    fit
        Vehicle fitted to a drive.

    Notes
    -----
    `plate_tests` costs as much as two fits. It is left out where no corner is below 55 degrees with all of its
    damping viscous: friction adds phase on the small motion of a plate.
    """
    if not has_loads(fit):
        return {}
    vehicle = fitted_structure(fit.model, fit.parameters)
    corners = [Corner(vehicle, tyre) for tyre in tyres(vehicle).values()]
    if all(corner.figures(*corner.extremes())[0] >= PLATE.phase_watched for corner in corners):
        return {}
    return {
        corner: (test.phase_shift, test.phase_shift_std)
        for corner, test in plate_tests(fit).items()
        if test.phase_shift < PLATE.phase_watched
    }


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
    friction
        Dry friction of the suspension of each corner [N]; those that are absent have none.
    uneven
        Half of what the damper of each corner has more in rebound than in bump [N s/m].
    sliding
        Velocity over which friction builds up [m/s].
    """

    def __init__(
        self,
        structure: Structure,
        tyre: Element,
        *,
        friction: Mapping[str, float] | None = None,
        uneven: Mapping[str, float] | None = None,
        sliding: float = PLATE.sliding,
    ) -> None:
        self._structure = structure
        self._tyre = tyre
        self._sliding = sliding
        rubbing = [element for element in structure.elements if element.part == "suspension"]
        self._suspensions = np.array([element.elongation for element in rubbing])
        self._friction = np.array([(friction or {}).get(element.owner, 0.0) for element in rubbing])
        self._uneven = np.array([(uneven or {}).get(element.owner, 0.0) for element in rubbing])
        parts: Mapping[Component, float] = structure.components()
        self.spring = parts[Component(tyre.owner, "spring")]
        self._damper = parts[Component(tyre.owner, "damper")]
        wheel = np.flatnonzero(tyre.elongation)
        self.unsprung = float(structure.mass[wheel[0], wheel[0]])
        #: Static contact force [N].
        self.load: Final = static_loads(structure)[tyre.owner]
        self.sprung = max(self.load / STANDARD_GRAVITY - self.unsprung, 1e-3 * self.unsprung)

    def forces(self, frequencies: Real) -> tuple[Complex, Complex]:
        """Return the contact force for one metre of the plate [N/m] at frequencies [Hz] and at twice these.

        Valves with a force b |v| pull at twice the frequency, and the motion by that, of mobility Y there, takes
        damping away: to second order 8 / (3 pi^2) b^2 (Y - Y* / 3).
        """
        s = np.asarray(2j * np.pi * frequencies, dtype=np.complex128)
        tyre = self._tyre.dynamic_stiffness(s)
        driven = (tyre[:, None] * self._tyre.elongation)[..., None]
        if not (self._friction.any() or self._uneven.any()):
            motion = np.linalg.solve(self._stiffness(s), driven)[..., 0]
            return np.asarray(tyre * (1 - motion @ self._tyre.elongation)), np.zeros(s.size, dtype=np.complex128)
        pulled = np.broadcast_to(self._suspensions.T, (s.size, *self._suspensions.T.shape))
        by_valves = np.linalg.solve(self._stiffness(2 * s), pulled)
        mobility = 2 * s[:, None] * np.einsum("sn,fns->fs", self._suspensions, by_valves)
        lost = 8 / (3 * np.pi**2) * self._uneven**2 * (mobility - mobility.conj() / 3)
        A = self._stiffness(s) - (self._suspensions.T * (s[:, None] * lost)[:, None]) @ self._suspensions
        by_plate = np.linalg.solve(A, driven)[..., 0]
        by_friction = np.linalg.solve(A, pulled)
        elongations, compliance = by_plate @ self._suspensions.T, self._suspensions @ by_friction
        free, mobility = PLATE.amplitude * s[:, None] * elongations, s[:, None, None] * compliance
        sliding = _friction_forces(free, mobility, self._friction, self._sliding) / PLATE.amplitude
        motion = by_plate - np.einsum("fns,fs->fn", by_friction, sliding)
        velocities = s[:, None] * (motion @ self._suspensions.T)
        pulls = 4 / (3 * np.pi) * self._uneven * velocities**2 / np.maximum(np.abs(velocities), 1e-12)
        twice = self._tyre.dynamic_stiffness(2 * s) * np.einsum("fns,fs,n->f", by_valves, pulls, self._tyre.elongation)
        return np.asarray(tyre * (1 - motion @ self._tyre.elongation)), np.asarray(twice)

    def _stiffness(self, s: Complex) -> Complex:
        """Return the dynamic stiffness at complex frequencies, shape (grid, n, n)."""
        D = self._structure.elongations
        stiffness = np.array([element.dynamic_stiffness(s) for element in self._structure.elements])
        return np.asarray(s[:, None, None] ** 2 * self._structure.mass + (D.T * stiffness.T[:, None]) @ D)

    def extremes(self) -> tuple[float, float]:
        """Return the frequencies [Hz] of the smallest phase shift and of the largest contact force."""
        body, wheel = (np.sqrt(self.spring / mass) / (2 * np.pi) for mass in (self.sprung, self.unsprung))
        frequencies = np.arange(min(body, wheel), PLATE.highest + PLATE.step, PLATE.step)
        force, _ = self.forces(frequencies)
        smallest = int(np.argmin(np.abs(np.angle(force[frequencies <= wheel]))))
        return float(frequencies[smallest]), float(frequencies[np.argmax(np.abs(force))])

    def figures(self, of_phase: float, of_force: float) -> list[float]:
        """Return phase shift [degrees], adhesion, damping ratios of body and wheel, and damping [N s/m]."""
        (at_phase, at_force), (_, twice) = self.forces(np.array([of_phase, of_force]))
        turn = np.exp(1j * np.radians(np.arange(360)))
        smallest = float(np.min((at_force * turn + twice * turn**2).real))
        return [
            float(np.degrees(np.abs(np.angle(at_phase)))),
            max(0.0, 1 + PLATE.amplitude * smallest / self.load),
            self._damper / (2 * float(np.sqrt(self.spring * self.sprung))),
            self._damper / (2 * float(np.sqrt((self.spring + self._tyre.stiffness) * self.unsprung))),
            self._damper,
        ]


def _slope(speeds: Real) -> Real:
    """Return the describing function of v / sqrt(1 + v^2) at amplitudes of v: 1 of small ones, 4 / (pi v) of large."""
    from scipy.special import ellipe, ellipkm1

    v = np.maximum(speeds, 1e-3)  # 1 to 4e-7
    rest = 1 / (1 + v**2)
    return np.asarray(
        4 / np.pi * (ellipe(1 - rest) - rest * ellipkm1(rest)) / (v * np.sqrt(1 - rest)), dtype=np.float64
    )


def _friction_forces(free: Complex, mobility: Complex, friction: Real, sliding: float) -> Complex:
    """Return the friction forces of suspensions [N] of amplitudes of velocity v = free - mobility forces [m/s].

    As dampings that follow the velocities, first those without friction: each round has more damping.
    """
    dampings, velocities = np.zeros(free.shape), free
    for _ in range(_ROUNDS if friction.any() else 0):
        dampings = friction / sliding * _slope(np.abs(velocities) / sliding)
        A: Complex = np.eye(friction.size) + mobility * dampings[:, None, :]
        before, velocities = velocities, np.asarray(np.linalg.solve(A, free[..., None])[..., 0], dtype=np.complex128)
        if np.allclose(velocities, before, rtol=1e-10, atol=0.0):
            break
    return np.asarray(dampings * velocities, dtype=np.complex128)
