from dataclasses import replace

import numpy as np
import pytest
from matplotlib.colors import same_color

from sprung.modal import PoleStatus
from sprung.results.figures import stabilisation_figure
from sprung.results.figures.draw import mode_colour
from sprung.results.figures.stabilisation import singular_values_in_decibels
from sprung.signals.spectrum import SpectralMatrix


def drawn(axes, gid):
    """Points of all lines of this name."""
    return [line for line in axes.get_lines() if line.get_gid() == gid]


def n_points(axes, gid):
    return sum(line.get_xdata().size for line in drawn(axes, gid))


@pytest.mark.parametrize("result", ["chain", "row_ladder", "subsets", "single"])
def test_every_pole_is_drawn_with_its_status(result, request: pytest.FixtureRequest) -> None:
    identification = request.getfixturevalue(result)
    figure = stabilisation_figure(identification)
    for axes, subset in zip(figure.axes, identification.subsets, strict=False):
        statuses = np.concatenate([diagram.status for diagram in subset.diagrams])
        for status in PoleStatus:
            assert n_points(axes, status.name) == np.count_nonzero(statuses == status)


def test_poles_lie_at_their_frequency_and_order(chain) -> None:
    axes = stabilisation_figure(chain).axes[0]
    diagram = chain.subsets[0].diagrams[0]
    selected = diagram.status == PoleStatus.SELECTED
    orders = np.array(diagram.poles.ladder)[diagram.poles.rungs]
    expected = sorted(zip(diagram.poles.natural_frequency[selected], orders[selected], strict=True))
    lines = drawn(axes, "SELECTED")
    points = sorted(point for line in lines for point in zip(line.get_xdata(), line.get_ydata(), strict=True))
    np.testing.assert_allclose(points, expected)
    assert axes.get_ylabel() == "Model order"


def test_selected_poles_have_the_colour_of_their_mode(subsets) -> None:
    frequencies = subsets.modes.natural_frequency
    for axes in stabilisation_figure(subsets).axes[: len(subsets.subsets)]:
        found = {
            k
            for line in drawn(axes, "SELECTED")
            for k, frequency in enumerate(frequencies)
            if same_color(line.get_color(), mode_colour(k)) and np.all(np.abs(line.get_xdata() / frequency - 1) < 0.1)
        }
        assert found == set(range(len(frequencies)))


def test_first_singular_value_does_not_depend_on_units(chain) -> None:
    spectra = chain.spectra
    factors = np.array([1000.0, 1.0, 1e-3])
    scaled = replace(spectra, matrix=spectra.matrix * factors[:, None, None] * factors[:, None])
    np.testing.assert_allclose(
        singular_values_in_decibels(scaled, like=scaled)[0],
        singular_values_in_decibels(spectra, like=spectra)[0],
        atol=1e-6,
    )


def test_first_singular_value_of_one_channel_is_its_density_over_its_variance() -> None:
    frequencies = np.linspace(0, 50, 101)
    flat = SpectralMatrix(frequencies, np.full((1, 1, 101), 7.0), ("a",), 2.0, 10)
    np.testing.assert_allclose(singular_values_in_decibels(flat, like=flat)[0], 10 * np.log10(1 / 50))
