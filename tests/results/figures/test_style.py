"""Style common to all figures, and frequency axes."""

import itertools
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from matplotlib.figure import Figure
from matplotlib.text import Text

from sprung.modal import Modes
from sprung.results.figures import spectra_figure, stabilisation_figure
from sprung.results.figures.draw import STYLE, ink_on, panel_grid, spread
from sprung.results.figures.frequency_axis import curve_limits, frequency_range
from sprung.signals.harmonics import Harmonic


@given(st.lists(st.floats(0, 1), min_size=1, max_size=30), st.floats(0, 0.2))
def test_spread_labels_keep_order_and_distance(wanted, distance) -> None:
    places = spread(np.sort(wanted), distance)
    distance = min(distance, 1 / len(wanted))
    assert np.all(np.diff(places) >= distance - 1e-9)
    assert places[0] >= distance / 2 - 1e-9
    assert places[-1] <= 1 - distance / 2 + 1e-9


@pytest.mark.parametrize(("n_panels", "grid"), [(1, (1, 1)), (4, (1, 4)), (5, (2, 3)), (9, (3, 3)), (10, (3, 4))])
def test_grids_have_few_rows_that_are_filled_evenly(n_panels, grid) -> None:
    assert panel_grid(n_panels, max_columns=4) == grid


def test_text_on_an_image_is_dark_on_light_cells_and_white_on_dark_ones() -> None:
    image = Figure().subplots().imshow(np.zeros((1, 1)), cmap="RdBu_r", vmin=-1, vmax=1)
    assert [ink_on(image, value) for value in (-1.0, 0.0, 1.0)] == ["white", STYLE.ink, "white"]


def made_modes(frequencies, channels):
    poles = np.array([2 * np.pi * frequency * (-0.05 + 1j) for frequency in frequencies], dtype=complex)
    n = len(poles)
    known = np.full(n, 0.01)
    shapes = np.ones((n, len(channels)), dtype=complex)
    return Modes(poles, shapes, channels, known, known, known, (None,) * n)


def test_range_is_linear_to_half_the_sampling_rate(chain) -> None:
    shown = frequency_range(chain)
    assert (shown.low, shown.high, shown.is_logarithmic) == (0.0, chain.spectra.frequencies[-1], False)


def test_range_is_logarithmic_where_modes_would_be_crowded(chain) -> None:
    crowded = replace(chain, modes=made_modes([1.5, 1.8], chain.modes.channels), members=np.zeros((2, 1)))
    shown = frequency_range(crowded)
    assert shown.is_logarithmic
    assert 0.3 < shown.low < 1.5
    axes = stabilisation_figure(crowded).axes[0]
    assert axes.get_xscale() == "log"


def test_range_is_the_band_that_was_asked_for(chain) -> None:
    narrow = replace(chain, settings=replace(chain.settings, band=(5.0, 30.0)))
    shown = frequency_range(narrow)
    assert 4 < shown.low < 5
    assert 30 < shown.high < 36


def boxes(figure, gid):
    figure.draw_without_rendering()
    texts = [text for axes in figure.axes for text in axes.texts if text.get_gid() == gid]
    return [Text.get_window_extent(text) for text in texts]  # without the leaders


@pytest.mark.parametrize("frequencies", [[7.0, 7.02, 7.04], [7.0, 7.05, *np.linspace(8, 60, 18)]])
@pytest.mark.parametrize("draw", [stabilisation_figure, spectra_figure])
def test_labels_of_close_modes_do_not_overlap(chain, frequencies, draw) -> None:
    close = replace(
        chain,
        modes=made_modes(frequencies, chain.modes.channels),
        members=np.full((len(frequencies), 1), -1),
    )
    found = boxes(draw(close), "mode label")
    assert len(found) == len(frequencies)
    assert not any(one.overlaps(other) for one, other in itertools.combinations(found, 2))


def test_labels_of_many_harmonics_do_not_overlap(chain) -> None:
    lines = tuple(
        Harmonic(0.7 * order, "constant", (0.7 * order, 0.7 * order), 0.1, 10.0, ("acc_1",), 0.7, order)
        for order in range(1, 80)
    )
    crowded = replace(chain, harmonics=lines)
    figure = stabilisation_figure(crowded)
    assert sum(line.get_gid() == "harmonic" for line in figure.axes[0].get_lines()) == 79
    found = boxes(figure, "harmonic label")
    assert 10 < len(found) < 79
    assert not any(one.overlaps(other) for one, other in itertools.combinations(found, 2))


def test_labels_of_harmonics_stay_above_the_poles(chain_with_lines) -> None:
    figure = stabilisation_figure(chain_with_lines)
    lowest = min(box.y0 for box in boxes(figure, "harmonic label"))
    axes = figure.axes[0]
    top = max(chain_with_lines.subsets[0].diagrams[0].poles.ladder)
    assert lowest > axes.transData.transform((1.0, top))[1]


def test_flat_spectra_look_flat() -> None:
    low, high = curve_limits(np.array([-10.0, -10.5]), dynamic_range=80, room=0.0)
    assert high - low > 20
    assert low < -10.5 < -10 < high
    low, high = curve_limits(np.array([0.0, -300.0]), dynamic_range=80, room=0.5)
    assert (low, high) == pytest.approx((-84.0, 4.0 + 88.0))
