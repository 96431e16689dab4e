"""Pictures of the plate and the car."""

import numpy as np

from sprung._arrays import Real
from sprung.identification import Identification
from sprung.modal import Modes
from sprung.recording import Recording
from sprung.reproduce.chapter_6.numbers import PLATE_IDENTIFIED, car, car_truth, wheelbase
from sprung.reproduce.thesis import BODY_MODES, theoretical
from sprung.results.figures import (
    Spread,
    densities_figure,
    histories_figure,
    reference_mac_figure,
    response_figure,
    runs_figure,
    shapes_figure,
    stabilisation_figure,
    stable_rates_figure,
)
from sprung.results.page.page import Picture, picture
from sprung.vehicles import frequency_response, parse_fault, structure, with_faults


def plate_pictures(truth: Modes, runs: list[Recording], identification: Identification) -> tuple[Picture, ...]:
    """Return figures 6-7 and 6-11 to 6-15."""
    marked = list(zip(BODY_MODES, truth.natural_frequency, strict=True))
    modes, channels = identification.modes, identification.channels
    return (
        picture(shapes_figure(truth, runs[0].channels, source="theory"), "Figure 6-7: theoretical modes of the plate."),
        picture(
            histories_figure([("", runs[0])], title="Plate under hammer blows", window=30.0),
            "Figure 6-11: responses (simulated), first thirty seconds.",
        ),
        picture(
            densities_figure([("", runs[0])], title="Plate", highest=10.0, segment=20.0, marked=marked),
            "Figure 6-12: power spectral densities (simulated). Dotted: theory.",
        ),
        picture(stabilisation_figure(identification), "Figure 6-13: stabilisation diagram of CoSS-SSI."),
        picture(stable_rates_figure(identification), "Figure 6-14: modes selected by the rate of stable points."),
        picture(shapes_figure(modes, channels, source="CoSS-SSI"), "Figure 6-15: modes identified by CoSS-SSI."),
    )


def plate_spread(truth: Modes, plates: Real) -> Picture:
    """Return the frequencies of the plate in all sets, (runs, 3, modes)."""
    spreads = [
        Spread(
            f"{label}: frequency [Hz]",
            ("CoSS-SSI",),
            plates[:, 0, k][None],
            truth.natural_frequency[k],
            (PLATE_IDENTIFIED[k],),
        )
        for k, label in enumerate(BODY_MODES)
    ]
    return picture(runs_figure(spreads, title="Plate: frequencies in all sets"), f"Spread over {len(plates)} sets.")


def car_responses() -> Picture:
    """Return figure 6-18."""
    model, f = structure(car()), np.linspace(0.2, 20, 500)
    response = frequency_response(model, f)
    curves = [
        (channel.removeprefix("acc_").upper(), response[:, row, row]) for row, channel in enumerate(model.outputs.names)
    ]
    return picture(
        response_figure(f, curves, title="Acceleration of each corner over the road below it", unit="m/s² / m"),
        "Figure 6-18: frequency responses of the 7-degree-of-freedom model (parameters of zafira).",
    )


def car_theory_shapes() -> tuple[Picture, ...]:
    """Return the shapes of figures 6-19 and 6-20."""
    model = structure(car())
    healthy = theoretical(model, labels=BODY_MODES)
    faulty = theoretical(with_faults(model, [parse_fault("front_left.spring=-0.5")]), labels=BODY_MODES)
    channels = model.outputs.channels
    return (
        picture(
            shapes_figure(healthy, channels, source="healthy"), "Figure 6-19: theoretical modes, healthy suspensions."
        ),
        picture(
            shapes_figure(faulty, channels, source="front-left spring -50 %"),
            "Figure 6-20: theoretical modes, front-left spring halved: all frequencies fall and the shapes turn.",
        ),
    )


def drive_pictures(runs: list[Recording]) -> tuple[Picture, ...]:
    """Return figures 6-22 and 6-23."""
    corners = runs[0].select(("acc_fl", "acc_fr", "acc_rl", "acc_rr"))
    return (
        picture(
            histories_figure([("", runs[0])], title="A drive: corners of the body, and the speed"),
            "Figure 6-22: a drive (simulated).",
        ),
        picture(
            densities_figure([("", corners)], title="Corners of the body", highest=20.0, segment=10.0),
            "Figure 6-23: power spectral densities (simulated).",
        ),
    )


def acs_pictures(acs: Identification, truth: Modes) -> tuple[Picture, ...]:
    """Return figures 6-24 and 6-25."""
    title = "MAC of theory (rows) and identified shapes"
    return (
        picture(stabilisation_figure(acs), "Figure 6-24: stabilisation diagram of ACS-Cov-SSI."),
        picture(stable_rates_figure(acs), "Figure 6-24: rate of stable points of ACS-Cov-SSI."),
        picture(
            shapes_figure(acs.modes, acs.channels, source="ACS-Cov-SSI"),
            "Figure 6-25: modes identified by ACS-Cov-SSI.",
        ),
        picture(reference_mac_figure([("ACS-Cov-SSI", acs.modes)], truth, title=title), "Figure 6-25: MAC."),
    )


def coss_pictures(coss: dict[str, Identification], truth: Modes) -> tuple[Picture, ...]:
    """Return figures 6-26 to 6-29."""
    pictures: list[Picture] = []
    for (condition, identification), first, second in zip(
        coss.items(), ("6-26", "6-28"), ("6-27", "6-29"), strict=True
    ):
        parts = [(f"subset {k + 1}", subset.modes) for k, subset in enumerate(identification.subsets)]
        title = f"MAC of healthy theory (rows) and subsets, {condition}"
        pictures += [
            picture(
                stabilisation_figure(identification, source=condition),
                f"Figure {first}: stabilisation diagrams of CoSS-SSI, {condition}.",
            ),
            picture(
                stable_rates_figure(identification, source=condition),
                f"Figure {first}: rates of stable points, {condition}.",
            ),
            picture(
                shapes_figure(identification.modes, identification.channels, source=condition),
                f"Figure {second}: modes identified by CoSS-SSI, {condition}.",
            ),
            picture(reference_mac_figure(parts, truth, title=title), f"Figure {second}: MAC, {condition}."),
        ]
    return tuple(pictures)


def bounce_input(speeds: tuple[int, ...] = (20, 30, 40)) -> Picture:
    """Return the input of bounce by a road under both axles, at speeds in km/h."""
    f = np.linspace(0.2, 5, 600)
    curves = []
    for speed in speeds:
        delay = wheelbase() / (speed / 3.6)
        gain = np.abs(1 + np.exp(-2j * np.pi * f * delay)) / 2
        curves.append((f"bounce input at {speed} km/h", gain + 1e-4 + 0j))
    marked = [("bounce mode", float(car_truth("normal").natural_frequency[0]))]
    title = "Share of the road's height that reaches bounce"
    return picture(
        response_figure(f, curves, title=title, unit="-", marked=marked), "Input of bounce by a road under both axles."
    )
