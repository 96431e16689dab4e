"""Universal files: what is written is read back, to the digits of the format."""

import sys

import numpy as np
import pytest

from sprung.errors import MissingPackageError, ParameterError
from sprung.formats.nodes import neighbours, nodes_of, write_universal
from sprung.modal import Modes
from sprung.recording import Channel

pyuff = pytest.importorskip("pyuff")

X, Y, Z = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)


def modes_of(channels, n_modes=3, seed=1):
    """Return random complex modes of channels."""
    generator = np.random.default_rng(seed)
    shapes = generator.standard_normal((n_modes, len(channels), 2)) @ [1, 0.1j]
    omega = 2 * np.pi * np.sort(generator.uniform(1, 20, n_modes))
    return Modes(
        poles=np.asarray(omega * (1j - 0.02), dtype=np.complex128),
        mode_shapes=shapes / np.abs(shapes).max(axis=1, keepdims=True),
        channels=tuple(channel.name for channel in channels),
        natural_frequency_std=np.full(n_modes, 0.01),
        damping_ratio_std=np.full(n_modes, 0.001),
        stable_rate=np.ones(n_modes),
        labels=("bounce", *(None,) * (n_modes - 1)),
    )


def corner_channels():
    """Return vertical sensors at the corners of a rectangle, and a lateral one at the first corner."""
    corners = ((1.25, 0.8, 0.1), (1.25, -0.8, 0.1), (-1.3, -0.8, 0.1), (-1.3, 0.8, 0.1))
    vertical = [Channel(f"z{k}", "acceleration", corner, Z) for k, corner in enumerate(corners)]
    return (*vertical, Channel("y0", "acceleration", corners[0], Y))


def rounded(values):
    """Return numbers as the format writes them: six significant digits."""
    return np.array([float(f"{value:.5e}") for value in np.ravel(values)]).reshape(np.shape(values))


@pytest.mark.parametrize("ending", ["unv", "uff"])
def test_geometry_and_modes_are_read_back(tmp_path, ending) -> None:
    channels = corner_channels()
    modes = modes_of(channels)
    write_universal(modes, channels, tmp_path / f"modes.{ending}")
    sets = pyuff.UFF(str(tmp_path / f"modes.{ending}")).read_sets()
    assert [each["type"] for each in sets] == [164, 15, 82, 55, 55, 55]
    units, nodes, lines, *shapes = sets
    assert units["units_description"].strip() == "SI"
    assert units["length"] == 1.0
    assert list(nodes["node_nums"]) == [1, 2, 3, 4]
    read = np.column_stack([nodes["x"], nodes["y"], nodes["z"]])
    assert read == pytest.approx(np.array([channel.position for channel in channels[:4]]), abs=1e-9)
    assert lines["nodes"].astype(int).tolist() == [1, 2, 0, 1, 4, 0, 2, 3, 0, 3, 4]
    for k, each in enumerate(shapes):
        assert (each["analysis_type"], each["data_ch"], each["mode_n"]) == (3, 2, k + 1)
        pole, shape = modes.poles[k], modes.mode_shapes[k]
        assert [each["eig"].real, each["eig"].imag] == pytest.approx(rounded([pole.real, pole.imag]), abs=1e-9)
        for part in ("real", "imag"):
            assert getattr(each["r3"], part) == pytest.approx(rounded(getattr(shape[:4], part)), abs=1e-9)
            lateral = [getattr(shape[4], part), 0, 0, 0]
            assert getattr(each["r2"], part) == pytest.approx(rounded(lateral), abs=1e-9)
        assert np.abs(each["r1"]).max() == 0
    assert shapes[0]["id1"].strip() == "mode 1 bounce"
    assert shapes[0]["id4"].strip() == "channels of the nodes: z0+y0 z1 z2 z3"


def test_channels_without_positions_stand_side_by_side(tmp_path) -> None:
    channels = tuple(Channel(f"ä channel with a long name {k}") for k in range(5))
    modes = modes_of(channels)
    write_universal(modes, channels, tmp_path / "modes.unv")
    _, nodes, _, first, *_ = pyuff.UFF(str(tmp_path / "modes.unv")).read_sets()
    assert list(nodes["x"]) == [0, 1, 2, 3, 4]
    assert first["r3"].real == pytest.approx(rounded(modes.mode_shapes[0].real), abs=1e-9)
    assert first["id3"].strip() == "positions unknown: channels side by side"
    assert first["id4"].strip().endswith("...")


def test_many_lines_are_cut_into_traces(tmp_path) -> None:
    channels = [Channel(f"c{k}", "acceleration", (float(k), 0.0, 0.0), Z) for k in range(201)]
    write_universal(modes_of(channels), channels, tmp_path / "modes.unv")
    traces = [each for each in pyuff.UFF(str(tmp_path / "modes.unv")).read_sets() if each["type"] == 82]
    pairs = {(int(a), int(b)) for trace in traces for a, b, *_ in np.append(trace["nodes"], 0).reshape(-1, 3)}
    assert pairs == {(k, k + 1) for k in range(1, 201)}


def test_other_endings_and_a_missing_package(tmp_path, monkeypatch) -> None:
    channels = corner_channels()
    with pytest.raises(ParameterError, match=r"universal files end in \.unv or \.uff"):
        write_universal(modes_of(channels), channels, tmp_path / "modes.txt")
    monkeypatch.setitem(sys.modules, "pyuff", None)
    with pytest.raises(MissingPackageError, match=r"pip install 'sprung\[uff\]'"):
        write_universal(modes_of(channels), channels, tmp_path / "modes.unv")


def test_motions_are_accelerations_along_the_directions() -> None:
    slanted = (0.6, 0.0, 0.8)
    channels = (
        Channel("a", "acceleration", (0.0, 0.0, 0.0), slanted),
        Channel("v", "velocity", (1.0, 0.0, 0.0), Z),
        Channel("rate", "angular_velocity", None, Y),
        Channel("d", "displacement", (1.0, 0.0, 0.0), X),
    )
    modes = modes_of(channels, 1)
    nodes = nodes_of(modes, channels)
    pole, shape = modes.poles[0], modes.mode_shapes[0]
    assert nodes.motions[0, 0] == pytest.approx(shape[0] * np.array(slanted), abs=1e-12)
    assert nodes.motions[0, 1] == pytest.approx(np.array([shape[3] * pole**2, 0, shape[1] * pole]), rel=1e-12)
    assert nodes.left_out == ("rate",)
    assert nodes.channels == (("a",), ("v", "d"))


def test_neighbours_are_the_edges_of_a_frame() -> None:
    positions = np.array([(x, y, z) for z in (0, 3, 6) for y in (0, 4) for x in (0, 5)], dtype=float)
    edges = {(i, j) for i, j in neighbours(positions) if np.count_nonzero(positions[i] != positions[j]) == 1}
    assert len(neighbours(positions)) == len(edges) == 3 * 4 + 2 * 4
    assert neighbours(np.zeros((1, 3))).shape == (0, 2)
