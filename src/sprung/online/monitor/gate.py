"""Gate that stops intake while the store cannot write."""

import logging
from collections.abc import Callable
from typing import TypeVar

from sprung.link import Every
from sprung.online.store import RefusedError, StoreError

T = TypeVar("T")

LOG = logging.getLogger("sprung.monitor")

#: Time for which intake stops after the store could not write [s].
_PAUSE = 2.0


class Gate:
    """Closed for two seconds after each error of the store, and while the disk is too full.

    Parameters
    ----------
    clock
        Present time [s] of a monotonic clock.
    """

    def __init__(self, clock: Callable[[], float]) -> None:
        self._pause = Every(_PAUSE, clock)
        self._error = self._shortage = ""

    @property
    def is_open(self) -> bool:
        """Whether work may be taken in; results that cannot be stored would have to be computed again."""
        return self._pause.is_due and not self._shortage

    @property
    def trouble(self) -> str:
        """Reason why the store cannot be used; empty if it can."""
        return self._shortage or self._error

    def refuse(self, error: StoreError) -> None:
        """Record an error of the store, and close for a while."""
        if str(error) != self._error:
            LOG.error(str(error))
        self._error = str(error)
        self._pause.start()

    def succeed(self) -> None:
        """Record that the store has written."""
        self._error = ""

    def set_shortage(self, sentence: str) -> None:
        """Stay closed while disk space is short, as `sentence` states; empty if it is not."""
        self._shortage = sentence

    def guard(self, act: Callable[[], T]) -> T | None:
        """Return the result of a function that needs the store; None, and close, if the store cannot write."""
        try:
            return act()
        except RefusedError as error:  # the store itself is sound
            LOG.error(str(error))
            return None
        except StoreError as error:
            self.refuse(error)
            return None
