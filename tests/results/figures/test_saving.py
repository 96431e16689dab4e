import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import matplotlib
import numpy as np
import pytest
from matplotlib.image import imread

from sprung.errors import ParameterError
from sprung.results.figures import figures, save_figures

ALWAYS = {"stabilisation.png", "spectra.png"}
OF_MODES = {"mode_shapes.png", "complexity.png", "mac.png"}


@pytest.fixture
def none(chain):
    """An identification without modes."""
    return replace(chain, modes=chain.modes.take([]), members=chain.members[:0])


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "names"),
    [
        ("chain_with_lines", ALWAYS | OF_MODES),
        ("edited", ALWAYS | OF_MODES),
        ("single", ALWAYS),
        ("none", ALWAYS),
        ("car", ALWAYS | OF_MODES | {"subsets.png"}),
    ],
)
def test_all_pictures_are_written(name, names, tmp_path: Path, request) -> None:
    identification, folder = request.getfixturevalue(name), tmp_path / "new" / "figures"
    paths = save_figures(identification, folder, source="run.csv")
    assert {path.name for path in paths} == names
    for path in paths:
        assert path.parent == folder
        picture = imread(path)
        assert min(picture.shape[:2]) > 300
        assert 0.01 < np.mean(picture[..., :3].min(axis=-1) < 0.95) < 0.9


@pytest.mark.slow
def test_headings_name_the_source_and_the_method(chain) -> None:
    for name, figure in figures(chain, source="run.csv").items():
        heading = figure.get_suptitle()
        assert "run.csv" in heading, name
    assert "Cov-SSI of acc_1, acc_2, acc_3 at 125 Hz" in figures(chain)["stabilisation"].get_suptitle()


@pytest.mark.slow
def test_no_global_state_of_matplotlib_is_touched(chain) -> None:
    before = matplotlib.rcParams.copy()
    for figure in figures(chain).values():
        figure.draw_without_rendering()
    assert matplotlib.rcParams.copy() == before
    code = "import sys, sprung.results.figures; sys.exit('matplotlib.pyplot' in sys.modules)"
    subprocess.run([sys.executable, "-c", code], check=True)


def test_another_format_is_refused(single, tmp_path: Path) -> None:
    with pytest.raises(ParameterError, match=r"^file_format 'gif' is not one of pdf, png, svg$"):
        save_figures(single, tmp_path / "new", file_format="gif")
    assert not (tmp_path / "new").exists()
