"""Analysis that falls behind: noticed by the age of the frames that wait, and reported until it has caught up."""

import logging
from collections.abc import Callable

from sprung.link import Every
from sprung.online.monitor.alert_book import AlertBook
from sprung.online.monitor.intake import MONITOR

LOG = logging.getLogger("sprung.monitor")

#: Cause of the alert.
OVERLOAD = "monitor:overload"
#: Time between checks, and between updates of the alert [s].
_LOOK, _REPEAT = 1.0, 60.0
#: Share of the limit below which the analysis has caught up, and how long it must not be behind again before the alert
#: clears, in limits: with all modes it may be too slow at once.
_CAUGHT_UP, _CALM = 0.5, 3.0


class Overload:
    """Whether the analysis is behind the vehicles.

    Parameters
    ----------
    alerts
        Alerts of all vehicles.
    limit
        Age of the oldest frame that waits for a worker, above which the analysis is behind [s].
    clock
        Present time, UTC ns.
    """

    def __init__(self, alerts: AlertBook, *, limit: float, clock: Callable[[], int]) -> None:
        self._alerts, self._limit, self._clock = alerts, limit, clock
        self._looking = Every(_LOOK, lambda: clock() / 1e9)
        self._reporting = Every(_REPEAT, lambda: clock() / 1e9)
        self._calm = Every(_CALM * limit, lambda: clock() / 1e9)
        self._is_on, self._is_reported = False, True  # perhaps by the previous release

    @property
    def is_on(self) -> bool:
        """Whether the analysis is behind: from the limit on, until the oldest frame is half as old."""
        return self._is_on

    @property
    def is_due(self) -> bool:
        """Whether to check again."""
        return self._looking.is_due

    def update(self, age: float, *, n_frames: int, n_vehicles: int) -> None:
        """Raise, update or clear the alert.

        Parameters
        ----------
        age
            Age of the oldest frame that waits [s]; 0 if none does.
        n_frames, n_vehicles
            Number of frames that wait, and of their vehicles.

        Raises
        ------
        StoreError
            If the store cannot write.
        """
        self._looking.start()
        self._is_on = age > self._limit * (_CAUGHT_UP if self._is_on else 1.0)
        if self._is_on:
            self._calm.start()
            self._report(age, n_frames, n_vehicles)
        elif self._is_reported and self._calm.is_due:
            self._alerts.clear(MONITOR, OVERLOAD, now=self._clock())
            self._is_reported = False
            self._reporting.reset()

    def _report(self, age: float, n_frames: int, n_vehicles: int) -> None:
        """Raise the alert, or update it once a minute."""
        if not self._reporting.is_due:
            return
        sentence = (
            f"the analysis is {age / 60:.1f} min behind, {n_frames} frames of {n_vehicles} vehicles wait: until it has "
            "caught up, modes are identified only once per window, and windows are late but none is left out; use "
            "more workers, or fewer vehicles on this machine"
        )
        LOG.warning(sentence)
        self._alerts.report(MONITOR, OVERLOAD, sentence, now=self._clock())
        self._is_reported = True
        self._reporting.start()
