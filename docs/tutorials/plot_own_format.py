"""
A file format of your own
=========================

A logger writes files that no other program reads. Three steps make them usable: bytes become numbers, numbers become a
:class:`sprung.Recording`, and the result is inspected before anything is identified.
"""

import io
import struct
import sys
import tempfile
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import sprung

# %%
# The logger
# ----------
# Its files have a header with the sampling rate (a 4-byte float), the number of channels and the sensitivity [counts
# per g], followed by 16-bit samples, channel by channel within each scan. Here is such a file, made from a simulated
# run of a car.

car = sprung.read_vehicle("zafira")
model = sprung.structure(car)
run = sprung.simulate(model, sprung.usual_excitation(model), duration=300.0, sampling_rate=100.0, snr=20, seed=1)

GRAVITY, SENSITIVITY = 9.80665, 20_000.0
counts = np.clip(np.rint(run.samples / GRAVITY * SENSITIVITY), -32768, 32767).astype("<i2")
file = io.BytesIO(struct.pack("<fHf", run.sampling_rate, len(counts), SENSITIVITY) + counts.T.tobytes())
print(f"{file.getbuffer().nbytes} bytes")

# %%
# From bytes to a recording
# -------------------------
# A recording holds samples in SI units, shape (channels, samples), one sampling rate, and what each channel is. A
# channel with a known quantity can be checked and scaled; its position on the body comes from the vehicle file, by its
# name.


def read_logger(stream, names):
    """Return the recording of a logger's file."""
    sampling_rate, n_channels, sensitivity = struct.unpack("<fHf", stream.read(10))
    if n_channels != len(names):
        raise sprung.FormatError(f"the file has {n_channels} channels, but {len(names)} names are given: name them all")
    scans = np.frombuffer(stream.read(), dtype="<i2").reshape(-1, n_channels)
    samples = scans.T / sensitivity * GRAVITY
    channels = tuple(sprung.Channel(name, "acceleration") for name in names)
    return sprung.Recording(samples, sampling_rate, channels, history=("read from a logger",))


recording = read_logger(file, ("acc_fl", "acc_fr", "acc_rl", "acc_rr"))
print(recording)

# %%
# A look before the analysis
# --------------------------
# :func:`sprung.inspect` finds dead, stuck, clipped and spiking channels, gaps and offsets: what ``sprung info``
# prints.

for channel in sprung.inspect(recording).channels:
    print(f"{channel.name}: RMS {channel.rms:.3g} {channel.unit}, {'dead' if channel.is_dead else 'alive'}")

figure, axes = plt.subplots(figsize=(8, 3), layout="constrained")
time = np.arange(1000) / recording.sampling_rate
for channel, samples in zip(recording.channels, recording.samples, strict=True):
    axes.plot(time, samples[:1000], linewidth=0.7, label=channel.name)
axes.set(xlabel="time [s]", ylabel="acceleration [m/s²]", xlim=(0, 10))
axes.legend(frameon=False, ncols=4, loc="lower center", bbox_to_anchor=(0.5, 1.0))
plt.show()

# %%
# From here on it is a recording like any other: it can be identified, or written in a common format by
# ``sprung.write(recording, "run.parquet")``.

identification = sprung.cov_ssi(recording, vehicle=car)
print(identification)

# %%
# A format for all commands
# -------------------------
# To make ``sprung identify run.xyz`` read such files, put them into a module with ``NAME``, ``EXTRA``, ``ENDINGS``,
# ``recognises`` and ``groups``, and name it in the ``pyproject.toml`` of a package of your own::
#
#     [project.entry-points."sprung.formats"]
#     logger = "logger_format"
#
# Once that package is installed, ``sprung.read`` and all commands read its files. Installing it leaves two things on
# the path of Python, which are written here by hand: the module, and its entry point.

MODULE = """
import numpy as np
from sprung.formats.table import Block, Group, Table, stated_column

NAME, EXTRA, ENDINGS = "a logger's file", None, (".xyz",)
HEAD = np.dtype([("sampling_rate", "<f4"), ("n_channels", "<u2"), ("sensitivity", "<f4")])


def recognises(head):
    return len(head) > HEAD.itemsize


def groups(path, settings):
    head = np.fromfile(path, HEAD, count=1)[0]
    samples = np.fromfile(path, "<i2", offset=HEAD.itemsize).reshape(-1, head["n_channels"]).T / head["sensitivity"]
    names = [f"channel_{number}" for number in range(1, len(samples) + 1)]

    def opened(channels):
        wanted = [names.index(name) for name in channels or names]
        columns = tuple(stated_column(names[k], names[k], "g") for k in wanted)

        def blocks(first=0, last=None):
            yield Block(first + 1, None, samples[wanted, first:last])

        return Table(path, columns, None, blocks, sampling_rate=float(head["sampling_rate"]))

    return (Group(path.name, tuple(names), path.name, opened),)
"""

with tempfile.TemporaryDirectory() as folder:
    Path(folder, "logger_format.py").write_text(MODULE, encoding="utf-8")
    metadata = Path(folder, "logger_format-1.0.dist-info")
    metadata.mkdir()
    (metadata / "entry_points.txt").write_text("[sprung.formats]\nlogger = logger_format\n", encoding="utf-8")
    sys.path.insert(0, folder)
    Path(folder, "run.xyz").write_bytes(file.getvalue())
    print(sprung.read(Path(folder, "run.xyz")))

# %%
# The shapes of the first recording are those of the car.

plt.figure(sprung.plotting.shapes_figure(identification.modes, identification.channels))
plt.show()
