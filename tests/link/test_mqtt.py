"""The link against a real mosquitto, and the configuration that is shipped for it."""

import gc
import os
import queue
import re
import signal
import subprocess
import sys
import time
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from urllib.parse import urlencode

import numpy as np
import pytest

from sprung.errors import DataError
from sprung.link import UPWARDS, Address, Link, LinkError, Spool, topic
from sprung.link.messages import LARGEST
from sprung.online.box.running import box_of, replay
from sprung.online.monitor import Site
from sprung.online.monitor.alert_book import Context
from sprung.online.monitor.intake import Intake
from sprung.online.store import open_store
from sprung.recording import Channel, Recording
from sprung.vehicles import read_vehicle

pytest.importorskip("paho.mqtt.client")

ROOT = Path(__file__).parents[2]
#: paho forgets to close a socket whose TLS fails, and leaves those that wake its thread to the garbage collector.
pytestmark = pytest.mark.filterwarnings("ignore:unclosed <s:ResourceWarning")
SHIPPED = ROOT / "deploy" / "mosquitto"
EVERYTHING = ["#", "sprung/#", "sprung/v1/+/raw", "sprung/v1/+/ack", "$share/all/sprung/v1/+/raw"]
WITH_WILL = """
import sys, time
from sprung.link import Address, Link

address, topic = sys.argv[1:]
link = Link(Address.parse(address), "mortal", topics=[], on_message=print, will=(topic, b"gone"))
link.open(timeout=10)
print("connected", flush=True)
time.sleep(60)
"""


@pytest.fixture(autouse=True)
def collected():
    """Let sockets go here, where that is allowed, and not in whatever test comes next."""
    yield
    gc.collect()


def eventually(condition, what, *, timeout=10.0):
    end = time.monotonic() + timeout
    while not condition():
        assert time.monotonic() < end, f"not within {timeout:g} s: {what}"
        time.sleep(0.005)


class Client:
    """A link that keeps what it hears."""

    def __init__(self, broker, name, *, address=None, known_as=None, topics=(), will=None):
        self._broker, self._n_topics = broker, len(topics)
        self._name = known_as or name
        self._heard: queue.SimpleQueue[tuple[str, bytes]] = queue.SimpleQueue()
        self.n_connected = 0
        self.link = Link(
            Address.parse(address or broker.address),
            name,
            topics=topics,
            on_message=lambda topic, payload: self._heard.put((topic, payload)),
            on_connected=self._count,
            will=will,
        )

    def _count(self):
        self.n_connected += 1

    def open(self):
        before = self._n_answers
        self.link.open(timeout=10.0)
        self._await_subscriptions(before)
        return self

    def come_back(self, broker_is_back):
        """Wait for a connection and subscriptions after the broker was away."""
        n_connected, before = self.n_connected, self._n_answers
        broker_is_back()
        eventually(lambda: self.n_connected > n_connected, "the link is back")
        self._await_subscriptions(before)

    @property
    def _n_answers(self):
        return self._broker.log.count(f"Sending SUBACK to {self._name}\n")

    def _await_subscriptions(self, before):
        eventually(lambda: self._n_answers >= before + self._n_topics, "the broker has answered all subscriptions")

    def heard_until(self, last, *, timeout=10.0):
        """Return what came before a message."""
        found: list[tuple[str, bytes]] = []
        end = time.monotonic() + timeout
        while True:
            try:
                heard = self._heard.get(timeout=max(end - time.monotonic(), 0.0))
            except queue.Empty:
                raise AssertionError(f"{str(last)[:80]} did not come, only {str(found)[:200]}") from None
            if heard == last:
                return found
            found.append(heard)

    def heard_first(self, *, timeout=10.0):
        """Return the next message."""
        return self._heard.get(timeout=timeout)

    def heard_until_now(self, other, name):
        """Return what came before a message that another client, or this one, sends now."""
        mark = os.urandom(8)
        assert other.link.publish(name, mark)
        return self.heard_until((name, mark))


@contextmanager
def connected(*clients):
    try:
        yield [client.open() for client in clients]
    finally:
        for client in clients:
            client.link.close()


@contextmanager
def mortal(address, name):
    """Run a process with a link whose will is published under a name; it can be killed."""
    process = subprocess.Popen([sys.executable, "-c", WITH_WILL, address, name], stdout=subprocess.PIPE, text=True)
    try:
        assert process.stdout is not None
        assert process.stdout.readline() == "connected\n"
        yield process
    finally:
        process.kill()
        process.communicate()


# The link


@pytest.fixture(scope="module")
def plain(mosquitto):
    return mosquitto()


def test_messages_arrive_whole_and_in_order_with_qos_1(plain) -> None:
    name = "sprung/v1/bus/raw"
    sent = [(name, str(number).encode()) for number in range(1000)] + [(name, bytes(LARGEST))]
    with connected(Client(plain, "ears", topics=["sprung/v1/+/raw"]), Client(plain, "mouth")) as (ears, mouth):
        for _, payload in sent:
            assert mouth.link.publish(name, payload)
        assert ears.heard_until(sent[-1]) == sent[:-1]
    assert re.search(r"Received PUBLISH from mouth \(d0, q1, r0, ", plain.log)
    assert re.search(r"Sending PUBLISH to ears \(d0, q1, r0, ", plain.log)


@pytest.mark.slow
def test_link_comes_back_and_subscribes_again_after_the_broker_was_killed(mosquitto) -> None:
    broker, name = mosquitto(), "sprung/v1/bus/raw"
    with connected(Client(broker, "ears", topics=[name])) as [ears]:
        assert ears.heard_until_now(ears, name) == []
        for _ in range(2):
            broker.kill9()
            eventually(lambda: not ears.link.is_connected, "the link takes note")
            assert ears.link.problem
            assert not ears.link.publish(name, b"nobody hears this")
            ears.come_back(broker.restart)
            assert ears.link.is_connected
            assert not ears.link.problem
            ears.heard_until_now(ears, name)  # after what the killed broker had not confirmed, if anything


@pytest.mark.slow
def test_link_waits_for_a_broker_that_starts_later(mosquitto) -> None:
    broker = mosquitto()
    broker.kill9()
    client = Client(broker, "early bird", topics=["sprung/v1/bus/ack"])
    client.link.open()
    try:
        eventually(lambda: "connection refused" in client.link.problem, "the link says why it is not connected")
        client.come_back(broker.restart)
        assert client.heard_until_now(client, "sprung/v1/bus/ack") == []
    finally:
        client.link.close()


def test_opening_says_that_nobody_listens(mosquitto) -> None:
    broker = mosquitto()
    broker.stop()
    with pytest.raises(LinkError, match=rf"{broker.address} cannot be reached \(connection refused\): check that"):
        Client(broker, "nobody").link.open(timeout=10.0)


def test_will_is_published_when_the_process_is_killed(plain) -> None:
    name = "sprung/v1/bus/state"
    with connected(Client(plain, "heir", topics=[name])) as [heir], mortal(plain.address, name) as process:
        assert heir.heard_until_now(heir, name) == []
        process.send_signal(signal.SIGKILL)
        assert heir.heard_until((name, b"gone")) == []


# Certificates and access, as shipped


def make_test_ca(folder, *names):
    subprocess.run([ROOT / "scripts" / "make-test-ca", folder, *names], check=True, capture_output=True)
    return folder


@pytest.fixture(scope="module")
def certificates(tmp_path_factory: pytest.TempPathFactory):
    return make_test_ca(tmp_path_factory.mktemp("ca"), "A", "B", "C", "monitor", "viewer")


def shipped_text(certificates, acl):
    """Return the shipped configuration with paths and port of the tests; it says more, and is the same otherwise."""
    text = (SHIPPED / "mosquitto.conf").read_text()
    for was, now in {
        "listener 8883": "listener {port} 127.0.0.1",
        "/etc/mosquitto/certs/": f"{certificates}/",
        "/etc/mosquitto/acl": str(acl),
        "/var/lib/mosquitto/": "{folder}/",
        "/var/log/mosquitto/": "{folder}/",
        "/run/mosquitto/": "{folder}/",
    }.items():
        assert was in text
        text = text.replace(was, now)
    return f"{text}\nlog_type all\n"


@pytest.fixture(scope="module")
def shipped(mosquitto, certificates):
    """A broker that goes by the shipped files."""
    return mosquitto(shipped_text(certificates, SHIPPED / "acl"))


def address(broker, authority, certificate=None):
    """Return where a broker is, with the authority to trust and the certificate to show."""
    files = {"ca": authority / "ca.crt"}
    if certificate:
        files |= {"cert": certificate.with_suffix(".crt"), "key": certificate.with_suffix(".key")}
    return f"mqtts://127.0.0.1:{broker.port}?{urlencode(files)}"


@pytest.fixture
def client(shipped, certificates):
    """Return a function from a certificate's name to a connected client."""
    made = []

    def connect(name, *, topics=(), client_id=None):
        where = address(shipped, certificates, certificates / name)
        made.append(Client(shipped, client_id or f"test-{name}", address=where, known_as=name, topics=topics))
        return made[-1].open()

    yield connect
    for one in made:
        one.link.close()


def upward(name="+"):
    return [topic(name, what) for what in UPWARDS]


def downward(name):
    return [topic(name, "ack"), topic(name, "cmd")]


def assert_refused(broker, where, *, says="", **options):
    one = Client(broker, "intruder", address=where, **options)
    before = broker.log.count("New client connected")
    one.link.open()
    try:
        eventually(lambda: one.link.problem, "a refusal")
        assert says in one.link.problem
        assert not one.n_connected
        assert not one.link.is_connected
        assert not one.link.publish(topic("A", "raw"), b"let me in")
        assert broker.log.count("New client connected") == before
    finally:
        one.link.close()


@pytest.mark.slow
def test_nobody_gets_in_without_a_certificate(shipped, certificates) -> None:
    assert_refused(shipped, address(shipped, certificates))


@pytest.mark.slow
def test_certificate_of_another_authority_is_refused(shipped, certificates, tmp_path: Path) -> None:
    other = make_test_ca(tmp_path, "A")
    assert_refused(shipped, address(shipped, certificates, other / "A"))


@pytest.mark.slow
def test_link_refuses_a_broker_of_another_authority(shipped, certificates, tmp_path: Path) -> None:
    other = make_test_ca(tmp_path, "A")
    where = address(shipped, other, certificates / "A")
    assert_refused(shipped, where, says="cannot be reached (TLS failed: self-signed certificate")
    with pytest.raises(LinkError, match="TLS failed"):
        Client(shipped, "intruder", address=where).link.open(timeout=1.0)


def test_vehicle_speaks_in_its_own_name_only(client) -> None:
    monitor = client("monitor", topics=upward())
    others = {name: client(name, topics=downward(name)) for name in ("B", "C")}
    viewer = client("viewer", topics=[topic("+", "alert")])
    vehicle = client("A", topics=downward("A"))
    forged = [topic("B", what) for what in (*UPWARDS, "ack", "cmd", "alert")]
    forged += [*downward("A"), topic("A", "alert"), topic("monitor", "state"), "sprung/v1/A/raw/more", "sprung/v1/A"]
    for name in forged:
        for is_retained in (False, True):
            assert vehicle.link.publish(name, b"forged", is_retained=is_retained)
    allowed = [(name, name.encode()) for name in upward("A")]
    for name, payload in allowed:
        assert vehicle.link.publish(name, payload)

    # The messages of one client arrive in order: what was forged would have come first.
    assert monitor.heard_until_now(vehicle, topic("A", "raw")) == allowed
    for name, one in {**others, "A": vehicle}.items():
        assert one.heard_until_now(monitor, topic(name, "ack")) == []
    assert viewer.heard_until_now(monitor, topic("A", "alert")) == []
    monitor.link.close()
    assert client("monitor", topics=upward()).heard_until_now(vehicle, topic("A", "raw")) == []  # nothing was kept


def test_vehicle_hears_only_what_is_said_to_it(client) -> None:
    spy = client("A", topics=[*EVERYTHING, *downward("A"), *downward("B"), *upward("B"), topic("A", "raw"), "$SYS/#"])
    monitor = client("monitor", topics=upward())
    other = client("B", topics=downward("B"))
    for name in upward("B"):
        assert other.link.publish(name, b"secret")
    assert monitor.heard_until((upward("B")[-1], b"secret")) == [(name, b"secret") for name in upward("B")[:-1]]
    for name in (topic("B", "alert"), topic("monitor", "state"), *downward("B")):
        assert monitor.link.publish(name, b"secret")
    assert other.heard_until((topic("B", "cmd"), b"secret")) == [(topic("B", "ack"), b"secret")]
    assert {name for name, _ in spy.heard_until_now(monitor, topic("A", "ack"))} == set()


def test_monitor_answers_commands_and_alerts(client) -> None:
    viewer = client("viewer", topics=[*EVERYTHING, *upward(), topic("+", "alert")])
    vehicle = client("A", topics=downward("A"))
    monitor = client("monitor", topics=upward())
    for what in ("ack", "cmd", "alert"):
        assert monitor.link.publish(topic("A", what), what.encode())
    assert vehicle.heard_until((topic("A", "cmd"), b"cmd")) == [(topic("A", "ack"), b"ack")]
    assert monitor.heard_until_now(monitor, topic("monitor", "state")) == []
    assert [name for name, _ in viewer.heard_until_now(monitor, topic("B", "alert"))].count(topic("A", "alert")) >= 1


def test_monitor_and_viewer_cannot_pass_for_a_vehicle(client) -> None:
    monitor = client("monitor", topics=upward())
    viewer = client("viewer")
    vehicle = client("A", topics=downward("A"))
    for name in (*upward("A"), *upward("viewer"), *downward("A"), topic("A", "alert")):
        assert viewer.link.publish(name, b"forged")
    for name in upward("A"):
        assert monitor.link.publish(name, b"forged")
    viewer.link.close()  # which ends after all of it
    assert vehicle.heard_until_now(monitor, topic("A", "ack")) == []
    assert monitor.heard_until_now(vehicle, topic("A", "raw")) == []


@pytest.mark.parametrize(("vehicle", "is_published"), [("A", True), ("B", False)])
def test_will_is_published_in_the_own_name_only(client, shipped, certificates, vehicle, is_published) -> None:
    monitor = client("monitor", topics=upward())
    other = client("B")
    with mortal(address(shipped, certificates, certificates / "A"), topic(vehicle, "state")) as process:
        ends = shipped.log.count("Client A ")
        process.send_signal(signal.SIGKILL)
        eventually(lambda: shipped.log.count("Client A ") > ends, "the broker sees it go")
    will = [(topic(vehicle, "state"), b"gone")]
    assert monitor.heard_until_now(other, topic("B", "raw")) == (will if is_published else [])


def test_vehicle_that_the_acl_denies_says_and_hears_nothing(mosquitto, certificates, tmp_path: Path) -> None:
    text = (SHIPPED / "acl").read_text()
    denying = text.replace("# user bus-17\n# topic deny sprung/v1/bus-17/#", "user A\ntopic deny sprung/v1/A/#")
    assert denying != text
    (tmp_path / "acl").write_text(denying)
    broker = mosquitto(shipped_text(certificates, tmp_path / "acl"))

    def made(name, topics):
        where = address(broker, certificates, certificates / name)
        return Client(broker, name, address=where, topics=topics)

    monitor, lost, other = made("monitor", upward()), made("A", downward("A")), made("B", downward("B"))
    with connected(monitor, lost, other):
        assert lost.link.publish(topic("A", "raw"), b"stolen")
        assert monitor.link.publish(topic("A", "ack"), b"secret")
        lost.link.close()
        eventually(lambda: "Client A disconnected" in broker.log, "the end of the lost one")
        assert "Sending PUBLISH to A " not in broker.log
        assert monitor.heard_until_now(other, topic("B", "raw")) == []
        assert other.heard_until_now(monitor, topic("B", "ack")) == []


def test_vehicle_cannot_throw_out_another_by_its_client_name(client) -> None:
    other = client("B", topics=downward("B"), client_id="sprung-box-B")
    rogue = client("A", topics=downward("A"), client_id="sprung-box-B")
    monitor = client("monitor")
    for name, one in (("B", other), ("A", rogue)):
        assert one.heard_until_now(monitor, topic(name, "ack")) == []
        assert one.n_connected == 1


def test_largest_frame_passes_and_a_larger_packet_does_not(client) -> None:
    monitor = client("monitor", topics=[topic("+", "raw")])
    vehicle = client("A")
    assert vehicle.link.publish(topic("A", "raw"), bytes(LARGEST))
    assert monitor.heard_until((topic("A", "raw"), bytes(LARGEST))) == []
    vehicle.link.publish(topic("A", "raw"), bytes(LARGEST + 100_000))
    eventually(lambda: not vehicle.link.is_connected, "the broker closes the connection")
    assert monitor.link.is_connected


def test_a_refused_message_is_a_problem_until_the_next_connection(client) -> None:
    one = client("A")
    assert (one.link.is_rejected, one.link.problem) == (False, "")
    assert one.link.publish(topic("B", "raw"), b"")
    eventually(lambda: one.link.is_rejected, "the refusal")
    assert "refuses messages: Not authorized" in one.link.problem


def test_a_vehicle_with_the_certificate_of_another_is_named_on_both_sides(
    client, shipped, certificates, tmp_path: Path, caplog
) -> None:
    where = address(shipped, certificates, certificates / "A")
    car = read_vehicle("zafira")
    box = box_of("tram-7", car, Spool(tmp_path / "spool", is_synced=False), Address.parse(where))
    monitor = client("monitor", topics=upward())
    channels = tuple(Channel(sensor.channel, sensor.quantity) for sensor in car.sensor)
    block = Recording(np.random.default_rng(1).standard_normal((len(channels), 100)), 100.0, channels)
    box.open(timeout=10.0)
    try:
        box.take(replace(block, start=10**18))
        with pytest.raises(DataError, match=r"1 frame not acknowledged: the broker .* refuses messages of vehicle"):
            replay(box, [], pace=None, patience=30.0)
        assert box.problem.endswith(
            f"refuses messages of vehicle 'tram-7', as the certificate {certificates}/A.crt is that of 'A': use "
            "--vehicle-id A, or the credentials of tram-7"
        )
        box.step()
        message = monitor.heard_first()
    finally:
        box.close()
    assert message[0] == topic("A", "event")
    with open_store(f"sqlite:///{tmp_path}/store.sqlite") as store:
        intake = Intake(Context(Site(), store), lambda name, payload: None)
        intake.take([message, message], now=0)
    assert caplog.messages == [
        "messages on sprung/v1/A/event are refused: a box with the certificate of 'A' calls itself 'tram-7', so that "
        "the broker refuses its samples: use --vehicle-id A on the box, or give it the certificate of tram-7"
    ]
    assert intake.figures["sprung_messages_refused_total"] == 2
