"""Roughness of a road (IRI, classes of ISO 8608) from the profile under a vehicle, potholes; maps and tables."""

import csv
import json
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal
from xml.sax.saxutils import quoteattr

import numpy as np

from sprung._arrays import Complex, Real
from sprung._checks import check_number, check_type
from sprung._display import counted
from sprung.errors import DataError, ParameterError
from sprung.likelihood.fitting import fit_windows
from sprung.recording import Recording, each_recording
from sprung.road.profile import RoadProfile, road_profile
from sprung.vehicles import Vehicle, check_on_axles
from sprung.vehicles.window import window_of


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
    from scipy import signal
    from scipy.interpolate import CubicSpline

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


#: Spatial frequency of the roughness [1/m], and waviness of the standard's classes.
_REFERENCE, _WAVINESS = 0.1, 2.0
#: Names of the channels with latitude and longitude.
_PLACES = (("latitude", "lat", "gnss_latitude", "gps_lat"), ("longitude", "lon", "lng", "gnss_longitude", "gps_lon"))


@dataclass(frozen=True, slots=True)
class SurveySettings:
    """How stretches and events are judged."""

    #: Largest share of a stretch on which the vehicle is too slow.
    slow: float = 0.1
    #: Spatial frequencies between which roughness and waviness are estimated [1/m].
    band: tuple[float, float] = (0.05, 1.0)
    #: Length over which the size of the golden car's motion is independent [m].
    independent: float = 2.0
    #: Wavelengths of events [m]; smallest depth [m], and smallest one over the scatter of the heights in 50 m.
    event: tuple[float, float] = (0.3, 3.0)
    depth: float = 0.008
    over_scatter: float = 5.0
    nearby: float = 50.0


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
    """

    iri: float
    iri_std: float
    roughness: float
    waviness: float
    road_class: str


@dataclass(frozen=True, slots=True)
class Stretch:
    """A stretch of the road.

    Parameters
    ----------
    begin, end
        Distance from the start of the survey [m].
    begin_time, end_time
        Time from the start of the recordings [s].
    left, right
        Roughness of the two tracks.
    n_passes
        Number of passes that are averaged.
    begin_place, end_place
        Latitude and longitude [degrees] of the vehicle there; None where the recordings do not have them.
    """

    begin: float
    end: float
    begin_time: float
    end_time: float
    left: TrackRoughness
    right: TrackRoughness
    n_passes: int = 1
    begin_place: tuple[float, float] | None = None
    end_place: tuple[float, float] | None = None


@dataclass(frozen=True, slots=True)
class RoadEvent:
    """A pothole or a bump.

    Parameters
    ----------
    at, time
        Distance [m] and time [s] of its middle.
    side
        "left", "right" or "both".
    kind
        "pothole" or "bump".
    depth, length
        Depth or height, and length [m].
    place
        Latitude and longitude [degrees]; None where the recordings do not have them.
    """

    at: float
    time: float
    side: Literal["left", "right", "both"]
    kind: Literal["pothole", "bump"]
    depth: float
    length: float
    place: tuple[float, float] | None = None


@dataclass(frozen=True, slots=True)
class RoadSurvey:
    """The road under a vehicle.

    Parameters
    ----------
    stretches
        Stretches on which the vehicle was fast enough, in the order of the way.
    events
        Potholes and bumps.
    notes
        Limits, one sentence each.
    """

    stretches: tuple[Stretch, ...]
    events: tuple[RoadEvent, ...]
    notes: tuple[str, ...] = ()


def survey_road(
    recordings: Recording | Iterable[Recording],
    vehicle: Vehicle,
    *,
    stretch: float = 100.0,
    allow_missing: bool = False,
) -> RoadSurvey:
    """Return the roughness of the road under a vehicle, and its potholes.

    Parameters
    ----------
    recordings
        Drive or drives with the speed, in the order of time.
    vehicle
        Vehicle with its sensors: calibrated, or described by a data sheet.
    stretch
        Length of a stretch [m], at least 20.
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
    wavelengths of 0.3 to 3 m.

    References
    ----------
    ASTM E1926-08; ISO 8608:2016.

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
    check_on_axles(vehicle, "a survey of the road")
    check_number("stretch", stretch, at_least=20)
    records = list(each_recording(recordings))
    windows = [window_of(record, vehicle, allow_missing=allow_missing) for record in records]
    fit = fit_windows(windows)
    profile = road_profile(windows, fit)
    slopes = np.stack([suspension_slope(row, spacing=profile.spacing) for row in profile.heights])
    n_points = round(stretch / profile.spacing)
    starts = range(0, profile.times.size - n_points + 1, n_points)
    stretches = tuple(
        _stretch(profile, slopes, slice(first, first + n_points))
        for first in starts
        if np.mean(~profile.is_valid[first : first + n_points]) <= SETTINGS.slow
    )
    if not stretches:
        raise DataError(f"no stretch of {stretch:g} m was driven fast enough: give a longer or faster drive")
    way = _way(records)
    if way is not None:
        stretches = tuple(
            replace(each, begin_place=way(each.begin_time), end_place=way(each.end_time)) for each in stretches
        )
    events = tuple(event if way is None else replace(event, place=way(event.time)) for event in _events(profile))
    slow = len(starts) - len(stretches)
    notes = (f"too slow: {counted(slow, 'stretch', 'es')}",) * (slow > 0)
    return RoadSurvey(stretches, events, (*notes, *_vehicle_notes(fit.model_error)))


def _way(records: Sequence[Recording]) -> Callable[[float], tuple[float, float]] | None:
    """Return the latitude and longitude [degrees] over time [s]; None where a recording lacks them."""
    columns: list[list[Real]] = [[], [], []]
    clock = 0.0
    for record in records:
        lower = {name.lower(): name for name in record.names}
        rows = [next((lower[name] for name in names if name in lower), None) for names in _PLACES]
        if None in rows:
            return None
        columns[0].append(clock + np.arange(record.n_samples) / record.sampling_rate)
        for column, name in zip(columns[1:], rows, strict=True):
            column.append(record.samples[record.index(str(name))])
        clock += record.duration
    times, latitudes, longitudes = (np.concatenate(column) for column in columns)
    known = np.isfinite(latitudes) & np.isfinite(longitudes)
    if not known.any():
        return None

    def place(time: float) -> tuple[float, float]:
        return (
            float(np.interp(time, times[known], latitudes[known])),
            float(np.interp(time, times[known], longitudes[known])),
        )

    return place


def _vehicle_notes(model_error: float) -> tuple[str, ...]:
    if model_error < 0.1:
        return ()
    return (f"the vehicle file explains the motion only to {100 * model_error:.0f} %: calibrate it on several drives",)


def _stretch(profile: RoadProfile, slopes: Real, part: slice) -> Stretch:
    begin, end = part.start * profile.spacing, part.stop * profile.spacing
    speed = float(np.median(profile.speeds[part]))
    left, right = (_roughness(profile, slopes[side], side, part, speed) for side in (0, 1))
    times = profile.times[part]
    return Stretch(begin, end, float(times[0]), float(times[-1]), left, right)


def _roughness(profile: RoadProfile, slopes: Real, side: int, part: slice, speed: float) -> TrackRoughness:
    """Return the roughness of one track on one stretch."""
    run_in = round(RUN_IN / profile.spacing)
    inside = slice(max(part.start, min(run_in, part.stop - run_in)), part.stop)
    found = float(np.mean(np.abs(slopes[inside])))
    missing, n, density = _missing(profile, side, speed)
    share = missing / max(float(np.mean(slopes[inside] ** 2)), 1e-300)
    index = 1000 * found * np.sqrt(1 + share)
    n_independent = max(1.0, (inside.stop - inside.start) * profile.spacing / SETTINGS.independent)
    gain = np.abs(GOLDEN_CAR.response(n)) ** 2 * n**-_WAVINESS
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
    roughness = float(np.mean(density * (n / _REFERENCE) ** _WAVINESS))
    slope = np.polyfit(np.log(n), np.log(density), 1, w=1 / np.sqrt(n))[0]
    return roughness, float(-slope)


def _events(profile: RoadProfile) -> tuple[RoadEvent, ...]:
    """Return the potholes and bumps of a profile."""
    from scipy import signal

    longest, shortest = 1 / SETTINGS.event[1], 1 / SETTINGS.event[0]
    sos = signal.butter(2, (longest, shortest), "bandpass", fs=1 / profile.spacing, output="sos")
    heights = signal.sosfiltfilt(sos, profile.heights, axis=1) * profile.is_valid
    n_nearby = round(SETTINGS.nearby / profile.spacing)
    found: list[RoadEvent] = []
    sides: tuple[Literal["left", "right"], ...] = ("left", "right")
    for side, row in zip(sides, heights, strict=True):
        blocks = np.abs(row[: row.size // n_nearby * n_nearby]).reshape(-1, n_nearby)
        if not len(blocks):
            continue
        scatter = 1.4826 * np.repeat(np.median(blocks, axis=1), n_nearby)
        limits = np.maximum(
            SETTINGS.depth, SETTINGS.over_scatter * np.pad(scatter, (0, row.size - scatter.size), "edge")
        )
        peaks, _ = signal.find_peaks(np.abs(row), height=limits, distance=round(SETTINGS.event[1] / profile.spacing))
        widths = signal.peak_widths(np.abs(row), peaks, rel_height=0.5)[0] * profile.spacing
        for peak, width in zip(peaks.tolist(), widths.tolist(), strict=True):
            is_bump = row[peak] > 0
            kind: Literal["pothole", "bump"] = "bump" if is_bump else "pothole"
            depth = float(abs(row[peak]))
            found.append(RoadEvent(peak * profile.spacing, float(profile.times[peak]), side, kind, depth, 2 * width))
    return tuple(_on_both_sides(sorted(found, key=lambda event: event.at)))


def _on_both_sides(events: Sequence[RoadEvent]) -> list[RoadEvent]:
    """Return events, with those that both tracks have at one place as one."""
    merged: list[RoadEvent] = []
    for event in events:
        last = merged[-1] if merged else None
        is_same = last is not None and event.kind == last.kind and event.at - last.at < SETTINGS.event[0]
        if last is not None and is_same and last.side not in {event.side, "both"}:
            depth, length = max(last.depth, event.depth), max(last.length, event.length)
            merged[-1] = replace(last, side="both", depth=depth, length=length)
        else:
            merged.append(event)
    return merged


def averaged(surveys: Sequence[RoadSurvey]) -> RoadSurvey:
    """Return the mean of several passes over one way that start at one place.

    Parameters
    ----------
    surveys
        Surveys with stretches of the same length, of one or several vehicles.

    Returns
    -------
    RoadSurvey
        Means of the indices, weighted by their variances; standard deviations with the scatter between passes; events
        of all passes.
    """
    passes: dict[float, list[Stretch]] = {}
    for survey in surveys:
        for stretch in survey.stretches:
            passes.setdefault(round(stretch.begin, 3), []).append(stretch)
    stretches = tuple(
        replace(
            own[0],
            left=_mean([stretch.left for stretch in own]),
            right=_mean([stretch.right for stretch in own]),
            n_passes=sum(stretch.n_passes for stretch in own),
        )
        for _, own in sorted(passes.items())
    )
    events = tuple(event for survey in surveys for event in survey.events)
    return RoadSurvey(stretches, events, tuple(dict.fromkeys(note for survey in surveys for note in survey.notes)))


def _mean(tracks: Sequence[TrackRoughness]) -> TrackRoughness:
    """Return the mean of a track over passes."""
    values, stds = (np.array([getattr(track, name) for track in tracks]) for name in ("iri", "iri_std"))
    weights = 1 / stds**2
    mean = float(np.average(values, weights=weights))
    scatter = float(np.std(values, ddof=1) / np.sqrt(len(values))) if len(values) > 1 else 0.0
    roughness = float(np.exp(np.mean([np.log(track.roughness) for track in tracks])))
    waviness = float(np.mean([track.waviness for track in tracks]))
    return TrackRoughness(
        mean, max(scatter, float(np.sqrt(1 / weights.sum()))), roughness, waviness, road_class_of(roughness)
    )


#: Columns of a table of stretches.
_COLUMNS = ("from_m", "to_m", "left_iri", "left_iri_std", "left_class", "right_iri", "right_iri_std", "right_class")


def write_survey(survey: RoadSurvey, path: str | Path) -> None:
    """Write a survey for maps or tables, by the ending of the file.

    Parameters
    ----------
    survey
        Road under a vehicle.
    path
        `.geojson`: a line for each stretch with index and class, a point for each event (RFC 7946). `.gpx`: events as
        way-points (GPX 1.1). `.csv`: a row for each stretch.

    Raises
    ------
    DataError
        If a map is asked for and the recordings have no latitude and longitude.
    ParameterError
        If the ending is another one.
    """
    check_type("survey", survey, RoadSurvey, advice="sprung.survey_road(recording, vehicle)")
    target = Path(path)
    ending = target.suffix.lower()
    if ending not in {".geojson", ".gpx", ".csv"}:
        raise ParameterError(f"{target.name} ends in {ending!r}: give a file that ends in .geojson, .gpx or .csv")
    if ending != ".csv" and not all(stretch.begin_place and stretch.end_place for stretch in survey.stretches):
        raise DataError("the recordings have no latitude and longitude for a map: write .csv, or record them [degrees]")
    if ending == ".csv":
        with target.open("w", newline="", encoding="utf-8") as file:
            writer = csv.writer(file)
            writer.writerow(_COLUMNS)
            writer.writerows(_rows(survey))
    elif ending == ".geojson":
        collection = {"type": "FeatureCollection", "features": list(_features(survey))}
        target.write_text(json.dumps(collection, indent=1), encoding="utf-8")
    else:
        target.write_text(_way_points(survey), encoding="utf-8")


def _rows(survey: RoadSurvey) -> Iterator[tuple[Any, ...]]:
    for stretch in survey.stretches:
        tracks = [(round(t.iri, 3), round(t.iri_std, 3), t.road_class) for t in (stretch.left, stretch.right)]
        yield (round(stretch.begin, 1), round(stretch.end, 1), *tracks[0], *tracks[1])


def _features(survey: RoadSurvey) -> Iterator[dict[str, Any]]:
    """Yield the features of a map; coordinates are longitude and latitude."""
    for stretch, row in zip(survey.stretches, _rows(survey), strict=True):
        ends = [list(reversed(place)) for place in (stretch.begin_place, stretch.end_place) if place]
        line = {"type": "LineString", "coordinates": ends}
        yield {"type": "Feature", "geometry": line, "properties": dict(zip(_COLUMNS, row, strict=True))}
    for event in survey.events:
        if event.place is not None:
            point = {"type": "Point", "coordinates": list(reversed(event.place))}
            properties = {"kind": event.kind, "side": event.side, "depth_m": event.depth, "length_m": event.length}
            yield {"type": "Feature", "geometry": point, "properties": properties}


def _way_points(survey: RoadSurvey) -> str:
    """Return the events as a GPX file."""
    points = [
        f"<wpt lat={quoteattr(f'{event.place[0]:.7f}')} lon={quoteattr(f'{event.place[1]:.7f}')}>"
        f"<name>{event.kind}, {event.side}, {1000 * event.depth:.0f} mm</name></wpt>"
        for event in survey.events
        if event.place is not None
    ]
    head = '<gpx version="1.1" creator="sprung" xmlns="http://www.topografix.com/GPX/1/1">'
    return "\n".join(['<?xml version="1.0" encoding="UTF-8"?>', head, *points, "</gpx>", ""])
