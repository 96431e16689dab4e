"""Argument checks, the only place where their messages are worded."""

import difflib
import re
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from importlib import import_module
from os import PathLike
from types import MappingProxyType
from typing import Any, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from sprung._arrays import Real
from sprung.errors import DataError, MissingPackageError, ParameterError

#: Similarity of two names (`difflib`, 0 to 1) above which one may be a slip of the other.
_ALIKE = 0.75
#: Units at the end of a name, in letters alone.
_UNITS_OF_NAMES = re.compile(r"(?<=.)(mps2|ms2|mss|kmh|kph|mps|dps|degs|rads|degc|kpa|mg|g)$")
_Value = TypeVar("_Value")
#: What gives a value of each type, and the function that reads it from a file.
_MAKERS = MappingProxyType(
    {
        "Baseline": "sprung.learn(observations)",
        "CornerFit": "sprung.fit_corners(recording, vehicle)",
        "DataSheet": "sprung.DataSheet(mass=.., wheelbase=.., ..)",
        "Diagnosis": "sprung.diagnose(observations, baseline)",
        "DriveSettings": "sprung.DriveSettings()",
        "Identification": "sprung.cov_ssi(recording)",
        "Modes": "sprung.cov_ssi(recording).modes",
        "Observation": "sprung.observe(recordings, vehicle)",
        "Recording": "sprung.read('run.csv')",
        "Structure": "sprung.structure(vehicle)",
        "TrackedModes": "sprung.track_modes(modes)",
        "TypeBaseline": "sprung.learn_type(observations_by_vehicle)",
        "Vehicle": "sprung.read_vehicle('car.toml')",
    }
)
_READERS = MappingProxyType({"Baseline": "read_baseline", "Recording": "read", "Vehicle": "read_vehicle"})
_FROM_SAMPLES = "sprung.Recording(samples, sampling_rate, channels), with samples of shape (channels, samples)"


def frozen_array(name: str, values: ArrayLike, *, ndim: int, dtype: Any = np.float64) -> NDArray[Any]:
    """Return `values` as a read-only array of `ndim` dimensions, without a copy where none is needed.

    Raises
    ------
    ParameterError
        If the array has another number of dimensions.
    """
    array = np.asarray(values, dtype=dtype)
    if array.ndim != ndim:
        raise ParameterError(f"{name} has {array.ndim} dimensions {array.shape}, but must have {ndim}")
    view = array.view()
    view.flags.writeable = False
    return view


def freeze(value: object, *, dtype: Any = np.float64, **ndim: int) -> None:
    """Make arrays of a frozen dataclass read-only, each with its number of dimensions; for `__post_init__`."""
    for name, count in ndim.items():
        object.__setattr__(value, name, frozen_array(name, getattr(value, name), ndim=count, dtype=dtype))


def check_number(
    name: str,
    value: float,
    *,
    above: float | None = None,
    at_least: float | None = None,
    at_most: float | None = None,
    advice: str = "",
) -> float:
    """Return `value` if it is a finite number within the bounds.

    Raises
    ------
    ParameterError
        If the value is not finite, or outside the bounds.
    """
    rules = []
    if above is not None:
        rules.append((f"above {above:g}", value > above))
    if at_least is not None:
        rules.append((f"at least {at_least:g}", value >= at_least))
    if at_most is not None:
        rules.append((f"at most {at_most:g}", value <= at_most))
    if not -np.inf < value < np.inf:  # an integer may be larger than those of numpy
        rules.insert(0, ("finite", False))
    if not all(holds for _, holds in rules):
        wanted = " and ".join(rule for rule, _ in rules)
        raise ParameterError(f"{name}={value:g} must be {wanted}" + (f": {advice}" if advice else ""))
    return value


def check_one_of(name: str, value: str, allowed: Collection[str], *, advice: str = "") -> str:
    """Return `value` if it is one of `allowed`.

    Raises
    ------
    ParameterError
        If the value is not one of them.
    """
    if value not in allowed:
        known = ", ".join(sorted(allowed))
        raise ParameterError(f"{name} {value!r} is not one of {known}" + (f": {advice}" if advice else ""))
    return value


def nearest_name(name: str, known: Iterable[str]) -> str | None:
    """Return the one of `known` that was probably meant by `name`; None if none is like it.

    Parameters
    ----------
    name
        Name that is not known.
    known
        Names to choose from.

    Notes
    -----
    Names that differ in case, separators and units alone ("AccZ", "acc_z [m/s^2]") are the same word; otherwise the
    names are compared by the share of letters that they have in common, in their order.

    Examples
    --------
    >>> nearest_name("AccZ", ["Acc_X", "Acc_Z"])
    'Acc_Z'
    >>> nearest_name("spring_stifness", ["damping", "spring_stiffness"])
    'spring_stiffness'
    """
    words = {other: _plain(other) for other in known}
    wanted = _plain(name)
    same = [other for other, word in words.items() if word == wanted]
    if same:
        return same[0]
    close = difflib.get_close_matches(wanted, words.values(), n=1, cutoff=_ALIKE)
    return next((other for other, word in words.items() if word in close), None)


def _plain(name: str) -> str:
    """Return the letters and digits of a name in lower case, without a unit in brackets or at its end."""
    letters = re.sub(r"[^a-z0-9]", "", re.sub(r"[\[(].*?[\])]", "", name.casefold()))
    return _UNITS_OF_NAMES.sub("", letters) or name.casefold()


def check_type(name: str, value: object, *types: type, advice: str = "") -> None:
    """Raise if `value` is of none of the types, the first of which is named with what gives one.

    Raises
    ------
    ParameterError
        If the value is of another type.
    """
    if not isinstance(value, types):
        raise wrong_type(name, value, types[0].__name__, advice)


def settings_of(kind: type[_Value], settings: _Value | None) -> _Value:
    """Return settings, or the default ones of their type for None.

    Raises
    ------
    ParameterError
        If they are of another type.
    """
    given = kind() if settings is None else settings
    check_type("settings", given, kind, advice=f"{kind.__name__}(...)")
    return given


def check_each(name: str, values: Iterable[_Value], *types: type) -> Iterable[_Value]:
    """Return several values of one of the types; those of an iterator are checked as it is read.

    Raises
    ------
    ParameterError
        If these are not several values, or one of them is of another type.
    """
    if isinstance(values, types):
        raise ParameterError(f"{name} is one {types[0].__name__}, but must be several: pass [{name}]")
    if isinstance(values, str | PathLike | Mapping) or hasattr(values, "shape") or not isinstance(values, Iterable):
        raise wrong_type(name, values, types[0].__name__)
    each = _checked(name, values, types)
    return list(each) if isinstance(values, Sequence) else each


def check_path(name: str, value: object) -> None:
    """Raise if `value` is not a path.

    Raises
    ------
    ParameterError
        If the value is of another type.
    """
    if not isinstance(value, str | PathLike):
        raise ParameterError(f"{name} is {_describe(value)}, but must be the path of one file: pass 'folder/name'")


def _checked(name: str, values: Iterable[_Value], types: tuple[type, ...]) -> Iterator[_Value]:
    """Yield the values, each if it is of one of the types."""
    for number, value in enumerate(values):
        check_type(f"{name}[{number}]", value, *types)
        yield value


def wrong_type(name: str, value: object, kind: str, advice: str = "") -> ParameterError:
    """Return the error of a value of another type than wanted, which says what to pass."""
    advice = advice or _MAKERS.get(kind, f"a sprung.{kind}")
    if isinstance(value, str | PathLike) and kind in _READERS:
        advice = f"sprung.{_READERS[kind]}({str(value)!r})"
    elif hasattr(value, "shape") and kind == "Recording":
        advice = _FROM_SAMPLES
    kind = "array" if kind == "ndarray" else kind
    article = "an" if kind[0] in "AEIOUa" else "a"
    return ParameterError(f"{name} is {_describe(value)}, but must be {article} {kind}: pass {advice}")


def _describe(value: object) -> str:
    """Return what a value of a wrong type is."""
    if value is None:
        return "None"
    if isinstance(value, str | PathLike):
        return f"the text {str(value)!r}"
    name = "array" if type(value).__name__ == "ndarray" else type(value).__name__
    kind = f"{'an' if name[0] in 'AEIOUaeiou' else 'a'} {name}"
    return f"{kind} of shape {value.shape}" if hasattr(value, "shape") else kind


def required(package: str, *, purpose: str, extra: str) -> Any:
    """Return an optional package, or raise an error that states its purpose and how to install it.

    Raises
    ------
    MissingPackageError
        If the package is not installed.
    """
    try:
        return import_module(package)
    except ImportError as error:
        if error.name is None or error.name.split(".")[0] != package.split(".", maxsplit=1)[0]:
            raise  # another module is missing
        advice = f"install it with pip install 'sprung[{extra}]'"
        raise MissingPackageError(f"{purpose} needs the package {package}: {advice}") from None


def data_frame_of(columns: Mapping[str, Any]) -> Any:
    """Return a pandas.DataFrame of columns by their names.

    Raises
    ------
    MissingPackageError
        If pandas is not installed.
    """
    return required("pandas", purpose="a data frame", extra="notebook").DataFrame(columns)


def check_complete(names: Sequence[str], samples: Real) -> None:
    """Raise if any of the samples, shape (channels, samples), is missing (NaN) or infinite.

    Raises
    ------
    DataError
        If a sample is missing or infinite.
    """
    # A sum over finite values is finite unless it overflows, and needs no array of its own.
    with np.errstate(over="ignore", invalid="ignore"):
        is_complete = np.isfinite(np.sum(samples))
    if is_complete:
        return
    n_missing = np.count_nonzero(~np.isfinite(samples), axis=1)
    if n_missing.any():
        row = int(np.argmax(n_missing))
        raise DataError(
            f"channel {names[row]!r} has {n_missing[row]} missing values: turn them into gaps (without_missing)"
        )
