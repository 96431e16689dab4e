"""Wrong first arguments of public functions: the sentence says what to pass."""

from functools import partial
from inspect import Parameter, isfunction, signature
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import sprung

pandas: Any = pytest.importorskip("pandas")
#: The package as a caller without a type checker sees it.
UNTYPED: Any = sprung
CAR = sprung.read_vehicle("zafira")
READERS = ("sprung.read('run.csv')", "sprung.read('b.csv')", "sprung.Recording(samples, sampling_rate, channels)")
#: Functions of one text, which state what it must be.
OF_TEXT = {"json_schema", "parse_fault"}


def functions() -> list[str]:
    """Return the names of all public functions that take a value."""
    named = {name: getattr(sprung, name) for name in sprung.__all__}
    return [name for name, function in named.items() if isfunction(function) and name not in OF_TEXT]


@pytest.mark.parametrize("name", functions())
@pytest.mark.parametrize("wrong", [3.0, object(), ["a", "b"]], ids=["number", "object", "list of texts"])
def test_every_public_function_says_what_to_pass_first(name, wrong, tmp_path) -> None:
    function = getattr(sprung, name)
    required = [
        parameter.name for parameter in signature(function).parameters.values() if parameter.default is Parameter.empty
    ]
    others = {"vehicle": CAR, "path": tmp_path / "result.json", "duration": 1.0, "sampling_rate": 100.0, "n_windows": 6}
    first = next(iter(signature(function).parameters))
    given = {other: others.get(other, [1.0]) for other in required if other != first}

    with pytest.raises(sprung.ParameterError, match=r" (is|must be) .*: pass ") as refusal:
        function(**{first: wrong}, **given)
    assert first in str(refusal.value) or "recordings" in str(refusal.value)
    assert not (tmp_path / "result.json").exists()


RUN = sprung.Recording(
    np.ones((5, 500)), 50.0, tuple(map(sprung.Channel, ("acc_fl", "acc_fr", "acc_rl", "acc_rr", "v")))
)


@pytest.mark.parametrize(
    "function",
    [
        partial(sprung.cov_ssi, RUN),
        partial(sprung.poly_lscf, RUN),
        partial(sprung.enhanced_fdd, RUN),
        partial(sprung.as_in_thesis),
        partial(sprung.fit_corners, RUN, CAR),
        partial(sprung.calibrate, RUN, CAR),
        partial(sprung.track_modes, []),
        partial(sprung.read, "run.csv"),
    ],
    ids=lambda function: function.func.__name__,
)
def test_settings_of_another_type_say_which_to_pass(function) -> None:
    with pytest.raises(sprung.ParameterError, match=r"settings is a dict, but must be an? (\w+): pass \1\(\.\.\.\)"):
        function(settings={"band": (1, 2)})


@pytest.mark.parametrize(
    "function",
    [
        sprung.cov_ssi,
        sprung.enhanced_fdd,
        sprung.windows,
        lambda recordings: sprung.fit_corners(recordings, CAR),
        lambda recordings: sprung.observe(recordings, CAR),
        lambda recordings: sprung.calibrate(recordings, CAR),
    ],
)
@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        ("run.csv", "recordings is the text 'run.csv', but must be a Recording: pass sprung.read('run.csv')"),
        (Path("run.csv"), "recordings is the text 'run.csv', but must be a Recording: pass sprung.read('run.csv')"),
        ([Path("b.csv")], "recordings[0] is the text 'b.csv', but must be a Recording: pass sprung.read('b.csv')"),
        (np.zeros((4, 9)), "recordings is an array of shape (4, 9), but must be a Recording: pass sprung.Recording("),
        (pandas.DataFrame({"a": [1]}), "recordings is a DataFrame of shape (1, 1), but must be a Recording: pass"),
        (None, "recordings is None, but must be a Recording: pass sprung.read('run.csv')"),
    ],
    ids=["text", "path", "list of paths", "array", "data frame", "none"],
)
def test_what_is_no_recording_is_named_with_what_makes_one_of_it(function, wrong, said) -> None:
    with pytest.raises(sprung.ParameterError) as refusal:
        function(wrong)
    assert str(refusal.value).startswith(said)


def test_an_iterator_is_checked_as_it_is_read() -> None:
    with pytest.raises(sprung.ParameterError, match=r"^recordings\[0\] is the text 'a.csv'"):
        UNTYPED.cov_ssi(iter(["a.csv"]))


def test_the_vehicle_and_the_baseline_are_checked_too() -> None:
    run = sprung.Recording(np.zeros((1, 100)), 100.0, (sprung.Channel("a"),))
    for function in (UNTYPED.fit_corners, UNTYPED.observe, UNTYPED.calibrate):
        with pytest.raises(sprung.ParameterError, match=r"pass sprung\.read_vehicle\('car\.toml'\)$"):
            function(run, "car.toml")
    with pytest.raises(sprung.ParameterError, match=r"^vehicle is the text 'car\.toml', but must be a Vehicle"):
        UNTYPED.cov_ssi(run, vehicle="car.toml")
    with pytest.raises(sprung.ParameterError, match=r"pass sprung\.read_baseline\('B\.json'\)$"):
        UNTYPED.diagnose([], "B.json")
    with pytest.raises(sprung.ParameterError, match=r"^observations is a Recording, .*pass sprung\.observe\(record"):
        UNTYPED.learn(run)
    with pytest.raises(sprung.ParameterError, match=r"^windows is one Modes, but must be several: pass \[windows\]$"):
        UNTYPED.track_modes(UNTYPED.Modes(np.zeros(0), np.zeros((0, 1)), ("a",), *3 * (np.zeros(0),), ()))


@pytest.mark.parametrize("wrong", [1, None, ["front_left.spring=-0.2"]])
def test_a_fault_that_is_no_text(wrong) -> None:
    with pytest.raises(sprung.ParameterError, match="fault"):
        UNTYPED.parse_fault(wrong)
