"""International Roughness Index of a profile, and classes of ISO 8608."""

from dataclasses import dataclass

import numpy as np
from scipy import signal
from scipy.interpolate import CubicSpline

from sprung._arrays import Complex, Real
from sprung._checks import check_number, check_type
from sprung.errors import DataError


@dataclass(frozen=True, slots=True)
class GoldenCar:
    """Quarter vehicle whose motion defines the index, per kilogram of body."""

    #: Stiffness of tyre and spring [1/s^2], damping [1/s], unsprung over sprung mass.
    tyre: float = 653.0
    spring: float = 63.3
    damping: float = 6.0
    unsprung: float = 0.15
    #: Speed [m/s], and length over which the tyre averages the profile [m].
    speed: float = 80 / 3.6
    contact_length: float = 0.25

    def matrices(self) -> tuple[Real, Real, Real]:
        """Return A, B and C from heights [m] to the velocity of the suspension [m/s]; states z_s, z_s', z_u, z_u'."""
        k_t, k_s, c, m = self.tyre, self.spring, self.damping, self.unsprung
        A = np.array(
            [
                [0.0, 1.0, 0.0, 0.0],
                [-k_s, -c, k_s, c],
                [0.0, 0.0, 0.0, 1.0],
                [k_s / m, c / m, -(k_s + k_t) / m, -c / m],
            ]
        )
        return A, np.array([[0.0], [0.0], [0.0], [k_t / m]]), np.array([[0.0, 1.0, 0.0, -1.0]])

    def response(self, spatial_frequency: Real) -> Complex:
        """Return the slope of the suspension for a sine of 1 m over spatial frequencies [1/m], in 1/m."""
        A, B, C = self.matrices()
        s = 2j * np.pi * np.asarray(spatial_frequency) * self.speed
        inverse = np.linalg.inv(s[..., None, None] * np.eye(4) - A)
        averaged = np.sinc(np.asarray(spatial_frequency) * self.contact_length)
        return np.asarray((C @ inverse @ B)[..., 0, 0] * averaged / self.speed)


GOLDEN_CAR = GoldenCar()
#: Distance after which the golden car has forgotten where it started [m].
RUN_IN = 20.0
#: Roughness G(n0) at which each class of ISO 8608 ends [m^3].
CLASS_LIMITS = tuple(32e-6 * 4**k for k in range(7))


def suspension_slope(heights: Real, *, spacing: float) -> Real:
    """Return the slope of the golden car's suspension along a profile.

    Parameters
    ----------
    heights
        Heights [m], shape (points,).
    spacing
        Distance between points [m], above 0.

    Returns
    -------
    ndarray
        Velocity of the suspension over the speed [m/m], shape (points,).

    Notes
    -----
    The profile, a spline through its points, is averaged over 0.25 m, the averages are joined by straight lines, and
    the motion between them is exact (first-order hold). The car starts at rest on the slope of the first 11 m.

    References
    ----------
    M. W. Sayers, On the calculation of International Roughness Index from longitudinal road profile, Transportation
    Research Record 1501 (1995) 1-12. ASTM E1926-08.
    F. Sroubek, M. Sorel, J. Zak, Precise International Roughness Index calculation, International Journal of Pavement
    Research and Technology 15 (2022) 1413-1419.
    """
    check_number("spacing", spacing, above=0)
    half = GOLDEN_CAR.contact_length / 2
    n_more = int(np.ceil(half / spacing))  # the profile goes on straight at both ends
    places = spacing * np.arange(-n_more, heights.size + n_more)
    longer = np.pad(heights, n_more, mode="reflect", reflect_type="odd")
    area = CubicSpline(places, longer).antiderivative()
    smooth = (area(places + half) - area(places - half))[n_more : n_more + heights.size] / (2 * half)
    A, B, C = GOLDEN_CAR.matrices()
    step = spacing / GOLDEN_CAR.speed
    a, b, c, d, _ = signal.cont2discrete((A, B, C, np.zeros((1, 1))), step, method="foh")
    n_first = min(smooth.size - 1, round(11.0 / spacing))
    slope = (smooth[n_first] - smooth[0]) / max(n_first * spacing, spacing)
    level = (
        smooth - smooth[0] - slope * spacing * np.arange(heights.size)
    )  # at rest on the first slope, which moves nothing
    numerator, denominator = signal.ss2tf(a, b, c, d)
    return np.asarray(signal.lfilter(numerator[0], denominator, level)) / GOLDEN_CAR.speed


def roughness_index(heights: Real, *, spacing: float, stretch: float = 100.0) -> Real:
    """Return the International Roughness Index of stretches of a profile.

    Parameters
    ----------
    heights
        Heights of one track [m], shape (points,).
    spacing
        Distance between points [m], above 0; at most 0.25 m for an exact index.
    stretch
        Length of a stretch [m].

    Returns
    -------
    ndarray
        Index [m/km = mm/m] of each whole stretch.

    Raises
    ------
    DataError
        If the profile is shorter than a stretch.

    Notes
    -----
    Mean size of the slope of the golden car's suspension, see `suspension_slope`.

    References
    ----------
    ASTM E1926-08, Standard practice for computing International Roughness Index of roads.

    Examples
    --------
    A sine of 1 cm amplitude and 10 m, where the golden car's suspension moves 1.25 times as steeply as the road:

    >>> import numpy as np
    >>> x = np.arange(0.0, 400.0, 0.05)
    >>> roughness_index(0.01 * np.sin(2 * np.pi * x / 10), spacing=0.05).round(1).tolist()
    [5.0, 5.0, 5.0, 5.0]
    """
    check_type("heights", heights, np.ndarray, advice="an array of heights in m")
    n_points = round(check_number("stretch", stretch, above=spacing) / spacing)
    if heights.size < n_points:
        raise DataError(f"a profile of {heights.size * spacing:.0f} m is shorter than a stretch of {stretch:g} m")
    slopes = np.abs(suspension_slope(heights, spacing=spacing))
    whole = heights.size // n_points
    return np.asarray(1000 * slopes[: whole * n_points].reshape(whole, n_points).mean(axis=1))


def road_class_of(roughness: float) -> str:
    """Return the class of ISO 8608, A to H, of a roughness G(n0) [m^3]."""
    return "ABCDEFGH"[int(np.searchsorted(CLASS_LIMITS, roughness))]
