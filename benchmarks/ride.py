"""What phonometry makes of the weightings and figures of ISO 2631-1, for `tests/ride/test_comfort.py`.

    python3.13 -m venv benchmarks/.venv313 && benchmarks/.venv313/bin/pip install phonometry==3.3.0
    benchmarks/.venv313/bin/python benchmarks/ride.py

phonometry (MIT, tested for conformance) needs Python 3.13, so that this script runs without Sprung and writes
`data/phonometry.json`: factors at every third octave from 0.02 to 400 Hz, and RMS, MTVV and VDV of a minute of sweeps
and shocks. The rows of `docs/conformance.md` compare Sprung with that file.
"""

import json
from pathlib import Path

import numpy as np
from phonometry import __version__
from phonometry.vibration import human_vibration as peer

RATE, NAMES = 500.0, ("Wk", "Wd", "Wf", "Wc", "We", "Wj", "Wb")


def shaking(time: np.ndarray) -> np.ndarray:
    """Return a sweep from 0.5 to 24.5 Hz and back to rest [m/s^2], with three shocks of half a sine of 50 ms."""
    sweep = np.sin(np.pi * time / time[-1]) * np.sin(2 * np.pi * (0.5 * time + 0.2 * time**2))
    shocks = sum(6 * np.sin(np.pi * (time - at) / 0.05) * ((time >= at) & (time < at + 0.05)) for at in (12, 30, 41))
    return sweep + shocks


def main() -> None:
    """Write what phonometry finds."""
    thirds = 10 ** (np.arange(-17, 27) / 10)
    samples = shaking(np.arange(round(60 * RATE)) / RATE)
    found = {}
    for name in NAMES:
        weighted = peer.apply_weighting(samples, RATE, name)
        found[name] = {
            "factors": peer.weighting_factors(name, thirds).tolist(),
            "rms": float(np.sqrt(np.mean(weighted**2))),
            "mtvv": peer.mtvv(weighted, RATE),
            "vdv": peer.vibration_dose_value(weighted, RATE),
        }
    document = {
        "source": f"phonometry {__version__}",
        "thirds": thirds.tolist(),
        "sampling_rate": RATE,
        "weightings": found,
    }
    path = Path(__file__).parent / "data" / "phonometry.json"
    path.write_text(json.dumps(document, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
