"""Roughness of a road (IRI, classes of ISO 8608) or level of a track from the profile under a vehicle, and potholes."""

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np

from sprung._arrays import Booleans, Complex, Real
from sprung._checks import check_number, check_type
from sprung._display import counted
from sprung.errors import DataError, ParameterError
from sprung.likelihood import CornerFit
from sprung.likelihood.fitting import fit_windows
from sprung.likelihood.lateral import fit_lateral_under
from sprung.recording import Recording, each_recording
from sprung.road.level import Levels, TrackLevel
from sprung.road.profile import RoadProfile, road_profile
from sprung.road.tracks import Section, Track, Ways, track_of, whole_sections
from sprung.vehicles import Vehicle
from sprung.vehicles.window import Window, window_of


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
    #: Longest straight line by which a profile is joined [m]: of 5 cm they make the index of a road 0.2 % smaller.
    longest_line: float = 0.01

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
    The profile, a spline through its points, is averaged over 0.25 m, averages at most 1 cm apart are joined by
    straight lines, and the motion between them is exact (first-order hold). The car starts at rest on the slope of the
    first 11 m.

    References
    ----------
    M. W. Sayers, On the calculation of International Roughness Index from longitudinal road profile, Transportation
    Research Record 1501 (1995) 1-12. ASTM E1926-08.
    F. Sroubek, M. Sorel, J. Zak, Precise International Roughness Index calculation, International Journal of Pavement
    Research and Technology 15 (2022) 1413-1419.
    """
    from scipy import signal
    from scipy.interpolate import CubicSpline

    check_number("spacing", spacing, above=0)
    half = GOLDEN_CAR.contact_length / 2
    n_more = int(np.ceil(half / spacing))  # the profile goes on straight at both ends
    places = spacing * np.arange(-n_more, heights.size + n_more)
    longer = np.pad(heights, n_more, mode="reflect", reflect_type="odd")
    area = CubicSpline(places, longer).antiderivative()
    finer = int(np.ceil(spacing / GOLDEN_CAR.longest_line))
    along = np.arange((heights.size - 1) * finer + 1) * (spacing / finer)
    smooth = (area(along + half) - area(along - half)) / (2 * half)
    A, B, C = GOLDEN_CAR.matrices()
    step = spacing / finer / GOLDEN_CAR.speed
    a, b, c, d, _ = signal.cont2discrete((A, B, C, np.zeros((1, 1))), step, method="foh")
    first = min(smooth.size - 1, round(11.0 / spacing) * finer)
    slope = (smooth[first] - smooth[0]) / max(along[first], spacing)
    level = smooth - smooth[0] - slope * along  # at rest on the first slope, which moves nothing
    numerator, denominator = signal.ss2tf(a, b, c, d)
    moved = signal.lfilter(numerator[0], denominator, level)
    return np.asarray(moved[::finer]) / GOLDEN_CAR.speed


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


@dataclass(frozen=True, slots=True)
class SurveySettings:
    """How stretches and events are judged."""

    #: Largest share of a stretch on which the vehicle is too slow, or that has no heights.
    slow: float = 0.1
    #: Spatial frequency of the roughness [1/m], and waviness of the standard's classes.
    reference: float = 0.1
    waviness: float = 2.0
    #: Spatial frequencies between which roughness and waviness are estimated [1/m].
    band: tuple[float, float] = (0.05, 1.0)
    #: Length over which the size of the golden car's motion is independent [m].
    independent: float = 2.0
    #: Wavelengths of events [m]; smallest depth [m], and smallest one over the scatter of the heights in 50 m.
    event: tuple[float, float] = (0.3, 3.0)
    depth: float = 0.008
    over_scatter: float = 5.0
    nearby: float = 50.0
    #: Smallest depth of an isolated defect of a track, the distance between two of them, or of both rails, and the
    #: length over which the scatter of the level counts [m].
    defect: float = 0.003
    apart: float = 3.0
    along: float = 200.0
    #: Lengths of dips and bumps that are fitted [m], and the largest one of a joint, a dip across both tracks.
    lengths: tuple[float, ...] = (0.3, 0.4, 0.5, 0.65, 0.8, 1.0, 1.25, 1.6, 2.0, 2.5, 3.0)
    joint: float = 0.8


SETTINGS = SurveySettings()


@dataclass(frozen=True, slots=True)
class TrackRoughness:
    """Roughness of one track on one stretch.

    Parameters
    ----------
    iri, iri_std
        International Roughness Index [m/km] and its standard deviation.
    roughness, waviness
        G(n0) at 0.1 cycles/m [m^3], and exponent of the spectrum.
    road_class
        Class of ISO 8608, A to H.
    iri_scatter
        Standard deviation of the index between passes; None for one pass.
    """

    iri: float
    iri_std: float
    roughness: float
    waviness: float
    road_class: str
    iri_scatter: float | None = None


@dataclass(frozen=True, slots=True)
class Stretch:
    """A stretch of the road.

    Parameters
    ----------
    begin, end
        Distance from the start of the recordings, or address on the ways [m].
    begin_time, end_time
        Time from the start of the recordings [s].
    left, right
        `TrackRoughness` of both tracks of a road, `TrackLevel` of both rails.
    alignment
        Alignment of a track, the lateral displacement of its centre line, as a level; None where it was not measured.
    n_passes
        Number of passes that are averaged.
    begin_place, end_place
        Latitude and longitude [degrees] of the vehicle there; None where the recordings do not have them.
    """

    begin: float
    end: float
    begin_time: float
    end_time: float
    left: Any
    right: Any
    n_passes: int = 1
    begin_place: tuple[float, float] | None = None
    end_place: tuple[float, float] | None = None
    alignment: TrackLevel | None = None

    @property
    def lines(self) -> dict[str, Any]:
        """What was measured along the way, by name: left, right, and the alignment where it was."""
        lines = {"left": self.left, "right": self.right}
        return lines if self.alignment is None else lines | {"alignment": self.alignment}


@dataclass(frozen=True, slots=True)
class RoadEvent:
    """A pothole, a bump or a joint of a road; a dip or a hump of a track.

    Parameters
    ----------
    at, time
        Distance [m] and time [s] of its middle.
    side
        "left", "right" or "both".
    kind
        "pothole", "bump", or "joint": a step, or a dip of at most 0.8 m across both tracks. Of a track "dip" or "hump".
    depth, length
        Depth or height, and length [m]; 0 for a step. Of a track those of its level in D1, the length at half depth.
    place
        Latitude and longitude [degrees]; None where the recordings do not have them.
    n_passes
        Number of passes that found it.
    """

    at: float
    time: float
    side: Literal["left", "right", "both"]
    kind: Literal["pothole", "bump", "joint", "dip", "hump"]
    depth: float
    length: float
    place: tuple[float, float] | None = None
    n_passes: int = 1


@dataclass(frozen=True, slots=True)
class RoadSurvey:
    """The road under a vehicle.

    Parameters
    ----------
    stretches
        Stretches on which the vehicle was fast enough, in the order of the way.
    events
        Potholes, bumps and joints; of a track isolated defects.
    notes
        Limits, one sentence each.
    """

    stretches: tuple[Stretch, ...]
    events: tuple[RoadEvent, ...]
    notes: tuple[str, ...] = ()

    @property
    def is_of_track(self) -> bool:
        """Whether its stretches have the level of a track instead of the roughness of a road."""
        return bool(self.stretches) and isinstance(self.stretches[0].left, TrackLevel)


def survey_road(
    recordings: Recording | Iterable[Recording],
    vehicle: Vehicle,
    *,
    stretch: float | None = None,
    ways: Ways | None = None,
    allow_missing: bool = False,
) -> RoadSurvey:
    """Return the roughness of the road under a vehicle, and its potholes; or the level of the track.

    Parameters
    ----------
    recordings
        Drive with the speed, in one recording or several in the order of time. For several passes over one road, see
        `survey_passes`.
    vehicle
        Vehicle with its sensors: calibrated, or described by a data sheet.
    stretch
        Length of a stretch [m], at least 20; None: 100, of a track 200.
    ways
        Ways, with stretches of the same length, whose addresses take the place of the distance; None: no ways.
    allow_missing
        Whether the recordings may lack sensors of the vehicle file.

    Returns
    -------
    RoadSurvey

    Raises
    ------
    DataError
        If the speed is missing, or the drive is too short or too slow.
    ParameterError
        If the length of a stretch is out of range.

    Notes
    -----
    First the vehicle is fitted to the drive, then the profile of the road follows from its motion (`road_profile`), and
    from it the International Roughness Index, whose square is increased by the share of the golden car's motion that
    the density of the error takes away. Its standard deviation has two parts: that error, and the uncertain parameters
    of the fitted vehicle, which all stretches of a drive have in common. Roughness and class are the mean of G(n) (n /
    n0)^2 between wavelengths of 20 and 1 m. An event is a height of 8 mm and five times the scatter around it, in
    wavelengths of 0.3 to 3 m; its kind, place and size are those of the dip, bump or step that fits it best.

    Under a rail vehicle, stretches have the standard deviations of the longitudinal level of both rails in the ranges
    D1 and D2 (`TrackLevel`) instead, which the density of the error increases likewise, and events are isolated
    defects: peaks of the level in D1 of 3 mm and five times the scatter around them. What several vehicles find at one
    place is of the track. Where the vehicle has lateral tables and sensors, its lateral motion is fitted
    (`fit_lateral`) and inverted likewise, to the alignment of the track's centre line.

    References
    ----------
    ASTM E1926-08; ISO 8608:2016; EN 13848-1:2019.

    Examples
    --------
    A minute on a road of class C, whose index lies near 2.2 sqrt(G(n0) / 16e-6):

    >>> from sprung.simulation import RoadConditions, RoadDrive, simulate_drive
    >>> from sprung.vehicles import read_vehicle
    >>> car = read_vehicle("zafira")
    >>> drive = simulate_drive(car, RoadDrive(duration=60.0, sampling_rate=100.0, road=RoadConditions("C")), seed=1)
    >>> survey = survey_road(drive.recording, car)
    >>> survey.stretches[1].left.road_class, 6 < survey.stretches[1].left.iri < 12
    ('C', True)
    """
    is_track = vehicle.kind == "rail"
    if vehicle.kind == "rig":
        raise ParameterError(
            f"vehicle {vehicle.name!r} is on a rig, under which no road is: state its kind, road or rail"
        )
    stretch = default_stretch(vehicle) if stretch is None else check_number("stretch", stretch, at_least=20)
    records = list(each_recording(recordings))
    windows = [window_of(record, vehicle, allow_missing=allow_missing) for record in records]
    track = track_of(windows)
    fit = fit_windows(windows)
    profile = road_profile(windows, fit, track)
    levels = Levels(profile, fit.model_error) if is_track else None
    measure = _roughness_of(profile) if levels is None else levels.at
    aligned, reasons = _alignment(windows, fit, track)
    if ways is None:
        whole = np.array([0.0, track.distances[-1]])
        sections = whole_sections(whole, whole, stretch)
    else:
        sections = ways.sections(track)
    stretches, slow = [], 0
    for section in sections:
        part = _part(profile, section)
        if part is None:
            continue
        if np.mean(~profile.is_valid[part]) > SETTINGS.slow:
            slow += 1
            continue
        begun, ended = profile.times[[part.start, part.stop - 1]].tolist()
        where = section.begin, section.begin + stretch, begun, ended
        places = track.place(begun), track.place(ended)
        stretches.append(Stretch(*where, measure(0, part), measure(1, part), 1, *places, aligned(section)))
    if not stretches:
        if ways is not None and not sections:
            raise DataError(f"the drive is on no way for {stretch:g} m: give latitude and longitude [degrees]")
        raise DataError(f"no stretch of {stretch:g} m was driven fast enough: give a longer or faster drive")
    found = _events(profile) if levels is None else _defects(profile, levels)
    events = [replace(event, place=track.place(event.time)) for event in found]
    if ways is not None:
        events = [replace(event, at=at) for event in events for at in _addresses(event.at, sections)]
    notes = (f"too slow: {counted(slow, 'stretch', 'es')}",) * (slow > 0)
    of_windows = dict.fromkeys(note for window in windows for note in window.notes)
    notes = (*of_windows, *notes, *_vehicle_notes(vehicle, fit.model_error), *reasons)
    return RoadSurvey(tuple(stretches), tuple(events), notes)


def _part(profile: RoadProfile, section: Section) -> slice | None:
    """Return the part of a profile on a section of the way; None where too much of it is missing."""
    part = slice(*np.searchsorted(profile.distances, [section.first, section.last]).tolist())
    share = (part.stop - part.start) * profile.spacing / max(section.last - section.first, profile.spacing)
    return None if share < 1 - SETTINGS.slow else part


def _alignment(
    windows: Sequence[Window], fit: CornerFit, track: Track
) -> tuple[Callable[[Section], TrackLevel | None], tuple[str, ...]]:
    """Return what gives the alignment of a section, where the windows show it, and why they do not."""
    try:
        sideways = fit_lateral_under(fit, windows)
        profile = None if sideways is None else road_profile(windows, sideways, track)
    except DataError as error:
        return lambda _: None, (f"no alignment: {error}",)
    if sideways is None or profile is None:
        return lambda _: None, ()
    levels = Levels(profile, sideways.model_error)

    def measure(section: Section) -> TrackLevel | None:
        part = _part(profile, section)
        return None if part is None or np.mean(~profile.is_valid[part]) > SETTINGS.slow else levels.at(0, part)

    return measure, sideways.notes


def default_stretch(vehicle: Vehicle) -> float:
    """Return the usual length of a stretch [m]: 100 on roads, 200 on tracks (EN 13848-6)."""
    return 200.0 if vehicle.kind == "rail" else 100.0


def _addresses(at: float, sections: Sequence[Section]) -> list[float]:
    """Return the address of a distance along a drive; none where the drive is on no whole stretch."""
    return [section.begin + at - section.first for section in sections if section.first <= at < section.last]


def _slopes(profile: RoadProfile) -> tuple[Real, Booleans]:
    """Return the slopes of the golden car's suspension, and where it has forgotten where it started."""
    slopes, is_settled = np.zeros_like(profile.heights), np.ones(profile.times.size, dtype=bool)
    for block in profile.blocks():
        slopes[:, block] = [suspension_slope(row[block], spacing=profile.spacing) for row in profile.heights]
        is_settled[block.start : min(block.start + round(RUN_IN / profile.spacing), block.stop)] = False
    return slopes, is_settled


def _vehicle_notes(vehicle: Vehicle, model_error: float) -> tuple[str, ...]:
    if model_error < 0.1:
        return ()
    advice = ": calibrate it on several drives" if vehicle.axle else ""
    return (f"the fitted spectra deviate {100 * model_error:.0f} % more than chance allows{advice}",)


def _roughness_of(profile: RoadProfile) -> Callable[[int, slice], TrackRoughness]:
    """Return what gives the roughness of a track on a part of a profile."""
    slopes, is_settled = _slopes(profile)

    def measure(side: int, part: slice) -> TrackRoughness:
        settled = np.arange(part.start, part.stop)[is_settled[part]]
        inside = settled if settled.size else np.arange(part.start, part.stop)
        return _roughness(profile, slopes[side, inside], side, part)

    return measure


def _roughness(profile: RoadProfile, slopes: Real, side: int, part: slice) -> TrackRoughness:
    """Return the roughness of one track on one stretch with its slopes."""
    found = float(np.mean(np.abs(slopes)))
    missing, n, density = _missing(profile, side, float(np.median(profile.speeds[part])))
    share = missing / max(float(np.mean(slopes**2)), 1e-300)
    index = 1000 * found * np.sqrt(1 + share)
    n_independent = max(1.0, slopes.size * profile.spacing / SETTINGS.independent)
    gain = np.abs(GOLDEN_CAR.response(n)) ** 2 * n**-SETTINGS.waviness
    of_fit = profile.sensitivity[:, side] @ (gain / gain.sum()) / 2
    std = index * np.sqrt(share / n_independent + np.sum(of_fit**2))
    roughness, waviness = _fitted_spectrum(profile.heights[side, part], profile.spacing, n, density)
    return TrackRoughness(float(index), float(std), roughness, waviness, road_class_of(roughness))


def _missing(profile: RoadProfile, side: int, speed: float) -> tuple[float, Real, Real]:
    """Return the mean square of the golden car's slope that the error takes away, and its density over 1/m."""
    row = int(np.argmin(np.abs(np.log(profile.at_speeds / speed))))
    n, density = profile.frequencies / speed, profile.missing_density[side, row] * speed
    gain = np.abs(GOLDEN_CAR.response(n)) ** 2
    return float(np.trapezoid(gain * density, n)), n, density


def _fitted_spectrum(heights: Real, spacing: float, n_missing: Real, missing: Real) -> tuple[float, float]:
    """Return the roughness [m^3] for the standard's waviness, and the waviness, of a spectrum with what is missing."""
    from scipy import signal

    detrended = signal.detrend(heights)
    window = signal.windows.hann(heights.size, sym=False)
    power = np.abs(np.fft.rfft(detrended * window)) ** 2 * 2 * spacing / np.sum(window**2)
    n = np.fft.rfftfreq(heights.size, spacing)
    inside = (n >= SETTINGS.band[0]) & (n <= SETTINGS.band[1])
    n, density = n[inside], power[inside] + np.interp(n[inside], n_missing, missing)
    roughness = float(np.mean(density * (n / SETTINGS.reference) ** SETTINGS.waviness))
    slope = np.polyfit(np.log(n), np.log(density), 1, w=1 / np.sqrt(n))[0]
    return roughness, float(-slope)


_SIDES: tuple[Literal["left", "right"], ...] = ("left", "right")


def _events(profile: RoadProfile) -> tuple[RoadEvent, ...]:
    """Return the potholes, bumps and joints of a profile."""
    from scipy import signal

    longest, shortest = 1 / SETTINGS.event[1], 1 / SETTINGS.event[0]
    sos = signal.butter(2, (longest, shortest), "bandpass", fs=1 / profile.spacing, output="sos")

    def filtered(block: slice) -> Real:
        return np.asarray(signal.sosfiltfilt(sos, profile.heights[:, block], axis=1) * profile.is_valid[block])

    found: list[RoadEvent] = []
    for block, side, row, peak in _peaks(
        profile, filtered, least=SETTINGS.depth, apart=SETTINGS.event[1], nearby=SETTINGS.nearby
    ):
        speed = profile.speeds[block.start + peak]
        length, size, offset = _shape(row, peak, profile.frequencies[-1] / speed, sos, profile.spacing)
        place = block.start + min(max(peak + offset, 0), row.size - 1)
        at, time = (float(each[place]) for each in (profile.distances, profile.times))
        kind: Literal["pothole", "bump", "joint"] = "joint" if not length else "bump" if size > 0 else "pothole"
        found.append(RoadEvent(at, time, _SIDES[side], kind, abs(size), length))
    return tuple(_on_both_sides(found, within=SETTINGS.event[0]))


def _defects(profile: RoadProfile, levels: Levels) -> tuple[RoadEvent, ...]:
    """Return the isolated defects of a track: peaks of its level in D1, each with its length at half of the depth."""
    from scipy import signal

    found = []
    for block, side, row, peak in _peaks(
        profile, levels.d1, least=SETTINGS.defect, apart=SETTINGS.apart, nearby=SETTINGS.along
    ):
        [width], *_ = signal.peak_widths(np.abs(row), [peak])
        at, time = (float(each[block.start + peak]) for each in (profile.distances, profile.times))
        kind: Literal["dip", "hump"] = "hump" if row[peak] > 0 else "dip"
        found.append(RoadEvent(at, time, _SIDES[side], kind, float(abs(row[peak])), float(width * profile.spacing)))
    return tuple(_on_both_sides(found, within=SETTINGS.apart))


def _peaks(
    profile: RoadProfile, heights_of: Callable[[slice], Real], *, least: float, apart: float, nearby: float
) -> Iterator[tuple[slice, int, Real, int]]:
    """Yield block, side, heights of the block and place of each peak far above the scatter around it."""
    from scipy import signal

    n_nearby = round(nearby / profile.spacing)
    for block in profile.blocks():
        if block.stop - block.start < n_nearby:
            continue
        for side, row in enumerate(heights_of(block)):
            blocks = np.abs(row[: row.size // n_nearby * n_nearby]).reshape(-1, n_nearby)
            scatter = 1.4826 * np.repeat(np.median(blocks, axis=1), n_nearby)
            limits = np.maximum(least, SETTINGS.over_scatter * np.pad(scatter, (0, row.size - scatter.size), "edge"))
            peaks, _ = signal.find_peaks(np.abs(row), height=limits, distance=round(apart / profile.spacing))
            yield from ((block, side, row, peak) for peak in peaks.tolist())


def _shape(row: Real, peak: int, highest: float, sos: Real, spacing: float) -> tuple[float, float, int]:
    """Return length [m] (0: a step), signed size [m] and offset [points] of the dip or step that fits a peak best.

    Dips d (1 + cos(2 pi x / l)) / 2 and steps are seen as the profile is: up to a spatial frequency [1/m], and through
    the band of events.
    """
    from scipy import signal

    reach, n = round(SETTINGS.event[1] / spacing), 1 << 10
    x = (np.arange(n) - n // 2) * spacing
    lengths = np.array([0.0, *SETTINGS.lengths])
    dips = [np.where(np.abs(x) < each / 2, 1 + np.cos(2 * np.pi * x / each), 0.0) / 2 for each in SETTINGS.lengths]
    spectra = np.fft.rfft([(x > 0) - x / x[0] * 0.5 - 0.5, *dips])
    spatial = np.fft.rfftfreq(n, spacing)
    _, band = signal.sosfreqz(sos, spatial, fs=1 / spacing)
    seen = np.fft.irfft(spectra * np.abs(band) ** 2 * (spatial <= highest), n)
    found = np.pad(row, reach)[peak : peak + 2 * reach + 1]
    offsets = np.arange(-reach // 3, reach // 3 + 1)
    shapes = np.array([seen[:, n // 2 - reach - each : n // 2 + reach + 1 - each] for each in offsets])
    along, energy = shapes @ found, np.sum(shapes**2, axis=2)
    best = np.unravel_index(np.argmax(along**2 / energy), along.shape)
    return float(lengths[best[1]]), float(along[best] / energy[best]), int(offsets[best[0]])


def _on_both_sides(events: Sequence[RoadEvent], *, within: float) -> list[RoadEvent]:
    """Return events by distance, with those that both tracks have at one place as one; a short dip of both is a joint.

    Two events are at one place if they are less than a distance apart [m].
    """
    merged: list[RoadEvent] = []
    for event in sorted(events, key=lambda event: event.at):
        last = merged[-1] if merged else None
        is_same = last is not None and event.kind == last.kind and event.at - last.at < within
        if last is not None and is_same and last.side not in {event.side, "both"}:
            depth, length = max(last.depth, event.depth), max(last.length, event.length)
            is_joint = last.kind == "joint" or (last.kind == "pothole" and length <= SETTINGS.joint)
            merged[-1] = replace(last, side="both", kind="joint" if is_joint else last.kind, depth=depth, length=length)
        else:
            merged.append(event)
    return merged
