"""What channels measure by their names: COVESA VSS, common loggers, and the names of a user's own table."""

import fnmatch
import math
import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from importlib import resources
from pathlib import Path
from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field, model_validator

from sprung._checks import check_one_of
from sprung.errors import FormatError, ParameterError
from sprung.recording import QUANTITIES, Channel
from sprung.toml import checked, toml_fields
from sprung.units import conversion

#: Names of corners, as in a vehicle file.
_CORNER = re.compile(r"(front|rear|axle[1-9]\d?)_(left|right)")
# A table of names is a page of text; anything larger is another file.
_LARGEST_FILE = 1_000_000

_Number = Annotated[float, Field(allow_inf_nan=False)]


@dataclass(frozen=True, slots=True)
class NameRule:
    """What channels of some names measure.

    Parameters
    ----------
    pattern
        Glob of the whole name: `*` any letters, `?` any letter, `[xyz]` one of these letters. Case, blanks and
        underscores do not count.
    quantity
        Key of `sprung.recording.QUANTITIES`, not "unknown".
    unit
        Unit of the values where the file states none; None: the name does not fix it.
    direction
        Unit vector of the measured axis, or of rotation, of the vehicle: x forward, y left, z up (ISO 8855); None where
        the name does not mean an axis of the vehicle.
    corner
        Corner of the vehicle, such as "front_left"; None: not a part of a corner, or unknown.
    source
        Standard, logger or file that the rule comes from.

    Raises
    ------
    ParameterError
        If the pattern is empty, the quantity or the corner unknown, the direction not of length 1, or the unit one of
        another quantity.

    Examples
    --------
    >>> NameRule("Vehicle.Speed", "speed", unit="km/h", source="COVESA VSS").fits("vehicle.speed")
    True
    """

    pattern: str
    quantity: str
    unit: str | None = None
    direction: tuple[float, float, float] | None = None
    corner: str | None = None
    source: str = ""

    def __post_init__(self) -> None:
        if not _plain(self.pattern).strip("*?"):
            raise ParameterError(f"name {self.pattern!r} fits every channel: state letters of the name")
        check_one_of("quantity", self.quantity, [name for name in QUANTITIES if name != "unknown"])
        if self.unit is not None:
            measured, _ = conversion(self.unit)
            if QUANTITIES[measured] != QUANTITIES[self.quantity]:
                raise ParameterError(
                    f"unit {self.unit!r} measures {measured}, not {self.quantity}: correct the unit or the quantity"
                )
        if self.direction is not None and abs(math.hypot(*self.direction) - 1) > 0.01:
            raise ParameterError(
                f"direction {list(self.direction)} has length {math.hypot(*self.direction):.3g}, but must have 1: "
                "divide it by its length"
            )
        if self.corner is not None and not _CORNER.fullmatch(self.corner):
            raise ParameterError(
                f"corner {self.corner!r} must be front_left, front_right, rear_left, rear_right, or one of an axle in "
                "between such as axle2_left: correct it"
            )

    def fits(self, name: str) -> bool:
        """Return whether the rule is for channels of a name."""
        return _expression(self.pattern).fullmatch(_plain(name)) is not None


class _Entry(BaseModel):
    """Table `[[channel]]` of a table of names."""

    model_config = ConfigDict(strict=True, extra="forbid", frozen=True)

    name: str
    quantity: str
    unit: str | None = None
    direction: Annotated[tuple[_Number, _Number, _Number] | None, Field(strict=False)] = None
    corner: str | None = None
    source: str = ""

    @model_validator(mode="after")
    def _is_rule(self) -> "_Entry":
        self.rule()
        return self

    def rule(self, source: str = "") -> NameRule:
        """Return the rule, from `source` if it does not state its own."""
        return NameRule(self.name, self.quantity, self.unit, self.direction, self.corner, self.source or source)


class _NameTable(BaseModel):
    """Contents of a table of names."""

    model_config = ConfigDict(strict=True, extra="forbid", frozen=True)

    channel: Annotated[tuple[_Entry, ...], Field(strict=False, max_length=10_000)] = ()


def read_name_table(path: str | Path | None = None) -> tuple[NameRule, ...]:
    """Return the rules by which names state what channels measure, those of a user's table first.

    Parameters
    ----------
    path
        TOML file with one table `[[channel]]` for each rule: `name` (a pattern, see `NameRule`), `quantity`, and as far
        as the name fixes them `unit`, `direction`, `corner` and `source`. None: the rules of the package alone.

    Returns
    -------
    tuple of NameRule
        The first rule that fits a name counts.

    Raises
    ------
    ParameterError
        If there is no such file.
    FormatError
        If the file is not a valid table; the message names file, field, rule and remedy.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = Path(folder) / "names.toml"
    ...     _ = path.write_text('channel = [{name = "SG_07", quantity = "strain"}]')
    ...     rules = read_name_table(path)
    ...
    >>> rule_of("SG_07", rules).quantity, rule_of("Vehicle.Speed", rules).quantity
    ('strain', 'speed')
    """
    if path is None:
        return _shipped()
    path = Path(path)
    if not path.is_file():
        raise ParameterError(f"table of channel names {str(path)!r} is not a file: correct the path")
    if path.stat().st_size > _LARGEST_FILE:
        raise FormatError(f"{path} has {path.stat().st_size} bytes, more than any table of channel names: give another")
    return (*_rules(path.read_bytes(), source=path.name, file=str(path)), *_shipped())


@lru_cache(maxsize=1)
def _shipped() -> tuple[NameRule, ...]:
    """Return the rules of the package."""
    file = resources.files("sprung") / "channel_names.toml"
    return _rules(file.read_bytes(), source="sprung", file="channel_names.toml")


def _rules(content: bytes, *, source: str, file: str) -> tuple[NameRule, ...]:
    """Return the rules of a table; `file` is its name in messages."""
    fields = toml_fields(content, source=file)
    try:
        return tuple(entry.rule(source) for entry in checked(_NameTable, fields).channel)
    except ParameterError as error:
        raise FormatError(f"{file}: {error}") from None


def rule_of(name: str, rules: Sequence[NameRule] | None = None) -> NameRule | None:
    """Return the first rule that fits a name; None if there is none.

    Parameters
    ----------
    name
        Name of a channel.
    rules
        Rules from `read_name_table`; None: those of the package.

    Examples
    --------
    >>> rule = rule_of("Vehicle.Speed")
    >>> rule.quantity, rule.unit, rule.source
    ('speed', 'km/h', 'COVESA VSS')
    >>> rule_of("my_sensor") is None
    True
    """
    return next((rule for rule in (_shipped() if rules is None else rules) if rule.fits(name)), None)


def is_imu(channels: Sequence[Channel]) -> bool:
    """Return whether channels are those of one IMU: three accelerations and three angular velocities.

    Examples
    --------
    >>> is_imu([Channel(f"{quantity}_{axis}") for quantity in ("acc", "gyro") for axis in "xyz"])
    True
    """
    rules = [rule_of(channel.name) if channel.quantity == "unknown" else None for channel in channels]
    quantities = [
        channel.quantity if rule is None else rule.quantity for channel, rule in zip(channels, rules, strict=True)
    ]
    return all(quantities.count(quantity) == 3 for quantity in ("acceleration", "angular_velocity"))


def corner_of(name: str) -> str | None:
    """Return the corner that the name of a channel states by the rules of the package; None if it states none.

    Examples
    --------
    >>> corner_of("Vehicle.Chassis.Axle.Row1.Wheel.Left.Speed")
    'front_left'
    """
    rule = rule_of(name)
    return None if rule is None else rule.corner


def identified(channel: Channel, rules: Sequence[NameRule] | None = None) -> tuple[Channel, float, NameRule | None]:
    """Return a channel with what its name states and its file does not.

    Parameters
    ----------
    channel
        Channel as read; its quantity is "unknown" where the file states no unit.
    rules
        Rules from `read_name_table`; None: those of the package.

    Returns
    -------
    channel
        With quantity and direction by the rule where the file states none. Without a unit, of the file or by the rule,
        the quantity stays unknown: samples of a known quantity are in SI units.
    factor
        SI value = factor times value of the file; 1 where the file or nothing states the unit.
    rule
        Rule that fits the name; None if none does, or the file states another quantity.

    Examples
    --------
    >>> channel, factor, _ = identified(Channel("Vehicle.Acceleration.Vertical"))
    >>> channel.quantity, channel.direction, factor
    ('acceleration', (0.0, 0.0, 1.0), 1.0)
    """
    rule = rule_of(channel.name, rules)
    if rule is None or (channel.quantity != "unknown" and channel.unit != QUANTITIES[rule.quantity]):
        return channel, 1.0, None
    direction = rule.direction if channel.direction is None else channel.direction
    if channel.quantity != "unknown" or rule.unit is None:
        return replace(channel, direction=direction), 1.0, rule
    return replace(channel, quantity=rule.quantity, direction=direction), conversion(rule.unit)[1], rule


def describe_mapping(channel: Channel, rule: NameRule) -> str:
    """Return what a rule states of a channel in words, for the history and `sprung info`.

    Parameters
    ----------
    channel
        Channel as read, before `identified`.
    rule
        Rule that fits its name.

    Examples
    --------
    >>> rule = rule_of("Vehicle.Speed")
    >>> describe_mapping(Channel("Vehicle.Speed"), rule)
    'Vehicle.Speed: speed [km/h] (COVESA VSS)'
    """
    words = rule.quantity.replace("_", " ")
    if channel.quantity != "unknown":
        facts = [words]
    else:
        facts = [f"{words} [{rule.unit}]" if rule.unit is not None else f"{words} of unknown unit"]
    if rule.direction is not None and channel.direction is None:
        facts.append(f"axis ({', '.join(f'{value:g}' for value in rule.direction)})")
    if rule.corner is not None:
        facts.append(rule.corner.replace("_", " "))
    source = f" ({rule.source})" if rule.source else ""
    return f"{channel.name}: {', '.join(facts)}{source}"


@lru_cache(maxsize=1024)
def _expression(pattern: str) -> re.Pattern[str]:
    """Return the regular expression of a pattern."""
    return re.compile(fnmatch.translate(_plain(pattern)))


def _plain(name: str) -> str:
    """Return a name in lower case, without blanks and underscores."""
    return re.sub(r"[\s_]", "", name.casefold())
