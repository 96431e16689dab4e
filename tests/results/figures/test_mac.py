from dataclasses import replace

import numpy as np
import pytest
from matplotlib.axes import Axes

from sprung._arrays import Real
from sprung.modal import Modes, join_modes, mac
from sprung.results.figures import (
    mac_figure,
    reference_mac_figure,
)


def matrix(axes: Axes) -> Real:
    (image,) = axes.get_images()
    return np.asarray(image.get_array())


def printed(axes: Axes) -> Real:
    texts = [text for text in axes.texts if text.get_gid() == "value"]
    side = round(np.sqrt(len(texts)))
    values = np.full((side, side), np.nan)
    for text in texts:
        column, row = text.get_position()
        values[round(row), round(column)] = float(text.get_text())
    return values


def test_values_of_the_modes(chain) -> None:
    axes = mac_figure(chain).axes[0]
    shapes = chain.modes.mode_shapes
    products = np.abs(shapes.conj() @ shapes.T) ** 2
    expected = products / np.outer(np.diag(products), np.diag(products)) ** 0.5
    np.testing.assert_allclose(matrix(axes), expected, atol=1e-12)
    np.testing.assert_allclose(printed(axes), expected, atol=0.0051)
    assert axes.get_yticklabels()[0].get_text() == f"1\n{chain.modes.natural_frequency[0]:.2f} Hz"


def test_values_between_the_subsets(subsets) -> None:
    axes = mac_figure(subsets).axes[1]
    parts = [subset.modes for subset in subsets.subsets]
    shapes = join_modes(parts).mode_shapes
    np.testing.assert_allclose(matrix(axes), mac(shapes, shapes))
    np.testing.assert_allclose(printed(axes), mac(shapes, shapes), atol=0.0051)
    places = [np.asarray(line.get_xdata()) for line in axes.get_lines()]
    edges = np.array([place[0] for place in places if np.ptp(place) == 0])
    np.testing.assert_allclose(edges, np.cumsum([len(part) for part in parts])[:-1] - 0.5)


def test_names_have_the_colours_of_the_modes(subsets) -> None:
    axes = mac_figure(subsets).axes
    colours = {label.get_text().split("\n")[-1]: label.get_color() for label in axes[0].get_yticklabels()}
    assert len(set(colours.values())) == len(subsets.modes)
    merged = [label.get_color() for label in axes[1].get_yticklabels()]
    assert set(merged) >= set(colours.values())


def test_very_many_modes_have_no_printed_values(chain) -> None:
    many = chain.modes.take(np.arange(30) % 3)
    figure = mac_figure(replace(chain, modes=many, members=np.full((30, 1), -1)))
    assert matrix(figure.axes[0]).shape == (30, 30)
    assert not [text for text in figure.axes[0].texts if text.get_gid() == "value"]
    figure.draw_without_rendering()


@pytest.mark.parametrize("result", ["chain", "subsets"])
def test_no_mode_is_said(result, request: pytest.FixtureRequest) -> None:
    identification = request.getfixturevalue(result)
    none = replace(identification, modes=identification.modes.take([]), members=identification.members[:0])
    assert mac_figure(none).axes[0].texts[0].get_text() == "No mode was identified."


def test_mac_against_a_reference(chain) -> None:
    nothing = chain.modes.take(np.array([], dtype=int))
    figure = reference_mac_figure([("all", chain.modes), ("none", nothing)], chain.modes, title="t")
    values = [float(text.get_text()) for text in figure.axes[0].texts]
    assert np.reshape(values, (3, 3)).diagonal() == pytest.approx(1)
    assert figure.axes[1].texts[0].get_text() == "No mode was identified."
    assert isinstance(chain.modes, Modes)
