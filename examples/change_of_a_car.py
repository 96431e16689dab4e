"""Learn the baseline of a healthy car and find a change: simulated drives, the last one with a stiff rear-right spring.

Run it with `python examples/change_of_a_car.py`; baseline and diagnosis are written to `baseline.json` and
`diagnosis.json`, and the corners against the baseline are drawn in `corners.png`.
"""

import sprung

car = sprung.read_vehicle("zafira")
healthy = sprung.simulate_drive(car, sprung.RoadDrive(duration=3600.0, snr=50.0), seed=1)
fault = sprung.parse_fault("rear_right.spring=0.25")
changed = sprung.simulate_drive(car, sprung.RoadDrive(duration=1200.0, faults=(fault,), snr=50.0), seed=2)

baseline = sprung.learn(sprung.observe(healthy.recording, car))
baseline.save("baseline.json")

diagnosis = sprung.diagnose(sprung.observe(changed.recording, car), sprung.read_baseline("baseline.json"))
diagnosis.save("diagnosis.json")
diagnosis.plot().savefig("corners.png")
for finding in diagnosis.findings:
    print(finding.sentence)
for sensor_fault in diagnosis.sensor_faults:
    print(f"{sensor_fault.channel} is {sensor_fault.kind}: {sensor_fault.detail}")
