"""Bounce tests: several pushes in a recording, a shipped car, friction, changes, and recordings without a test."""

import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest
from benchmarks.bounce import paired, pushed

from sprung.bounce_tests import bounce, bounce_changes
from sprung.errors import DataError, ParameterError
from sprung.formats import read
from sprung.identification.begins import delayed, free_from
from sprung.identification.free_response import fit_free_response
from sprung.identification.friction import swing_with_friction
from sprung.identification.methods import cov_ssi
from sprung.identification.settings import IdentificationSettings
from sprung.identification.transients import find_transients, without_hum
from sprung.modal import INTERVAL_95
from sprung.recording import Channel, Recording
from sprung.results.tables.corners import bounce_tables
from sprung.vehicles import Sensor, Structure, parse_fault, read_vehicle, structure, with_faults

CAR = read_vehicle("zafira")


def pushes(seed=0, *, faults=(), level=0.02) -> Recording:
    """Return four corners of a car pressed by half a sine, one after another, with the noise of a phone."""
    car = with_faults(structure(CAR), [parse_fault(fault) for fault in faults])
    hands = np.zeros((len(car.coordinates), 4))
    hands[:3] = np.array([[1.0, -x, y] for x in (1.22, -1.58) for y in (0.7, -0.7)]).T
    names = (*car.inputs, "hand_1", "hand_2", "hand_3", "hand_4")
    pressed = Structure(car.coordinates, car.mass, car.elements, names, np.hstack([car.forces, hands]), car.outputs)
    system = pressed.discretised(100.0)
    force = np.zeros((len(names), 1800))
    for k in range(4):
        force[len(car.inputs) + k, 100 + 400 * k : 134 + 400 * k] = -900 * np.sin(np.pi * np.arange(34) / 34)
    state, samples = np.zeros(len(system.state_matrix)), np.empty((4, 1800))
    for k in range(1800):
        samples[:, k] = system.output_matrix @ state + system.feedthrough @ force[:, k]
        state = system.state_matrix @ state + system.input_matrix @ force[:, k]
    samples += level * np.random.default_rng(seed).standard_normal(samples.shape)
    return Recording(samples, 100.0, tuple(Channel(each.name, each.quantity) for each in car.outputs.channels))


def released_with_friction() -> np.ndarray:
    """Return a travel that is pushed and released in the presence of friction, shape (samples, 1)."""
    time = np.arange(500) / 100
    swing = 0.03 * swing_with_friction(time, natural_frequency=1.6, damping_ratio=0.06, friction=0.08)
    travel = np.concatenate([np.zeros(200), np.linspace(0.0, 0.03, 30), swing, np.full(100, swing[-1])])
    return travel[:, None] + 1e-4 * np.random.default_rng(5).standard_normal((travel.size, 1))


@pytest.fixture(scope="module")
def healthy():
    return bounce(pushes(), vehicle=CAR)


def test_pushes_are_found_where_they_are() -> None:
    found = find_transients(pushes())
    assert len(found) == 4
    np.testing.assert_allclose([each.onset for each in found], 1.0 + 4.0 * np.arange(4), atol=0.2)
    assert all(each.begin >= each.onset + 0.2 for each in found)


@pytest.mark.slow
def test_free_motion_begins_where_the_hands_let_go(healthy) -> None:
    run = pushes()
    spans = [delayed(run, test.transient) for test in healthy.tests]
    fit = fit_free_response([run.part(*span) for span in spans], band=(0.0, 20.0))
    firsts = [free_from(fit, k, run, spans[k], test.transient) for k, test in enumerate(healthy.tests)]
    late = np.array(firsts) - (134 + 400 * np.arange(4))
    assert np.all(late >= 0)
    assert np.all(late <= 8)


@pytest.mark.parametrize(("vehicle", "seed"), [("zafira-printed", 0), ("zafira", 0)])
def test_identification_takes_pushes_as_bounce_tests_do(vehicle, seed) -> None:
    """Files of one push, three seconds of them swings: they had no mode, or one more that the noise was taken for."""
    runs, exact = pushed(vehicle, seed)
    modes = cov_ssi(runs).modes
    np.testing.assert_allclose(modes.natural_frequency, exact.natural_frequency[:3], rtol=5e-3)
    np.testing.assert_allclose(modes.damping_ratio, exact.damping_ratio[:3], rtol=0.02)
    assert np.all(modes.natural_frequency_std < 5e-3 * modes.natural_frequency)


def test_a_car_pushed_at_its_corners(healthy) -> None:
    exact = structure(CAR).modes()
    modes = healthy.modes
    body = [modes.labels.index(label) for label in ("bounce", "pitch", "roll")]
    np.testing.assert_allclose(modes.natural_frequency[body], exact.natural_frequency[:3], rtol=0.01)
    np.testing.assert_allclose(modes.damping_ratio[body], exact.damping_ratio[:3], rtol=0.05)
    identifiable = [value for value in healthy.corners if value.is_identifiable]
    assert {value.component.kind for value in identifiable} >= {"spring", "damper"}
    assert all(abs(value.log_ratio) < 3.5 * value.std for value in identifiable)


@pytest.mark.slow
def test_a_phone_that_the_vehicle_file_describes_gives_springs_and_dampers() -> None:
    """One place, three channels under the names of an app: from four pushes all springs within 5 %, dampers 12 %."""
    shift = np.array([0.474, 0.281, 0.0])
    axes = {"Acceleration z": (0.0, 0.0, 1.0), "Gyroscope x": (1.0, 0.0, 0.0), "Gyroscope y": (0.0, 1.0, 0.0)}
    described = [
        Sensor(
            channel=name,
            quantity="acceleration" if name.startswith("Acc") else "angular_velocity",
            unit="m/s^2" if name.startswith("Acc") else "rad/s",
            position=tuple(shift),
            direction=axis,
        )
        for name, axis in axes.items()
    ]
    runs = [
        Recording(run.samples, run.sampling_rate, tuple(Channel(name, each.quantity) for name, each in renamed))
        for run in pushed("zafira", 0)[0]
        for renamed in [list(zip(axes, run.channels, strict=True))]
    ]
    with pytest.raises(ParameterError, match="under \\[\\[sensor\\]\\]"):
        bounce(runs, vehicle=CAR)
    result = bounce(runs, vehicle=CAR.model_copy(update={"sensor": tuple(described)}))
    assert result.modes.labels == ("bounce", "pitch", "roll")
    known = [value for value in result.corners if value.component.kind != "tyre"]
    assert len(known) == 8
    assert all(value.is_identifiable for value in known)
    assert all(abs(value.log_ratio) < (0.05 if value.component.kind == "spring" else 0.12) for value in known)


def test_a_mode_near_its_node_at_the_phone_is_compared_with_itself(healthy) -> None:
    """A weak damper moved the node of pitch: its shape was that of bounce, and its frequency 14 % above the earlier."""
    modes = healthy.modes.take(np.arange(3))
    shapes = modes.mode_shapes.copy()
    shapes[1] = shapes[0]
    after = replace(healthy, modes=replace(modes, mode_shapes=shapes), fit=None, corners=())
    changes = bounce_changes(replace(after, modes=modes), after)
    assert len(changes) == 6
    assert all(change.change == 0 for change in changes)


@pytest.mark.slow
def test_a_weak_damper_is_the_change(healthy) -> None:
    after = bounce(pushes(1, faults=["front_left.damper=-0.5"]), vehicle=CAR).changed_since(healthy)
    dampers = {each.part: each for each in after.changes if each.part.endswith("damper")}
    worst = max(dampers.values(), key=lambda each: each.score)
    assert worst.part == "front_left.damper"
    assert worst.is_significant
    assert worst.interval[0] < -0.5 < worst.interval[1]
    sides = {each.part: each for each in after.sides}
    assert set(sides) >= {"front.damper", "rear.damper", "front.spring", "rear.spring"}
    assert [part for part, each in sides.items() if each.is_significant] == ["front.damper"]
    assert sides["front.damper"].interval[0] < -0.5 < sides["front.damper"].interval[1]
    assert not any(each.is_significant for each in healthy.sides)
    again = bounce(pushes(2), vehicle=CAR).changed_since(healthy)
    assert sum(each.is_significant for each in again.changes) <= 1


def test_friction_is_stated_apart() -> None:
    result = bounce(Recording(released_with_friction().T, 100.0, (Channel("travel", "displacement"),)))
    (test,) = result.tests
    (friction,) = test.frictions
    assert friction is not None
    assert friction.is_significant
    assert friction.damping_ratio == pytest.approx(0.06, abs=0.01)
    assert friction.sticking[0] == pytest.approx(0.08 * 0.03, rel=0.1)
    assert result.modes.damping_ratio[0] > 0.08


@pytest.mark.slow
@pytest.mark.parametrize(
    ("quantity", "order", "shapes"), [("displacement", 0, [[1, 0.6], [0.5, -1]]), ("acceleration", 2, [[1, 1]])]
)
def test_friction_beside_a_faster_swing_makes_no_false_modes(quantity, order, shapes) -> None:
    """The first mode was two, around 1.45 and 1.8 Hz, or 1.25 and 1.8: linear modes imitate its friction."""
    time = np.arange(1000) / 200
    slow = swing_with_friction(time, natural_frequency=1.6, damping_ratio=0.06, friction=0.06, order=order)
    pole = 2 * np.pi * 8.0 * (1j * np.sqrt(1 - 0.04**2) - 0.04)
    fast = (pole**order * np.exp(pole * time)).real
    motion = np.array(shapes, dtype=float) @ np.stack([slow, 0.4 * fast * np.abs(slow).max() / np.abs(fast).max()])
    push = np.linspace(0, 1, 60) * motion[:, :1] * (order == 0)
    rest = np.zeros((len(motion), 400)), np.repeat(motion[:, -1:], 200, axis=1)
    samples = np.concatenate([rest[0], push, motion, rest[1]], axis=1)
    samples += 2e-3 * np.abs(samples).max() * np.random.default_rng(1).standard_normal(samples.shape)
    result = bounce(Recording(samples, 200.0, tuple(Channel(f"c{k}", quantity) for k in range(len(motion)))))
    assert len(result.modes) == 2
    assert result.modes.natural_frequency == pytest.approx([1.6, 8.0], rel=0.08)
    assert result.modes.damping_ratio[1] == pytest.approx(0.04, abs=0.005)
    friction, linear = result.tests[0].frictions
    assert linear is None
    assert friction is not None
    assert friction.damping_ratio == pytest.approx(0.06, abs=0.01)


def drop(seed=0, *, hum=0.0) -> np.ndarray:
    """Return two seconds of rest and a decay of 1.5 Hz with 15 % and 8 Hz with 10 % damping, shape (2, samples)."""
    time = np.arange(9 * 400) / 400
    after, motion = time[800:] - time[800], np.zeros(time.size)
    for f, xi, size in ((1.5, 0.15, 1.0), (8.0, 0.1, 0.5)):
        turning = 2 * np.pi * f * np.sqrt(1 - xi**2)
        motion[800:] += size * np.exp(-2 * np.pi * f * xi * after) * np.sin(turning * after)
    line = hum * np.sin(2 * np.pi * 50 * time)
    both = np.stack([motion + line, 0.7 * motion + 1.1 * line])
    return both + 0.02 * np.random.default_rng(seed).standard_normal(both.shape)


ACCELERATIONS = (Channel("acc_f", "acceleration"), Channel("acc_r", "acceleration"))


def test_travels_of_two_linear_modes_show_no_friction() -> None:
    """One travel alone, as a swing with friction, stuck at 1 count: bounce and pitch together leave the noise."""
    poles = 2 * np.pi * np.array([1.274, 1.468]) * np.exp(1j * (np.pi / 2 + np.arcsin([0.237, 0.276])))
    waves = np.exp(np.outer(poles, np.arange(300) / 100))
    motion = (
        60 * (np.array([[1.0, 0.5], [0.95, 0.45], [0.8, -0.6], [0.75, -0.5]]) @ (np.array([[1], [1]]) * waves)).real
    )
    press = motion[:, :1] * np.sin(np.linspace(0, np.pi / 2, 30))
    travels = np.round(np.hstack([np.zeros((4, 150)), press, motion, np.zeros((4, 60))]))
    (test,) = bounce(Recording(travels, 100.0, tuple(Channel(name, "unknown") for name in "abcd"))).tests
    assert set(test.frictions) == {None}
    assert test.residual < 0.01


@pytest.mark.slow
def test_a_drop_beside_hum() -> None:
    """With mains hum, a record is nowhere quiet: no drop was found, and `identify --kind free` found none either."""
    result = bounce(Recording(drop(hum=0.3), 400.0, ACCELERATIONS))
    assert any("hum" in note for note in result.notes)
    settings = IdentificationSettings(kind="free")
    for modes in (result.modes, cov_ssi(Recording(drop(hum=0.3), 400.0, ACCELERATIONS), settings=settings).modes):
        assert modes.natural_frequency == pytest.approx([1.5, 8.0], rel=0.01)
        assert modes.damping_ratio == pytest.approx([0.15, 0.1], rel=0.05)
    assert not bounce(Recording(drop(), 400.0, ACCELERATIONS)).notes


@pytest.mark.parametrize("hum", [0.03, 0.1, 0.3, 1.0])
@pytest.mark.parametrize("line", [50.0, 60.0, 100.0])
def test_a_drop_of_a_half_car_beside_hum_is_free_motion(line, hum) -> None:
    """`identify` took it for random motion: no mode, or false ones at 17 Hz; or the hum for a mode."""
    exact = np.array([[1.2, 1.5, 11.0, 13.7], [0.22, 0.18, 0.14, 0.12]])
    poles = 2 * np.pi * exact[0] * (1j * np.sqrt(1 - exact[1] ** 2) - exact[1])
    shapes = np.array([[1.0, 0.6, 0.9, 0.1], [0.7, -0.9, 0.1, 0.9]])
    time = np.arange(8 * 400) / 400
    motion = (shapes @ (np.array([1.0, 0.7, 0.8, 0.6])[:, None] * np.exp(poles[:, None] * time))).real
    hums = hum * np.array([[1.0], [1.1]]) * np.sin(2 * np.pi * line * time + np.array([[0.4], [0.9]]))
    noise = 0.005 * np.random.default_rng(round(line)).standard_normal(motion.shape)
    result = cov_ssi(Recording(motion + hums + noise, 400.0, ACCELERATIONS))
    assert set(result.sources) == {"free_response"}
    assert f"hum: lines at {line:.4g} Hz subtracted" in result.notes
    for frequency, std in zip(result.modes.natural_frequency, result.modes.natural_frequency_std, strict=True):
        assert np.abs(exact[0] - frequency).min() < 4 * np.hypot(std, 0.01 * frequency)


def test_a_swing_that_rings_long_is_no_hum() -> None:
    """A light mode that dies away within the record is a line to the search for harmonics, and must stay."""
    time = np.arange(4000) / 200
    ringing = np.exp(-2 * np.pi * 11 * 0.002 * time) * np.sin(2 * np.pi * 11 * time)
    motion = np.stack([ringing, 0.7 * ringing]) + 0.01 * np.random.default_rng(3).standard_normal((2, 4000))
    modes = cov_ssi(Recording(motion, 200.0, ACCELERATIONS)).modes
    assert modes.natural_frequency == pytest.approx([11.0], rel=1e-3)
    assert modes.damping_ratio == pytest.approx([0.002], rel=0.05)


def test_pushes_at_even_intervals_are_no_hum() -> None:
    """They have lines at the multiples of their rate."""
    rng = np.random.default_rng(0)
    time, motion = np.arange(8000) / 100, np.zeros((1, 8000))
    for onset in 0.5 + 4 * np.arange(20) + 0.05 * rng.standard_normal(20):
        since = np.maximum(time - onset, 0)
        motion += np.exp(-2 * np.pi * 1.5 * 0.2 * since) * np.sin(2 * np.pi * 1.5 * since)
    pushed = Recording(motion + 0.01 * rng.standard_normal(motion.shape), 100.0, ACCELERATIONS[:1])
    assert without_hum(pushed) is pushed


@pytest.mark.parametrize(
    ("duration", "pushes_at"),
    [(105.0, (80.0, 85.0, 90.0, 95.0)), (12.0, (2.0, 2.7, 3.4, 4.1))],
    ids=["after a long rest", "rocked"],
)
def test_few_pushes_in_a_long_record_are_no_hum(duration, pushes_at) -> None:
    """Noise lasts at the lines of the pushes: they were subtracted, and modes of 0.2 % appeared."""
    time = np.arange(round(100 * duration)) / 100
    motion = np.full((1, time.size), 9.6)
    for onset in pushes_at:
        since = np.maximum(time - onset, 0)
        motion += np.exp(-2 * np.pi * 1.5 * 0.2 * since) * np.sin(2 * np.pi * 1.47 * since)
    samples = motion + 0.02 * np.random.default_rng(0).standard_normal(motion.shape)
    pushed = Recording(samples, 100.0, ACCELERATIONS[:1])
    assert without_hum(pushed) is pushed


def test_a_time_in_seconds_under_a_heading_of_milliseconds_is_doubted() -> None:
    """Modes of 1500 Hz were stated without a word."""
    history = ("time: column 'time [ms]', by its name",)
    result = bounce(Recording(drop(), 400e3, ACCELERATIONS, history=history))
    assert "is the time in s, not in ms" in result.notes[0]


def test_without_a_push_there_is_no_answer() -> None:
    noise = np.random.default_rng(6).standard_normal((2, 3000))
    with pytest.raises(DataError, match="push and let go"):
        bounce(Recording(noise, 100.0, (Channel("a", "acceleration"), Channel("b", "acceleration"))))


def test_linear_modes_of_two_travels_are_no_friction_of_one() -> None:
    """A drop whose second travel no swing with friction describes: "sticks below 0.11 mm" of the first."""
    time = np.arange(1600) / 200
    after = np.clip(time - 2, 0, None)
    decays = [
        (time > 2) * np.exp(-xi * 2 * np.pi * f * after) * np.cos(2 * np.pi * f * np.sqrt(1 - xi**2) * after)
        for f, xi in ((1.9, 0.18), (2.9, 0.22))
    ]
    travels = np.array([[20e-3, 6e-3], [12e-3, -15e-3]]) @ decays
    travels += 2e-4 * np.random.default_rng(0).standard_normal(travels.shape)
    channels = tuple(Channel(name, "displacement") for name in ("fork", "shock"))
    result = bounce(Recording(travels, 200.0, channels))
    np.testing.assert_allclose(result.modes.natural_frequency, [1.9, 2.9], rtol=0.01)
    assert result.tests[0].frictions == (None, None)


@pytest.mark.slow
def test_tests_without_a_clear_mode_say_so() -> None:
    """With the engine running, tests and an empty table were all that was shown."""
    run, time = pushes(), np.arange(1800) / 100
    engine = np.sin(2 * np.pi * (25.3 * time + 0.3 * np.sin(0.8 * time))) * [[0.3], [0.4], [0.5], [0.6]]
    result = bounce(Recording(run.samples + engine, 100.0, run.channels))
    assert len(result.modes) == 0
    assert "no mode is clear" in result.notes[-1]


@pytest.mark.slow
def test_rebound_clicks_of_a_bicycle(real_file) -> None:
    """Viscous damping rises with 0, 4, 8, 12, 17 clicks; frequencies, with spring and rider unchanged, are alike.

    With friction, the damping of 0 and 4 clicks, and of 12 and 17, does not differ beyond its deviations.
    """
    results = [bounce(read(real_file(f"mtb_sst_rebound_clicks/0008{number}.SST"))) for number in (3, 4, 5, 6, 7)]
    fits = [fit for result in results if (fit := result.tests[-1].frictions[0]) is not None]
    viscous = [fit.damping_ratio for fit in fits]
    assert len(viscous) == 5
    assert viscous == sorted(viscous)
    shown = [bounce_tables(result)[1].rows[-len(result.tests[-1].modes)][4] for result in results]
    assert [float(each.split()[0]) for each in shown] == pytest.approx(100 * np.array(viscous), abs=0.5)
    damping = [float(results[k].modes.damping_ratio[0]) for k in (0, 2, 3)]
    assert damping == sorted(damping)
    frequency = [float(result.modes.natural_frequency[0]) for result in results]
    assert max(frequency) / min(frequency) < 1.17


def test_a_brake_pulse_among_sensors_that_do_not_move() -> None:
    """Pitch after a stop; four of the six channels of the IMU hold noise alone, which hid the motion."""
    time = np.arange(1600) / 200
    swing = np.zeros(time.size)
    after = time[480:] - time[480]
    swing[480:] = np.exp(-0.2 * 2 * np.pi * 1.76 * after) * np.sin(2 * np.pi * 1.76 * np.sqrt(1 - 0.2**2) * after)
    samples = 0.02 * np.random.default_rng(1).standard_normal((6, time.size))
    samples[[0, 4]] += np.array([[1.0], [0.6]]) * swing
    channels = tuple(Channel(f"{name}_{axis}", "unknown") for name in ("acc", "gyro") for axis in "xyz")
    result = bounce(Recording(samples, 200.0, channels))
    assert result.modes.natural_frequency == pytest.approx([1.76], rel=0.01)
    assert result.modes.damping_ratio == pytest.approx([0.2], rel=0.05)


@pytest.mark.slow
@pytest.mark.parametrize("seed", [0, 3])
def test_two_pushes_in_noise_show_two_close_modes(seed) -> None:
    """The second does not fall to a third of its peak before the noise; modes of each begin the search for all."""
    time, rng = np.arange(1600) / 200, np.random.default_rng(seed)
    frequencies, damping = np.array([1.518, 1.759]), np.array([0.162, 0.204])
    poles = 2 * np.pi * frequencies * (1j * np.sqrt(1 - damping**2) - damping)
    shapes = np.array([[0.1, 0.2, 1.0, 0.15, 0.1, 0.0], [0.5, -0.2, 0.4, -0.05, 0.3, 0.0]])
    samples = np.repeat([[0.02], [0.004]], 3, axis=0) * rng.standard_normal((6, time.size))
    for start, amplitudes in ((0.85, (1.0, 0.5)), (4.65, (0.8, -0.6))):
        after = time[time >= start] - start
        waves = np.exp(np.outer(poles, after)).imag * np.array(amplitudes)[:, None]
        samples[:, time >= start] += shapes.T @ waves
    channels = tuple(Channel(f"{name}_{axis}", "unknown") for name in ("acc", "gyro") for axis in "xyz")
    result = bounce(Recording(samples, 200.0, channels))
    assert len(result.tests) == 2
    assert result.modes.natural_frequency == pytest.approx(frequencies, rel=0.01)
    assert result.modes.damping_ratio == pytest.approx(damping, rel=0.05)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("samples", "heads", "shown_part"),
    [
        (pushes().samples[:, :500].T, [f"{name} [m/s^2]" for name in "abcd"], "1 test"),
        (released_with_friction(), ["travel [m]"], "viscous"),
    ],
)
def test_a_push_needs_no_scipy_and_no_diagnosis(samples, heads, shown_part, tmp_path) -> None:
    """What is not used is not imported: it took half of the time of the command."""
    np.savetxt(path := tmp_path / "push.csv", samples, delimiter=",", header=",".join(heads), comments="")
    code = (
        f"import sys; from sprung.cli import main; main(['bounce', {str(path)!r}, '--sampling-rate', '100']);"
        " print(sorted({'scipy', 'sprung.kits', 'sprung.diagnosis.baseline'} & set(sys.modules)))"
    )
    shown = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout
    assert shown.endswith("[]\n"), shown
    assert shown_part in shown


@pytest.mark.slow
@pytest.mark.parametrize("seed", [1, 2, 3])
def test_modes_of_a_coach_that_three_seconds_do_not_separate_have_wide_intervals(seed) -> None:
    """Sway at 0.60, frames at 0.70 and roll at 1.17 Hz read as one mode at 0.74 Hz: 4 to 12 deviations beside one."""
    recordings, exact = pushed("coach", seed)
    tests = bounce(recordings)
    modes = tests.modes
    pairs = [(j, k) for j, k in paired(modes.poles, exact.poles) if exact.natural_frequency[k] < 1.5]
    assert len(pairs) == 3
    for j, k in pairs:
        assert modes.natural_frequency[j] == pytest.approx(
            exact.natural_frequency[k], abs=INTERVAL_95 * modes.natural_frequency_std[j]
        )
    assert any("cannot be distinguished" in note for note in tests.notes)
