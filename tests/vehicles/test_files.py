"""Vehicle files: what is read, what is refused and in which words."""

import math
import tomllib

import pytest
from hypothesis import given
from hypothesis import strategies as st

from sprung.errors import FormatError, ParameterError, SprungError
from sprung.vehicles import (
    VEHICLES,
    Chain,
    Quarter,
    Vehicle,
    parse_vehicle,
    read_description,
    read_vehicle,
    write_vehicle,
)

# The example of the contract, with every optional part.
EXAMPLE = """
schema = "sprung.vehicle/1"
name = "zafira"
kind = "road"
speed_channel = "gps_speed"
speed_delay = 1.0
speed_scale = 1.02
[body]
mass = 1480.0
pitch_inertia = 2200.0
roll_inertia = 360.0
product_of_inertia = -40.0
height = 0.55
[[axle]]
x = 1.22
half_track = 0.702
unsprung_mass = 40.5
spring_stiffness = 44179.0
damping = 1781
tyre_stiffness = 190900.0
anti_roll_stiffness = 12e3
rolling_radius = 0.31
[[axle]]
x = -1.58
half_track = 0.702
unsprung_mass = 40.5
spring_stiffness = 36295.0
damping = 1688.0
tyre_stiffness = 190900.0
[[mounted_mass]]
mass = 180.0
x = 1.1
frequency = 11.0
damping_ratio = 0.08
[[sensor]]
channel = "acc_fl"
quantity = "acceleration"
unit = "g"
position = [1.22, 0.702, 0]
direction = [0.0, 0.0, 1.0]
scale = 0.001
[[sensor]]
channel = "pitch_rate"
quantity = "angular_velocity"
unit = "deg/s"
direction = [0.0, 1.0, 0.0]
delay = 0.004
[[sensor]]
channel = "oil"
quantity = "temperature"
unit = "°C"
[[sensor]]
channel = "level_fl"
quantity = "travel"
unit = "mm"
between = "front_left"
[[sensor]]
channel = "wss_fl"
quantity = "wheel_speed"
unit = "rpm"
on = "wheel_front_left"
[[sensor]]
channel = "tpms_fl"
quantity = "pressure"
unit = "bar"
on = "wheel_front_left"
[[flexible_mode]]
shape = "torsion"
frequency = 22.0
damping_ratio = 0.03
[[flexible_mode]]
shape = "bending"
frequency = 27.0
damping_ratio = 0.02
mass = 600.0
[[learnt]]
name = "acc_fl.x"
value = 1.22
std = 0.01
given = 1.30
source = "calibration with 4 drives"
[[learnt]]
name = "torsion.frequency"
value = 22.0
std = 0.2
"""

CHAIN = {"name": "c", "kind": "chain", "mass": [{"mass": 1.0, "stiffness": 2.0, "damping": 3.0}]}


def changed(path, value):
    """The example's fields with one of them changed, or left out where the value is None."""
    fields = tomllib.loads(EXAMPLE)
    place = fields
    for step in path[:-1]:
        place = place[step]
    if value is None:
        del place[path[-1]]
    else:
        place[path[-1]] = value
    return fields


def test_example_of_the_contract(tmp_path) -> None:
    path = tmp_path / "zafira.toml"
    path.write_text(EXAMPLE, encoding="utf-8")
    vehicle = read_description(path)
    assert isinstance(vehicle, Vehicle)
    assert vehicle.axle[0].anti_roll_stiffness == 12e3
    assert vehicle.axle[1].anti_roll_stiffness == 0.0
    assert vehicle.mounted_mass[0].y == 0.0
    assert vehicle.speed_channel == "gps_speed"
    assert vehicle.sensor[0].factor == pytest.approx(9.80665e-3)
    channel = vehicle.sensor[0].as_channel()
    assert channel.position == (1.22, 0.702, 0.0)
    assert channel.unit == "m/s^2"
    assert (vehicle.sensor[0].delay, vehicle.sensor[1].delay) == (0.0, 0.004)
    assert vehicle.sensor[3].as_channel().quantity == "displacement"
    assert vehicle.flexible_mode[0].mass is None
    assert (vehicle.learnt[0].given, vehicle.learnt[1].given) == (1.30, None)
    assert read_description(str(path)) == vehicle


def test_a_file_without_the_later_fields_has_their_defaults() -> None:
    vehicle = read_vehicle("zafira")
    assert (vehicle.speed_delay, vehicle.speed_scale, vehicle.flexible_mode, vehicle.learnt) == (0.0, 1.0, (), ())
    assert (vehicle.body.product_of_inertia, vehicle.body.height) == (0.0, None)
    assert {(sensor.delay, sensor.between) for sensor in vehicle.sensor} == {(0.0, None)}


@pytest.mark.parametrize("name", VEHICLES)
def test_shipped_vehicles_are_read_by_name_and_written_again(name, tmp_path) -> None:
    vehicle = read_description(name)
    assert vehicle.name == name
    assert vehicle.speed_channel == "speed"
    assert type(vehicle) is {"chain3": Chain, "quarter": Quarter}.get(name, Vehicle)
    write_vehicle(vehicle, tmp_path / "again.toml")
    assert read_description(tmp_path / "again.toml") == vehicle


def test_every_part_survives_writing(tmp_path) -> None:
    vehicle = parse_vehicle({**tomllib.loads(EXAMPLE), "name": 'say "Ω", \\ and \x7f'})
    write_vehicle(vehicle, tmp_path / "again.toml")
    assert read_description(tmp_path / "again.toml") == vehicle


def test_vehicle_cannot_be_changed() -> None:
    body, name = read_vehicle("zafira").body, "mass"
    with pytest.raises(ValueError, match="frozen"):
        setattr(body, name, 1.0)


def test_directions_get_the_length_one() -> None:
    vehicle = parse_vehicle(changed(("sensor", 0, "direction"), [0.0, 0.707, 0.707]))
    direction = vehicle.sensor[0].as_channel().direction
    assert direction is not None
    assert math.hypot(*direction) == pytest.approx(1.0, rel=1e-15)


@pytest.mark.parametrize(
    ("path", "value", "message"),
    [
        (("kind",), "boat", "kind='boat' must be one of road, rail, rig, quarter, chain: add or correct it"),
        (("kind",), None, "kind=None must be one of road, rail, rig, quarter, chain: add or correct it"),
        (("kind",), ["road"], "kind=['road'] must be one of"),
        (("schema",), "sprung.vehicle/2", "schema='sprung.vehicle/2' must be 'sprung.vehicle/1': correct it"),
        (("name",), None, "name is missing: add it"),
        (("name",), "", "name='' must be text of at least 1 character: fill it in"),
        (("name",), " x", "name=' x' must be one line of text without blanks around it: correct it"),
        (("name",), "x" * 101, "xxx... must be text of at most 100 characters: shorten it"),
        (("speed_channel",), 3, "speed_channel=3 must be text: write it in quotes"),
        (("wings",), 2, "wings is not known here: remove it, or correct its spelling"),
        (("body",), 3, "body=3 must be a table of fields: write [name] above them"),
        (("body", "mass"), 0.0, "body, mass=0.0 must be above 0: correct it"),
        (("body", "mass"), float("inf"), "body, mass=inf must be finite: give a number"),
        (("axle",), 3, "axle=3 must be a list: write numbers in brackets"),
        (("axle", 1), None, "axle has 1 entries, but must have at least 2: correct it"),
        (("axle", 1, "x"), None, "[[axle]] 2, x is missing: add it"),
        (("axle", 1, "x"), 1.58, "x of the axles is [1.22, 1.58], but must fall from front to rear"),
        (("axle", 1, "damping"), -3, "[[axle]] 2, damping=-3 must be at least 0: correct it"),
        (("axle", 1, "damping"), "3", "[[axle]] 2, damping='3' must be a number: write it without quotes"),
        (("axle", 1, "damping"), True, "[[axle]] 2, damping=True must be a number"),
        (("axle", 1, "damping"), float("nan"), "[[axle]] 2, damping=nan must be finite: give a number"),
        (("axle", 0, "spring_stifness"), 1.0, "[[axle]] 1, spring_stifness is not known here: did you mean spring_"),
        (("body", "unsprung_mass"), 1.0, "body, unsprung_mass is not known here: move it to the table that it belongs"),
        (("axle", 0, "tyre_stiffness"), None, "[[axle]] 1: unsprung_mass needs tyre_stiffness: add it, or leave both"),
        (("mounted_mass", 0, "frequency"), 0, "[[mounted_mass]] 1, frequency=0 must be above 0: correct it"),
        (("sensor", 0), 1, "[[sensor]] 1=1 must be a table of fields: write [name] above them"),
        (("sensor", 0, "unit"), "deg/s", "[[sensor]] 1: unit 'deg/s' measures angular_velocity, not acceleration: "),
        (("sensor", 0, "unit"), "furlong", "[[sensor]] 1: unit 'furlong' is unknown: convert the values to one of m/s"),
        (("sensor", 0, "quantity"), "colour", "[[sensor]] 1: quantity 'colour' is not one of acceleration, "),
        (("sensor", 0, "quantity"), "unknown", "[[sensor]] 1: quantity 'unknown' is not one of acceleration, "),
        (("sensor", 0, "position"), [1, 2], "[[sensor]] 1, position[2] is missing: add it"),
        (("sensor", 0, "position"), None, "sensor 'acc_fl' has no position: add position = [forward, left, up]"),
        (("sensor", 0, "position"), [1, 2, "a"], "[[sensor]] 1, position[2]='a' must be a number"),
        (("sensor", 0, "direction"), [1, 2, 0], "[[sensor]] 1: direction [1.0, 2.0, 0.0] has length 2.24, but must"),
        (("sensor", 1, "direction"), None, "sensor 'pitch_rate' has no direction: add direction = [forward, left, up]"),
        (("sensor", 0, "scale"), 0, "[[sensor]] 1: scale=0 must not be 0: leave it out"),
        (("sensor", 0, "on"), "roof", "[[sensor]] 1, on='roof' must be one of body, wheel_front_left, wheel_front_"),
        (("sensor", 0, "delay"), 11, "[[sensor]] 1, delay=11 must be at most 10: correct it"),
        (("sensor", 0, "between"), "front_left", "[[sensor]] 1: between='front_left' is for the quantities travel and"),
        (("sensor", 3, "between"), None, "[[sensor]] 4: quantity 'travel' needs the suspension that it measures: add"),
        (("sensor", 3, "between"), "front", "[[sensor]] 4, between='front' must be one of front_left, front_right, "),
        (("sensor", 4, "on"), "body", "sensor 'wss_fl', on='body' must be one of wheel_front_left, wheel_front_right"),
        (("axle", 0, "rolling_radius"), None, "sensor 'wss_fl' measures the rotation of wheel_front_left, whose axle"),
        (("body", "product_of_inertia"), 900.0, "body, product_of_inertia=900 kg m2 must be between -889.9 and 889.9"),
        (("body", "height"), 0, "body, height=0 must be above 0: correct it"),
        (("speed_scale",), 0, "speed_scale=0 must be above 0: correct it"),
        (("speed_delay",), -20.0, "speed_delay=-20.0 must be at least -10: correct it"),
        (("flexible_mode", 0, "shape"), "twist", "[[flexible_mode]] 1, shape='twist' must be 'torsion' or 'bending'"),
        (("flexible_mode", 1, "shape"), "torsion", "[[flexible_mode]]: shape 'torsion' occurs more than once: remove"),
        (("learnt", 0, "std"), -0.1, "[[learnt]] 1, std=-0.1 must be at least 0: correct it"),
        (("sensor", 1, "channel"), "acc_fl", "channel 'acc_fl' has more than one [[sensor]]: rename or remove one"),
    ],
)
def test_refusals_name_the_field_the_rule_and_the_remedy(path, value, message) -> None:
    with pytest.raises(ParameterError) as refusal:
        parse_vehicle(changed(path, value))
    assert message in str(refusal.value)
    assert "\n" not in str(refusal.value)


@pytest.mark.parametrize(
    ("path", "wrong", "right"),
    [
        (("axle", 0, "spring_stiffness"), "stifness", "[[axle]] 1, stifness is not known here: did you mean spring_st"),
        (("axle", 1, "half_track"), "halftrack", "[[axle]] 2, halftrack is not known here: did you mean half_track?"),
        (("sensor", 0, "channel"), "chanel", "[[sensor]] 1, chanel is not known here: did you mean channel?"),
        (("axle",), "axles", "axles is not known here: did you mean axle?"),
        (("axle",), "axel", "axel is not known here: did you mean axle?"),
    ],
)
def test_a_misspelt_key_is_named_and_not_the_one_that_is_missing_for_it(path, wrong, right) -> None:
    fields = tomllib.loads(EXAMPLE)
    table = fields
    for step in path[:-1]:
        table = table[step]
    table[wrong] = table.pop(path[-1])
    with pytest.raises(ParameterError) as refusal:
        parse_vehicle(fields)
    assert str(refusal.value).startswith(right)
    assert "more)" not in str(refusal.value)


def test_further_problems_are_counted() -> None:
    fields = changed(("axle", 0, "damping"), -1)
    fields["axle"][1]["x"] = "far"
    with pytest.raises(ParameterError, match=r"\[\[axle\]\] 1, damping=-1 .* \(and 1 more\)$"):
        parse_vehicle(fields)


@pytest.mark.parametrize(
    ("fields", "message"),
    [
        ({"quantity": "acceleration", "unit": "g"}, r"\[\[sensor\]\] 1, on='body' must be one of mass_1: correct it"),
        ({"quantity": "travel", "unit": "mm", "between": "mass_1"}, "between='mass_1' needs a vehicle with corners: r"),
    ],
)
def test_chain_has_neither_body_nor_corners(fields, message) -> None:
    with pytest.raises(ParameterError, match=message):
        parse_vehicle({**CHAIN, "sensor": [{"channel": "a", **fields}]})


def test_neither_file_nor_name() -> None:
    with pytest.raises(ParameterError, match="vehicle 'zafirra' is neither a file nor one of chain3, coach, "):
        read_vehicle("zafirra")
    with pytest.raises(ParameterError, match="is neither a file"):
        read_vehicle("/")


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"", r"v\.toml: schema=None must be \"sprung.vehicle/1\": add it as the first line"),
        (b"a = \n", r"v\.toml is not a TOML file: Invalid value \(at line 1, column 5\)"),
        (b"\xff\xfe", r"v\.toml is not a TOML file: 'utf-8' codec can't decode"),
        (b"x = " + b"[" * 100_000, r"v\.toml is not a TOML file: nested too deeply"),
        (b"#" * 1_000_001, r"v\.toml has 1000001 bytes, more than any vehicle file"),
        (EXAMPLE.replace("damping = 1781", "damping = -1").encode(), r"v\.toml: \[\[axle\]\] 1, damping=-1 must be at"),
    ],
)
def test_bad_files_are_refused_with_their_name(tmp_path, content, message) -> None:
    path = tmp_path / "v.toml"
    path.write_bytes(content)
    with pytest.raises(FormatError, match=message):
        read_description(path)


values = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=5),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=5), inner, max_size=3),
    max_leaves=5,
)
tables = [("body",), ("axle",), ("axle", 0), ("mounted_mass",), ("sensor",), ("sensor", 0)]
numbers = [("body", "mass"), ("axle", 1, "x"), ("sensor", 0, "position")]
places = st.sampled_from([("name",), ("sensor", 0, "unit"), *tables, *numbers])


@pytest.mark.slow
@given(place=places, value=values)
def test_any_value_anywhere_is_read_or_refused_in_one_sentence(place, value) -> None:
    fields, message = changed(place, value), ""
    try:
        parse_vehicle(fields)
    except SprungError as refusal:
        message = str(refusal)
    assert "\n" not in message


@pytest.mark.parametrize("name", ["chain3", "quarter"])
def test_a_description_without_axles_is_not_a_vehicle(name) -> None:
    kind = read_description(name).kind
    message = rf"^vehicle '{name}' is of kind {kind}, but must be a body on axles \(kind road, rail or rig\): "
    with pytest.raises(ParameterError, match=message):
        read_vehicle(name)


def test_many_unknown_keys_are_counted_at_once() -> None:
    """A hostile file: comparing each key with all others would take hours."""
    fields = tomllib.loads(EXAMPLE) | {f"wing_{number}": 1 for number in range(20_000)}
    with pytest.raises(ParameterError, match=r"wing_0 is not known here: .* \(and 19999 more\)$"):
        parse_vehicle(fields)
