"""The bounce test of a workshop: pushes, drops and releases of a vehicle, from recordings to springs and dampers."""

from collections.abc import Iterable

from sprung._threads import one_thread
from sprung.bounce_tests.results import RULES, Bounce, BounceChange, BounceTest, CornerValue, bounce_changes
from sprung.bounce_tests.swings import corners_of, fitted_together, pooled, size_of, tested
from sprung.errors import DataError
from sprung.identification.transients import find_transients, without_hum
from sprung.recording import Recording, each_recording
from sprung.signals.inspection import doubts_of
from sprung.vehicles import Vehicle
from sprung.vehicles.labels import labelled
from sprung.vehicles.sensor_layout import AnyVehicle, output_channels, usable

__all__ = ["Bounce", "BounceChange", "BounceTest", "CornerValue", "bounce", "bounce_changes"]


@one_thread
def bounce(
    recordings: Recording | Iterable[Recording],
    *,
    vehicle: AnyVehicle | None = None,
    before: Recording | Iterable[Recording] | None = None,
    allow_missing: bool = False,
) -> Bounce:
    """Return frequencies and damping of a vehicle's body from pushes, drops or releases.

    Parameters
    ----------
    recordings
        Recordings with one or several tests: the vehicle at rest, pushed, and left to swing until it is quiet again.
    vehicle
        Vehicle, for the names of modes and for springs and dampers.
    before
        Recordings of an earlier test of the same vehicle and sensors, with which this one is compared.
    allow_missing
        Whether recordings may lack sensors of the vehicle file.

    Returns
    -------
    Bounce

    Raises
    ------
    DataError
        If no recording has a motion that swings freely.

    Notes
    -----
    Motions that die away are found (`find_transients`), and fitted by free modes (`fit_free_response`), together where
    the motion is linear. Where modes leave more than friction does, a swing with viscous damping and dry friction
    describes the test (`fit_friction`). The modes are those of the tests, linear or with friction, to which the largest
    motion belongs.

    Examples
    --------
    >>> import numpy as np
    >>> from sprung.recording import Channel, Recording
    >>> time = np.arange(300) / 100
    >>> swing = np.exp(-0.2 * 2 * np.pi * 1.5 * time) * np.sin(2 * np.pi * 1.5 * np.sqrt(1 - 0.2**2) * time)
    >>> rest = np.zeros(300)
    >>> noise = 0.01 * np.random.default_rng(1).standard_normal(900)
    >>> motion = np.concatenate([rest, swing, rest]) + noise
    >>> result = bounce(Recording(motion[None], 100.0, (Channel("acc", "acceleration"),)))
    >>> len(result.tests), result.modes.damping_ratio.round(2)
    (1, array([0.2]))
    """
    given = [recordings] if isinstance(recordings, Recording) else list(each_recording(recordings))
    moving = [_motion(run, vehicle, allow_missing) for run in given]
    runs = [without_hum(run) for run in moving]
    tests: list[BounceTest] = []
    notes: list[str] = []
    for number, run in enumerate(runs):
        notes += doubts_of(run)
        if run is not moving[number]:
            notes.append(f"hum: {run.history[-1]}")
        transients = find_transients(run)
        sizes = [size_of(run, transient) for transient in transients]
        for transient, size in zip(transients, sizes, strict=True):
            if size < RULES.min_size * max(sizes):
                notes.append(f"the motion at {transient.onset:.1f} s is left out: it is far smaller than the largest")
                continue
            try:
                tests.append(tested(run, number, transient))
            except DataError as error:
                notes.append(f"the motion at {transient.onset:.1f} s is left out: {error}")
    if not tests:
        reason = f" ({notes[0]})" if notes else ""
        raise DataError(
            f"no push after which the vehicle swings freely was found{reason}: record it at rest, push and let go, and"
            " wait until it is quiet"
        )
    linear = [test for test in tests if test.frictions[0] is None]
    with_friction = [test for test in tests if test.frictions[0] is not None]
    largest = max(tests, key=lambda test: size_of(runs[test.recording], test.transient))
    fit = None if largest.frictions[0] is not None else fitted_together(linear, runs)
    modes = fit.modes if fit is not None else pooled(with_friction)
    modes = labelled(modes, runs[0].channels, vehicle=vehicle)
    notes += () if fit is None else fit.notes
    if not len(modes):
        notes.append(
            "no mode is clear: damping is too high (above about 60 %), the tests differ, or something else moved the"
            " sensors: record with the engine off, and leave out their handling with --from and --to"
        )
    corners: tuple[CornerValue, ...] = ()
    sides: tuple[BounceChange, ...] = ()
    if isinstance(vehicle, Vehicle) and vehicle.bogie:
        notes.append("springs and dampers are not estimated: the vehicle stands on bogies")
    elif isinstance(vehicle, Vehicle) and fit is not None:
        corners, sides, more = corners_of(fit, vehicle)
        notes += more
    if with_friction:
        notes.append("friction: modes are described without it, with the damping that dissipates the same energy")
    result = Bounce(tuple(tests), modes, fit, corners, sides, notes=tuple(notes))
    if before is None:
        return result
    return result.changed_since(bounce(before, vehicle=vehicle, allow_missing=allow_missing))


def _motion(recording: Recording, vehicle: AnyVehicle | None, allow_missing: bool) -> Recording:
    """Return the channels of motion of a recording, in its longest stretch."""
    motion = usable(recording, vehicle=vehicle, allow_missing=allow_missing)
    motion = motion.select(output_channels(motion, vehicle))
    longest = max(motion.stretches(), key=lambda part: part.stop - part.start)
    return motion.part(longest.start, longest.stop)
