"""Steps of a sampled linear model, with the standard library alone: FMUs carry a copy of this file."""

import json
from operator import mul
from pathlib import Path
from typing import Any


class SteppedModel:
    """Linear model at rest that moves on in fixed steps, with inputs that rise evenly within a step.

    Parameters
    ----------
    path
        JSON file with the `step` [s], the matrices `state`, `values`, `rises`, `readings` and `feedthrough` as lists of
        rows, and the variables `inputs` and `outputs`: name, unit and description of each.

    Notes
    -----
    x[k+1] = A x[k] + B0 u[k] + B1 (u[k+1] - u[k]), y = C x + D u: exact where the inputs are linear within a step.
    """

    def __init__(self, path: str | Path) -> None:
        document: dict[str, Any] = json.loads(Path(path).read_text(encoding="utf-8"))
        self.step: float = document["step"]
        self.inputs: list[dict[str, str]] = document["inputs"]
        self.outputs: list[dict[str, str]] = document["outputs"]
        self.values = [0.0] * len(self.inputs)
        self.rates = [0.0] * len(self.inputs)
        self._columns = [
            a + b + c for a, b, c in zip(document["state"], document["values"], document["rises"], strict=True)
        ]
        self._rows = [c + d for c, d in zip(document["readings"], document["feedthrough"], strict=True)]
        self._state = [0.0] * len(self._columns)
        self._elapsed = 0.0

    def set_value(self, number: int, value: float) -> None:
        """Set an input as it is now."""
        self.values[number], self._elapsed = value, 0.0

    def set_rate(self, number: int, rate: float) -> None:
        """Set the rate at which an input rises from now on [1/s]."""
        self.rates[number], self._elapsed = rate, 0.0

    def advance(self, duration: float) -> None:
        """Move on by a duration [s].

        Raises
        ------
        ValueError
            If the duration is not a multiple of the step.
        """
        count = round(duration / self.step)
        if count < 1 or abs(duration - count * self.step) > 1e-6 * self.step:
            raise ValueError(
                f"the communication step {duration:.9g} s must be a multiple of the model's step {self.step:.9g} s:"
                " set it so in the importing tool"
            )
        rises = [rate * self.step for rate in self.rates]
        for number in range(count):
            held = [value + number * rise for value, rise in zip(self.values, rises, strict=True)]
            known = self._state + held + rises
            self._state = [sum(map(mul, row, known)) for row in self._columns]
        self._elapsed = count * self.step

    def reading(self, number: int) -> float:
        """Return an output as it is now."""
        inputs = [value + rate * self._elapsed for value, rate in zip(self.values, self.rates, strict=True)]
        return sum(map(mul, self._rows[number], self._state + inputs))
