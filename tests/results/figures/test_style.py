"""Words, numbers and places that all figures share."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from matplotlib.figure import Figure

from sprung._display import listed
from sprung.results.figures.style import INK, in_hertz, in_percent, ink_on, panel_grid, pretty_unit, spread


@given(st.lists(st.floats(0, 1), min_size=1, max_size=30), st.floats(0, 0.2))
def test_spread_labels_keep_order_and_distance(wanted, distance) -> None:
    places = spread(np.sort(wanted), distance)
    distance = min(distance, 1 / len(wanted))
    assert np.all(np.diff(places) >= distance - 1e-9)
    assert places[0] >= distance / 2 - 1e-9
    assert places[-1] <= 1 - distance / 2 + 1e-9


def test_labels_with_room_stay_where_they_belong() -> None:
    np.testing.assert_allclose(spread([0.2, 0.5, 0.9], 0.1), [0.2, 0.5, 0.9])


def test_numbers_are_short() -> None:
    assert [in_hertz(f) for f in (0.2345, 7.013, 182.29, 1234.5)] == ["0.234 Hz", "7.01 Hz", "182.3 Hz", "1234 Hz"]
    assert [in_percent(x) for x in (0.0112, 0.2294)] == ["1.12 %", "22.9 %"]


@pytest.mark.parametrize(("n_panels", "grid"), [(1, (1, 1)), (4, (1, 4)), (5, (2, 3)), (9, (3, 3)), (10, (3, 4))])
def test_grids_have_few_rows_that_are_filled_evenly(n_panels, grid) -> None:
    assert panel_grid(n_panels, most_columns=4) == grid


def test_units_have_superscripts() -> None:
    assert [pretty_unit(unit) for unit in ("m/s^2", "m^3", "rad/s", "")] == ["m/s²", "m³", "rad/s", ""]


def test_many_names_are_cut_short_and_counted() -> None:
    assert listed(["a", "b"]) == "a, b"
    names = [f"acc_{k}" for k in range(100)]
    kept, _, n_more = listed(names).removesuffix(" more").rpartition(" and ")
    assert len(kept.split(", ")) + int(n_more) == 100


def test_text_on_an_image_is_dark_on_light_cells_and_white_on_dark_ones() -> None:
    image = Figure().subplots().imshow(np.zeros((1, 1)), cmap="RdBu_r", vmin=-1, vmax=1)
    assert [ink_on(image, value) for value in (-1.0, 0.0, 1.0)] == ["white", INK, "white"]
