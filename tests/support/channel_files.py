"""The known axis of `dialects` in files of groups of channels, each written by the library of its format.

They have what such files have: groups of other rates, scaled integers, enumerations, missing samples, texts.
"""

from __future__ import annotations

import json
import struct
from pathlib import Path

import numpy as np
from foreign_axis import axis

AXIS = axis(rows=3000)
T, ANGLE, TORQUE = AXIS["t"], AXIS["angle"], AXIS["torque"]
STEP = 2.0 * np.pi / 65536  # of an encoder [rad]
COUNTS = np.round(ANGLE / STEP).astype(np.int32)
BETWEEN = np.abs(TORQUE[1:-1] - 0.5 * (TORQUE[:-2] + TORQUE[2:])) < 1e-3  # its neighbours tell the value
MISSING = np.r_[False, BETWEEN & (np.arange(T.size - 2) % 40 == 20), False]  # samples of the torque
START_NS = 1_700_000_000_000_000_000
LIBRARIES = {
    "mf4": "asammdf", "h5": "h5py", "hdf5": "h5py", "mcap": "mcap", "tdms": "nptdms", "ulg": "pyulog",
}  # fmt: skip


def mdf_of_a_vehicle(path: Path) -> None:
    """Counts with a linear conversion, an enumeration, samples marked as invalid, a slow group."""
    from asammdf import MDF, Signal
    from asammdf.blocks.conversion_utils import from_dict

    states = {"val_0": 0, "text_0": b"off", "val_1": 1, "text_1": b"on", "default": b"unknown"}
    with MDF(version="4.10") as file:
        file.append(
            [
                Signal(COUNTS, T, "rad", "motor_angle", conversion=from_dict({"a": STEP, "b": 0.0})),
                Signal(np.where(MISSING, 1e6, TORQUE), T, "Nm", "motor_torque", invalidation_bits=MISSING),
                Signal((T > 1.0).astype(np.uint8), T, "", "power", conversion=from_dict(states)),
            ],
            acq_name="drive",
            common_timebase=True,
        )
        file.append([Signal(20.0 + T[::100], T[::100], "degC", "temperature")], acq_name="slow")
        file.save(path, overwrite=True, compression=1)


def hdf5_folders(path: Path) -> None:
    """A folder per device, units as attributes, counts with a factor, a fill value, an enumeration, a text."""
    import h5py

    with h5py.File(path, "w") as file:
        file.attrs["project"] = "test rig"
        drive = file.create_group("drive")
        torque = np.where(MISSING, -9999.0, TORQUE)
        for name, values, unit in (("torque", torque, "Nm"), ("position", COUNTS, "rad"), ("t", T, "s")):
            drive[name] = values
            drive[name].attrs["units"] = unit
        drive["position"].attrs["scale_factor"] = STEP
        drive["torque"].attrs["_FillValue"] = -9999.0
        drive.create_dataset("power", data=(T > 1.0).astype("i1"), dtype=h5py.enum_dtype({"OFF": 0, "ON": 1}, "i1"))
        climate = file.create_group("climate")
        climate["temperature"], climate["t"] = 20.0 + T[::100], T[::100]
        file["operator"] = "somebody"


def hdf5_table(path: Path) -> None:
    """One table of records, as PyTables and pandas write it."""
    import h5py

    rows = np.zeros(T.size, dtype=[("time", "f8"), ("angle_rad", "f4"), ("torque_Nm", "f4"), ("note", "S4")])
    rows["time"], rows["angle_rad"], rows["torque_Nm"], rows["note"] = T, ANGLE, TORQUE, b"ok"
    with h5py.File(path, "w") as file:
        file.create_dataset("run/rows", data=rows, compression="gzip")


def mat_of_version_7_3(path: Path) -> None:
    """What `save -v7.3` of MATLAB writes: a head, transposed arrays, texts as numbers, a structure as a folder."""
    import h5py

    with h5py.File(path, "w", userblock_size=512) as file:
        kind = "MATLAB_class"
        for name, values in (("t", T), ("data/angle_rad", ANGLE), ("data/torque_Nm", TORQUE)):
            file[name] = values[None, :]  # a column of MATLAB
            file[name].attrs[kind] = np.bytes_("double")
        file["data"].attrs[kind] = np.bytes_("struct")
        file["note"] = np.array([[ord(letter)] for letter in "test rig"], dtype=np.uint16)
        file["note"].attrs[kind] = np.bytes_("char")
        file.create_group("#refs#")["a"] = np.arange(9.0)
    with path.open("r+b") as raw:
        raw.write(b"MATLAB 7.3 MAT-file, Platform: GLNXA64".ljust(116) + bytes(8) + b"\x00\x02IM")


def mcap_json(path: Path) -> None:
    """Two topics of JSON, one of another rate, with nested fields, a text and a message without a field."""
    from mcap.writer import CompressionType, Writer

    with path.open("wb") as stream:
        writer = Writer(stream, compression=CompressionType.LZ4)
        writer.start()
        schema = writer.register_schema("axis", "jsonschema", b"{}")
        axis_id, slow_id = (writer.register_channel(name, "json", schema) for name in ("/axis/state", "/climate"))
        for k, (t, angle, torque) in enumerate(zip(T, ANGLE, TORQUE, strict=True)):
            row = {"motor": {"angle_rad": angle, "torque_Nm": torque}, "mode": "run"}
            if MISSING[k]:
                del row["motor"]["torque_Nm"]
            at = START_NS + round(t * 1e9)
            writer.add_message(axis_id, at, json.dumps(row).encode(), at)
            if k % 100 == 0:
                writer.add_message(slow_id, at, json.dumps({"temperature": 20.0 + t}).encode(), at)
        writer.finish()


def mcap_ros2(path: Path) -> None:
    """sensor_msgs/JointState of ROS 2, logged late by a jittering time, so that the stamp of the header counts."""
    from mcap_ros2.writer import Writer

    definition = (
        "std_msgs/Header header\nstring[] name\nfloat64[] position\nfloat64[] velocity\nfloat64[] effort\n"
        f"{'=' * 80}\nMSG: std_msgs/Header\nbuiltin_interfaces/Time stamp\nstring frame_id\n"
        f"{'=' * 80}\nMSG: builtin_interfaces/Time\nint32 sec\nuint32 nanosec\n"
    )
    with path.open("wb") as stream, Writer(stream) as writer:
        schema = writer.register_msgdef("sensor_msgs/msg/JointState", definition)
        for k, (t, angle, torque) in enumerate(zip(T, ANGLE, TORQUE, strict=True)):
            seconds, rest = divmod(START_NS + round(t * 1e9), 10**9)
            late = START_NS + round(t * 1e9) + 300_000 * (k * 7 % 5)
            message = {
                "header": {"stamp": {"sec": seconds, "nanosec": rest}, "frame_id": ""},
                "name": ["axis"], "position": [angle], "velocity": [], "effort": [torque],
            }  # fmt: skip
            writer.write_message("/joint_states", schema, message, late, late)


def tdms_waveforms(path: Path) -> None:
    """Waveforms of LabVIEW in two segments: the clock is a property, a slow group, a channel of texts."""
    from nptdms import ChannelObject, RootObject, TdmsWriter

    def wave(name: str, values: np.ndarray, step_s: float, unit: str, group: str = "drive") -> ChannelObject:
        about = {"wf_increment": step_s, "wf_start_offset": 0.0, "wf_samples": values.size, "unit_string": unit}
        return ChannelObject(group, name, values, about)

    half = T.size // 2
    with TdmsWriter(path) as file:
        for rows in (slice(0, half), slice(half, None)):
            every = slice(rows.start, rows.stop, 100)
            file.write_segment(
                [
                    RootObject({"operator": "somebody"}),
                    wave("motor angle", ANGLE[rows], 1e-3, "rad"),
                    wave("motor torque", TORQUE[rows].astype(np.float32), 1e-3, "Nm"),
                    wave("temperature", 20.0 + T[every], 0.1, "degC", "climate"),
                    ChannelObject("events", "text", ["begin"]),
                ]
            )


def ulog_topics(path: Path) -> None:
    """Topics of a flight log, by the ULog file format of PX4: header, flags, formats, subscriptions, data."""

    def message(kind: bytes, content: bytes) -> bytes:
        return struct.pack("<HB", len(content), kind[0]) + content

    start_us = 5_000_000
    parts = [b"ULog\x01\x12\x35\x01", struct.pack("<Q", start_us), message(b"B", bytes(40))]
    formats = (b"motor:uint64_t timestamp;double angle_rad;double torque_nm;", b"climate:uint64_t timestamp;float t_c;")
    parts += [message(b"F", one) for one in formats]
    parts += [message(b"A", struct.pack("<BH", 0, k) + name) for k, name in enumerate((b"motor", b"climate"))]
    for k, (t, angle, torque) in enumerate(zip(T, ANGLE, TORQUE, strict=True)):
        at = start_us + round(t * 1e6)
        parts.append(message(b"D", struct.pack("<HQdd", 0, at, angle, torque)))
        if k % 100 == 0:
            parts.append(message(b"D", struct.pack("<HQf", 1, at, 20.0 + t)))
    path.write_bytes(b"".join(parts))


CHANNEL_FILES = {
    "ASAM MDF 4, groups": ("mf4", mdf_of_a_vehicle),
    "HDF5, folders": ("h5", hdf5_folders),
    "HDF5, table": ("hdf5", hdf5_table),
    "MCAP, JSON": ("mcap", mcap_json),
    "MCAP, ROS 2": ("mcap", mcap_ros2),
    "TDMS": ("tdms", tdms_waveforms),
    "ULog": ("ulg", ulog_topics),
}
