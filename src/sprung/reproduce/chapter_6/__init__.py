"""Chapter 6: a plate on four springs, and a car on a country road."""

import numpy as np

from sprung._arrays import Real
from sprung.reproduce.chapter import Chapter
from sprung.reproduce.chapter_6 import figures, prose
from sprung.reproduce.chapter_6.numbers import Example, car_truth, example, experiment, plate_truth
from sprung.results.page.page import Block, Section


def contents(example: Example, results: list[tuple[Real, Real]]) -> tuple[str, tuple[Section, ...]]:
    """Return the verdict and the sections."""
    plates, cars = (np.array(part) for part in zip(*results, strict=True))
    plate, healthy = plate_truth(), car_truth("normal")
    plate_blocks: tuple[Block, ...] = (
        *figures.plate_pictures(plate, example.plate_records, example.plate),
        prose.plate_table(plate, example.plate, plates),
        figures.plate_spread(plate, plates),
    )
    theory: tuple[Block, ...] = (figures.car_responses(), prose.car_theory_table(), *figures.car_theory_shapes())
    nulls: tuple[Block, ...] = (prose.null_paragraph(), prose.null_table(), figures.bounce_input())
    return prose.verdict(plates, cars), (
        Section("Plate on four springs", plate_blocks),
        Section("The car in theory", theory),
        Section("The drive", figures.drive_pictures(example.drives["normal"])),
        Section("ACS-Cov-SSI, normal", figures.acs_pictures(example.acs, healthy)),
        Section("CoSS-SSI, normal and with a soft tyre", figures.coss_pictures(example.coss, healthy)),
        Section("What is found how often", (prose.car_table(cars),)),
        Section("Why bounce is hard to find on a road", nulls),
    )


CHAPTER = Chapter(
    title="Chapter 6: plate on springs, and a car on the road",
    example=example,
    experiment=experiment,
    contents=contents,
    settings=prose.SETTINGS,
)
