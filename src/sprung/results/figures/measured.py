"""Figures of plans, roads, rides, running stability and bounce tests."""

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from sprung._arrays import Real
from sprung.bounce_tests import Bounce, BounceTest
from sprung.kits import KITS, KitPlan, candidates, kit_of
from sprung.likelihood.expected import expected_fit
from sprung.likelihood.lateral import LateralFit
from sprung.modal import INTERVAL_95
from sprung.results.figures import draw
from sprung.results.figures.draw import STYLE, with_unit
from sprung.results.tables.wording import format_name
from sprung.ride import Ride, Travel
from sprung.road import RoadSurvey


def kit_figure(plan: KitPlan) -> Figure:
    """Draw the vehicle from above with its sensors, and the expected standard deviations, also of the usual kits.

    Examples
    --------
    >>> from sprung.kits import kit_of, plan
    >>> from sprung.vehicles import read_vehicle
    >>> figure = kit_figure(plan(kit_of(read_vehicle("zafira"), "two")))
    >>> [axes.get_title(loc="left") for axes in figure.axes]
    ['sensors; rings: other places', 'expected standard deviation of one window']
    """
    figure = draw.new_figure("What the kit will see", height=4.6)
    above, stds = draw.panels(figure, 1, 2, width_ratios=(1, 2.2))[0]
    vehicle = plan.vehicle
    half = max(axle.half_track for axle in vehicle.axle)
    front, rear = vehicle.axle[0].x, vehicle.axle[-1].x
    above.add_patch(Rectangle((-half, rear - 0.8), 2 * half, front - rear + 1.6, fill=False, edgecolor=STYLE.faint))
    for axle in vehicle.axle:
        for side in (1, -1):
            above.add_patch(Rectangle((side * axle.half_track - 0.1, axle.x - 0.3), 0.2, 0.6, color="#D8D8D8"))
    for place in candidates(vehicle):
        if place.position is not None:
            above.plot(-place.position[1], place.position[0], "o", color=STYLE.faint, markersize=6, fillstyle="none")
    for sensor in vehicle.sensor:
        if sensor.position is not None:
            x, y = -sensor.position[1], sensor.position[0]
            above.plot(x, y, "o", color=STYLE.colours[0], markersize=6)
            draw.note(above, sensor.channel, (x, y + 0.15), ha="center")
    above.set_aspect("equal")
    above.autoscale_view()
    above.margins(0.15)
    above.axis("off")
    draw.title(above, "sensors; rings: other places")
    places = np.arange(len(plan.components))[::-1]
    for offset, colour, label, values in (
        (0.2, STYLE.colours[0], "value", [part.std for part in plan.components]),
        (-0.2, STYLE.colours[1], "left over right", [part.contrast_std or np.nan for part in plan.components]),
    ):
        stds.barh(places + offset, 100 * np.array(values), 0.36, color=colour, label=label)
    for name, marker in zip(KITS, "os^D", strict=True):
        known = expected_fit(kit_of(vehicle, name), plan.drive.on_mean_road).contrast_std
        values = [100 * known.get(part.component, np.nan) for part in plan.components]
        stds.plot(values, places - 0.2, marker, color="black", markersize=4, fillstyle="none", label=f"kit {name}")
    stds.set_yticks(places, [format_name(str(part.component)) for part in plan.components], fontsize=STYLE.small)
    stds.set_xlabel("Standard deviation [%]")
    draw.title(stds, "expected standard deviation of one window")
    stds.set_xlim(0, 1.3 * stds.get_xlim()[1])
    draw.legend(stds, n_columns=1, loc="upper right")
    return figure


def road_figure(survey: RoadSurvey, *, source: str = "") -> Figure:
    """Draw roughness index or track level along the way, with events, and on a map where places are known.

    Examples
    --------
    >>> from sprung.road import RoadSurvey, Stretch, TrackRoughness
    >>> track = TrackRoughness(4.0, 0.1, 6e-5, 2.0, "B")
    >>> figure = road_figure(RoadSurvey((Stretch(0.0, 100.0, 0.0, 5.0, track, track),), ()))
    >>> figure.axes[0].get_ylabel()
    'IRI [m/km]'
    """
    is_track = survey.is_of_track
    measures = (("d1", "D1 [mm]"), ("d2", "D2 [mm]")) if is_track else (("iri", "IRI [m/km]"),)
    has_map = any(stretch.begin_place for stretch in survey.stretches)
    sides = dict.fromkeys(name for stretch in survey.stretches for name in stretch.lines)
    head = (
        ("Track", "Standard deviations of level and alignment; bands: 95 % intervals; marks: defects")
        if is_track
        else ("Road", "Bands: 95 % intervals; marks: potholes, bumps, joints")
    )
    figure = draw.new_figure(*head, height=3.0 + len(measures), source=source)
    grid = draw.panels(figure, len(measures), 1 + has_map, width_ratios=(2, 1)[: 1 + has_map])
    ends = np.array([(stretch.begin, stretch.end) for stretch in survey.stretches])
    gaps = 1 + np.flatnonzero(ends[1:, 0] - ends[:-1, 1] > 1e-6 * ends[:-1, 1])
    edges = np.append(np.insert(ends[:, 0], gaps, ends[gaps - 1, 1]), ends[-1, 1])
    for (name, label), axes in zip(measures, grid[:, 0], strict=True):
        for side, colour in zip(sides, STYLE.colours, strict=False):
            value, std = (np.insert(_of_stretches(survey, side, each), gaps, np.nan) for each in (name, f"{name}_std"))
            axes.stairs(value, edges, color=colour, label=side, linewidth=1.4, baseline=None)
            low, high = value - INTERVAL_95 * std, value + INTERVAL_95 * std
            band = {"step": "post", "color": colour, "alpha": 0.2, "linewidth": 0}
            axes.fill_between(edges, [*low, low[-1]], [*high, high[-1]], **band)
        axes.set(ylim=(0, axes.get_ylim()[1]), xlabel="Distance [m]", ylabel=label)
    axes = grid[0, 0]
    for event in survey.events:
        marker = {"pothole": "v", "dip": "v", "bump": "^", "hump": "^", "joint": "|"}[event.kind]
        axes.plot(event.at, axes.get_ylim()[1], marker, color=STYLE.ink, markersize=4, clip_on=False)
    for other in grid[1:, 0]:
        other.set_xlim(axes.get_xlim())
    draw.legend(axes)
    for (name, label), panel in zip(measures, grid[:, 1] if has_map else (), strict=has_map):
        places = np.array([stretch.begin_place or (np.nan, np.nan) for stretch in survey.stretches])
        ends = np.array([np.nanmin(places, axis=0), np.nanmax(places, axis=0)])
        middle, narrow = ends.mean(axis=0), np.cos(np.radians(ends[:, 0].mean()))
        half = 0.55 * max(float(np.max((ends[1] - ends[0]) * (1.0, narrow))), 1e-3)
        mean = (_of_stretches(survey, "left", name) + _of_stretches(survey, "right", name)) / 2
        marks = panel.scatter(places[:, 1], places[:, 0], c=mean, s=12, cmap="viridis")
        figure.colorbar(marks, ax=panel, label=label)
        panel.set(xlabel="Longitude [°]", xlim=middle[1] + np.array([-half, half]) / narrow)
        panel.set(ylabel="Latitude [°]", ylim=(middle[0] - half, middle[0] + half), aspect=1 / narrow)
        panel.locator_params(axis="x", nbins=4)
    return figure


def _of_stretches(survey: RoadSurvey, side: str, name: str) -> Real:
    """Return a figure of one side of all stretches, lengths in mm; NaN where it is unknown."""
    found = [getattr(stretch.lines.get(side), name, None) for stretch in survey.stretches]
    return (1000 if survey.is_of_track else 1) * np.array(found, dtype=np.float64)


def ride_figure(ride: Ride, *, source: str = "") -> Figure:
    """Draw the weighted RMS of each channel with the limits of ISO 2631-1, that of each 5 s, and the travel used.

    Examples
    --------
    >>> from sprung.ride import Ride, RidePoint
    >>> point = RidePoint("seat_z", "z", "iso2631", "Wk", 0.5, 0.6, 1.0, 3.0, 0.5, "fairly uncomfortable")
    >>> ride_figure(Ride((point,), (), None, ())).axes[0].get_xlabel()
    'Weighted RMS [m/s²]'
    """
    where = "Light: largest running value (MTVV). Lines: limits of comfort of ISO 2631-1 for the RMS"
    n_rows = 2 * bool(ride.points) + len(ride.travel)
    height = (3.2 + 0.7 * max(len(ride.points), 3)) * bool(ride.points) + 2.0 * len(ride.travel)
    where = where if ride.points else "Share of the time over travel and speed; rebound is positive"
    figure = draw.new_figure("Ride", where, width=8.0, height=max(height, 3.0), source=source)
    grid = figure.subfigures(n_rows, 1, squeeze=False)[:, 0]
    for row, travel in zip(grid[2 * bool(ride.points) :], ride.travel, strict=True):
        _draw_travel(draw.panels(row, 1, 2)[0], travel)
    if not ride.points:
        return figure
    axes = draw.panels(grid[0])[0, 0]
    places = np.arange(len(ride.points))[::-1]
    axes.barh(places, [point.mtvv for point in ride.points], 0.6, color="#CFE0EC")
    axes.barh(places, [point.rms for point in ride.points], 0.6, color=STYLE.colours[0])
    names = [f"{point.channel} {point.axis}, {point.standard}, {point.weighting}" for point in ride.points]
    axes.set_yticks(places, names, fontsize=STYLE.small)
    reach = axes.get_xlim()[1]
    for limit in (0.315, 0.5, 0.8, 1.25, 2.0):
        if limit < reach:
            axes.axvline(limit, color=STYLE.faint, linewidth=0.8, linestyle=":")
    axes.set_xlabel("Weighted RMS [m/s²]")
    axes = draw.panels(grid[1])[0, 0]
    for point in ride.points:
        axes.stairs(point.continuous, np.arange(len(point.continuous) + 1) / 12, baseline=None, label=point.channel)
    axes.set(ylim=(0, axes.get_ylim()[1]), xlabel="Time with values [min]", ylabel="RMS of 5 s [m/s²]")
    draw.legend(axes)
    return figure


def stability_figure(fit: LateralFit, *, source: str = "") -> Figure:
    """Draw the damping ratio of the least damped lateral mode over speed, with the critical speed."""
    figure = draw.new_figure("Running stability", height=3.6, source=source)
    axes = draw.panels(figure)[0, 0]
    speed, damping, std = np.array(fit.least_damping).T
    half = INTERVAL_95 * std
    axes.fill_between(speed, 100 * (damping - half), 100 * (damping + half), color="#CFE0EC", label="95 % interval")
    axes.plot(speed, 100 * damping, color=STYLE.colours[0], label="least damped lateral mode")
    axes.axvspan(*fit.speeds, color=STYLE.faint, alpha=0.2, linewidth=0, label="speeds driven")
    axes.axhline(0, color=STYLE.faint, linewidth=0.8)
    if fit.critical_speed is not None:
        critical, low, high = fit.critical_speed
        axes.errorbar(critical, 0, xerr=[[critical - low], [high - critical]], fmt="o", color=STYLE.colours[1])
        draw.note(axes, f"critical speed {critical:.3g} m/s", (critical, 0), ha="right", va="top")
    axes.set(xlabel="Speed [m/s]", ylabel="Damping ratio [%]")
    draw.legend(axes, n_columns=3, loc="lower left")
    return figure


def _draw_travel(panels: Sequence[Axes], travel: Travel) -> None:
    """Draw the histograms of the travel and of its speed."""
    cases = ((travel.travel_histogram, 1000, "Travel [mm]"), (travel.speed_histogram, 1, "Speed [m/s], rebound > 0"))
    for axes, (histogram, scale, label) in zip(panels, cases, strict=True):
        axes.stairs(
            100 * np.array(histogram.shares), scale * np.array(histogram.edges), fill=True, color=STYLE.colours[0]
        )
        axes.set(xlabel=label, ylabel="Time [%]")
    draw.title(panels[0], travel.channel)


#: Most tests that are drawn, and most channels of each.
_MAX_TESTS, _MAX_CHANNELS = 6, 4


def bounce_figure(bounce: Bounce, *, source: str = "") -> Figure:
    """Draw the channels of each test over time, with the fitted motion, and the envelope of its slowest mode.

    Examples
    --------
    >>> import sprung
    >>> time = np.arange(300) / 100
    >>> swing = np.exp(-0.2 * 2 * np.pi * 1.5 * time) * np.sin(2 * np.pi * 1.5 * np.sqrt(1 - 0.2**2) * time)
    >>> rest = np.zeros(300)
    >>> motion = np.concatenate([rest, swing, rest]) + 0.01 * np.random.default_rng(1).standard_normal(900)
    >>> tests = sprung.bounce(sprung.Recording(motion[None], 100.0, (sprung.Channel("acc", "acceleration"),)))
    >>> len(bounce_figure(tests).axes)
    1
    """
    tests = bounce.tests[:_MAX_TESTS]
    n_channels = min(len(tests[0].part.channels), _MAX_CHANNELS)
    what = "Free motion after each push: record, fit and envelope"
    figure = draw.new_figure(what, source, width=max(4.0 * len(tests), 7.0), height=1.6 + 1.9 * n_channels)
    grid = draw.panels(figure, n_channels, len(tests), size=STYLE.small, sharex="col")
    for column, test in enumerate(tests):
        for row in range(n_channels):
            _draw_test(grid[row, column], test, row)
        title = f"test {column + 1}, at {test.transient.onset:.1f} s"
        draw.title(grid[0, column], title, size=STYLE.small)
        grid[-1, column].set_xlabel("Time [s]")
    for axes, channel in zip(grid[:, 0], tests[0].part.channels, strict=False):
        axes.set_ylabel(with_unit(channel.name, channel.unit))
    draw.legend(figure, grid[0, 0].get_legend_handles_labels()[0], n_columns=3, loc="outside lower left")
    return figure


def _draw_test(axes: Axes, test: BounceTest, row: int) -> None:
    part, times = test.part, test.transient
    time = times.begin + np.arange(part.n_samples) / part.sampling_rate
    step = max(1, part.n_samples // 2000)
    axes.plot(time[::step], part.samples[row, ::step], color=STYLE.ink, linewidth=0.8, label="record")
    fitted = test.fitted[row]
    axes.plot(time[::step], fitted[::step], color=STYLE.colours[0], linewidth=1.4, linestyle="--", label="fit")
    known = np.flatnonzero(np.isfinite(fitted))
    if known.size:
        middle = float(fitted[known[-1]])
        slowest = int(np.argmax(np.abs(test.modes.mode_shapes[:, row])))
        rate = test.modes.damping_ratio[slowest] * 2 * np.pi * test.modes.natural_frequency[slowest]
        largest = float(np.max(np.abs(fitted[known] - middle)))
        first = int(known[np.argmax(np.abs(fitted[known] - middle))])
        envelope = largest * np.exp(-rate * (time[first:] - time[first]))
        for side in (1, -1):
            label = "envelope" if side == 1 else None
            axes.plot(time[first:], middle + side * envelope, color=STYLE.colours[1], linewidth=0.8, label=label)
