"""A larger car than that of `design`, with stiffer bars: whose cornering stiffness drives determine least."""

from benchmarks.multibody.design import Axle, Design

LARGER_CAR = Design(
    "suv",
    mass=1780.0,
    height=0.68,
    inertia=(690.0, 3100.0, 3400.0),
    axles=(
        Axle(
            "front",
            "macpherson",
            1.25,
            0.80,
            spring=31e3,
            damper=2.4e3,
            tyre=240e3,
            wheel_mass=46.0,
            cornering=95e3,
            bar=20e3,
            radius=0.34,
            steers=True,
        ),
        Axle(
            "rear",
            "wishbone",
            -1.50,
            0.80,
            spring=101e3,
            damper=6.9e3,
            tyre=240e3,
            wheel_mass=44.0,
            cornering=85e3,
            bar=16e3,
            radius=0.34,
        ),
    ),
    sensor_height=0.15,
)
