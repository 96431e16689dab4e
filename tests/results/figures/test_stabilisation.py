from dataclasses import replace

import numpy as np
import pytest
from matplotlib.colors import same_color
from matplotlib.patches import Rectangle

from sprung.modal import PoleStatus
from sprung.results.figures import stabilisation_figure
from sprung.results.figures.stabilisation import singular_values_in_decibels
from sprung.results.figures.style import mode_colour
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


def legend(figure):
    return [text.get_text() for text in figure.legends[0].get_texts()]


def test_legend_counts_the_poles_of_each_status(chain) -> None:
    counts = np.bincount(chain.subsets[0].diagrams[0].status, minlength=len(PoleStatus))
    labels = legend(stabilisation_figure(chain))
    assert f"selected: part of a mode ({counts[PoleStatus.SELECTED]})" in labels
    assert f"damping changes ({counts[PoleStatus.DAMPING_CHANGED]})" in labels


def test_rungs_of_the_thesis_are_block_rows(row_ladder) -> None:
    axes = stabilisation_figure(row_ladder).axes[0]
    assert axes.get_ylabel() == "Number of block rows"
    rungs = np.concatenate([line.get_ydata() for line in drawn(axes, "SELECTED")])
    assert set(rungs) <= set(range(12, 31))
    assert rungs.max() == 30


def test_harmonics_stand_at_their_frequency_with_their_name(chain_with_lines) -> None:
    axes = stabilisation_figure(chain_with_lines).axes[0]
    assert [line.get_xdata()[0] for line in drawn(axes, "harmonic")] == [12.5, 25.0]
    (band,) = [patch for patch in axes.patches if isinstance(patch, Rectangle) and patch.get_gid() == "harmonic band"]
    assert (band.get_x(), band.get_x() + band.get_width()) == pytest.approx((31.0, 36.0))
    labels = {text.get_text() for text in axes.texts if text.get_gid() == "harmonic label"}
    assert labels == {"12.50 Hz", "25.00 Hz", "0.516 per m"}
    assert "harmonics (1 to 2 × 12.5 Hz)" in legend(stabilisation_figure(chain_with_lines))


def test_modes_are_labelled_with_frequency_and_damping(chain) -> None:
    axes = stabilisation_figure(chain).axes[0]
    texts = [text.get_text() for text in axes.texts if text.get_gid() == "mode label"]
    modes = chain.modes
    expected = [f"{k + 1}\n{modes.natural_frequency[k]:.2f} Hz\n{100 * modes.damping_ratio[k]:.2f} %" for k in range(3)]
    assert texts == expected
    np.testing.assert_allclose([line.get_xdata()[0] for line in drawn(axes, "mode")], modes.natural_frequency)


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


def test_before_and_after_editing_are_both_drawn(edited) -> None:
    behind = stabilisation_figure(edited).axes[-1]
    first = [line for line in behind.get_lines() if str(line.get_gid()).startswith("first")]
    names = [line.get_gid() for line in first]
    assert names == ["first singular value", "first singular value before editing"]
    after, before = (np.asarray(line.get_ydata()) for line in first)
    np.testing.assert_allclose(after, singular_values_in_decibels(edited.edited_spectra, like=edited.spectra)[0, 1:])
    np.testing.assert_allclose(before, singular_values_in_decibels(edited.spectra, like=edited.spectra)[0, 1:])
