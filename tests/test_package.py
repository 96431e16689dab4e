import ast
import subprocess
import sys
from importlib import metadata
from pathlib import Path
from pkgutil import resolve_name

import pytest

import sprung


def test_import_is_light() -> None:
    code = "import sys, sprung; print(sorted({'numpy', 'scipy', 'pydantic', 'typer'} & set(sys.modules)))"
    assert subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout == "[]\n"


def test_every_public_name_is_there_and_listed() -> None:
    for name in sprung.__all__:
        assert getattr(sprung, name) is not None
        assert name in dir(sprung)


def test_the_stub_has_the_same_names_from_the_same_modules() -> None:
    stub = ast.parse(Path(sprung.__file__).with_suffix(".pyi").read_text(encoding="utf-8"))
    imports = [node for node in stub.body if isinstance(node, ast.ImportFrom)]
    typed = [(f"{node.module}:{alias.name}", alias.asname) for node in imports for alias in node.names]
    assert {name for _, name in typed} == set(sprung.__all__)
    for place, name in typed:
        expected = sprung.plotting if name == "plotting" else resolve_name(place)
        assert getattr(sprung, str(name)) is expected


def test_types_of_results_have_a_public_name() -> None:
    car = sprung.structure(sprung.read_vehicle("zafira"))
    assert isinstance(car, sprung.Structure)
    assert all(isinstance(component, sprung.Component) for component in car.components())
    assert isinstance(sprung.read_description("chain3"), sprung.Chain)
    assert callable(sprung.plotting.save_figures)


def test_version_is_that_of_the_installed_package() -> None:
    assert metadata.version("sprung") == sprung.__version__


def test_unknown_names_are_refused() -> None:
    name = "frequencies"
    with pytest.raises(AttributeError, match="'frequencies'"):
        getattr(sprung, name)


def test_three_lines_from_a_file_to_modes(tmp_path) -> None:
    from sprung.simulation import usual_excitation
    from sprung.vehicles import chain

    masses = chain()
    simulated = sprung.simulate(masses, usual_excitation(masses), duration=120.0, sampling_rate=200.0, seed=1)
    sprung.write(simulated, tmp_path / "run.csv")

    run = sprung.read(tmp_path / "run.csv")
    lines = str(sprung.cov_ssi(run)).splitlines()

    assert lines[0].split("  ")[-1] == "label"
    assert [float(line.split()[0]) for line in lines[1:]] == pytest.approx([7.01, 19.65, 28.39], rel=0.01)
    assert [float(line.split()[3]) for line in lines[1:]] == pytest.approx([1.12, 3.15, 4.55], rel=0.3)
