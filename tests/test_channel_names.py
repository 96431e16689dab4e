"""What channels measure by their names: COVESA VSS, loggers, tables of users; and names that state nothing."""

import math

import pytest

from sprung.channel_names import NameRule, describe_mapping, identified, read_name_table, rule_of
from sprung.errors import FormatError, ParameterError
from sprung.recording import QUANTITIES, Channel
from sprung.units import conversion

WHEEL = "Vehicle.Chassis.Axle.Row{}.Wheel.{}.{}"


@pytest.mark.parametrize(
    ("name", "quantity", "factor", "direction", "corner"),
    [
        ("Vehicle.Speed", "speed", 1 / 3.6, None, None),
        ("Vehicle.Acceleration.Longitudinal", "acceleration", 1.0, (1, 0, 0), None),
        ("Vehicle.Acceleration.Lateral", "acceleration", 1.0, (0, 1, 0), None),
        ("Vehicle.Acceleration.Vertical", "acceleration", 1.0, (0, 0, 1), None),
        ("Vehicle.AngularVelocity.Roll", "angular_velocity", math.pi / 180, (1, 0, 0), None),
        ("Vehicle.AngularVelocity.Pitch", "angular_velocity", math.pi / 180, (0, 1, 0), None),
        ("Vehicle.AngularVelocity.Yaw", "angular_velocity", math.pi / 180, (0, 0, 1), None),
        ("Vehicle.Exterior.AirTemperature", "temperature", 1.0, None, None),
        (WHEEL.format(1, "Left", "Speed"), "speed", 1 / 3.6, None, "front_left"),
        (WHEEL.format(2, "Right", "Speed"), "speed", 1 / 3.6, None, "rear_right"),
        (WHEEL.format(1, "Right", "AngularSpeed"), "angular_velocity", math.pi / 180, None, "front_right"),
        (WHEEL.format(2, "Left", "Tire.Pressure"), "pressure", 1000.0, None, "rear_left"),
        (WHEEL.format(2, "Left", "Tire.Temperature"), "temperature", 1.0, None, "rear_left"),
        (WHEEL.format(1, "Left", "Tire.RubberTemperature"), "temperature", 1.0, None, "front_left"),
    ],
)
def test_vss_fixes_quantity_unit_axis_and_corner(name, quantity, factor, direction, corner) -> None:
    """Units of the COVESA Vehicle Signal Specification 6.0; axes by ISO 8855."""
    channel, found, rule = identified(Channel(name))
    assert (channel.name, channel.quantity, channel.direction) == (name, quantity, direction)
    assert found == pytest.approx(factor, rel=1e-15)
    assert rule is not None
    assert (rule.corner, rule.source) == (corner, "COVESA VSS")
    assert identified(Channel(name.lower()))[0].quantity == quantity


@pytest.mark.parametrize(
    ("name", "quantity", "unit"),
    [
        ("AccelerationX", "acceleration", None),
        ("AngularRateZ", "angular_velocity", None),
        ("accelerometer x", "acceleration", None),
        ("Acceleration x", "acceleration", None),
        ("Linear Acceleration z", "acceleration", "m/s^2"),
        ("userAccelerationX", "acceleration", "g"),
        ("rotationRateX", "angular_velocity", "rad/s"),
        ("accX", "acceleration", None),
        ("Acc_X", "acceleration", None),
        ("gyro_x", "angular_velocity", None),
        ("Gyr_X", "angular_velocity", None),
        ("FreeAcc_Z", "acceleration", "m/s^2"),
        ("X (100g)", "acceleration", None),
        ("az", "acceleration", None),
        ("gz", "angular_velocity", None),
        ("GPSvel", "speed", None),
        ("speed_mps", "speed", "m/s"),
        ("GPS_speed_kmh", "speed", "km/h"),
        ("vehicle_speed", "speed", None),
        ("acc_z_g", "acceleration", "g"),
        ("gyro_z_dps", "angular_velocity", "deg/s"),
    ],
)
def test_names_of_loggers_have_no_axis_and_a_unit_only_where_they_fix_it(name, quantity, unit) -> None:
    """An unknown unit leaves the quantity of the channel unknown: samples of a known one are in SI units."""
    channel, factor, rule = identified(Channel(name))
    assert rule is not None
    assert (rule.quantity, rule.unit, rule.direction) == (quantity, unit, None)
    assert channel == Channel(name, "unknown" if unit is None else quantity)
    assert factor == (1.0 if unit is None else conversion(unit)[1])


@pytest.mark.parametrize(
    "name",
    [
        *("x", "z", "a", "g", "t", "v", "ch1", "X", "acc", "accuracy", "axle", "gyrate", "oil", "throttle", "mag_x"),
        *("speed_limit", "wind_speed_mps", "Vehicle.AverageSpeed", "Vehicle.Speed.Limit", "My.Vehicle.Speed"),
        *("accelerate_g", "Temperature", WHEEL.format(3, "Left", "Speed"), WHEEL.format(1, "Center", "Speed")),
    ],
)
def test_ambiguous_names_state_nothing(name) -> None:
    assert rule_of(name) is None
    assert identified(Channel(name)) == (Channel(name), 1.0, None)


def test_what_a_file_states_wins() -> None:
    """Its unit is converted already; its quantity may contradict the name, its axis is that of the sensor."""
    placed = Channel("Vehicle.Acceleration.Vertical", "acceleration", None, (0.0, 0.0, -1.0))
    assert identified(placed)[:2] == (placed, 1.0)
    stated = Channel("Vehicle.Speed", "speed")
    assert identified(stated) == (stated, 1.0, rule_of("Vehicle.Speed"))
    other = Channel("Vehicle.Acceleration.Vertical", "temperature")
    assert identified(other) == (other, 1.0, None)


def test_a_user_s_table_comes_first(tmp_path) -> None:
    path = tmp_path / "names.toml"
    path.write_text(
        """
        [[channel]]
        name = "BodyZ_*"
        quantity = "acceleration"
        unit = "g"
        direction = [0.0, 0.0, 1.0]
        corner = "axle2_left"

        [[channel]]
        name = "vehicle.speed"
        quantity = "speed"
        unit = "m/s"
        source = "our bus"
        """
    )
    rules = read_name_table(path)
    assert rules[2:] == read_name_table() == read_name_table(None)
    assert rules[0] == NameRule("BodyZ_*", "acceleration", "g", (0.0, 0.0, 1.0), "axle2_left", "names.toml")
    channel, factor, rule = identified(Channel("body z 3"), rules)
    assert channel == Channel("body z 3", "acceleration", None, (0.0, 0.0, 1.0))
    assert (factor, rule) == (9.80665, rules[0])
    assert identified(Channel("Vehicle.Speed"), rules)[1:] == (1.0, rules[1])
    assert identified(Channel("Vehicle.Acceleration.Vertical"), rules)[0].quantity == "acceleration"


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("[[channel]]\nname='a_z'", "[[channel]] 1, quantity is missing: add it"),
        ("[[channel]]\nnam='a_z'\nquantity='speed'", "[[channel]] 1, nam is not known here: did you mean name?"),
        ("[[channels]]\nname='a'", "channels is not known here: did you mean channel?"),
        ("[[channel]]\nname='*'\nquantity='speed'", "name '*' fits every channel: state letters of the name"),
        ("[[channel]]\nname='v'\nquantity='pace'", "quantity 'pace' is not one of acceleration,"),
        ("[[channel]]\nname='v'\nquantity='unknown'", "quantity 'unknown' is not one of acceleration,"),
        ("[[channel]]\nname='v'\nquantity='speed'\nunit='g'", "unit 'g' measures acceleration, not speed: correct"),
        ("[[channel]]\nname='v'\nquantity='speed'\nunit='knots'", "unit 'knots' is unknown"),
        ("[[channel]]\nname='v'\nquantity='speed'\ndirection=[1,1,0]", "direction [1.0, 1.0, 0.0] has length 1.41"),
        ("[[channel]]\nname='v'\nquantity='speed'\ncorner='left'", "corner 'left' must be front_left, front_right"),
        ("[[channel]]\nname=3", "[[channel]] 1, name=3 must be text"),
        ("[[channel", "is not a TOML file"),
    ],
)
def test_mistakes_in_a_table_are_named(tmp_path, text, sentence) -> None:
    path = tmp_path / "names.toml"
    path.write_text(text)
    with pytest.raises(FormatError) as refusal:
        read_name_table(path)
    assert str(refusal.value).startswith(str(path))
    assert sentence in str(refusal.value)
    assert "\n" not in str(refusal.value)


def test_a_table_that_is_no_file(tmp_path) -> None:
    with pytest.raises(ParameterError, match=r"is not a file: correct the path"):
        read_name_table(tmp_path / "nothing.toml")
    large = tmp_path / "large.toml"
    large.write_bytes(b"#" * 1_000_001)
    with pytest.raises(FormatError, match="has 1000001 bytes, more than any table of channel names"):
        read_name_table(large)


@pytest.mark.parametrize(
    ("channel", "words"),
    [
        (Channel("Vehicle.Speed"), "Vehicle.Speed: speed [km/h] (COVESA VSS)"),
        (Channel("Vehicle.Speed", "speed"), "Vehicle.Speed: speed (COVESA VSS)"),
        (
            Channel("Vehicle.AngularVelocity.Pitch"),
            "Vehicle.AngularVelocity.Pitch: angular velocity [degrees/s], axis (0, 1, 0) (COVESA VSS)",
        ),
        (
            Channel(WHEEL.format(1, "Left", "Tire.Pressure"), "pressure"),
            "Vehicle.Chassis.Axle.Row1.Wheel.Left.Tire.Pressure: pressure, front left (COVESA VSS)",
        ),
        (Channel("AngularRateZ"), "AngularRateZ: angular velocity of unknown unit (CANedge, CANmod)"),
    ],
)
def test_what_was_mapped_is_said(channel, words) -> None:
    rule = rule_of(channel.name)
    assert rule is not None
    assert describe_mapping(channel, rule) == words


def test_rules_of_the_package_have_sources_and_known_quantities() -> None:
    for rule in read_name_table():
        assert rule.source
        assert rule.quantity in QUANTITIES
        assert (rule.direction is None) or rule.source == "COVESA VSS"
