"""Modes of a vehicle: shares of the rigid-body motions, names, and notes on unusual ones."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from sprung._arrays import Complex, Real
from sprung.modal import Modes, mac
from sprung.recording import Channel
from sprung.vehicles import (
    Description,
    ExactModes,
    Outputs,
    Structure,
    Vehicle,
    participation,
    sensor_outputs,
    structure,
    wheel_hop_frequencies,
)
from sprung.vehicles.structure import MOTIONS as MOTION_QUANTITIES

#: Rigid-body motions of a body on its suspension, in the order of every participation.
MOTIONS = ("bounce", "pitch", "roll")


@dataclass(frozen=True, slots=True)
class _Naming:
    """Limits of the names of modes, and of what is usual."""

    share: float = 0.5  # smallest share of a motion in a mode that is named after it
    similar: float = 0.7  # smallest MAC with the mode of the vehicle file on bogies whose label it gets
    explained: float = 0.7  # smallest share of the shape that the rigid body must explain
    nearby: float = 0.2  # largest relative difference from a known natural frequency of a mode identified with it
    unsure: float = 1.6  # factor to the file's body modes: a full load, one broken spring, friction that locks springs
    spread: float = 3.0  # largest ratio of the natural frequencies of two motions of one body on its suspension
    frequencies: tuple[float, float] = (0.5, 20.0)  # usual of a body [Hz]; a shorter model has the root of its scale
    full_size: float = 2.5  # wheelbase from which a vehicle is no such model [m]
    damping: tuple[float, float] = (0.02, 1.0)  # usual ratios of a body on its springs


_NAMING = _Naming()


def rigid_body_participation(
    modes: Modes, channels: Sequence[Channel], *, mass: Real | None = None
) -> tuple[Real, Real]:
    """Return the shares of bounce, pitch and roll in each mode, and the share of its shape that they explain.

    Parameters
    ----------
    modes
        Modes on channels with known quantity, position and direction.
    channels
        Channels of `modes`, in the same order.
    mass
        Mass and inertia matrix of the body, shape (3, 3), for shares of kinetic energy. None: shares of the sum of
        squares that each motion alone gives at the sensors; if some sensors measure rotation, shares of the kinetic
        energy of a body with radii of gyration of 1 m.

    Returns
    -------
    shares
        Shares of bounce, pitch and roll, sum 1, shape (modes, 3); NaN where the layout does not determine the three
        motions, or the shape has none of them.
    explained
        Share of the shape's sum of squares that the rigid body explains, shape (modes,).

    Notes
    -----
    Least squares of the shape on (pole^2 Ya + pole Yv + Yd) q with the sensors' output matrices, so that angular
    velocities and accelerations go together.
    """
    n_modes = len(modes)
    unknown = np.full((n_modes, 3), np.nan), np.zeros(n_modes)
    if not all(_is_placed(channel) for channel in channels):
        return unknown
    outputs = sensor_outputs(MOTIONS, sensors=channels, carriers=["body"] * len(channels))
    has_rotations = any(MOTION_QUANTITIES[channel.quantity][1] for channel in channels)
    shares, explained = np.full((n_modes, 3), np.nan), np.zeros(n_modes)
    for k, (pole, shape) in enumerate(zip(modes.poles, modes.mode_shapes, strict=True)):
        matrix = _sensed(outputs, complex(pole))
        if np.linalg.matrix_rank(matrix) < 3:
            return unknown
        motion = np.linalg.lstsq(matrix, shape, rcond=None)[0]
        if not motion.any():
            continue
        explained[k] = 1 - np.sum(np.abs(shape - matrix @ motion) ** 2) / np.sum(np.abs(shape) ** 2)
        if mass is None and not has_rotations:
            power = np.sum(np.abs(matrix * motion) ** 2, axis=0)
            shares[k] = power / power.sum()
        else:
            inertia = np.eye(3) if mass is None else mass
            shares[k] = participation(inertia, motion[None].astype(np.complex128))[0]
    return shares, explained


def _is_placed(channel: Channel) -> bool:
    """Return whether the motion of a rigid body determines the reading of the channel."""
    is_motion = channel.quantity in MOTION_QUANTITIES
    has_place = channel.quantity.startswith("angular") or channel.quantity == "angle" or channel.position is not None
    return is_motion and channel.direction is not None and has_place


def _sensed(outputs: Outputs, pole: complex) -> Complex:
    """Return the readings of the sensors for unit motions at a pole."""
    return np.asarray(outputs.acceleration * pole**2 + outputs.velocity * pole + outputs.displacement, dtype=complex)


def labelled(modes: Modes, channels: Sequence[Channel], *, vehicle: Description | None = None) -> Modes:
    """Return the modes with labels "bounce", "pitch", "roll" and "wheel_hop" where these can be identified.

    Parameters
    ----------
    modes
        Modes by rising frequency.
    channels
        Channels of `modes`, in the same order.
    vehicle
        Vehicle description, for the mass matrix of the body (shares of energy) and the wheel-hop frequencies. The modes
        of a quarter vehicle or a chain are labelled by frequency only, those of a vehicle on bogies by their shapes.

    Returns
    -------
    Modes
        Modes with labels; None for a mode without one.

    Notes
    -----
    Each motion labels one mode: the lowest in which it has more than half of the energy, if its frequency is plausible.
    With a vehicle file that is from the lowest of its modes of the body over 1.6 to the highest times 1.6; without one,
    up to three times the frequency of the lowest mode of a rigid body. A mode within 20 % of
    sqrt((spring + tyre) / unsprung mass) / 2 pi of an axle is wheel hop, unless the body twists or bends in it: the
    wheels move a rigid body.
    """
    if isinstance(vehicle, Vehicle) and vehicle.bogie:
        return replace(modes, labels=_labels_by_shape(modes, structure(vehicle).modes()))
    if vehicle is not None and not isinstance(vehicle, Vehicle):
        return replace(modes, labels=_labels_by_frequency(modes, structure(vehicle).modes()))
    exact = None if vehicle is None else structure(vehicle)
    mass = None if exact is None else exact.mass[:3, :3]
    hops = np.zeros(0) if vehicle is None else wheel_hop_frequencies(vehicle)
    shares, explained = rigid_body_participation(modes, channels, mass=mass)
    is_twisted = (explained < _NAMING.explained) & np.isfinite(shares).any() & _shows_twist(channels, vehicle)
    motions = [
        MOTIONS[int(np.argmax(share))] if fit >= _NAMING.explained and share.max() >= _NAMING.share else None
        for share, fit in zip(shares, explained, strict=True)
    ]
    lowest, highest = _plausible(modes, motions, exact)
    labels: list[str | None] = []
    for frequency, motion, twisted in zip(modes.natural_frequency, motions, is_twisted, strict=True):
        label = None
        if np.any(np.abs(frequency - hops) <= _NAMING.nearby * hops) and not twisted:
            label = "wheel_hop"
        elif lowest <= frequency <= highest and motion not in labels:
            label = motion
        labels.append(label)
    return replace(modes, labels=tuple(labels))


def _plausible(modes: Modes, motions: Sequence[str | None], exact: Structure | None) -> tuple[float, float]:
    """Return the lowest and the highest frequency [Hz] of modes of the body."""
    if exact is not None:
        return body_range(exact.modes())
    rigid = [f for f, motion in zip(modes.natural_frequency, motions, strict=True) if motion is not None]
    return 0.0, _NAMING.spread * min(rigid, default=np.inf)


def highest_of_body(nominal: Structure) -> float:
    """Return the highest natural frequency of bounce, pitch and roll [Hz]."""
    modes = nominal.modes()
    body = [f for f, label in zip(modes.natural_frequency, modes.labels, strict=True) if label in MOTIONS]
    return float(max(body, default=0.0))


def body_range(exact: ExactModes) -> tuple[float, float]:
    """Return the lowest and the highest plausible frequency of a mode of the body [Hz].

    Parameters
    ----------
    exact
        Modes of the vehicle file.

    Notes
    -----
    From the lowest of bounce, pitch and roll over 1.6 to the highest times 1.6; 0 to infinity where none oscillates.
    """
    body = [float(f) for f, label in zip(exact.natural_frequency, exact.labels, strict=True) if label in MOTIONS]
    return (min(body) / _NAMING.unsure, _NAMING.unsure * max(body)) if body else (0.0, np.inf)


def _shows_twist(channels: Sequence[Channel], vehicle: Vehicle | None) -> bool:
    """Return whether the channels show that a body twists or bends: more of them than motions, all on the body."""
    elsewhere = {sensor.channel for sensor in vehicle.sensor if sensor.on != "body"} if vehicle is not None else set()
    is_placed = all(_is_placed(channel) and channel.name not in elsewhere for channel in channels)
    return is_placed and len(channels) > len(MOTIONS)


def _labels_by_shape(modes: Modes, exact: ExactModes) -> tuple[str | None, ...]:
    """Return for each mode the label of the exact mode of the most similar shape near its frequency, each once."""
    if not set(modes.channels) <= set(exact.channels):  # of a file without sensors
        return (None,) * len(modes)
    rows = [exact.channels.index(name) for name in modes.channels]
    ratios = modes.natural_frequency[:, None] / exact.natural_frequency
    near = (ratios < _NAMING.unsure) & (ratios > 1 / _NAMING.unsure)
    similar = np.where(near, mac(modes.mode_shapes, exact.mode_shapes[:, rows]), 0.0)
    best = similar.argmax(axis=1)
    values, labels = similar.max(axis=1), [exact.labels[row] for row in best]
    rivals = [[v for v, other in zip(values, labels, strict=True) if other == label] for label in labels]
    return tuple(
        label if value >= _NAMING.similar and (label == "wheel_hop" or value == max(of_label)) else None
        for label, value, of_label in zip(labels, values, rivals, strict=True)
    )


def _labels_by_frequency(modes: Modes, exact: ExactModes) -> tuple[str | None, ...]:
    """Return for each mode the label of the nearest exact mode, if it is near and no other mode is nearer to it."""
    distances = np.abs(modes.natural_frequency[:, None] / exact.natural_frequency - 1)
    return tuple(
        exact.labels[nearest] if row[nearest] <= _NAMING.nearby and distances[:, nearest].argmin() == k else None
        for k, row in enumerate(distances)
        for nearest in [int(row.argmin())]
    )


def plausibility_notes(vehicle: Description) -> tuple[str, ...]:
    """Return notes on modes of the body with unusual frequency or damping, one sentence each.

    Parameters
    ----------
    vehicle
        Vehicle; a quarter vehicle or a chain may move in any way.

    Notes
    -----
    Usual are 0.5 to 20 Hz, more for models shorter than 2.5 m between the axles, and damping ratios of 2 to 100 %.
    Numbers out of all proportion are refused as the file is read (`description`).
    """
    if not isinstance(vehicle, Vehicle):
        return ()
    modes = structure(vehicle).modes()
    named = {label: k for k, label in enumerate(modes.labels) if label in MOTIONS}
    lowest, highest = _NAMING.frequencies
    highest *= float(np.sqrt(max(1.0, _NAMING.full_size / vehicle.wheelbase)))
    frequencies = {label: float(modes.natural_frequency[k]) for label, k in named.items()}
    odd = ", ".join(f"{label} {f:.2g} Hz" for label, f in frequencies.items() if not lowest <= f <= highest)
    damping = {label: float(modes.damping_ratio[k]) for label, k in named.items()}
    # Of the body above a ground that does not move: strong dampers leave no mode.
    supports = [(axle.spring_stiffness, axle.damping) for axle in vehicle.axle]
    supports += [bogie.secondary[:2] for bogie in vehicle.bogie]
    stiffness, damper = 2 * np.sum(supports, axis=0)
    above_ground = float(damper / (2 * np.sqrt(stiffness * vehicle.body.mass)))
    damping["bounce"] = max(damping.get("bounce", 0.0), above_ground)
    least, most = _NAMING.damping
    undue = ", ".join(f"{label} {_percent(x)} %" for label, x in damping.items() if not least <= round(x, 6) <= most)
    notes = []
    if odd:
        notes.append(
            f"unusual frequencies of the vehicle file's body: {odd}; {lowest:g} to {highest:.3g} Hz is usual: check"
            " masses, inertias and spring stiffness, and their units"
        )
    if undue:
        notes.append(
            f"unusual damping of the vehicle file's body: {undue}; {100 * least:g} to {100 * most:g} % is usual: check"
            " damping, and its unit (N s/m)"
        )
    return tuple(notes)


def _percent(ratio: float) -> str:
    """Return a ratio in percent, to two digits."""
    return f"{float(f'{100 * round(ratio, 6):.2g}'):g}"
