"""Learn the baseline of a healthy car and find a change: simulated drives, the last one with a stiff rear-right spring.

Run it with `python examples/change_of_a_car.py`; baseline and diagnosis are written to `baseline.json` and
`diagnosis.json`.
"""

import sprung

car = sprung.read_vehicle("zafira")
healthy = sprung.simulate_drive(car, sprung.DriveSettings("road", duration=3600.0, snr=50.0), seed=1)
fault = sprung.parse_fault("rear_right.spring=0.25")
changed = sprung.simulate_drive(car, sprung.DriveSettings("road", duration=1200.0, faults=(fault,), snr=50.0), seed=2)


def observe(recording: sprung.Recording) -> list[sprung.Observation]:
    return [sprung.observe(part, car, time=time) for time, part in sprung.windows([recording])]


baseline = sprung.learn(observe(healthy.recording), vehicle=car.name)
sprung.write_baseline(baseline, "baseline.json")

diagnosis = sprung.diagnose(observe(changed.recording), sprung.read_baseline("baseline.json"))
sprung.write_diagnosis(diagnosis, "diagnosis.json")
for finding in diagnosis.findings:
    print(finding.sentence)
for sensor_fault in diagnosis.sensor_faults:
    print(f"{sensor_fault.channel} is {sensor_fault.kind}: {sensor_fault.detail}")
