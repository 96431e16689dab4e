"""Argument checks, the only place where their messages are worded."""

from collections.abc import Collection, Sequence
from importlib import import_module
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from sprung._arrays import Real
from sprung.errors import DataError, MissingPackageError, ParameterError


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
        raise missing_package(error, package, purpose=purpose, extra=extra) from None


def missing_package(error: ImportError, package: str, *, purpose: str, extra: str) -> ImportError:
    """Return the error of an optional package that is not installed; `error` itself if another module is missing."""
    if error.name is None or error.name.split(".")[0] != package.split(".", maxsplit=1)[0]:
        return error
    return MissingPackageError(f"{purpose} needs the package {package}: install it with pip install 'sprung[{extra}]'")


def check_complete(names: Sequence[str], samples: Real) -> None:
    """Raise if any of the samples, shape (channels, samples), is missing (NaN) or infinite.

    Raises
    ------
    DataError
        If a sample is missing or infinite.
    """
    n_missing = np.count_nonzero(~np.isfinite(samples), axis=1)
    if n_missing.any():
        row = int(np.argmax(n_missing))
        raise DataError(
            f"channel {names[row]!r} has {n_missing[row]} missing values: turn them into gaps (without_missing)"
        )
