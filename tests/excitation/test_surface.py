import itertools
import json

import numpy as np
import pytest
from scipy.interpolate import CubicSpline
from scipy.signal import csd

from sprung.errors import FormatError, ParameterError
from sprung.excitation import (
    Corrugation,
    Crossings,
    Joints,
    Potholes,
    Rail,
    Road,
    SurfaceMotion,
    constant_speed,
    rail_alignment,
    rail_quality,
    random_speed,
    read_surface,
    road_class,
)
from sprung.excitation.surface import SPACING, random_profile
from sprung.formats import read


def heights(surface, *, length=200e3, seed=1, **options):
    return random_profile(surface, first=0.0, last=length, generator=np.random.default_rng(seed), **options).heights


def spectra(tracks):
    """Auto and cross spectral densities over cycles/m, averaged over many segments of 655 m."""

    def density(one, other):
        return csd(one, other, fs=1 / SPACING, nperseg=2**15, detrend=False)

    n, left = density(tracks[0], tracks[0])
    right, cross = density(tracks[1], tracks[1])[1], density(tracks[0], tracks[1])[1]
    return n, left.real, right.real, cross


@pytest.fixture(scope="module")
def class_c():
    return spectra(heights(road_class("C"), length=100e3))


def bands(n, values):
    """Means over third octaves from 0.03 to 8 cycles/m."""
    edges = np.geomspace(0.03, 8, 25)
    return np.array([values[(n >= a) & (n < b)].mean() for a, b in itertools.pairwise(edges)])


@pytest.mark.slow
def test_spectrum_is_that_of_the_class(class_c, conforms) -> None:
    n, left, right, _ = class_c
    expected = np.divide(256e-6 * 0.1**2, n**2, where=n > 0, out=np.zeros_like(n))
    ratios = [bands(n, found / np.maximum(expected, 1e-30)) for found in (left, right)]
    what = "spectrum of 100 km of simulated road of class C over G(n0) (n / n0)^-2, third octaves, both tracks"
    conforms("ISO 8608:2016", "5.1, C.2", what, ratios, 1.0, absolute=0.08)


def test_classes_are_those_of_the_standard(conforms) -> None:
    printed = np.array([16, 64, 256, 1024, 4096, 16384, 65536, 262144]) * 1e-6
    found = [road_class(name).roughness for name in "ABCDEFGH"]
    conforms("ISO 8608:2016", "table C.1", "geometric means of G(n0), classes A to H", found, printed, rel=1e-9)


@pytest.mark.slow
def test_coherence_of_left_and_right(class_c) -> None:
    n, left, right, cross = class_c
    found = bands(n, cross.real) / np.sqrt(bands(n, left) * bands(n, right))
    weight = road_class("C").density(n)
    expected = bands(n, np.exp(-1.5 * n) * weight) / bands(n, weight)
    assert found == pytest.approx(expected, abs=0.05)
    assert np.abs(bands(n, cross.imag)).max() < 0.05 * bands(n, left).max()


@pytest.mark.slow
def test_energy_is_the_integral_of_the_spectrum(conforms) -> None:
    """Parseval: mean square = integral of G from 0.01 to 10 cycles/m = G0 n0^2 (1/0.01 - 1/10)."""
    squares = [np.mean(heights(road_class("B"), length=50e3, seed=seed) ** 2) for seed in range(8)]
    what = "mean square height of 400 km of simulated road of class B against the integral of the spectrum"
    conforms("ISO 8608:2016", "5.1, C.2", what, np.mean(squares), 64e-6 * 0.01 * (100 - 0.1), rel=0.1)


def test_contact_averages_over_its_length() -> None:
    rough = random_profile(Road(1e-4), first=0, last=50, generator=np.random.default_rng(2))
    rolled = random_profile(Road(1e-4), first=0, last=50, generator=np.random.default_rng(2), contact_length=0.2)
    spline = CubicSpline(SPACING * np.arange(rough.heights.shape[1]), rough.heights[0])
    place = 20.0
    average = spline.integrate(place - 0.1, place + 0.1) / 0.2
    assert rolled.height(True, place) == pytest.approx(average, abs=1e-6 * np.abs(rough.heights).max())


@pytest.mark.slow
@pytest.mark.parametrize("axles", [(1.2, -1.5), (2.0, 0.5, -2.0)])
def test_rear_wheels_follow_with_the_delay_of_the_speed(axles) -> None:
    """z_rear(t) = z_front(t') where distance(t') = distance(t) - wheelbase, to the last digits at any speed."""
    speed = random_speed(60.0, low=4.0, high=15.0, n_stops=1, generator=np.random.default_rng(5))
    motion = SurfaceMotion(road_class("C"), axles, speed)
    rate = 200.0
    wheels = motion.samples(12000, sampling_rate=rate, generator=np.random.default_rng(6))
    profile = random_profile(
        road_class("C"),
        first=-(axles[0] - axles[-1]) - 1,
        last=float(speed.distance(11999 / rate)) + 1,
        generator=np.random.default_rng(6),
        contact_length=0.1,
    )
    distance = speed.distance(np.arange(12000) / rate)
    for row, axle in enumerate(np.repeat(axles, 2)):
        expected = profile.height(row % 2 == 0, distance - (axles[0] - axle))
        assert wheels[row] == pytest.approx(expected, rel=1e-9, abs=1e-15)


def test_potholes_have_the_number_and_depth_asked_for() -> None:
    places = np.arange(0, 200e3, 0.05)
    found = Potholes(per_kilometre=5, share_of_bumps=0, depth=(0.02, 0.02)).heights(places, np.random.default_rng(1))
    lowest = (found.min(axis=0) < 0) & np.r_[True, found.min(axis=0)[:-1] == 0]
    assert lowest.sum() == pytest.approx(1000, abs=130)
    assert found.min() == pytest.approx(-0.02, rel=0.01)
    assert found.max() == 0


def test_joints_are_on_one_rail_or_staggered() -> None:
    places = np.arange(0, 36, 0.5)
    left, right = Joints(18.0, 0.002, stagger=5.0).heights(places, np.random.default_rng(1))
    assert places[left == -0.002].tolist() == [0.0, 18.0]
    assert places[right == -0.002].tolist() == [5.0, 23.0]
    left, right = Joints(18.0, 0.002, side="right").heights(places, np.random.default_rng(1))
    assert not left.any()
    assert places[right == -0.002].tolist() == [0.0, 18.0]
    with pytest.raises(ParameterError):
        Joints(side="both")  # type: ignore[arg-type]


def test_joints_come_every_rail_length() -> None:
    places = np.arange(-30, 100, 0.02)
    found = Joints(rail_length=18.0, depth=0.003).heights(places, np.random.default_rng(1))[0]
    dips = places[1:-1][(found[1:-1] < found[:-2]) & (found[1:-1] < found[2:]) & (found[1:-1] < -0.002)]
    assert dips == pytest.approx([-18, 0, 18, 36, 54, 72, 90], abs=0.011)


def test_crossings_come_as_often_as_stated_on_one_rail_or_both() -> None:
    places = np.arange(0.0, 200_000.0, 0.02)
    found = Crossings(per_kilometre=3.0, depth=0.003, share_of_both_rails=0.3).heights(places, np.random.default_rng(1))
    dips = (found[:, 1:-1] < np.minimum(found[:, :-2], found[:, 2:])) & (found[:, 1:-1] < -0.001)
    both, either = np.count_nonzero(dips.all(axis=0)), np.count_nonzero(dips.any(axis=0))
    assert either == pytest.approx(600, abs=75)
    assert both / either == pytest.approx(0.3, abs=0.06)
    assert found.min() == pytest.approx(-0.0045, rel=0.02)


def test_corrugation_has_its_size_and_its_waves_on_each_rail() -> None:
    places = np.arange(0.0, 4000.0, 0.02)
    found = Corrugation(wavelength=0.1, amplitude=3e-5, bandwidth=0.05).heights(places, np.random.default_rng(1))
    assert found.std(axis=1) == pytest.approx(3e-5, rel=0.02)
    assert np.mean(found[0] * found[1]) == pytest.approx(0.0, abs=0.05 * 3e-5**2)
    power = np.abs(np.fft.rfft(found[0])) ** 2
    n = np.fft.rfftfreq(places.size, 0.02)
    mean = np.average(n, weights=power)
    assert mean == pytest.approx(10.0, rel=0.01)
    assert np.sqrt(np.average((n - mean) ** 2, weights=power)) == pytest.approx(0.5, rel=0.05)


def test_a_wheel_on_corrugation_moves_by_its_size() -> None:
    """Through the points of the profile, and averaged over a contact of 1 cm: sin(pi / 10) / (pi / 10) of it."""
    speed, time = constant_speed(20.0), np.arange(0, 20, 1e-4)
    smooth = Rail(1e-12)
    track = SurfaceMotion(smooth, (0.0,), speed, contact_length=0.01, obstacles=(Corrugation(0.1, 1e-4, 0.02),))
    assert track.at(time, np.random.default_rng(2)).std(axis=1) == pytest.approx(1e-4 * np.sinc(0.1), rel=0.03)


def test_classes_of_the_fra_have_the_printed_spectra() -> None:
    """k A_v Wc^2 / (W^2 (W^2 + Wc^2)), cross level 4 k A_v Wc^2 / ((W^2 + Wc^2)(W^2 + Ws^2)), in cm^2 and rad/m."""
    W, k, Wc = np.array([0.1, 0.7, 3.0]), 0.25, 0.8245
    for name, A, Aa, Ws in (
        ("fra1", 1.2107, 3.3634, 0.6046),
        ("fra2", 1.0181, 1.2107, 0.9308),
        ("fra3", 0.6816, 0.4128, 0.8520),
        ("fra4", 0.5376, 0.3027, 1.1312),
        ("fra5", 0.2095, 0.0762, 0.8209),
        ("fra6", 0.0339, 0.0339, 0.4380),
    ):
        track, over_cycles = rail_quality(name), 2 * np.pi
        profile = over_cycles * 1e-4 * k * A * Wc**2 / (W**2 * (W**2 + Wc**2))
        cross_level = over_cycles * 1e-4 * 4 * k * A * Wc**2 / ((W**2 + Wc**2) * (W**2 + Ws**2))
        assert track.common(W / over_cycles) == pytest.approx(profile, rel=1e-3)
        assert 4 * track.differing(W / over_cycles) == pytest.approx(cross_level, rel=1e-3)
        alignment = over_cycles * 1e-4 * k * Aa * Wc**2 / (W**2 * (W**2 + Wc**2))
        assert rail_alignment(name).common(W / over_cycles) == pytest.approx(alignment, rel=1e-3)
    assert np.isfinite(heights(rail_quality("fra6"))).all()


@pytest.mark.slow
def test_rail_has_the_spectra_of_the_standard(conforms) -> None:
    """At W = 1 rad/m, half sum: A Wc^2 / ((1 + Wr^2)(1 + Wc^2)); over cycles times 2 pi."""
    n, left, right, cross = spectra(heights(rail_quality("bad")))
    vertical = 1.080e-6 * 0.8246**2 / ((1 + 0.0206**2) * (1 + 0.8246**2)) * 2 * np.pi
    near = np.abs(n - 1 / (2 * np.pi)) < 0.02
    common = ((left + right) / 2 + cross.real) / 2
    differing = ((left + right) / 2 - cross.real) / 2
    shape = rail_quality("bad").common(n[near]) / vertical
    found, what = np.mean(common[near] / shape), "vertical spectrum of 200 km of simulated bad track at 1 rad/m"
    conforms("ERRI B176", "high level", what, found, vertical, rel=0.1)
    shape = rail_quality("bad").differing(n[near]) / (vertical / (1 + 0.4380**2))
    found, what = np.mean(differing[near] / shape), "cross level of 200 km of simulated bad track at 1 rad/m"
    conforms("ERRI B176", "high level", what, found, vertical / (1 + 0.4380**2), rel=0.1)


@pytest.mark.slow
def test_a_rougher_right_track_has_its_level_and_keeps_the_left(class_c) -> None:
    n, left, right, cross = spectra(heights(road_class("C"), length=100e3, right_over_left=10 ** (2.5 / 20)))
    inside = (n > 0.03) & (n < 8)
    np.testing.assert_allclose(10 * np.log10(right[inside] / class_c[2][inside]), 2.5, rtol=1e-6, equal_nan=False)
    np.testing.assert_allclose(left, class_c[1], rtol=1e-6, atol=1e-12, equal_nan=False)
    # a factor of one track does not touch the coherence
    coherence, before = (np.abs(c[inside]) ** 2 / (a * b)[inside] for _, a, b, c in ((n, left, right, cross), class_c))
    np.testing.assert_allclose(coherence, before, rtol=1e-6, equal_nan=False)


def broken(side):
    return (Potholes(per_kilometre=2.0, side=side),)


@pytest.mark.slow
def test_potholes_keep_to_their_side() -> None:
    smooth = heights(road_class("A"), length=20e3)
    for side, row in (("left", 0), ("right", 1)):
        obstacles = heights(road_class("A"), length=20e3, obstacles=broken(side)) - smooth
        assert np.abs(obstacles[row]).max() > 0.01
        assert np.abs(obstacles[1 - row]).max() <= 1e-12


@pytest.fixture
def waves(tmp_path):
    """A file of waves of 4 m, twice as high at the left edge as in the middle and flat at the right one."""
    opencrg = pytest.importorskip("pyopencrg")
    path = tmp_path / "waves.crg"
    wave = {"length": 200.0, "width": 3.0, "u_inc": 0.05, "v_inc": 0.1}
    opencrg.generate.from_function(lambda u, v: 50 + 0.01 * np.sin(np.pi * u / 2) * (1 + v / 1.5), **wave).save(path)
    return path


def test_an_opencrg_file_gives_the_heights_under_the_wheels(waves) -> None:
    surface = read_surface(waves, half_track=0.75)
    x = np.arange(0.0, 200.0, 0.31)
    expected = 0.01 * np.sin(np.pi * x / 2) * np.array([[1.5], [0.5]])
    assert surface.at(x) == pytest.approx(expected, abs=3e-4)  # linear between points of 5 cm
    assert surface.at(400.0 - x) == pytest.approx(surface.at(x), abs=1e-9)  # back
    assert surface.at(-x) == pytest.approx(surface.at(x), abs=1e-9)
    profile = random_profile(surface, first=-50.0, last=450.0, generator=np.random.default_rng(1))
    assert profile.height(True, x) == pytest.approx(expected[0], abs=3e-4)


def test_unfit_opencrg_files_are_refused(waves, tmp_path) -> None:
    with pytest.raises(FormatError, match=r"known to 1.5 m beside its middle, and the wheels run at 1.6 m"):
        read_surface(waves, half_track=1.6)
    with pytest.raises(FormatError, match=r"cannot be read as OpenCRG: file not found"):
        read_surface(tmp_path / "none.crg", half_track=0.7)
    other = tmp_path / "other.crg"
    other.write_text("time,acc\n0,1\n")
    with pytest.raises(FormatError, match="cannot be read as OpenCRG"):
        read_surface(other, half_track=0.7)


def test_a_drive_on_an_opencrg_file_is_shaken_by_its_waves(waves, sprung, tmp_path) -> None:
    """At 10 m/s waves of 4 m are 2.5 Hz, and turn their sign every 20 s, at the ends of the surface."""
    words = ("--surface", waves, "--minutes", "1", "--speed", "9.99", "10.01", "--out", tmp_path / "drive.npz")
    assert sprung("simulate", "road", *words).code == 0
    run = read(tmp_path / "drive.npz")
    power = np.abs(np.fft.rfft(run.samples[:4] * np.hanning(run.n_samples), axis=1)) ** 2
    frequencies = np.fft.rfftfreq(run.n_samples, 1 / run.sampling_rate)
    assert frequencies[power.sum(axis=0).argmax()] == pytest.approx(2.5, abs=0.06)
    conditions = json.loads((tmp_path / "drive.npz.truth.json").read_text())["conditions"]
    assert conditions["road"] == {"surface": "waves.crg"}
    both = sprung("simulate", "road", *words, "--road", "A")
    assert (both.code, "give --surface or --road, not both" in both.err) == (2, True)
