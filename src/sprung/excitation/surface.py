"""Roads and tracks: random unevenness, potholes, joints, and the height that the wheels of a vehicle follow."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Literal, Protocol

import numpy as np
from numpy.typing import ArrayLike
from scipy.fft import irfft, next_fast_len, rfft

from sprung._arrays import Real
from sprung._checks import check_number, check_one_of, required
from sprung.errors import FormatError, ParameterError
from sprung.excitation.noise import FunctionOfTime
from sprung.excitation.route import SpeedProfile

if TYPE_CHECKING:
    from scipy.interpolate import CubicSpline

#: Roughness G(n0) of the road classes at n0 = 0.1 cycles/m, geometric mean [m^3] (ISO 8608:2016, table C.1).
ROAD_CLASSES: MappingProxyType[str, float] = MappingProxyType({name: 16e-6 * 4**k for k, name in enumerate("ABCDEFGH")})
#: Spatial frequency at which the roughness of a road is given, and the range in which it is uneven [1/m].
REFERENCE, LOWEST, HIGHEST = 0.1, 0.01, 10.0
#: Distance between the points of a profile [m], and its shortest length.
SPACING, _SHORTEST = 0.02, 1000.0
#: Largest number of points of a profile.
_MAX_POINTS = 2e8
#: Smallest number of points of a measured surface.
_SHORTEST_MEASURED = 51
#: Qualities of tracks, and the corner [rad/m] of those whose long waves have none.
RailQuality = Literal["good", "bad", "fra1", "fra2", "fra3", "fra4", "fra5", "fra6"]
_NO_CORNER = 1e-6
#: Tracks in the order of their rows.
_SIDES = ("left", "right")


class Surface(Protocol):
    """Unevenness of a left and a right track: spectra of its common and its differing part."""

    def common(self, spatial_frequency: Real) -> Real:
        """Return the one-sided spectral density of (left + right) / 2 over cycles/m [m^3]."""

    def differing(self, spatial_frequency: Real) -> Real:
        """Return the one-sided spectral density of (left - right) / 2 over cycles/m [m^3]."""


@dataclass(frozen=True, slots=True)
class Road:
    """Road of ISO 8608 with coherence between the left and the right track.

    Parameters
    ----------
    roughness
        One-sided displacement spectral density G(n0) at n0 = 0.1 cycles/m [m^3], above 0.
    waviness
        Exponent w of the spectral density, 0 to 5; 2 in the standard.
    coherence_length
        Length [m], at least 0, in the function g = exp(-coherence_length n) of the spatial frequency n.

    Raises
    ------
    ParameterError
        If a number is out of range.

    Notes
    -----
    G(n) = roughness (n / n0)^-waviness between 0.01 and 10 cycles/m, for both tracks. Their cross spectrum is G g, so
    that their half sum has the density G (1 + g) / 2 and their half difference G (1 - g) / 2; g^2 is the
    magnitude-squared coherence. An isotropic surface would have another g, fixed by G alone (Kamash and Robson).

    References
    ----------
    ISO 8608:2016, Mechanical vibration - Road surface profiles - Reporting of measured data.

    C. J. Dodds and J. D. Robson, The description of road surface roughness, Journal of Sound and Vibration 31 (1973),
    175-183.

    K. M. A. Kamash and J. D. Robson, The application of isotropy in road surface modelling, Journal of Sound and
    Vibration 57 (1978), 89-100.
    """

    roughness: float
    waviness: float = 2.0
    coherence_length: float = 1.5

    def __post_init__(self) -> None:
        check_number("roughness", self.roughness, above=0)
        check_number("waviness", self.waviness, at_least=0, at_most=5)
        check_number("coherence_length", self.coherence_length, at_least=0)

    def density(self, spatial_frequency: Real) -> Real:
        """Return the density G(n) of one track over cycles/m [m^3]; 0 outside 0.01 to 10 cycles/m."""
        inside = (spatial_frequency >= LOWEST) & (spatial_frequency <= HIGHEST)
        density = self.roughness * (np.maximum(spatial_frequency, LOWEST) / REFERENCE) ** -self.waviness
        return np.where(inside, density, 0.0)

    def coherence(self, spatial_frequency: Real) -> Real:
        """Return g(n), the cross spectrum of the tracks over their auto spectrum."""
        return np.exp(-self.coherence_length * spatial_frequency)

    def common(self, spatial_frequency: Real) -> Real:
        """Return the density of the half sum [m^3]."""
        return self.density(spatial_frequency) * (1 + self.coherence(spatial_frequency)) / 2

    def differing(self, spatial_frequency: Real) -> Real:
        """Return the density of the half difference [m^3]."""
        return self.density(spatial_frequency) * (1 - self.coherence(spatial_frequency)) / 2


def road_class(name: str) -> Road:
    """Return the road of a roughness class of ISO 8608, A (very good) to H (very poor).

    Parameters
    ----------
    name
        Letter of the class, in either case.

    Raises
    ------
    ParameterError
        If the class does not exist.

    References
    ----------
    ISO 8608:2016, Mechanical vibration - Road surface profiles - Reporting of measured data, table C.1.

    Examples
    --------
    >>> road_class("C").roughness
    0.000256
    """
    return Road(ROAD_CLASSES[check_one_of("road class", name.upper(), ROAD_CLASSES)])


def road_mix(text: str) -> tuple[tuple[float, float], ...]:
    """Return the roughness [m^3] and the share of each road in a mix of classes.

    Parameters
    ----------
    text
        A class of ISO 8608, or classes with their shares of the time, which add up to 1.

    Raises
    ------
    ParameterError
        If a class does not exist, or a share is no number.

    Examples
    --------
    >>> road_mix("B"), road_mix("A:0.3, C:0.7")
    (((6.4e-05, 1.0),), ((1.6e-05, 0.3), (0.000256, 0.7)))
    """
    mix = []
    for part in text.split(","):
        name, _, share = part.strip().partition(":")
        try:
            mix.append((road_class(name).roughness, float(share) if share or "," in text else 1.0))
        except ValueError as error:
            if isinstance(error, ParameterError):
                raise
            raise ParameterError(
                f"road {part.strip()!r} is no class with its share: give classes such as A:0.3,B:0.5,C:0.2"
            ) from None
    return tuple(mix)


@dataclass(frozen=True, slots=True)
class Rail:
    """Track with the irregularity spectra of ERRI B176 or of a class of the Federal Railroad Administration (FRA).

    Parameters
    ----------
    roughness
        Scale factor A of the spectra [m rad], above 0: 4.032e-7 for a good track, 1.080e-6 for a bad one.
    lowest, cross_level
        Corners Wr of long waves and Ws of the cross level [rad/m], above 0.

    Raises
    ------
    ParameterError
        If a number is not above 0.

    Notes
    -----
    One-sided densities over the angular spatial frequency W [rad/m]: A Wc^2 / ((W^2 + Wr^2)(W^2 + Wc^2)) of the
    vertical irregularity, and W^2 / (W^2 + Ws^2) times that of half the cross level, with Wc = 0.8246, Wr = 0.0206
    and Ws = 0.4380 rad/m. Over cycles/m they are 2 pi times larger. Those of the FRA have the same form without Wr.

    References
    ----------
    ERRI B176, Bogies with steered or steering wheelsets (1989); H. Claus and W. Schiehlen, Modeling and simulation of
    railway bogie structural vibrations, Vehicle System Dynamics 29 (1998), supplement, 538-552.
    """

    roughness: float
    lowest: float = 0.0206
    cross_level: float = 0.4380

    def __post_init__(self) -> None:
        for name in ("roughness", "lowest", "cross_level"):
            check_number(name, getattr(self, name), above=0)

    def common(self, spatial_frequency: Real) -> Real:
        """Return the density of the vertical irregularity [m^3]."""
        squared = (2 * np.pi * spatial_frequency) ** 2
        return 2 * np.pi * self.roughness * 0.8246**2 / ((squared + self.lowest**2) * (squared + 0.8246**2))

    def differing(self, spatial_frequency: Real) -> Real:
        """Return the density of half the cross level, as a height [m^3]."""
        squared = (2 * np.pi * spatial_frequency) ** 2
        return self.common(spatial_frequency) * squared / (squared + self.cross_level**2)


def rail_quality(name: str) -> Rail:
    """Return a "good" or a "bad" track of ERRI B176, or "fra1" to "fra6" of the classes of the FRA, see `Rail`.

    Raises
    ------
    ParameterError
        If there is no such quality.

    Notes
    -----
    FRA: A = k A_v with k = 0.25; Wc is printed as 0.8245. Figures of the profile are those of Berawi; corners of the
    cross level are of secondary literature, and were not compared with a source.

    The gauge is that of straight rails: to first order a wheelset on rails that are wider by e does not move sideways,
    as both of its wheels roll on radii smaller by the conicity times e / 2, and goes down by as much, 0.1 mm for a
    conicity of 0.05 and 4 mm.

    References
    ----------
    A. R. B. Berawi, Improving railway track maintenance using power spectral density (PSD), doctoral thesis, University
    of Porto (2013), as transcribed by D. Cantero, TTB-2D, SoftwareX 20 (2022).

    Examples
    --------
    >>> rail_quality("good").roughness
    4.032e-07
    >>> round(rail_quality("bad").common(0.1) / rail_quality("good").common(0.1), 3)  # at every spatial frequency
    2.679
    """
    tracks = {"good": Rail(4.032e-7), "bad": Rail(1.080e-6)}
    for quality, (level, _, corner) in _classes_of_the_fra().items():
        tracks[quality] = Rail(0.25e-4 * level, _NO_CORNER, corner)
    return tracks[check_one_of("rail quality", name, tracks)]


def rail_alignment(name: str) -> Rail:
    """Return the track whose `common` part is the spectrum of the alignment of a quality as of `rail_quality`.

    Notes
    -----
    FRA: A = k A_a, of secondary literature, not compared with a source.
    """
    tracks = {"good": Rail(2.119e-7), "bad": Rail(6.125e-7)}
    for quality, (_, alignment, _) in _classes_of_the_fra().items():
        tracks[quality] = Rail(0.25e-4 * alignment, _NO_CORNER)
    return tracks[check_one_of("rail quality", name, tracks)]


def _classes_of_the_fra() -> dict[str, tuple[float, float, float]]:
    """Return A_v and A_a of level and alignment [cm^2 rad/m], and the corner of the cross level [rad/m]."""
    return {
        "fra1": (1.2107, 3.3634, 0.6046),
        "fra2": (1.0181, 1.2107, 0.9308),
        "fra3": (0.6816, 0.4128, 0.8520),
        "fra4": (0.5376, 0.3027, 1.1312),
        "fra5": (0.2095, 0.0762, 0.8209),
        "fra6": (0.0339, 0.0339, 0.4380),
    }


@dataclass(frozen=True, eq=False, slots=True)
class MeasuredSurface:
    """Measured heights of a left and a right track; a drive that is longer goes back and forth over them.

    Parameters
    ----------
    name
        Name of the file.
    heights
        Heights of the left and the right track [m], shape (2, points), `SPACING` apart.
    """

    name: str
    heights: Real

    def at(self, positions: Real) -> Real:
        """Return the heights of left and right at positions [m], shape (2, points); the first one is at 0."""
        last = self.heights.shape[1] - 1
        places = np.abs((positions / SPACING + last) % (2 * last) - last)
        return np.array([np.interp(places, np.arange(last + 1), row) for row in self.heights])


def read_surface(path: str | Path, *, half_track: float) -> MeasuredSurface:
    """Return the surface of an OpenCRG file under the wheels of a vehicle that follows its reference line.

    Parameters
    ----------
    path
        File of ASAM OpenCRG (.crg), binary or text.
    half_track
        Distance of the wheels from the reference line [m], above 0.

    Raises
    ------
    FormatError
        If the file is no OpenCRG file, or its surface has no heights under the wheels.
    MissingPackageError
        If pyopencrg is not installed.

    Notes
    -----
    Heights are those of the grid: slope and banking of the road, which the body follows, are left out.

    References
    ----------
    ASAM OpenCRG 1.2 (curved regular grid).
    """
    check_number("half_track", half_track, above=0)
    opencrg = required("pyopencrg", purpose="reading OpenCRG files", extra="crg")
    try:
        road = opencrg.read(path)
    except (OSError, ValueError) as error:
        raise FormatError(f"{path} cannot be read as OpenCRG: {error}") from None
    along = road.u[0] + SPACING * np.arange(int(road.length / SPACING) + 1)
    widest = min(-road.v[0], road.v[-1])
    if widest < half_track:
        raise FormatError(f"{path} is known to {widest:g} m beside its middle, and the wheels run at {half_track:g} m")
    heights = np.array([road.uv_to_z(along, np.full(along.size, v), grid_only=True) for v in (half_track, -half_track)])
    if along.size < _SHORTEST_MEASURED or not np.isfinite(heights).all():
        raise FormatError(f"{path} is shorter than 1 m, or has no heights in the tracks of the wheels: crop it")
    return MeasuredSurface(Path(path).name, heights - heights[:, :1].mean())


@dataclass(frozen=True, eq=False)
class Profile:
    """Heights of a left and a right track along the road.

    Parameters
    ----------
    first
        Position of the first height [m].
    heights
        Heights of the left and the right track [m], shape (2, points), `SPACING` apart.
    """

    first: float
    heights: Real

    @cached_property
    def _splines(self) -> "CubicSpline":
        from scipy.interpolate import CubicSpline

        positions = self.first + SPACING * np.arange(self.heights.shape[1])
        return CubicSpline(positions, self.heights, axis=1)

    def height(self, is_left: bool, position: ArrayLike) -> Real:
        """Return the height of a track at positions [m], by a cubic spline through its points."""
        side = 0 if is_left else 1
        return self._splines.construct_fast(self._splines.c[..., side], self._splines.x)(np.asarray(position))


class Obstacle(Protocol):
    """Deterministic or rare unevenness of a road or track, added to its random profile."""

    def heights(self, positions: Real, generator: np.random.Generator) -> Real:
        """Return the heights of left and right at rising positions [m], shape (2, points) [m]."""


@dataclass(frozen=True, slots=True)
class Potholes:
    """Potholes and bumps at random positions.

    Parameters
    ----------
    per_kilometre
        Mean number per kilometre, on either side.
    depth
        Smallest and largest depth [m]; a share of them are bumps of that height.
    length
        Shortest and longest length [m].
    share_of_bumps
        Share that are bumps, 0 to 1.
    share_of_both_sides
        Share that extend over both tracks, 0 to 1; the others are on one side at random.
    side
        The only side that has potholes, "left" or "right"; None: as `share_of_both_sides` states.

    Raises
    ------
    ParameterError
        If a number is out of range, or the side is neither "left" nor "right".

    Notes
    -----
    Each has the shape depth (1 - cos(2 pi x / length)) / 2.
    """

    per_kilometre: float = 5.0
    depth: tuple[float, float] = (0.01, 0.04)
    length: tuple[float, float] = (0.4, 1.2)
    share_of_bumps: float = 0.3
    share_of_both_sides: float = 0.3
    side: Literal["left", "right"] | None = None

    def __post_init__(self) -> None:
        check_number("per_kilometre", self.per_kilometre, at_least=0)
        if self.side is not None:
            check_one_of("side of the potholes", self.side, _SIDES)
        for name in ("share_of_bumps", "share_of_both_sides"):
            check_number(name, getattr(self, name), at_least=0, at_most=1)

    def heights(self, positions: Real, generator: np.random.Generator) -> Real:
        """Return the heights of left and right at rising positions [m], shape (2, points) [m]."""
        heights = np.zeros((2, positions.size))
        span = positions[-1] - positions[0]
        for _ in range(generator.poisson(self.per_kilometre * span / 1000)):
            start, length = positions[0] + generator.uniform(0, span), generator.uniform(*self.length)
            height = generator.uniform(*self.depth) * (1 if generator.random() < self.share_of_bumps else -1)
            sides = [0, 1] if generator.random() < self.share_of_both_sides else [int(generator.integers(2))]
            if self.side is not None:
                sides = [_SIDES.index(self.side)]
            inside = slice(*np.searchsorted(positions, [start, start + length]))
            heights[sides, inside] += height * (1 - np.cos(2 * np.pi * (positions[inside] - start) / length)) / 2
        return heights


@dataclass(frozen=True, slots=True)
class Joints:
    """Dipped rail joints at equal distances on both rails, or on one.

    Parameters
    ----------
    rail_length
        Distance between joints [m].
    depth, length
        Depth and length of a dip [m]; it decays exponentially to both sides, with a kink at the joint.
    stagger
        Distance of the joints of the right rail ahead of those of the left one [m].
    side
        The only rail that has joints, "left" or "right"; None: both have.

    Raises
    ------
    ParameterError
        If a number is out of range, or the side is neither "left" nor "right".

    Notes
    -----
    Height -depth exp(-3 distance / length) at a distance from the nearest joint.
    """

    rail_length: float = 18.0
    depth: float = 0.002
    length: float = 0.3
    stagger: float = 0.0
    side: Literal["left", "right"] | None = None

    def __post_init__(self) -> None:
        if self.side is not None:
            check_one_of("side of the joints", self.side, _SIDES)
        for name in ("rail_length", "depth", "length"):
            check_number(name, getattr(self, name), above=0)

    def heights(self, positions: Real, generator: np.random.Generator) -> Real:
        """Return the heights of left and right at positions [m], shape (2, points) [m]."""
        del generator  # joints are regular
        places = np.subtract.outer([0.0, self.stagger], positions)  # of the left and of the right rail
        distance = np.abs((places + self.rail_length / 2) % self.rail_length - self.rail_length / 2)
        has_joints = np.array([[self.side in (None, side)] for side in _SIDES])
        return -self.depth * np.exp(-3 * distance / self.length) * has_joints


@dataclass(frozen=True, slots=True)
class Crossings:
    """Dips of crossing noses and single bad joints at random places of the rails.

    Parameters
    ----------
    per_kilometre
        Mean number per kilometre.
    depth, length
        Depth and length of a dip [m], of the shape of `Joints`; its depth is 0.5 to 1.5 times that.
    share_of_both_rails
        Share that are on both rails, 0 to 1; the others are on one of them at random.

    Raises
    ------
    ParameterError
        If a number is out of range.
    """

    per_kilometre: float = 3.0
    depth: float = 0.003
    length: float = 0.3
    share_of_both_rails: float = 0.3

    def __post_init__(self) -> None:
        check_number("per_kilometre", self.per_kilometre, at_least=0)
        check_number("share_of_both_rails", self.share_of_both_rails, at_least=0, at_most=1)
        for name in ("depth", "length"):
            check_number(name, getattr(self, name), above=0)

    def heights(self, positions: Real, generator: np.random.Generator) -> Real:
        """Return the heights of left and right at rising positions [m], shape (2, points) [m]."""
        heights = np.zeros((2, positions.size))
        span = positions[-1] - positions[0]
        for _ in range(generator.poisson(self.per_kilometre * span / 1000)):
            place, depth = positions[0] + generator.uniform(0, span), self.depth * generator.uniform(0.5, 1.5)
            rails = [0, 1] if generator.random() < self.share_of_both_rails else [int(generator.integers(2))]
            near = slice(*np.searchsorted(positions, [place - 4 * self.length, place + 4 * self.length]))
            heights[rails, near] -= depth * np.exp(-3 * np.abs(positions[near] - place) / self.length)
        return heights


@dataclass(frozen=True, slots=True)
class Corrugation:
    """Corrugation of both rails: unevenness in a narrow band of short waves.

    Parameters
    ----------
    wavelength
        Mean length of the waves [m], at least 0.06 m, three points of a profile.
    amplitude
        RMS of the height of each rail [m].
    bandwidth
        Standard deviation of the spatial frequency over its mean.

    Raises
    ------
    ParameterError
        If a number is out of range.

    Notes
    -----
    Gaussian noise of each rail, independent of the other, with a spectrum of the shape of Gauss's bell.

    References
    ----------
    S. L. Grassie and J. Kalousek, Rail corrugation: characteristics, causes and treatments, Proceedings of the
    Institution of Mechanical Engineers F 207 (1993), 57-68.
    """

    wavelength: float = 0.1
    amplitude: float = 2e-5
    bandwidth: float = 0.1

    def __post_init__(self) -> None:
        check_number("wavelength", self.wavelength, at_least=3 * SPACING)
        check_number("amplitude", self.amplitude, at_least=0)
        check_number("bandwidth", self.bandwidth, above=0, at_most=0.5)

    def heights(self, positions: Real, generator: np.random.Generator) -> Real:
        """Return the heights of left and right at rising positions [m], shape (2, points) [m]."""
        noise = rfft(generator.standard_normal((2, positions.size)), axis=1)
        n = np.arange(noise.shape[1]) / (positions.size * SPACING)
        noise *= np.exp(-(((n * self.wavelength - 1) / (2 * self.bandwidth)) ** 2))
        heights = irfft(noise, n=positions.size, axis=1)
        return np.asarray(self.amplitude * heights / heights.std(), dtype=np.float64)


def random_profile(
    surface: Surface | MeasuredSurface,
    *,
    first: float,
    last: float,
    generator: np.random.Generator,
    contact_length: float = 0.0,
    obstacles: Sequence[Obstacle] = (),
    right_over_left: float = 1.0,
) -> Profile:
    """Return a random profile of a road or track, or that of a measured surface.

    Parameters
    ----------
    surface
        Spectra of the unevenness, or measured heights.
    first, last
        Positions where the profile begins and ends [m].
    generator
        Source of the randomness.
    contact_length
        Length of the contact patch over which a wheel averages the profile [m]; 0 for none.
    obstacles
        Obstacles on the surface, such as potholes and joints.
    right_over_left
        Random unevenness of the right track over that prescribed, an amplitude ratio, above 0; obstacles are not
        scaled.

    Raises
    ------
    ParameterError
        If the ratio is not above 0, or the profile is too long to be held in memory.

    Notes
    -----
    The Fourier coefficients of the half sum and the half difference are independent and Gaussian, with the variances
    that the spectra prescribe; the average over a contact patch of length a multiplies them by sin(pi n a) / (pi n a).
    """
    check_number("right_over_left", right_over_left, above=0)
    n_points = next_fast_len(math.ceil(max(last - first, _SHORTEST) / SPACING) + 2, real=True)
    check_number("points of the profile", n_points, at_most=_MAX_POINTS, advice="simulate a shorter drive")
    n = np.arange(n_points // 2 + 1) / (n_points * SPACING)
    positions = np.asarray(first + SPACING * np.arange(n_points), dtype=np.float64)
    if isinstance(surface, MeasuredSurface):
        heights = surface.at(positions)
    else:
        draws = generator.standard_normal((2, 2, n.size))
        densities = np.stack([surface.common(n), surface.differing(n)])
        densities[:, n < LOWEST] = densities[:, n > HIGHEST] = 0.0
        # one-sided density G: each coefficient of the real transform has E|X|^2 = G n_points / (2 spacing)
        common, differing = (draws[:, 0] + 1j * draws[:, 1]) * np.sqrt(densities * n_points / (4 * SPACING))
        heights = irfft(np.stack([common + differing, right_over_left * (common - differing)]), n=n_points, axis=1)
    for obstacle in obstacles:
        heights = heights + obstacle.heights(positions, generator)
    if contact_length:
        heights = irfft(rfft(heights, axis=1) * np.sinc(n * contact_length), n=n_points, axis=1)
    return Profile(first, heights)


@dataclass(frozen=True, eq=False, slots=True)
class SurfaceMotion(FunctionOfTime):
    """Height of a road or track under each wheel of a vehicle that travels along it.

    Parameters
    ----------
    surface
        `Road`, `Rail` or `MeasuredSurface`.
    axle_positions
        Distance of each axle ahead of the centre of gravity, front to rear [m].
    speed
        Speed over time [m/s].
    contact_length
        Length of the contact patch over which a wheel averages the profile [m], at least 0.
    obstacles
        Obstacles on the surface, such as potholes and joints.
    right_over_left
        Random unevenness of the right track over that of `surface`, an amplitude ratio, above 0.

    Raises
    ------
    ParameterError
        If the axles are not in order from front to rear, or a number is out of range.

    Notes
    -----
    The wheel of axle j follows its track at distance(t) - (x_1 - x_j): the profile under the front wheel, delayed by
    the travel time of the wheelbase. Inputs are the corners front to rear, left before right.
    """

    surface: Surface | MeasuredSurface
    axle_positions: tuple[float, ...]
    speed: SpeedProfile
    contact_length: float = 0.1
    obstacles: tuple[Obstacle, ...] = ()
    right_over_left: float = 1.0

    def __post_init__(self) -> None:
        if not self.axle_positions or list(self.axle_positions) != sorted(self.axle_positions, reverse=True):
            raise ParameterError(f"axle_positions {self.axle_positions} must fall from front to rear: sort them")
        check_number("contact_length", self.contact_length, at_least=0)
        check_number("right_over_left", self.right_over_left, above=0)

    @property
    def n_inputs(self) -> int:
        """Number of inputs: two wheels on each axle."""
        return 2 * len(self.axle_positions)

    def at(self, time: Real, generator: np.random.Generator) -> Real:
        """Return the height under every wheel at rising times [s], shape (wheels, times) [m]."""
        distance = self.speed.distance(time)
        behind = self.axle_positions[0] - np.array(self.axle_positions)
        profile = random_profile(
            self.surface,
            first=distance[0] - behind[-1] - 1,
            last=distance[-1] + 1,
            generator=generator,
            contact_length=self.contact_length,
            obstacles=self.obstacles,
            right_over_left=self.right_over_left,
        )
        return np.stack([profile.height(is_left, distance - gap) for gap in behind for is_left in (True, False)])
