"""Plans, roads, rides, running stability and plate tests as tables and sentences."""

from collections.abc import Mapping, Sequence
from statistics import median
from typing import TYPE_CHECKING

from sprung._display import counted, listed
from sprung.modal import INTERVAL_95
from sprung.results.tables.wording import Table, format_estimate, format_name

if TYPE_CHECKING:
    from sprung.kits import KitPlan
    from sprung.likelihood.lateral import LateralFit
    from sprung.likelihood.plate_test import PlateTest
    from sprung.ride import Ride
    from sprung.road import RoadSurvey, TrackLevel, TrackRoughness

#: Stretches from which on a table of them is cut.
_MOST_STRETCHES = 40


def plan_tables(plan: "KitPlan") -> tuple[Table, Table]:
    """Return the tables of the components and of the sensors of a plan."""
    from sprung.kits import CHANGES

    sizes = tuple(f"{100 * change:.0f} %" for change in CHANGES)
    columns = ("component", "std [%]", "left/right", "front/rear", *sizes)
    rows = []
    for part in plan.components:
        ratios = ["" if std is None else f"{100 * std:.1f}" for std in (part.contrast_std, part.axle_std)]
        times = [_minutes(part.minutes[change], plan) for change in CHANGES]
        values = (f"{100 * part.std:.1f}", *ratios, *times) if part.is_identifiable else ("–",) * 6
        rows.append((format_name(str(part.component)), *values))
    caption = (
        f"std [%], also of the ratios left/right and front/rear: of one window; {', '.join(sizes)}: median time [min] "
        "until a change of that size is found; –: not determined; >: not within 64 windows"
    )
    components = Table("What the kit will see", columns, tuple(rows), ends_in_words=False, caption=caption)
    sensors = tuple((sensor.channel, f"{100 * sensor.gain:.0f}") for sensor in plan.sensors)
    return components, Table("Sensors", ("channel", "narrower by it [%]"), sensors, ends_in_words=False)


def _minutes(value: float | None, plan: "KitPlan") -> str:
    return f"> {64 * plan.drive.minutes:.0f}" if value is None else f"{value:.0f}"


def describe_plan(plan: "KitPlan") -> list[str]:
    """Return the conditions of a plan, and its limits."""
    low, high = plan.drive.speed
    drive = f"windows of {plan.drive.minutes:g} min at {3.6 * low:.0f} to {3.6 * high:.0f} km/h"
    speed = "" if plan.drive.has_speed else ", speed not recorded"
    redundant = [sensor.channel for sensor in plan.sensors if sensor.gain < 0.02]
    repeated = [f"{', '.join(redundant)}: each repeats what the others measure, and buys the check of the sensors"]
    roads = " and ".join(
        f"G(n0) = {1e6 * roughness:.0f}e-6 m³" + (f" for {100 * share:.0f} % of the time" if share < 1 else "")
        for roughness, share in plan.drive.roads
    )
    unknown = [format_name(str(part.component)) for part in plan.components if not part.is_identifiable]
    times = [_minutes(part.minutes[0.1], plan) for part in plan.components if part.is_identifiable]
    latest = max(times, key=lambda words: (words.startswith(">"), float(words.lstrip("> "))), default="never")
    named = f"a loss of 10 % of each {'other ' * bool(unknown)}part is found after {latest} min".replace(
        "> ", "more than "
    )
    return [
        named + f"; not determined: {', '.join(unknown)}" * bool(unknown),
        f"{drive}, {roads}{speed}",
        *(repeated * bool(redundant)),
        *plan.notes,
    ]


def road_tables(survey: "RoadSurvey") -> list[Table]:
    """Return the tables of a road or track: its stretches, the alignment of a track, events where there are some."""
    has_alignment = any(stretch.alignment for stretch in survey.stretches)
    aligned = [road_table(survey, lines=("alignment",))] if has_alignment else []
    return [road_table(survey), *aligned, *([events_table(survey)] if survey.events else [])]


def describe_road(survey: "RoadSurvey") -> list[str]:
    """Return the range of the index or level of a survey with the number of events, and its notes."""
    name, factor, unit = ("d1", 1000.0, "mm in D1") if survey.is_of_track else ("iri", 1.0, "m/km")
    tracks = [each for stretch in survey.stretches for each in (stretch.left, stretch.right)]
    values = [factor * getattr(track, name) for track in tracks]
    first, what = survey.stretches[0], "level" if survey.is_of_track else "IRI"
    head = f"{counted(len(survey.stretches), 'stretch', 'es')} of {first.end - first.begin:.0f} m"
    events = f"; {_events_of(survey)}: {len(survey.events)}" * bool(survey.events)
    sizes = f"{min(values):.2f} to {max(values):.2f} {unit}, median {median(values):.2f}"
    return [f"{head}: {what} {sizes}{events}", *survey.notes]


def road_table(survey: "RoadSurvey", *, lines: Sequence[str] = ("left", "right")) -> Table:
    """Return the table of the stretches of a road or track: both sides, or the alignment."""
    shown = survey.stretches[:_MOST_STRETCHES]
    is_mean = any(stretch.n_passes > 1 for stretch in survey.stretches)
    if survey.is_of_track:
        what = "Level" if "left" in lines else "Alignment"
        title, unit = f"{what} of the track, EN 13848: standard deviations", "mm"
        names: tuple[str, ...] = tuple(f"{line} {range_} [mm]" for range_ in ("D1", "D2") for line in lines)
    else:
        title, unit = "Road", "m/km"
        names = ("left IRI [m/km]", "right IRI [m/km]", "left class", "right class")
    rows = []
    for stretch in shown:
        first, second, scatters = zip(*(_cells(stretch.lines.get(line)) for line in lines), strict=True)
        passes = (f"{stretch.n_passes}", ", ".join(scatters)) if is_mean else ()
        rows.append((f"{stretch.begin:.0f}", f"{stretch.end:.0f}", *first, *second, *passes))
    columns = ("from [m]", "to [m]", *names, *(("passes", f"scatter [{unit}]") if is_mean else ()))
    left = len(survey.stretches) - len(rows)
    caption = "± standard deviation" + (
        f"; scatter: standard deviation between passes, {listed(lines)}" if is_mean else ""
    )
    caption += "; D1: wavelengths of 3 to 25 m, D2: 25 to 70 m" if survey.is_of_track else ""
    caption += f"; {left} more stretches in the files" if left else ""
    return Table(title, columns, tuple(rows), n_words=0, caption=caption)


def _cells(track: "TrackRoughness | TrackLevel | None") -> tuple[str, str, str]:
    """Return the two figures of a track, index and class or its levels in D1 and D2, and the scatter of the first."""
    from sprung.road import TrackRoughness

    if track is None:
        return "–", "–", "–"
    if isinstance(track, TrackRoughness):
        scatter = "–" if track.iri_scatter is None else f"{track.iri_scatter:.2f}"
        return format_estimate(track.iri, track.iri_std), track.road_class, scatter
    scatter = "–" if track.d1_scatter is None else f"{1000 * track.d1_scatter:.2f}"
    long = "–" if track.d2 is None or track.d2_std is None else _in_mm(track.d2, track.d2_std)
    return _in_mm(track.d1, track.d1_std), long, scatter


def _in_mm(length: float, std: float) -> str:
    return f"{1000 * length:.3f} ± {1000 * std:.3f}"


def events_table(survey: "RoadSurvey") -> Table:
    """Return the table of potholes, bumps and joints, or of isolated defects of a track, the deepest first."""
    is_of_one = all(event.n_passes == 1 for event in survey.events)
    deepest = sorted(survey.events, key=lambda event: -event.depth)[:_MOST_STRETCHES]
    rows = [
        (
            event.kind,
            event.side,
            f"{event.at:.0f}",
            f"{1000 * event.depth:.0f}",
            f"{event.length:.1f}" if event.length else "step",
            "" if is_of_one else f"{event.n_passes}",
        )
        for event in deepest
    ]
    columns = ("event", "side", "at [m]", "depth [mm]", "length [m]", "passes")
    return Table(_events_of(survey).capitalize(), columns, tuple(rows), n_words=2, ends_in_words=False)


def _events_of(survey: "RoadSurvey") -> str:
    return "isolated defects" if survey.is_of_track else "potholes, bumps and joints"


def ride_tables(ride: "Ride") -> list[Table]:
    """Return the tables of a ride: vibration, and travel where there is any."""
    columns = ("channel", "RMS [m/s²]", "MTVV [m/s²]", "VDV", "crest", "value", "rating")
    rows = tuple(
        (
            f"{point.channel} ({point.axis}, {point.weighting})",
            f"{point.rms:.3g}",
            f"{point.mtvv:.3g}",
            f"{point.vdv:.3g}",
            f"{point.crest_factor:.1f}",
            f"{point.value:.3g}",
            point.rating or "",
        )
        for point in ride.points
    )
    title = f"Ride by {listed(tuple(dict.fromkeys(point.standard for point in ride.points)))}"
    tables = [Table(title, columns, rows, caption="VDV in m/s^1.75")] if rows else []
    if ride.travel:
        heads = ("channel", "from [mm]", "to [mm]", "5 % [mm]", "95 % [mm]", "used [%]", "bottomed", "rebound", "bump")
        used = tuple(
            (
                travel.channel,
                *(f"{1000 * value:.0f}" for value in (travel.lowest, travel.highest)),
                *(f"{1000 * travel.quantiles[k]:.0f}" for k in (0, -1)),
                f"{100 * travel.share_used:.0f}" if travel.share_used == travel.share_used else "",
                f"{travel.n_bottomed}" if travel.share_used == travel.share_used else "",
                f"{travel.rebound_speed:.2g}",
                f"{travel.bump_speed:.2g}",
            )
            for travel in ride.travel
        )
        caption = "rebound, bump: 95 % of the speed [m/s]"
        tables.append(Table("Travel", heads, used, ends_in_words=False, caption=caption))
    return tables


def describe_ride(ride: "Ride") -> list[str]:
    """Return the comfort by three axes together, and the limits of a ride."""
    from sprung.ride import comfort_in_words, health_dose, mean_comfort_in_words

    sentences = []
    if ride.points:
        worst = max(ride.points, key=lambda point: point.value)
        place = f"most at {worst.channel} ({worst.axis}), {worst.weighting}"
        sentences.append(f"{place}: {worst.value:.3g}" + f", {worst.rating}" * bool(worst.rating))
        if rated := [point for point in ride.points if point.health]:
            harshest = max(rated, key=health_dose)
            sentences.append(f"health (ISO 2631-1) at {harshest.channel} ({harshest.axis}): {harshest.health}")
    if ride.travel:
        ends = min(each.lowest for each in ride.travel), max(each.highest for each in ride.travel)
        sentences.append("travel from {:.0f} to {:.0f} mm".format(*(1000 * end for end in ends)))
    if ride.mean_comfort is not None:
        words = mean_comfort_in_words(ride.mean_comfort)
        sentences.append(f"mean comfort N_MV {ride.mean_comfort:.2f} (EN 12299): {words}")
    if (total := ride.vibration_total) is not None:
        sentences.append(f"vibration total value {total:.3g} m/s² (ISO 2631-1): {comfort_in_words(total)}")
    return [*sentences, *ride.notes]


def stability_tables(fit: "LateralFit") -> list[Table]:
    """Return the tables of the lateral components and of the least damped lateral mode over speed."""
    units = {"spring": "N/m", "damper": "N s/m", "creep": "N"}
    rows = []
    for name, part in fit.estimates.items():
        unit = units.get(name.rsplit("_", 1)[-1], "")
        std = (part.interval[1] - part.interval[0]) / (2 * INTERVAL_95)
        change = f"{100 * (part.value / part.nominal - 1):+.1f}"
        rows.append((format_name(name) + f" [{unit}]" * bool(unit), format_estimate(part.value, std), change))
    damping = [
        (
            f"{each.speed:.1f}",
            f"{3.6 * each.speed:.0f}",
            f"{100 * each.damping_ratio:.1f} ± {100 * each.damping_ratio_std:.1f}",
        )
        for each in fit.least_damping
    ]
    return [
        Table("Lateral suspension", ("component", "value", "from the file [%]"), tuple(rows)),
        Table("Least damped lateral mode", ("speed [m/s]", "[km/h]", "damping ratio [%]"), tuple(damping), n_words=0),
    ]


def describe_stability(fit: "LateralFit") -> list[str]:
    """Return the critical speed with its interval and margin, and the notes of a fit of lateral motion."""
    if fit.critical_speed is None:
        return ["every lateral mode is damped up to 200 m/s", *fit.notes]
    (speed, low, high), driven = fit.critical_speed, fit.speeds[1]
    margin = f"{100 * abs(fit.margin or 0.0):.0f} % {'above' if speed > driven else 'below'} the highest speed driven"
    return [
        f"critical speed {speed:.3g} m/s ({low:.3g} to {high:.3g}), or {3.6 * speed:.0f} km/h, {margin} "
        f"({driven:.3g} m/s): the linear one, for small motions on straight track",
        *fit.notes,
    ]


def plate_tests_table(tests: "Mapping[str, PlateTest]") -> Table:
    """Return the table of what a suspension tester would measure."""
    from sprung.likelihood.plate_test import PLATE

    columns = (
        "corner",
        "phase shift [°]",
        "adhesion [%]",
        "damping body [%]",
        "damping wheel [%]",
        "friction [N]",
        "remark",
    )
    rows = tuple(
        (
            format_name(corner),
            format_estimate(test.phase_shift, test.phase_shift_std),
            format_estimate(100 * test.adhesion, 100 * test.adhesion_std),
            format_estimate(100 * test.damping_ratio, 100 * test.damping_ratio_std),
            format_estimate(100 * test.wheel_damping_ratio, 100 * test.wheel_damping_ratio_std),
            ("{}" if test.is_friction_identifiable else "({})").format(
                format_estimate(test.friction, test.friction_std)
            ),
            _remark(test),
        )
        for corner, test in tests.items()
    )
    caption = (
        f"as on a suspension tester; limits: phase shift {PLATE.phase_limit:.0f}°, left against right 30 %; friction in"
        " brackets is not identifiable: with less of it than stated, phase shifts are smaller"
    )
    return Table("Inspection", columns, rows, caption=caption)


def _remark(test: "PlateTest") -> str:
    from sprung.likelihood.plate_test import PLATE

    below = test.phase_shift < PLATE.phase_limit
    uncertain = abs(test.phase_shift - PLATE.phase_limit) < INTERVAL_95 * test.phase_shift_std
    words = []
    if below or uncertain:
        words.append("near the limit" if uncertain else "fails")
    if test.asymmetry > PLATE.asymmetry_limit:
        words.append(f"{100 * test.asymmetry:.0f} % apart from the other side")
    return ", ".join(words)
