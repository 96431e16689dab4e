"""Estimate the springs, dampers and tyres of a car from a drive: ten simulated minutes with a soft front-left spring.

Run it with `python examples/corners_of_a_drive.py`; the estimates are written to `corners.json`.
"""

import sprung

car = sprung.read_vehicle("zafira")
fault = sprung.parse_fault("front_left.spring=-0.2")
drive = sprung.simulate_drive(car, sprung.RoadDrive(duration=600.0, faults=(fault,), snr=50.0), seed=1)

fit = sprung.fit_corners(drive.recording, car)
for component, value, nominal, deviation in zip(
    fit.components, fit.values, fit.nominal, fit.log_ratios_std, strict=True
):
    change = f"{100 * (value / nominal - 1):+5.1f} ± {100 * deviation:.1f} %"
    print(f"{component!s:20} {value:10.0f}  {change}")

fit.save("corners.json")
spring = sprung.read_corners("corners.json").corners["front_left"]["spring"]
print(f"front-left spring: {100 * (spring.relative_to_nominal - 1):+.0f} % from nominal, truth -20 %")
