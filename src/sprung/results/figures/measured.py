"""Figures of plans, roads and rides."""

import numpy as np
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from sprung.kits import KitPlan
from sprung.results.figures.style import FAINT, HALF_WIDTH_95, INK, MODE_COLOURS, NORMAL, SMALL, new_figure, plain
from sprung.results.tables.table import in_words
from sprung.ride import Ride
from sprung.road import RoadSurvey


def kit_figure(plan: KitPlan) -> Figure:
    """Draw the vehicle from above with its sensors, and the expected standard deviations.

    Examples
    --------
    >>> from sprung.kits import kit_of, plan
    >>> from sprung.vehicles import read_vehicle
    >>> figure = kit_figure(plan(kit_of(read_vehicle("zafira"), "two")))
    >>> [axes.get_title(loc="left") for axes in figure.axes]
    ['sensors', 'expected standard deviation of one window']
    """
    figure = new_figure("What the kit will see", "", width=9.5, height=4.6)
    above, stds = figure.subplots(1, 2, width_ratios=(1, 2.2))
    vehicle = plan.vehicle
    half = max(axle.half_track for axle in vehicle.axle)
    front, rear = vehicle.axle[0].x, vehicle.axle[-1].x
    above.add_patch(Rectangle((-half, rear - 0.8), 2 * half, front - rear + 1.6, fill=False, edgecolor=FAINT))
    for axle in vehicle.axle:
        for side in (1, -1):
            above.add_patch(Rectangle((side * axle.half_track - 0.1, axle.x - 0.3), 0.2, 0.6, color="#D8D8D8"))
    for sensor in vehicle.sensor:
        if sensor.position is not None:
            above.plot(-sensor.position[1], sensor.position[0], "o", color=MODE_COLOURS[0], markersize=6)
            place = (-sensor.position[1], sensor.position[0] + 0.15)
            above.annotate(sensor.channel, place, ha="center", fontsize=SMALL, color=INK)
    above.set_aspect("equal")
    above.autoscale_view()
    above.margins(0.15)
    above.axis("off")
    above.set_title("sensors", loc="left", fontsize=NORMAL)
    places = np.arange(len(plan.components))[::-1]
    for offset, colour, label, values in (
        (0.2, MODE_COLOURS[0], "value", [part.std for part in plan.components]),
        (-0.2, MODE_COLOURS[1], "left over right", [part.contrast_std or np.nan for part in plan.components]),
    ):
        stds.barh(places + offset, 100 * np.array(values), 0.36, color=colour, label=label)
    stds.set_yticks(places, [in_words(str(part.component)) for part in plan.components], fontsize=SMALL)
    stds.set_xlabel("Standard deviation [%]", fontsize=NORMAL)
    stds.set_title("expected standard deviation of one window", loc="left", fontsize=NORMAL)
    stds.legend(fontsize=SMALL, frameon=False, ncols=2, loc="lower right", bbox_to_anchor=(1, 1))
    plain(stds)
    return figure


def road_figure(survey: RoadSurvey, *, source: str = "") -> Figure:
    """Draw the International Roughness Index along the way, with events, and on a map where places are known.

    Examples
    --------
    >>> from sprung.road import RoadSurvey, Stretch, TrackRoughness
    >>> track = TrackRoughness(4.0, 0.1, 6e-5, 2.0, "B")
    >>> figure = road_figure(RoadSurvey((Stretch(0.0, 100.0, 0.0, 5.0, track, track),), ()))
    >>> figure.axes[0].get_ylabel()
    'IRI [m/km]'
    """
    has_map = all(stretch.begin_place for stretch in survey.stretches)
    what = f"Road: {source}" if source else "Road"
    figure = new_figure(what, "Bands: 95 % intervals; marks: potholes and bumps", width=9.5, height=4.0)
    axes, *maps = figure.subplots(1, 1 + has_map, squeeze=False, width_ratios=(2, 1)[: 1 + has_map])[0]
    begins = np.array([[stretch.begin, stretch.end] for stretch in survey.stretches])
    for side, colour in (("left", MODE_COLOURS[0]), ("right", MODE_COLOURS[1])):
        tracks = [getattr(stretch, side) for stretch in survey.stretches]
        index, std = (np.array([getattr(track, name) for track in tracks]) for name in ("iri", "iri_std"))
        edges = [*begins[:, 0], begins[-1, 1]]
        axes.stairs(index, edges, color=colour, label=side, linewidth=1.4, baseline=None)
        low, high = index - HALF_WIDTH_95 * std, index + HALF_WIDTH_95 * std
        axes.fill_between(edges, [*low, low[-1]], [*high, high[-1]], step="post", color=colour, alpha=0.2, linewidth=0)
    top = axes.get_ylim()[1]
    for event in survey.events:
        axes.plot(event.at, top, "v" if event.kind == "pothole" else "^", color=INK, markersize=4, clip_on=False)
    axes.set_ylim(0, top)
    axes.set_xlabel("Distance [m]", fontsize=NORMAL)
    axes.set_ylabel("IRI [m/km]", fontsize=NORMAL)
    axes.legend(fontsize=SMALL, frameon=False)
    plain(axes)
    for panel in maps:
        places = np.array([stretch.begin_place for stretch in survey.stretches])
        mean = np.array([(stretch.left.iri + stretch.right.iri) / 2 for stretch in survey.stretches])
        marks = panel.scatter(places[:, 1], places[:, 0], c=mean, s=12, cmap="viridis")
        figure.colorbar(marks, ax=panel, label="IRI [m/km]")
        panel.set_xlabel("Longitude [°]", fontsize=NORMAL)
        panel.set_ylabel("Latitude [°]", fontsize=NORMAL)
        panel.set_aspect(1 / np.cos(np.radians(places[:, 0].mean())))
        plain(panel)
    return figure


def ride_figure(ride: Ride, *, source: str = "") -> Figure:
    """Draw the weighted RMS of each channel with the limits of ISO 2631-1.

    Examples
    --------
    >>> from sprung.ride import Ride, RidePoint
    >>> point = RidePoint("seat_z", "z", "iso2631", "Wk", 0.5, 0.6, 1.0, 3.0, 0.5, "fairly uncomfortable")
    >>> ride_figure(Ride((point,), (), None, ())).axes[0].get_xlabel()
    'Weighted RMS [m/s²]'
    """
    what = f"Ride: {source}" if source else "Ride"
    where = "Light: largest running value (MTVV). Lines: limits of comfort of ISO 2631-1 for the RMS"
    figure = new_figure(what, where, width=8.0, height=1.6 + 0.35 * max(len(ride.points), 3))
    axes = figure.subplots()
    places = np.arange(len(ride.points))[::-1]
    axes.barh(places, [point.mtvv for point in ride.points], 0.6, color="#CFE0EC")
    axes.barh(places, [point.rms for point in ride.points], 0.6, color=MODE_COLOURS[0])
    names = [f"{point.channel} {point.axis}, {point.standard}, {point.weighting}" for point in ride.points]
    axes.set_yticks(places, names, fontsize=SMALL)
    reach = axes.get_xlim()[1]
    for limit in (0.315, 0.5, 0.8, 1.25, 2.0):
        if limit < reach:
            axes.axvline(limit, color=FAINT, linewidth=0.8, linestyle=":")
    axes.set_xlabel("Weighted RMS [m/s²]", fontsize=NORMAL)
    plain(axes)
    return figure
