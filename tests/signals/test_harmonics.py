from dataclasses import replace

import h5py
import numpy as np
import pytest
from pyarrow import parquet
from scipy import signal

from sprung.errors import DataError, ParameterError
from sprung.excitation import QUARTER_CASES, RandomInputs
from sprung.recording import Channel, Gap, Recording
from sprung.signals.conditioning import SLOWEST
from sprung.signals.harmonics import (
    Harmonic,
    find_harmonics,
    in_families,
    missing_multiples,
    near_harmonic,
    with_present_bands,
    without_side_lines,
)
from sprung.simulation import simulate, usual_excitation
from sprung.vehicles import read_description, structure


def recorded(samples, sampling_rate, **fields):
    samples = np.atleast_2d(samples)
    return Recording(samples, sampling_rate, tuple(Channel(f"c{i}") for i in range(len(samples))), **fields)


def vibration(frequencies, damping_ratio, *, seed, duration=60.0, sampling_rate=200.0, n_channels=3):
    """Random vibration of independent modes, mixed into channels, with 5 % noise."""
    rng = np.random.default_rng(seed)
    n_samples, lead_in = round(duration * sampling_rate), round(60 * sampling_rate)
    modes = []
    for frequency in frequencies:
        pole = 2j * np.pi * frequency * np.sqrt(1 - damping_ratio**2) - 2 * np.pi * frequency * damping_ratio
        denominator = np.real(np.poly(np.exp(np.array([pole, np.conj(pole)]) / sampling_rate)))
        mode = signal.lfilter([1.0], denominator, rng.standard_normal(lead_in + n_samples))[lead_in:]
        modes.append(mode / mode.std())
    samples = rng.standard_normal((n_channels, len(modes))) @ modes
    return samples + 0.05 * samples.std() * rng.standard_normal(samples.shape)


def smoothed(samples, sigma):
    """What `ndimage.gaussian_filter1d` returns, by Fourier transforms: a tenth of its time."""
    reach = np.arange(-4 * sigma, 4 * sigma + 1)
    kernel = np.exp(-0.5 * (reach / sigma) ** 2)
    padded = np.pad(samples, 4 * sigma, mode="symmetric")
    return signal.oaconvolve(padded, kernel / kernel.sum(), mode="valid")


def quarter(case, seed):
    """A case of the thesis; pulses fall on whole samples, which gives their multiples side lines above some 150 Hz."""
    vehicle = structure(read_description("quarter"))
    return simulate(vehicle, QUARTER_CASES[case - 1], duration=60.0, sampling_rate=1000.0, seed=seed)


# Constant frequency


@pytest.mark.slow
def test_pulses_are_one_family_of_multiples() -> None:
    found = [line for line in find_harmonics(quarter(2, seed=1)) if line.frequency < 400]
    harmonics = [line for line in found if line.fundamental is not None]
    assert all(line.frequency > 180 for line in found if line.fundamental is None)
    assert len(harmonics) == 109
    assert all(line.fundamental == pytest.approx(3.65, abs=1e-3) for line in harmonics)
    assert [line.order for line in harmonics] == list(range(1, 110))
    for line in harmonics:
        assert line.frequency == pytest.approx(3.65 * line.order, abs=line.resolution)
        assert line.kind == "constant"
        assert line.band[0] < line.frequency < line.band[1]


@pytest.mark.slow
def test_a_sine_between_the_pulses_is_not_a_multiple() -> None:
    harmonics = [line for line in find_harmonics(quarter(4, seed=2)) if line.frequency < 150]
    (sine,) = [line for line in harmonics if line.fundamental is None]
    assert sine.frequency == pytest.approx(17.0, abs=0.01)
    assert (sine.order, len(sine.channels)) == (1, 2)
    assert len(harmonics) == 42


@pytest.mark.parametrize("frequency", [3.3, 11.7, 43.21, 92.0])
def test_a_tone_in_noise_is_found_where_it_is(frequency) -> None:
    t = np.arange(12_000) / 200
    samples = np.random.default_rng(3).standard_normal((2, t.size))
    samples[1] += 0.7 * np.sin(2 * np.pi * frequency * t)
    (line,) = find_harmonics(recorded(samples, 200.0))
    assert line.frequency == pytest.approx(frequency, abs=0.01)
    assert line.channels == ("c1",)


def test_a_tone_that_comes_and_goes_is_found() -> None:
    t = np.arange(12_000) / 200
    samples = np.random.default_rng(4).standard_normal(t.size) + np.where(t > 25, np.sin(2 * np.pi * 40 * t), 0)
    (line,) = find_harmonics(recorded(samples, 200.0))
    assert line.frequency == pytest.approx(40.0, abs=0.05)


def test_a_tone_in_a_damped_mode_is_found_and_the_mode_is_not() -> None:
    t = np.arange(12_000) / 200
    samples = vibration([10.0], 0.1, seed=5, n_channels=1) / 3 + 0.5 * np.sin(2 * np.pi * 10.5 * t)
    (line,) = find_harmonics(recorded(samples, 200.0))
    assert line.frequency == pytest.approx(10.5, abs=0.02)


def test_a_tone_below_what_the_record_can_show_is_not_claimed() -> None:
    t = np.arange(12_000) / 200
    samples = np.random.default_rng(6).standard_normal(t.size) + 3 * np.sin(2 * np.pi * 1.7 * t)
    assert find_harmonics(recorded(samples, 200.0)) == ()
    (line,) = find_harmonics(recorded(samples, 200.0), min_damping=0.02)
    assert line.frequency == pytest.approx(1.7, abs=0.01)


def test_lines_do_not_depend_on_scale_order_of_channels_or_a_gap() -> None:
    t = np.arange(24_000) / 200
    samples = np.random.default_rng(7).standard_normal((2, t.size)) + np.sin(2 * np.pi * 31 * t)
    (line,) = find_harmonics(recorded(samples, 200.0))
    (other,) = find_harmonics(recorded(1e6 * samples[::-1], 200.0))
    assert other.frequency == pytest.approx(line.frequency)
    assert other.channels == line.channels
    (third,) = find_harmonics(recorded(samples, 200.0, gaps=(Gap(11_000, 3.21),)))
    assert third.frequency == pytest.approx(31.0, abs=0.02)


def test_dead_channels_and_short_recordings_have_no_lines() -> None:
    assert find_harmonics(recorded(np.zeros((2, 6000)), 100.0)) == ()
    assert find_harmonics(recorded(np.ones((1, 20)), 100.0)) == ()


def test_what_cannot_be_searched_is_refused() -> None:
    recording = recorded(np.zeros((1, 100)), 100.0)
    with pytest.raises(ParameterError, match="false_alarm_rate=2"):
        find_harmonics(recording, false_alarm_rate=2.0)
    with pytest.raises(DataError, match="no channel besides the speed"):
        find_harmonics(recording, speed="c0")
    with pytest.raises(DataError, match="missing values"):
        find_harmonics(recorded(np.full((1, 1000), np.nan), 100.0))


@pytest.mark.parametrize("tone", [(), (5.2,)])
def test_light_modes_of_half_an_hour_are_no_lines_and_a_tone_among_them_is_one(tone) -> None:
    """Half-power bandwidths of 4.5 and 27 over the duration: all were called lines."""
    t = np.arange(90_000) / 50
    for seed in range(4):
        samples = vibration([3.1, 7.7, 12.3, 18.9], 0.0008, seed=seed, duration=1800.0, sampling_rate=50.0)
        samples += 0.1 * samples.std() * sum(np.sin(2 * np.pi * frequency * t) for frequency in tone)
        lines = find_harmonics(recorded(samples, 50.0))
        assert [line.frequency for line in lines] == pytest.approx(tone, abs=0.003)


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["chain3", "quarter", "white", "light", "lightest"])
def test_random_vibration_has_no_harmonics(kind) -> None:
    """At the default rate of 1e-3, lines in two of 100 records have a probability of 5e-3."""
    n_with_lines = 0
    for seed in range(100):
        if kind == "white":
            recording = recorded(np.random.default_rng(seed).standard_normal((4, 12_000)), 200.0)
        elif kind in ("light", "lightest"):
            damping_ratio = 0.005 if kind == "light" else 0.003
            recording = recorded(vibration([2.9, 3.3, 5.2, 11.0, 31.0], damping_ratio, seed=seed), 200.0)
        else:
            vehicle = structure(read_description(kind))
            excitation = usual_excitation(vehicle)
            assert isinstance(excitation, RandomInputs)
            recording = simulate(vehicle, excitation, duration=60.0, sampling_rate=400.0, snr=10.0, seed=seed)
        n_with_lines += len(find_harmonics(recording)) > 0
    assert n_with_lines <= 1


# Families


def family(fundamental, n_orders, *, seed, duration=100.0, wander=0.0, onset=0.0):
    """Noise and three modes in three channels, and the multiples of a fundamental that wanders and starts late."""
    generator = np.random.default_rng(seed)
    t = np.arange(round(120 * duration)) / 120
    drift = smoothed(generator.standard_normal(t.size), 960)
    turns = np.cumsum(fundamental * (1 + wander * drift / drift.std())) / 120
    samples = vibration([3.7, 11.1, 16.7], 0.01, seed=seed, duration=duration, sampling_rate=120.0)
    samples += samples.std() * generator.standard_normal(samples.shape)
    for order in range(1, n_orders + 1):
        gains = generator.uniform(0.3, 1.0, 3) * generator.choice([-1, 1], 3) * samples.std()
        samples += gains[:, None] * (t > onset) * np.sin(2 * np.pi * order * turns + generator.uniform(0, 6))
    return recorded(samples, 120.0)


@pytest.mark.parametrize("fundamental", [0.93, 1.37, 2.2])
def test_the_multiples_of_a_shake_table_are_one_family(fundamental) -> None:
    """Also of a fundamental below 0.84 / (0.005 T) = 1.68 Hz, and of a sine that starts late."""
    for seed in range(2):
        lines = find_harmonics(family(fundamental, 15, seed=seed, onset=9.0))
        members = [line for line in lines if line.fundamental == pytest.approx(fundamental, rel=1e-3)]
        assert len(members) >= 12
        assert all(line.kind == "constant" for line in members)
        assert {line.order for line in (*members, *missing_multiples(members))} >= set(range(1, 14))


def test_an_engine_whose_speed_wanders_has_drifting_lines() -> None:
    """Narrow poles at the mean frequency of every order are at a harmonic."""
    lines = find_harmonics(family(11.2, 4, seed=1, wander=0.01))
    assert {line.kind for line in lines} == {"drifting"}
    orders = 11.1 * np.arange(1, 5)
    assert near_harmonic(orders, np.full(4, 0.003), lines, resolution=0.3).all()


def test_lines_of_several_recordings_are_one_family() -> None:
    """Each recording has a fundamental of its own, one of them half of it."""
    lines = [
        Harmonic(f, "constant", (f - 0.01, f + 0.01), 0.02, 20.0, ("a",), 5.0 / part + error, part * order)
        for order, f in enumerate(5.0 * np.arange(1, 21), start=1)
        for part, error in [(2, 0.0) if order % 9 == 0 else (1, 1e-7 * (order % 4))]
    ]
    found = in_families([*lines, replace(lines[0], frequency=101.3, fundamental=None, order=1)])
    assert [line.fundamental for line in found[:-1]] == [pytest.approx(5.0)] * 20
    assert len({line.fundamental for line in found[:-1]}) == 1
    assert [line.order for line in found] == [*range(1, 21), 1]
    assert found[-1].fundamental is None


def test_side_lines_are_left_out_and_other_lines_are_not() -> None:
    def line(frequency, prominence, fundamental=None):
        return Harmonic(frequency, "constant", (frequency, frequency), 0.025, prominence, ("a",), fundamental)

    family = [line(3.65 * order, 25.0, 3.65) for order in range(60, 65)]
    others = [line(3.65 * 61 - 0.1, 30.0), line(3.65 * 62 - 0.2, 15.0)]
    assert list(without_side_lines([*family, *others, line(3.65 * 63 - 0.1, 15.0)])) == [*family, *others]


def test_multiples_that_are_not_seen_are_those_below_the_highest() -> None:
    lines = [Harmonic(2.0 * k, "constant", (2.0 * k, 2.0 * k), 0.1, 20.0, ("a",), 2.0, k) for k in (1, 2, 4, 6)]
    assert [line.frequency for line in missing_multiples(lines)] == [6.0, 10.0]
    assert missing_multiples(lines[:3]) == ()
    drifting = [replace(line, kind="drifting") for line in lines[1:3]]
    assert [(line.frequency, line.resolution) for line in missing_multiples(drifting)] == [
        (2.0, pytest.approx(0.05)),
        (6.0, pytest.approx(0.15)),
    ]


# Proportional to speed


def drive(spread, *, seed, line=0.0, duration=600.0):
    """Body modes, wheel hop and a light mode, the speed, and a wheel's line with its double and 0.3 % slip."""
    rng = np.random.default_rng(seed)
    n_samples = round(duration * 100)
    smooth = smoothed(rng.standard_normal(n_samples + 20_000), 1500)[10_000:-10_000]
    slip = smoothed(rng.standard_normal(n_samples), 300)
    v = np.maximum(15 + spread * smooth / smooth.std(), 0)
    body = vibration([1.5, 1.8, 2.4, 11.0], 0.15, seed=seed, duration=duration, sampling_rate=100.0, n_channels=4)
    body += 0.3 * vibration([19.0, 27.0], 0.02, seed=seed, duration=duration, sampling_rate=100.0, n_channels=4)
    turns = np.cumsum(v * (1 + 0.003 * slip / slip.std())) * 0.516 / 100
    body += line * body.std() * (np.cos(2 * np.pi * turns) + 0.4 * np.cos(4 * np.pi * turns))
    channels = (*(Channel(f"c{i}") for i in range(4)), Channel("v", "speed"))
    return Recording(np.vstack([body, v]), 100.0, channels)


@pytest.mark.slow
@pytest.mark.parametrize("spread", [1.0, 4.0])
def test_the_lines_of_a_wheel_are_proportional_to_speed(spread) -> None:
    recording = drive(spread, seed=1, line=0.3)
    once, twice = find_harmonics(recording, speed="v")
    assert once.kind == twice.kind == "speed"
    assert once.frequency == pytest.approx(0.516, rel=0.005)
    assert (once.order, twice.order) == (1, 2)
    v = recording.samples[-1]
    assert once.band[0] == pytest.approx(0.516 * np.quantile(v, 0.05), rel=0.02)
    assert once.band[1] == pytest.approx(0.516 * np.quantile(v, 0.95), rel=0.02)


def test_known_lines_sweep_the_bands_of_the_present_speeds() -> None:
    wheel = Harmonic(0.516, "speed", (7.2, 11.6), 0.004, 15.0, ("c0",))
    hum = Harmonic(50.0, "constant", (49.9, 50.1), 0.2, 15.0, ("c0",))
    recording = drive(4.0, seed=2, duration=60.0)
    v = recording.samples[-1]
    slow, fast = np.quantile(v[v >= SLOWEST], (0.05, 0.95))
    present, same = with_present_bands([wheel, hum], recording, speed="v")
    assert present.band == (pytest.approx(0.514 * slow), pytest.approx(0.518 * fast))
    assert (replace(present, band=wheel.band), same) == (wheel, hum)
    at_rest = replace(recording, samples=recording.samples * np.array([[1], [1], [1], [1], [0]]))
    assert with_present_bands([wheel, hum], at_rest, speed="v") == (wheel, hum)
    assert with_present_bands([wheel, hum], recording, speed=None) == (wheel, hum)


@pytest.mark.slow
def test_at_constant_speed_no_line_is_called_proportional_to_it() -> None:
    assert all(line.kind != "speed" for line in find_harmonics(drive(0.02, seed=2, line=0.3), speed="v"))


@pytest.mark.slow
@pytest.mark.parametrize(("spread", "duration"), [(1.0, 600.0), (4.0, 600.0), (4.0, 60.0)])
def test_drives_without_lines_have_none(spread, duration) -> None:
    n_lines = sum(len(find_harmonics(drive(spread, seed=s, duration=duration), speed="v")) for s in range(10))
    assert n_lines == 0


# Poles


def test_a_narrow_pole_at_a_line_is_a_harmonic_and_a_damped_mode_next_to_it_is_not() -> None:
    line = Harmonic(3.65, "constant", (3.6, 3.7), 0.1, 20.0, ("a",))
    frequencies = np.array([3.65, 3.56, 3.65, 3.65, 4.5, 13.2])
    ratios = np.array([0.001, 0.01, 0.13, 0.04, 0.001, 0.001])
    is_harmonic = near_harmonic(frequencies, ratios, [line], resolution=0.25)
    assert is_harmonic.tolist() == [True, True, False, False, False, False]
    assert not near_harmonic(frequencies, ratios, [], resolution=0.25).any()


def test_a_pole_in_the_band_that_a_line_sweeps_is_a_harmonic_unless_it_is_heavily_damped() -> None:
    wheel = Harmonic(0.516, "speed", (7.2, 11.6), 0.003, 15.0, ("a",))
    is_harmonic = near_harmonic([11.6, 9.0, 11.0, 13.5, 1.5], [0.03, 0.04, 0.1, 0.02, 0.04], [wheel], resolution=0.2)
    assert is_harmonic.tolist() == [True, True, False, False, False]


def test_poles_without_damping_ratios_are_refused() -> None:
    with pytest.raises(ParameterError, match="need as many damping ratios"):
        near_harmonic([1.0, 2.0], [0.1], [], resolution=0.1)


# Real recordings


def car(path):
    """Return a decoded log at 100 Hz, jittering time stamps resampled."""
    table = parquet.read_table(path)
    stamps = table["t_s"].to_numpy()
    grid = np.arange(stamps[0], stamps[-1], 0.01)
    names = [name for name in table.column_names if name != "t_s"]
    samples = [np.interp(grid, stamps, table[name].to_numpy().astype(float)) for name in names]
    channels = tuple(Channel(name, "speed" if name == "Speed" else "unknown") for name in names)
    return Recording(np.array(samples), 100.0, channels)


@pytest.mark.parametrize("name", ["00000165_00000001-60FEB68B", "00000165_00000002-60FEB8E3"])
def test_the_wheels_of_a_car_turn_at_0_516_per_metre(real_file, name) -> None:
    """Its circumference is 1.94 m; the middle half of 76 windows lies at 0.513 to 0.519 (the data's description)."""
    path = real_file(f"canedge_car_body_imu/{name}_decoded.parquet")
    harmonics = find_harmonics(car(path), speed="Speed")
    wheel, twice, thrice = harmonics[:3]
    assert 0.513 < wheel.frequency < 0.519
    assert len(wheel.channels) == 6
    assert wheel.prominence > 12
    assert [line.order for line in (wheel, twice, thrice)] == [1, 2, 3]
    assert {line.kind for line in harmonics} == {"speed"}


def test_engine_lines_of_a_car(real_file) -> None:
    with h5py.File(real_file("endaq_car_ide/GPS-Chick-Fil-A_003.h5")) as file:
        group = file["ch80_40g_DC_Acceleration"]
        samples = np.array([group[f"{axis}_(40g)"][:] for axis in "XYZ"], dtype=float)
        sampling_rate = float(group.attrs["fs_Hz"])
    found = [line.frequency for line in find_harmonics(recorded(samples, sampling_rate), min_damping=0.01)]
    for frequency in (22.6, 45.2, 90.9, 109.9, 227.7):
        assert min(abs(np.array(found) - frequency)) < 0.01 * frequency
