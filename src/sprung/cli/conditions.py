"""Files of conditions of simulated drives: `sprung simulate road --conditions drive.toml`."""

from functools import partial
from pathlib import Path
from typing import Annotated, Any, Literal, TypeVar

from pydantic import BaseModel, ConfigDict, Field

from sprung.errors import FormatError, ParameterError
from sprung.excitation import Corrugation, Crossings, Joints, RailQuality
from sprung.simulation import (
    REALISTIC_FORCE_LAWS,
    Deviations,
    Driving,
    ForceLaw,
    Imperfection,
    Payload,
    RoadConditions,
    SuspensionConditions,
    WheelOrders,
    delayed,
    held,
    mems_accelerometers,
    rail_force_laws,
    scaled,
)
from sprung.toml import checked, toml_fields
from sprung.vehicles import Vehicle
from sprung.vehicles.sections import NotNegative, Positive

_FINEST_BITS = 32

_Conditions = TypeVar("_Conditions", bound="DriveConditions")


class Table(BaseModel):
    """Table of a file of conditions: without unknown keys, immutable."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)


class Suspension(Table):
    """Departures of the suspension from the linear one of the vehicle file.

    Parameters
    ----------
    temperature
        Temperature of the dampers [°C]; damping is nominal at 20 °C.
    tyre_temperature
        Temperature of the air in the tyres [°C]; their stiffness is nominal at 20 °C.
    nonlinear
        Usual force laws. Of a car: asymmetric dampers, friction, progressive springs and bump stops. On a track:
        friction by the load in the suspension of a bogie alone, and bump stops in every stage.
    force_laws
        Force laws by part ("suspension", "primary", "secondary" ..) or by owner and part, in place of the usual ones.
    """

    temperature: float = 20.0
    tyre_temperature: float = 20.0
    nonlinear: bool = False
    force_laws: dict[str, ForceLaw] = {}


class Accelerometers(Table):
    """Noise, range and resolution of the accelerometers.

    Parameters
    ----------
    noise_density
        One-sided spectral density of the noise, its square root [m/s^2 / sqrt(Hz)]; MEMS have 2e-4 to 3e-3.
    full_scale
        Half the range [m/s^2]; it matters where `bits` is given.
    bits
        Number of bits over the range; default: as fine as a 32-bit number.
    """

    noise_density: NotNegative = 0.0
    full_scale: Positive = 19.62
    bits: Annotated[int, Field(ge=1, le=_FINEST_BITS)] | None = None


class SpeedChannel(Table):
    """Errors of the recorded speed.

    Parameters
    ----------
    delay
        Delay of the speed at its update [s].
    rate
        Updates per second [Hz], held in between, as from GPS; default: one for each sample.
    scale
        Ratio of recorded to true speed.
    """

    delay: NotNegative = 0.0
    rate: Positive | None = None
    scale: Positive = 1.0


class DriveConditions(Table):
    """Conditions of all drives.

    Parameters
    ----------
    n_stops
        Number of stops on the way.
    """

    n_stops: int = Field(0, ge=0)
    payload: tuple[Payload, ...] = ()
    suspension: Suspension = Suspension()
    deviations: Deviations = Deviations()
    accelerometers: Accelerometers = Accelerometers()
    speed_channel: SpeedChannel = SpeedChannel()

    def settings(self, vehicle: Vehicle) -> dict[str, Any]:
        """Return the settings of a drive of a vehicle that the file states."""
        suspension = self.suspension
        laws = (self.usual_laws(vehicle) if suspension.nonlinear else {}) | suspension.force_laws
        own = self.__class__.model_fields.keys() - DriveConditions.model_fields
        return {
            "n_stops": self.n_stops,
            "payload": self.payload,
            "suspension": SuspensionConditions(suspension.temperature, laws, suspension.tyre_temperature),
            "deviations": self.deviations,
            "imperfections": (*self._accelerometer_imperfections(), *self._speed_imperfections(vehicle.speed_channel)),
            **{name: getattr(self, name) for name in own},
        }

    def usual_laws(self, vehicle: Vehicle) -> dict[str, ForceLaw]:
        """Return the force laws of a nonlinear suspension of this kind of drive."""
        del vehicle
        return dict(REALISTIC_FORCE_LAWS)

    def _accelerometer_imperfections(self) -> tuple[Imperfection, ...]:
        sensors = self.accelerometers
        noise, resolution = mems_accelerometers(
            noise_density=sensors.noise_density, full_scale=sensors.full_scale, bits=sensors.bits or _FINEST_BITS
        )
        return (*([noise] if sensors.noise_density else []), *([resolution] if sensors.bits else []))

    def _speed_imperfections(self, channel: str) -> tuple[Imperfection, ...]:
        speed = self.speed_channel
        parts: list[Imperfection] = []
        if speed.scale != 1:
            parts.append(partial(scaled, channel=channel, factor=speed.scale))
        if speed.rate is not None:
            parts.append(partial(held, channel=channel, rate=speed.rate, delay=speed.delay))
        elif speed.delay:
            parts.append(partial(delayed, channel=channel, delay=speed.delay))
        return tuple(parts)


class RoadDriveConditions(DriveConditions):
    """Conditions of drives on a road."""

    road: RoadConditions = RoadConditions()
    driving: Driving = Driving()
    wheel_orders: WheelOrders | None = None


class RailDriveConditions(DriveConditions):
    """Conditions of drives on a track.

    Parameters
    ----------
    quality
        Level of the track's irregularity: "good" (low) or "bad" (high) by ERRI B176; "fra1" to "fra6" by class of the
        FRA.
    welded
        Whether the rails are welded; otherwise they have joints.
    joints
        Distance, depth, length and offset of the dipped joints, and their rail; default: every 18 m on both.
    crossings
        Crossings and single bad joints at random places.
    corrugation
        Corrugation of the rails.
    wheel_orders
        Unbalance, run-out and flats of the wheels, whose radius is to be stated.
    """

    quality: RailQuality = "good"
    welded: bool = False
    joints: Joints = Joints()
    crossings: Crossings | None = None
    corrugation: Corrugation | None = None
    wheel_orders: WheelOrders | None = None

    def usual_laws(self, vehicle: Vehicle) -> dict[str, ForceLaw]:
        """Return the force laws of the stages that the vehicle has."""
        return rail_force_laws(vehicle)


class RigRunConditions(DriveConditions):
    """Conditions of runs on a roller rig.

    Parameters
    ----------
    driven
        Wheelsets that stand on driven rollers.
    """

    driven: Literal["all", "front"] = "all"


def read_conditions(model: type[_Conditions], path: Path | None) -> _Conditions:
    """Return the conditions of a file; without one, those of a healthy vehicle on a calm drive.

    Raises
    ------
    FormatError
        If the file is not valid TOML, or a field is unknown or outside its range.
    """
    if path is None:
        return model()
    try:
        return checked(model, toml_fields(path.read_bytes(), source=str(path)))
    except ParameterError as error:
        raise FormatError(f"{path}: {error}") from None
