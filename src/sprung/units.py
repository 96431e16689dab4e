"""Units that sprung reads, with the quantity that each measures and the factor to its SI unit."""

import math
from types import MappingProxyType

from sprung.errors import ParameterError

#: Standard acceleration of free fall [m/s^2] (CODATA; exact by definition).
STANDARD_GRAVITY = 9.80665
#: Standard atmosphere [Pa] (CODATA; exact by definition).
STANDARD_ATMOSPHERE = 101325.0

_DEGREE = math.pi / 180

#: Quantity and factor of every known unit, in its plain spelling.
UNITS = MappingProxyType(
    {
        "m/s^2": ("acceleration", 1.0),
        "mm/s^2": ("acceleration", 1e-3),
        "cm/s^2": ("acceleration", 1e-2),
        "g": ("acceleration", STANDARD_GRAVITY),
        "mg": ("acceleration", 1e-3 * STANDARD_GRAVITY),
        "ug": ("acceleration", 1e-6 * STANDARD_GRAVITY),
        "rad/s": ("angular_velocity", 1.0),
        "mrad/s": ("angular_velocity", 1e-3),
        "deg/s": ("angular_velocity", _DEGREE),
        "mdeg/s": ("angular_velocity", 1e-3 * _DEGREE),
        "rpm": ("angular_velocity", 2 * math.pi / 60),
        "m/s": ("speed", 1.0),
        "km/h": ("speed", 1 / 3.6),
        "mph": ("speed", 0.44704),
        "mm/s": ("velocity", 1e-3),
        "m": ("displacement", 1.0),
        "cm": ("displacement", 1e-2),
        "mm": ("displacement", 1e-3),
        "um": ("displacement", 1e-6),
        "rad": ("angle", 1.0),
        "mrad": ("angle", 1e-3),
        "deg": ("angle", _DEGREE),
        "strain": ("strain", 1.0),
        "um/m": ("strain", 1e-6),
        "N": ("force", 1.0),
        "kN": ("force", 1e3),
        "degC": ("temperature", 1.0),
        "Pa": ("pressure", 1.0),
        "kPa": ("pressure", 1e3),
        "bar": ("pressure", 1e5),
        "psi": ("pressure", 6894.757293168361),
        "km": ("distance", 1e3),
        "mi": ("distance", 1609.344),
    }
)

_OTHER_SPELLINGS = MappingProxyType(
    {
        "m/s2": "m/s^2",
        "m/s/s": "m/s^2",
        "m*s^-2": "m/s^2",
        "mm/s2": "mm/s^2",
        "cm/s2": "cm/s^2",
        "g_n": "g",
        "gn": "g",
        "milli-g": "mg",
        "deg/sec": "deg/s",
        "dps": "deg/s",
        "degps": "deg/s",
        "radps": "rad/s",
        "mps": "m/s",
        "mps2": "m/s^2",
        "rad/sec": "rad/s",
        "1/min": "rpm",
        "kph": "km/h",
        "kmh": "km/h",
        "m/m": "strain",
        "ustrain": "um/m",
        "microstrain": "um/m",
        "ue": "um/m",
        "C": "degC",
        "celsius": "degC",
        "Celsius": "degC",
        "degrees": "deg",
        "degrees/s": "deg/s",
    }
)

# The last two are the micro sign and the Greek letter, and the Greek letters of microstrain.
_PLAIN_CHARACTERS = (
    ("²", "^2"),
    ("**", "^"),
    ("°", "deg"),
    ("℃", "degC"),
    ("µ", "u"),
    ("μ", "u"),
    ("ε", "e"),
)


def conversion(unit: str) -> tuple[str, float]:
    """Return the quantity that `unit` measures and the factor that turns its values into SI.

    Parameters
    ----------
    unit
        Key of `UNITS` or another common spelling of one, such as "m/s²", "°/s", "[g]" or "µm/m".

    Returns
    -------
    tuple of str and float
        Key of `sprung.recording.QUANTITIES`, and factor of SI value = factor times value.

    Raises
    ------
    ParameterError
        If the unit is unknown; the message lists the known ones.

    Notes
    -----
    Upper and lower case are different units (mg, Mg), so "G" is not taken for "g". "g" is the standard acceleration of
    free fall, never the gram. A unit has a factor but no offset, so kelvin and degrees Fahrenheit are unknown. Speed
    (of the vehicle) and velocity (of a vibration) have the same SI unit: m/s, km/h and mph are reported as speed, mm/s
    as velocity; and so have distance (driven: km, mi) and displacement (m, mm).

    Examples
    --------
    >>> conversion("g")
    ('acceleration', 9.80665)
    >>> conversion("mm/s²")
    ('acceleration', 0.001)
    """
    plain = unit.strip().strip("[]()").replace(" ", "")
    for character, spelling in _PLAIN_CHARACTERS:
        plain = plain.replace(character, spelling)
    plain = _OTHER_SPELLINGS.get(plain, plain)
    if plain not in UNITS:
        raise ParameterError(f"unit {unit!r} is unknown: convert the values to one of {', '.join(UNITS)}")
    return UNITS[plain]
