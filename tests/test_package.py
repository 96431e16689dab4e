import inspect
import subprocess
import sys
from collections.abc import Iterator
from importlib import import_module, metadata
from typing import Annotated, Any, get_args, get_origin, get_type_hints

import pytest

import sprung


def test_import_is_light() -> None:
    code = "import sys, sprung; print(sorted({'numpy', 'scipy', 'pydantic', 'typer'} & set(sys.modules)))"
    assert subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout == "[]\n"


@pytest.mark.parametrize(
    "package", ["sprung", "sprung.results.documents", "sprung.results.tables", "sprung.results.page"]
)
def test_every_public_name_is_there_and_listed(package: str) -> None:
    module = import_module(package)
    assert len(module.__all__) > 8
    for name in module.__all__:
        assert getattr(module, name) is not None
        assert name in dir(module)
    with pytest.raises(AttributeError, match=f"module '{package}' has no attribute 'corner'"):
        module.corner  # noqa: B018


def test_types_of_results_have_a_public_name() -> None:
    car = sprung.structure(sprung.read_vehicle("zafira"))
    assert isinstance(car, sprung.Structure)
    assert all(isinstance(component, sprung.Component) for component in car.components())
    assert isinstance(sprung.read_description("chain3"), sprung.Chain)


@pytest.mark.slow
def test_figures_are_reachable_from_the_package() -> None:
    code = "import sprung; print(sprung.plotting.save_figures.__name__, 'tracks_figure' in dir(sprung.plotting))"
    process = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert process.stdout == "save_figures True\n"


#: Types of parts of models, which are named in packages of their own.
OF_MODELS = {
    "likelihood": {"DrivenSegments", "Expected", "LateralModel", "Model", "Stiffening"},
    "diagnosis": {"Scatter"},
    "excitation": {"Lines", "MeasuredSurface", "Route"},
    "simulation": {"ForceLaw"},
    "vehicles": {
        *("BodyShape", "ChainMass", "Element", "Lateral", "LearntNumber", "MechanicalSystem", "Outputs", "QuarterBody"),
        *("QuarterCorner", "StateSpace", "Wheel"),
    },
}


def own_types(annotation: Any) -> Iterator[type]:
    """Yield the types of this package in an annotation."""
    if get_origin(annotation) is Annotated:
        return
    for part in get_args(annotation):
        yield from own_types(part)
    if isinstance(annotation, type) and annotation.__module__.startswith("sprung."):
        yield annotation


def received(kind: type) -> Iterator[Any]:
    """Yield the types of the public attributes of a type, and of what its methods return."""
    yield from (hint for name, hint in get_type_hints(kind).items() if not name.startswith("_"))
    for name, member in inspect.getmembers(kind):
        function = member.fget if isinstance(member, property) else member
        if not name.startswith("_") and inspect.isfunction(function) and function.__module__ == kind.__module__:
            yield get_type_hints(function, include_extras=True).get("return")


def test_every_type_that_is_received_is_importable_from_the_package() -> None:
    values = [getattr(sprung, name) for name in sprung.__all__]
    public = {value for value in values if isinstance(value, type)}
    hints = [get_type_hints(function).get("return") for function in values if inspect.isfunction(function)]
    results = public - {kind for kind in public if issubclass(kind, sprung.Document | Exception)}
    hints += [hint for kind in results for hint in received(kind)]
    missing = {f"{kind.__module__.split('.')[1]}.{kind.__name__}" for hint in hints for kind in own_types(hint)}
    missing -= {f"{kind.__module__.split('.')[1]}.{kind.__name__}" for kind in public}
    assert missing <= {f"{home}.{name}" for home, names in OF_MODELS.items() for name in names}


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
