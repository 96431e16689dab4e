"""Modes followed over windows: the oracle is the known identity of every simulated mode."""

import h5py
import numpy as np
import pytest

from sprung.errors import DataError, ParameterError
from sprung.identification import cov_ssi
from sprung.identification.tracking import TrackingSettings, track_modes
from sprung.modal import Modes, mac, unit_shapes
from sprung.simulation import simulate, usual_excitation
from sprung.vehicles import chain

CHANNELS = ("a", "b", "c", "d")
#: Orthogonal shapes.
SHAPES = np.array([[1, 1, 1, 1], [1, 1, -1, -1], [1, -1, -1, 1], [1, -1, 1, -1]], dtype=complex)


def window(frequency, shapes, *, std, damping=0.01, channels=CHANNELS, labels=None):
    """Return modes of given frequencies [Hz] and shapes, not in order."""
    frequency, n = np.asarray(frequency, dtype=float), len(frequency)
    damping = np.broadcast_to(damping, n)
    return Modes(
        poles=2 * np.pi * frequency * (1j * np.sqrt(1 - damping**2) - damping),
        mode_shapes=unit_shapes(np.asarray(shapes, dtype=complex)),
        channels=channels,
        natural_frequency_std=np.broadcast_to(std, n),
        damping_ratio_std=0.1 * damping,
        stable_rate=np.ones(n),
        labels=(None,) * n if labels is None else labels,
    )


def sequence(seed, courses, *, shapes=SHAPES, std=0.01, found=0.9, n_false=0, noise=0.1, empty=()):
    """Return windows in which true modes scatter by `std` [Hz] and are found with probability `found`, in any order.

    `courses` has the true frequencies, shape (modes, windows), `n_false` the mean number of false modes of random
    shape; `shapes` the true shapes, shape (modes, channels) or (windows, modes, channels). Also return the number of
    the true mode of each mode, -1 for false ones.
    """
    generator = np.random.default_rng(seed)
    n_modes, n_windows = courses.shape
    n_channels = shapes.shape[-1]
    windows: list[Modes | None] = []
    truth = []
    for k in range(n_windows):
        own = shapes[k] if shapes.ndim == 3 else shapes
        rows = np.flatnonzero(generator.random(n_modes) < found)
        n_wrong = generator.poisson(n_false)
        wrong = generator.standard_normal((n_wrong, n_channels)) + 1j * generator.standard_normal((n_wrong, n_channels))
        disturbed = own[rows] + noise * generator.standard_normal((len(rows), n_channels))
        phases = np.exp(2j * np.pi * generator.random(len(rows) + n_wrong))[:, None]
        frequency = [
            *(courses[rows, k] + std * generator.standard_normal(len(rows))),
            *generator.uniform(1.0, 10.0, n_wrong),
        ]
        order = generator.permutation(len(frequency))
        if k in empty or not len(order):
            windows.append(None)
            truth.append(np.zeros(0, dtype=int))
            continue
        every = np.concatenate([disturbed, wrong]) * phases
        channels = tuple(f"c{c}" for c in range(n_channels))
        windows.append(window(np.array(frequency)[order], every[order], std=std, channels=channels))
        truth.append(np.array([*rows, *[-1] * n_wrong])[order])
    return windows, truth


def identities(track, truth):
    """Return the true mode of each mode of a track."""
    return np.array([truth[k][member] for k, member in zip(track.windows, track.members, strict=True)])


def check_identities(result, truth, n_modes, *, purity=1.0, completeness=0.97):
    """Check that each true mode is one track with (nearly) all of its modes and no others."""
    assert len(result.tracks) == n_modes
    every = np.concatenate(truth)
    owners = []
    for track in result.tracks:
        numbers, counts = np.unique(identities(track, truth), return_counts=True)
        owner = numbers[np.argmax(counts)]
        assert counts.max() >= purity * len(track)
        assert counts.max() >= completeness * np.sum(every == owner)
        owners.append(owner)
    assert sorted(owners) == list(range(n_modes))


def steady(*frequencies, n_windows=60):
    return np.tile(np.array(frequencies)[:, None], n_windows)


@pytest.mark.parametrize("seed", range(5))
def test_steady_modes_among_false_ones(seed) -> None:
    windows, truth = sequence(seed, steady(2.0, 3.0, 5.0, 7.0), n_false=2)
    result = track_modes(windows)
    check_identities(result, truth, 4, purity=0.97)
    n_untracked = sum(map(len, result.untracked_modes))
    assert n_untracked + sum(map(len, result.tracks)) == sum(len(modes) for modes in windows if modes is not None)


@pytest.mark.parametrize("seed", range(5))
def test_crossing_modes_keep_their_shapes(seed) -> None:
    time = np.arange(80)
    courses = np.array([3.0 + 0.005 * time, 3.4 - 0.005 * time])
    windows, truth = sequence(seed, courses, n_false=0.5)
    check_identities(track_modes(windows), truth, 2, purity=0.98)


def test_in_a_veering_tracks_stay_on_their_branches() -> None:
    # Two coupled modes: frequencies repel and shapes rotate into each other over many windows.
    n = 120
    detuning = np.linspace(-1, 1, n)
    split = np.sqrt(detuning**2 + 0.2**2)
    courses = np.array([5.0 - 0.3 * split, 5.0 + 0.3 * split])
    angle = 0.5 * np.arctan2(0.2, detuning)
    shapes = np.array([[np.sin(angle), -np.cos(angle)], [np.cos(angle), np.sin(angle)]]).transpose(2, 0, 1)
    windows, truth = sequence(1, courses, shapes=shapes @ SHAPES[:2], std=0.005, noise=0.05)
    check_identities(track_modes(windows), truth, 2)


@pytest.mark.parametrize("seed", range(3))
def test_close_modes_never_exchange(seed) -> None:
    # 0.6 % apart, with a scatter of 0.3 %: only the shapes distinguish them.
    windows, truth = sequence(seed, steady(3.0, 3.018, n_windows=100), std=0.009, found=0.7)
    check_identities(track_modes(windows), truth, 2)


@pytest.mark.parametrize("seed", range(3))
def test_shapes_that_turn_in_a_plane_are_two_modes(seed) -> None:
    # A mast: bending in two planes with nearly equal frequencies, whose directions differ from window to window.
    generator = np.random.default_rng(seed)
    angle = generator.choice([0.0, 0.4, 1.2], 150)
    turned = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]]).transpose(2, 0, 1)
    windows, truth = sequence(
        seed, steady(0.352, 0.355, n_windows=150), shapes=turned @ SHAPES[:2], std=0.0005, noise=0.03
    )
    check_identities(track_modes(windows), truth, 2, purity=0.9, completeness=0.9)


def test_missing_windows_are_a_gap_and_long_absence_is_an_end() -> None:
    windows, truth = sequence(1, steady(2.0, 5.0), empty=range(20, 40))
    check_identities(track_modes(windows), truth, 2)
    result = track_modes(windows, settings=TrackingSettings(gap=10.0))
    assert len(result.tracks) == 4
    assert [track.windows[-1] < 20 for track in result.tracks].count(True) == 2
    assert all(track.presence > 0.7 for track in result.tracks)
    assert not result.has_result[20:40].any()


def test_births_and_deaths() -> None:
    windows, truth = sequence(1, steady(2.0, 5.0), found=1.0)
    windows = [
        modes.take(np.flatnonzero((owner == 0) == (k < 30)))
        for k, (modes, owner) in enumerate(zip(windows, truth, strict=True))
    ]
    first, second = track_modes(windows).tracks
    assert (first.windows[0], first.windows[-1]) == (0, 29)
    assert (second.windows[0], second.windows[-1]) == (30, 59)


def test_slow_trend_is_followed_and_stated() -> None:
    courses = 3.0 * (1 - 0.1 * np.linspace(0, 1, 100))[None]
    windows, truth = sequence(1, courses, std=0.005)
    result = track_modes(windows, times=np.arange(0.0, 360000.0, 3600.0))
    check_identities(result, truth, 1)
    trend = result.tracks[0].natural_frequency.trend
    assert trend is not None
    span = np.ptp(result.tracks[0].times) / (99 * 3600)
    assert trend.change == pytest.approx(-0.3 * span, abs=4 * trend.change_std)
    assert trend.change_std < 0.01
    assert trend.slope == pytest.approx(-0.3 / (99 * 3600), rel=0.02)


@pytest.mark.parametrize("seed", range(3))
def test_jump_is_followed_as_the_same_mode(seed) -> None:
    courses = steady(2.0, 3.0, 5.0)
    courses[:, 30:] *= 0.975
    windows, truth = sequence(seed, courses, std=0.003, n_false=0.3)
    result = track_modes(windows)
    check_identities(result, truth, 3, purity=0.98)
    for track, frequency in zip(result.tracks, (2.0, 3.0, 5.0), strict=True):
        (jump,) = track.jumps
        assert 30 <= jump.window <= 32
        assert (jump.before, jump.after) == pytest.approx((frequency, 0.975 * frequency), rel=2e-3)


def test_jump_beyond_the_reach_is_a_death_and_a_birth() -> None:
    courses = steady(2.0)
    courses[:, 30:] *= 0.8
    windows, _ = sequence(1, courses)
    assert [len(track.jumps) for track in track_modes(windows).tracks] == [0, 0]
    (track,) = track_modes(windows, settings=TrackingSettings(reach=0.3)).tracks
    assert len(track.jumps) == 1


def test_scatter_and_stated_deviations() -> None:
    windows, _ = sequence(1, steady(3.0, n_windows=400), std=0.01, found=1.0)
    value = track_modes(windows).tracks[0].natural_frequency
    assert value.mean == pytest.approx(3.0, abs=4 * 0.01 / 20)
    assert value.scatter == pytest.approx(0.01, rel=0.15)
    assert value.stated == pytest.approx(0.01)
    assert value.low == pytest.approx(3.0 - 0.0196, abs=0.004)
    assert value.high == pytest.approx(3.0 + 0.0196, abs=0.004)


def test_deviations_that_are_wrong_or_unknown() -> None:
    for stated in (0.1, 0.001, np.nan):
        windows, truth = sequence(2, steady(2.0, 3.0, 3.2, 5.0), n_false=0.5)
        windows = [
            None
            if modes is None
            else window(modes.natural_frequency, modes.mode_shapes, std=stated, channels=modes.channels)
            for modes in windows
        ]
        check_identities(track_modes(windows), truth, 4, purity=0.97)


def test_few_windows() -> None:
    alone = window([2.0, 3.0], SHAPES[:2], std=0.01)
    assert [len(track) for track in track_modes([alone]).tracks] == [1, 1]
    assert [len(track) for track in track_modes([alone, alone]).tracks] == [2, 2]
    further = window([2.0, 4.0], SHAPES[:2], std=0.01)
    result = track_modes([alone, further])
    assert [len(track) for track in result.tracks] == [2]
    assert [len(track) for track in result.untracked_modes] == [1, 1]
    assert np.isnan(result.tracks[0].natural_frequency.scatter)
    assert result.tracks[0].natural_frequency.trend is None


def mast_windows(path):
    """Return the hours and the published modes of each hour of a guyed mast, None where there are none."""
    with h5py.File(path) as file:
        names = ("frequencies", "std_frequencies", "damping", "modeshapes", "time")
        frequency, frequency_std, damping, shapes, hours = (file[name][:] for name in names)
    windows = []
    for k in range(len(hours)):
        rows = np.flatnonzero(np.isfinite(frequency[k]) & (damping[k] > 0) & (damping[k] < 100))
        rows = rows[np.argsort(frequency[k][rows])]
        modes = window(
            frequency[k][rows],
            shapes[k][rows],
            std=frequency_std[k][rows],
            damping=damping[k][rows] / 100,
            channels=tuple(f"c{c}" for c in range(shapes.shape[-1])),
        )
        windows.append(modes if len(rows) else None)
    return hours.astype(float), windows


@pytest.mark.slow
def test_weeks_of_a_guyed_mast(real_file) -> None:
    # The README of the data states clusters at 0.16, 0.34 to 0.36 and 0.60 to 0.64 (two planes of bending each, found
    # nearly every hour), 1.28 to 1.34, 2.02 to 2.06, 3.28 to 3.36 and 3.45 Hz, and false poles of up to 90 % damping.
    hours, windows = mast_windows(real_file("guyed_mast_monitoring/60min_modal_accel.nc"))
    result = track_modes(windows, times=hours)
    values = [(float(np.median(track.modes.natural_frequency)), track) for track in result.tracks]
    for low, high in ((0.34, 0.36), (0.60, 0.64)):
        first, second = (track for frequency, track in values if low < frequency < high)
        assert min(first.presence, second.presence) > 0.75
        assert mac(first.mode_shape[None], second.mode_shape[None])[0, 0] < 0.1
        for track in (first, second):
            assert track.natural_frequency.scatter < 0.004 * low
            assert track.natural_frequency.high - track.natural_frequency.low < 0.03 * low
            assert not track.jumps
    for low, high in ((1.28, 1.34), (2.02, 2.06), (3.28, 3.36), (3.43, 3.46)):
        assert sum(len(track) for frequency, track in values if low < frequency < high) > 25
    clusters = ((0.15, 0.21), (0.34, 0.36), (0.60, 0.64), (1.28, 1.34), (2.02, 2.06), (3.26, 3.46))
    outside = [len(track) for frequency, track in values if not any(low < frequency < high for low, high in clusters)]
    assert sum(outside) <= 6
    assert not any(track.natural_frequency.high > 3.5 for track in result.tracks)


@pytest.mark.slow
def test_chain_whose_stiffness_falls_by_five_percent() -> None:
    # Frequencies go with the square root of the stiffness: 2.5 % lower in the second half.
    windows = []
    for k in range(30):
        vehicle = chain(stiffness=9800.0 * (1.0 if k < 15 else 0.95))
        run = simulate(vehicle, usual_excitation(vehicle), duration=60.0, sampling_rate=200.0, snr=10.0, seed=k)
        windows.append(cov_ssi(run).modes)
    result = track_modes(windows)
    exact = chain().modes().natural_frequency
    assert [len(track) for track in result.tracks] == pytest.approx([30, 30, 30], abs=2)
    for track, frequency in zip(result.tracks, exact, strict=True):
        values, is_before = track.modes.natural_frequency, track.windows < 15
        ratio = np.mean(values[~is_before]) / np.mean(values[is_before])
        assert ratio == pytest.approx(np.sqrt(0.95), abs=4e-3)
        assert np.mean(values[is_before]) == pytest.approx(frequency, rel=4e-3)
        # Lightly damped modes are too certain for a change of 2.5 % within a window to be drift: it is a jump at 15.
        assert all(jump.window in {15, 16} for jump in track.jumps)


def test_messages() -> None:
    modes = window([2.0], SHAPES[:1], std=0.01)
    with pytest.raises(DataError, match="no window has a mode"):
        track_modes([None, modes.take(np.zeros(0, dtype=int))])
    with pytest.raises(DataError, match="no window has a mode"):
        track_modes([])
    with pytest.raises(ParameterError, match="2 times are given for 1 windows"):
        track_modes([modes], times=[0.0, 1.0])
    with pytest.raises(ParameterError, match="times must rise"):
        track_modes([modes, modes], times=[1.0, 1.0])
    other = window([2.0], SHAPES[:1], std=0.01, channels=("a", "b", "c", "x"))
    with pytest.raises(ParameterError, match="window 2 has the channels a, b, c, x, but earlier ones have a, b, c, d"):
        track_modes([modes, other])
    with pytest.raises(ParameterError, match="out_of=2 must be at least 3"):
        TrackingSettings(out_of=2)
