"""The box, and each step of the way of a frame."""

import argparse
import time
from pathlib import Path

from measuring import print_table
from programs import Program, course, cpu, memory, mosquitto, publisher, until


def measure_box(_given: argparse.Namespace, folder: Path) -> None:
    """A box that sends eight channels at 1 kHz as they were recorded."""
    from sprung.formats import write
    from sprung.link import VERSION, Header, Key, checked_map, message

    recording = eight_channels(40.0)
    file = folder / "drive.npz"
    write(recording, file)
    n_bytes, n_samples = 0, 0
    with mosquitto(folder) as broker:

        def came(name: str, payload: bytes) -> None:
            nonlocal n_bytes, n_samples
            document = checked_map(payload)
            n_bytes += len(payload)
            header = Header.of(document)
            n_samples += header.n_samples * len(document[Key.CHANNELS])
            answer = {Key.VERSION: VERSION, Key.BOOT: header.boot, Key.SEQ: header.seq}
            monitor.publish(name.replace("raw", "ack"), message(answer))

        monitor = publisher(broker, topics=["sprung/v1/+/raw"], on_message=came)
        options = ["--vehicle-id", "car", "--vehicle", "zafira", "--broker", broker, "--spool", str(folder / "spool")]
        box = Program(["box", str(file), *options, "--pace", "1"], folder)
        until(lambda: n_samples, patience=30.0)
        start_up = cpu(box.pid)
        time.sleep(3.0)
        before, begin = cpu(box.pid), time.monotonic()
        time.sleep(20.0)
        share = (cpu(box.pid) - before) / (time.monotonic() - begin)
        size = memory(box.pid)
        box.close()
        monitor.close()
    print_table(
        "The box: 8 channels at 1 kHz from a file, in real time",
        ("what", "value", "goal"),
        [
            ("CPU, share of a core", f"{share:.1%}", "below 5 %"),
            ("memory, MiB", f"{size:.0f}", "below 150 MB"),
            ("CPU until the first frame has come, s", f"{start_up:.1f}", ""),
            ("bytes per sample on the wire", f"{n_bytes / n_samples:.2f}", ""),
            ("errors", str(len(box.errors)), "0"),
        ],
    )


def eight_channels(duration: float) -> object:
    """Return the accelerations of two drives at 1 kHz."""
    from dataclasses import replace

    import numpy as np

    from sprung.recording import Channel
    from sprung.simulation import RoadDrive, simulate_drive
    from sprung.vehicles import read_vehicle

    settings = RoadDrive(duration=duration, sampling_rate=1000.0, snr=50.0)
    runs = [simulate_drive(read_vehicle("zafira"), settings, seed=seed).recording for seed in range(2)]
    return replace(
        runs[0],
        samples=np.concatenate([run.samples[:4] for run in runs]),
        channels=tuple(Channel(f"a{k}", "acceleration") for k in range(8)),
        history=(),
    )


def measure_delivery(_given: argparse.Namespace, folder: Path) -> None:
    """What each step of the way of a frame can do."""
    from sprung.link import Frame, Spool, decode, encode, quantised
    from sprung.online.box import blocks_of
    from sprung.online.store import StoredFrame, open_store

    prepared, large = course(), list(blocks_of(eight_channels(30.0), length=1.0))
    small = [prepared.first]
    payloads = [prepared.payload("car", 1, seq) for seq in range(2000)]

    def encoded(blocks: list[object]) -> list[bytes]:
        found = []
        for seq, block in enumerate(blocks):
            counts, scale, flags = quantised(block.samples)
            found.append(encode(Frame("car", 1, seq, 0, 5_000_000, block.names, scale, counts, 2, flags)))
        return found

    def spooled(name: str, *, is_synced: bool) -> None:
        spool = Spool(folder / name, is_synced=is_synced)
        for payload in payloads[:500]:
            spool.append(lambda _boot, _seq, payload=payload: payload)
        spool.close()

    def stored(step: int) -> None:
        store = open_store(f"sqlite:///{folder}/{step}.sqlite")
        frames = [StoredFrame("car", 1, seq, 0, payload) for seq, payload in enumerate(payloads[:1000])]
        for first in range(0, 1000, step):
            store.inbox.add_frames(frames[first : first + step], now=1)
        store.close()

    steps = [
        ("quantised and encoded, 5 channels at 200 Hz", 500, lambda: encoded(small * 500)),
        ("quantised and encoded, 8 channels at 1 kHz", 30, lambda: encoded(large)),
        ("decoded, 5 channels at 200 Hz", 2000, lambda: [decode(payload) for payload in payloads]),
        ("into the spool, each on the disk", 500, lambda: spooled("synced", is_synced=True)),
        ("into the spool, not synced", 500, lambda: spooled("loose", is_synced=False)),
        ("into the store, one in a transaction", 1000, lambda: stored(1)),
        ("into the store, 100 in a transaction", 1000, lambda: stored(100)),
    ]
    rows = []
    for name, count, act in steps:
        wall, used = time.perf_counter(), time.process_time()
        act()
        wall, used = time.perf_counter() - wall, time.process_time() - used
        rows.append((name, f"{count / wall:.0f}", f"{1e3 * used / count:.3f}"))
    print_table("Delivery, frames of a second", ("step", "frames/s", "CPU, ms per frame"), rows)
