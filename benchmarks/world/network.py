"""A broker that promises to deliver each message at least once, and a network that keeps it from doing so."""

import zlib
from collections.abc import Callable, Sequence

from chance import Chance, Crash


class Broker:
    """Passes messages between links, in any order and number, as chance has it.

    Parameters
    ----------
    chance
        Decides what is lost.
    on_acknowledgement
        Function that receives vehicle and payload of each acknowledgement that the monitor publishes.
    """

    def __init__(self, chance: Chance, *, on_acknowledgement: Callable[[str, bytes], None]) -> None:
        self.chance = chance
        self._links: list[SimulatedLink] = []
        self._under_way: list[tuple[SimulatedLink, str, bytes]] = []
        self._retained: dict[str, bytes] = {}
        self._on_acknowledgement = on_acknowledgement
        #: Function called with link, topic and payload of a message that the broker confirmed, before it is delivered.
        self.on_confirmed: Callable[[SimulatedLink, str, bytes], None] | None = None

    @property
    def n_under_way(self) -> int:
        """Number of messages between links."""
        return len(self._under_way)

    @property
    def links(self) -> "list[SimulatedLink]":
        """Links of running processes."""
        return self._links

    def add(self, link: "SimulatedLink") -> None:
        self._links.append(link)

    def drop(self, link: "SimulatedLink") -> None:
        """Forget the link of a process that ended, and what was on its way to it."""
        self._links = [other for other in self._links if other is not link]
        self._under_way = [entry for entry in self._under_way if entry[0] is not link]

    def take(self, sender: "SimulatedLink", topic: str, payload: bytes, *, is_retained: bool) -> None:
        """Take a message, and put it on its way to all that subscribed."""
        vehicle, what = topic.split("/")[2:]
        if what == "ack":
            self._on_acknowledgement(vehicle, payload)
        self.chance.note(f"{what} {0 if what == 'health' else zlib.crc32(payload[:-4]):08x}", sender.name)
        if sender.is_cut:
            return
        if self.on_confirmed is not None:
            self.on_confirmed(sender, topic, payload)
        if is_retained:
            self._retained[topic] = payload
        for link in self._links:
            if link.is_connected and link.wants(topic):
                self._send(link, topic, payload)

    def deliver(self) -> None:
        """Deliver one message."""
        if not self._under_way:
            return
        is_overtaken = len(self._under_way) > 1 and self.chance.happens("message overtaken")
        place = self.chance.random.randrange(len(self._under_way)) if is_overtaken else 0
        link, topic, payload = self._under_way.pop(place)
        if link.is_connected and not link.is_cut:
            link.on_message(topic, payload)

    def crash(self) -> None:
        """Lose all messages, which were confirmed, and all connections; perhaps what was retained too."""
        self._under_way.clear()
        if self.chance.random.random() < 0.5:
            self._retained.clear()
        for link in self._links:
            link.lose()

    def connect(self, link: "SimulatedLink") -> None:
        """Connect a link, and send it what is retained."""
        link.is_connected, link.is_cut = True, False
        link.on_connected()
        for topic, payload in self._retained.items():
            if link.wants(topic):
                self._send(link, topic, payload)

    def lose(self, link: "SimulatedLink") -> None:
        """Lose a connection, with what was on its way."""
        link.lose()
        self._under_way = [entry for entry in self._under_way if entry[0] is not link]

    def _send(self, link: "SimulatedLink", topic: str, payload: bytes) -> None:
        if self.chance.happens("message lost", topic):
            return
        self._under_way.append((link, topic, payload))
        if self.chance.happens("message doubled", topic):
            self._under_way.append((link, topic, payload))


class SimulatedLink:
    """What a box or a monitor takes for its connection to the broker, as `sprung.link.Link`."""

    is_rejected = False

    def __init__(
        self,
        broker: Broker,
        name: str,
        *,
        topics: Sequence[str],
        on_message: Callable[[str, bytes], None],
        on_connected: Callable[[], None] = lambda: None,
        will: tuple[str, bytes] | None = None,
    ) -> None:
        self._broker, self.name, self._topics = broker, name, tuple(topics)
        self.on_message, self.on_connected = on_message, on_connected
        self.is_connected = self.is_cut = False

    @property
    def problem(self) -> str:
        """Reason why there is no connection."""
        return "" if self.is_connected else "the broker was lost"

    def wants(self, topic: str) -> bool:
        """Return whether a topic is subscribed to."""
        parts = topic.split("/")
        return any(
            all(own in ("+", part) for own, part in zip(each.split("/"), parts, strict=True)) for each in self._topics
        )

    def open(self, *, timeout: float = 0.0) -> None:
        """Connect, sooner or later."""
        self._broker.add(self)

    def publish(self, topic: str, payload: bytes, *, is_retained: bool = False) -> bool:
        """Hand over a message, and return whether there seemed to be a connection."""
        if self.name.startswith("monitor"):
            if self._broker.chance.happens("monitor killed as it publishes", self.name):
                raise Crash("kill")
        elif self._broker.chance.happens("box killed at a call", f"{self.name} publish"):
            raise Crash("kill")
        if not self.is_connected:
            return False
        self._broker.take(self, topic, payload, is_retained=is_retained)
        return True

    def lose(self) -> None:
        """Lose the connection."""
        self.is_connected = self.is_cut = False

    def close(self) -> None:
        """Disconnect."""
        self._broker.drop(self)
