"""The golden car against closed forms."""

import numpy as np
import pytest
from scipy.linalg import expm
from scipy.signal import lfilter

from sprung.errors import DataError
from sprung.road import GOLDEN_CAR, road_class_of, roughness_index, suspension_slope


@pytest.mark.parametrize("wavelength", [2.0, 5.0, 12.0, 30.0])
def test_the_index_of_a_sine_is_that_of_the_response(wavelength, conforms) -> None:
    spacing, amplitude = 0.05, 0.005
    x = np.arange(0.0, 60 * wavelength, spacing)
    slope = suspension_slope(amplitude * np.sin(2 * np.pi * x / wavelength), spacing=spacing)[x.size // 2 :]
    response = np.abs(GOLDEN_CAR.response(np.array([1 / wavelength])))[0]
    found = np.sqrt(2 * np.mean(slope**2))
    what = f"slope of the golden car on waves of {wavelength:g} m against its response"
    conforms("ASTM E1926", "golden car", what, found, amplitude * response, rel=1e-4)


def test_the_motion_over_a_quarter_of_a_metre_is_the_printed_one(conforms) -> None:
    """M. W. Sayers, T. D. Gillespie, W. D. O. Paterson (1986), World Bank Technical Paper 46, for 250 mm.

    The first coefficient of the input is a difference of nearly equal numbers, printed to five valid digits.
    """
    printed = [
        [0.9966071, 0.01091514, -0.002083274, 0.0003190145],
        [-0.5563044, 0.9438768, -0.8324718, 0.05064701],
        [0.02153176, 0.002126763, 0.7508714, 0.008221888],
        [3.335013, 0.3376467, -39.12762, 0.4347564],
    ]
    A, B, _ = GOLDEN_CAR.matrices()
    moved = expm(A * 0.25 / GOLDEN_CAR.speed)
    entered = np.linalg.solve(A, (moved - np.eye(4)) @ B)[:, 0]
    source, clause = "World Bank Technical Paper 46", "coefficients of the IRI, 250 mm"
    conforms(source, clause, "state transition matrix of the golden car", moved, printed, rel=1e-6)
    conforms(source, clause, "its input", entered, [0.005476107, 1.388776, 0.2275968, 35.79262], rel=2e-5)


def test_the_response_is_that_of_the_quarter_car(conforms) -> None:
    """By its equations of motion, m z'' = forces, solved as two equations instead of by states."""
    n = 0.2
    w = 2 * np.pi * n * GOLDEN_CAR.speed
    k_t, k_s, c, m = GOLDEN_CAR.tyre, GOLDEN_CAR.spring, GOLDEN_CAR.damping, GOLDEN_CAR.unsprung
    spring = k_s + 1j * w * c
    body, wheel = np.linalg.solve([[spring - w**2, -spring], [-spring, k_t + spring - m * w**2]], [0.0, k_t])
    expected = 1j * w * (body - wheel) / GOLDEN_CAR.speed * np.sinc(n * GOLDEN_CAR.contact_length)
    found = GOLDEN_CAR.response(np.array([n]))
    conforms("ASTM E1926", "golden car", "response against two equations of motion", found, expected, rel=1e-12)


def test_a_constant_slope_moves_no_suspension() -> None:
    x = np.arange(0.0, 200.0, 0.05)
    assert np.abs(suspension_slope(3.0 + 0.02 * x, spacing=0.05)[:-10]).max() < 1e-9


def test_the_index_is_proportional_to_the_heights() -> None:
    heights = np.cumsum(np.random.default_rng(1).standard_normal(8000)) * 1e-3
    single, double = (roughness_index(scale * heights, spacing=0.05) for scale in (1.0, 2.0))
    assert single.shape == (4,)
    assert double == pytest.approx(2 * single)


def test_a_finer_profile_has_the_same_index() -> None:
    x = np.arange(0.0, 200.0, 0.01)
    lengths = np.array([1.7, 4.3, 9.1, 21.0])[:, None]
    heights = np.sum(0.01 * np.sin(2 * np.pi * x / lengths + lengths), axis=0)
    fine, coarse = (roughness_index(heights[::step], spacing=0.01 * step) for step in (1, 10))
    assert coarse == pytest.approx(fine, rel=1.5e-2)  # straight lines between points of 10 cm


def test_a_short_profile_is_refused() -> None:
    with pytest.raises(DataError, match="shorter than a stretch"):
        roughness_index(np.zeros(100), spacing=0.05)


def test_classes_end_where_the_standard_says(conforms) -> None:
    """In 1e-6 m^3; the change of the name lies within a part in a million."""
    printed = np.array([32, 128, 512, 2048, 8192, 32768, 131072])
    around = [[road_class_of(limit * 1e-6 * (1 + side)) for side in (-1e-6, 1e-6)] for limit in printed]
    named = ["ABCDEFGH".index(name) for pair in around for name in pair]
    what = "numbers of the classes a millionth below and above each limit of G(n0)"
    conforms("ISO 8608:2016", "table C.1", what, named, [k + side for k in range(7) for side in (0, 1)], absolute=0)


@pytest.mark.parametrize(("roughness", "name"), [(16e-6, "A"), (33e-6, "B"), (256e-6, "C"), (1.0, "H")])
def test_classes(roughness, name) -> None:
    assert road_class_of(roughness) == name


def waves(*terms: tuple[float, float, float]):
    """Return the mean height over the tyre's contact of waves (1/m, m, rad), at places [m], and the heights."""
    n, size, phase = (np.array(column)[:, None] for column in zip(*terms, strict=True))

    def height(x):
        return np.concatenate([np.sum(size * np.sin(2 * np.pi * n * p + phase), axis=0) for p in np.split(x, 50)])

    def mean(x):
        share = np.sinc(n * GOLDEN_CAR.contact_length)
        return np.concatenate(
            [np.sum(share * size * np.sin(2 * np.pi * n * p + phase), axis=0) for p in np.split(x, 50)]
        )

    return height, mean


def step_of(size: float, place: float):
    """Return the mean height over the tyre's contact of a step, at places [m], and the heights."""
    half = GOLDEN_CAR.contact_length / 2
    return lambda x: size * (x > place), lambda x: size * np.clip((x - place + half) / (2 * half), 0, 1)


def iso_road(roughness: float):
    """Return a road of ISO 8608 as 400 waves between 0.011 and 2.83 1/m, as `waves` does."""
    edges = np.geomspace(0.011, 2.83, 401)
    n, width = np.sqrt(edges[1:] * edges[:-1]), np.diff(edges)
    sizes = np.sqrt(2 * roughness * (n / 0.1) ** -2 * width)
    return waves(*zip(n, sizes, np.random.default_rng(4).uniform(0, 2 * np.pi, n.size), strict=True))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("what", "road"),
    [
        ("waves of 2, 5, 12 and 30 m", waves(*((1 / length, 0.005, length) for length in (2.0, 5.0, 12.0, 30.0)))),
        ("a step of 10 mm", step_of(0.01, 150.0)),
        *((f"a road of class {name}", iso_road(4.0**k * 16e-6)) for k, name in enumerate("ABCDE")),
    ],
)
def test_the_index_of_samples_is_that_of_the_continuous_profile(what, road, conforms) -> None:
    """Motion of the golden car over the profile itself in steps of 1 mm, not over its samples.

    F. Sroubek, M. Sorel, J. Zak, Precise International Roughness Index calculation, International Journal of Pavement
    Research and Technology 15 (2022) 1413-1419 (the index as a property of the continuous profile).
    """
    height, mean = road
    fine, spacing, length = 1e-3, 0.05, 400.0
    x = np.arange(0.0, length, fine)
    A, B, C = GOLDEN_CAR.matrices()
    start = mean(np.zeros(50))[0]
    u = mean(x) - start
    poles, vectors = np.linalg.eig(A)
    forces, outputs = np.linalg.solve(vectors, B)[:, 0], (C @ vectors)[0]
    slope = np.zeros(x.size, complex)
    for pole, force, output in zip(poles, forces, outputs, strict=True):
        factor = np.exp(pole * fine / GOLDEN_CAR.speed)  # the profile is constant over a step of 1 mm
        middles = 0.5 * (u[1:] + u[:-1]) * force * (factor - 1) / pole
        slope[1:] += output * lfilter([1.0], [1.0, -factor], middles)
    exact = 1000 * np.abs(slope.real).reshape(4, -1).mean(axis=1)[2:] / GOLDEN_CAR.speed
    found = roughness_index(height(np.arange(0.0, length, spacing)), spacing=spacing)[2:]
    conforms(
        "Sroubek et al. 2022",
        "precise IRI",
        f"index of {what} from samples every 5 cm",
        found,
        exact,
        absolute=0.01,
        unit="m/km",
    )
