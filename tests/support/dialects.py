"""One known rotary axis as the programs of drives, controllers and loggers export it, each by a writer of its own.

The forms follow public descriptions and exports: the manual of TwinCAT Scope, LinuxCNC's halscope(1) and halsampler(1),
`camonitor` and the archiver appliance of EPICS, annotated CSV of InfluxDB, `rostopic echo -p`, PlotJuggler, SINUMERIK
Trace sessions, the telemetry of ODrive and moteus.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable
from pathlib import Path

import numpy as np
from channel_files import CHANNEL_FILES
from foreign_axis import axis

AXIS = axis(rows=3000)
T, ANGLE, TORQUE = AXIS["t"], AXIS["angle"], AXIS["torque"]
SPEED = np.gradient(ANGLE, 1e-3)
REV = ANGLE / (2.0 * np.pi)
DEG = np.rad2deg(ANGLE)
FILETIME = 133_500_000_000_000_000  # 100 ns since 1601


def _lines(path: Path, lines: Iterable[str], ending: str = "\n") -> None:
    path.write_text(ending.join(lines) + ending, encoding="utf-8")


def _rows(delimiter: str, *columns: np.ndarray, form: str = ".6f", comma: bool = False) -> list[str]:
    text = [delimiter.join(format(value, form) for value in row) for row in zip(*columns, strict=True)]
    return [line.replace(".", ",") for line in text] if comma else text


def twincat_pairs(path: Path) -> None:
    """A time column for each channel, decimal comma."""
    about = ["Name\taxis", "File\taxis.svdx", f"Starttime of export\t{FILETIME}\tMonday\t10:40:00.000", "", ""]
    about += ["Name\tActPosition\tName\tActTorque", "Data-Type\tREAL64\tData-Type\tREAL64"]
    about += ["SampleTime[ms]\t1\tSampleTime[ms]\t1", "Unit\t° (Angle)\tUnit\tNm (Torque)", ""]
    _lines(path, about + _rows("\t", 1e3 * T, DEG, 1e3 * T, TORQUE, comma=True), "\r\n")


def twincat_one_clock(path: Path) -> None:
    """One time column for all channels of a sample time, and an end tag."""
    about = ["Name;axis", "File;axis.csv", "", "Name;ActPosition;ActTorque", "Data-Type;REAL64;REAL64"]
    about += ["SampleTime[ms];1;1", "ScaleFactor;1;1", "Unit;rad (Angle);Nm (Torque)", ""]
    _lines(path, [*about, *_rows(";", 1e3 * T, ANGLE, TORQUE), "EOF"])


def twincat_full_stamps(path: Path) -> None:
    """Time stamps in FILETIME."""
    about = ["Name;axis", "", "Name;ActPosition;Name;ActTorque", "SampleTime[ms];1;SampleTime[ms];1"]
    about += ["Unit;rad (Angle);Unit;Nm (Torque)", ""]
    stamps = [FILETIME + 10_000 * k for k in range(T.size)]
    rows = [f"{s};{a:.6f};{s};{m:.6f}" for s, a, m in zip(stamps, ANGLE, TORQUE, strict=True)]
    _lines(path, about + rows)


def twincat_points(path: Path) -> None:
    """Commas between fields and points in numbers, and the short header."""
    names = "Name,ActPosition,Name,ActTorque"
    _lines(path, [names, "Unit,deg,Unit,Nm", *_rows(",", 1e3 * T, DEG, 1e3 * T, TORQUE)], "\r\n")


def twincat_local_time(path: Path) -> None:
    """Stamps of local time."""
    about = ["Name;axis", "", "Name;ActPosition;ActTorque", "Unit;rad (Angle);Nm (Torque)", ""]
    stamps = [f"01.03.2024 12:00:{k // 1000:02d},{k % 1000:03d}" for k in range(T.size)]
    rows = _rows(";", ANGLE, TORQUE, comma=True)
    _lines(path, about + [f"{stamp};{row}" for stamp, row in zip(stamps, rows, strict=True)])


def twincat_bare(path: Path) -> None:
    """Without a header: a time column for each channel."""
    _lines(path, _rows("\t", 1e3 * T, ANGLE, 1e3 * T, TORQUE))


def halscope(path: Path) -> None:
    """A comment with the period, then names of pins."""
    _lines(path, ["TIME,joint.0.motor-pos-fb,pid.x.torque-fb", *_rows(",", T, ANGLE, TORQUE)])


def halsampler(path: Path) -> None:
    """Numbered samples without names, with a line where the buffer ran over."""
    rows = [f"{k} {a:.6f} {m:.6f}" for k, (a, m) in enumerate(zip(ANGLE, TORQUE, strict=True))]
    _lines(path, [*rows[:1500], "overrun", *rows[1500:]])


def epos_recorder(path: Path) -> None:
    """Recorder of a position controller: names, units below, tabulators."""
    about = ["EPOS Studio Data Recording", "Sampling Period: 1 ms", ""]
    names = "Time\tPosition Actual Value\tVelocity Actual Value\tTorque Actual Value"
    columns = 1e3 * T, np.round(REV * 4096), SPEED * 30.0 / np.pi, 1e3 * TORQUE
    _lines(path, [*about, names, "[ms]\t[inc]\t[rpm]\t[mNm]", *_rows("\t", *columns)])


def odrive_json(path: Path) -> None:
    """Lists by name, as a liveplotter or a logging script dumps them."""
    columns = {"time": T, "pos_estimate": REV, "vel_estimate": SPEED / (2 * np.pi), "torque_estimate": TORQUE}
    path.write_text(json.dumps({"axis0": {name: values.tolist() for name, values in columns.items()}}))


def odrive_csv(path: Path) -> None:
    names = "time,axis0.encoder.pos_estimate [turn],axis0.motor.torque_estimate [Nm]"
    _lines(path, [names, *_rows(",", T, REV, TORQUE)])


def moteus_json_lines(path: Path) -> None:
    """A record of registers per line."""
    rows = zip(1.7e9 + T, REV, SPEED / (2 * np.pi), TORQUE, strict=True)
    keys = ("timestamp", "position_rev", "velocity_rev_s", "torque_Nm")
    _lines(path, (json.dumps(dict(zip(keys, map(float, row), strict=True))) for row in rows))


def moteus_csv(path: Path) -> None:
    names = "time,mode,position,velocity,torque,q_current,voltage,temperature,fault"
    columns = T, np.full(T.size, 10.0), REV, SPEED / (2 * np.pi), TORQUE, 2.0 * TORQUE
    columns += np.full(T.size, 24.0), 30.0 + T, np.zeros(T.size)
    _lines(path, [names, *_rows(",", *columns)])


def json_table(path: Path) -> None:
    rows = np.column_stack((T, ANGLE, TORQUE)).tolist()
    path.write_text(json.dumps({"columns": ["time_s", "motor_angle_rad", "torque_Nm"], "data": rows}))


def json_records(path: Path) -> None:
    keys = ("time_s", "motor_angle_rad", "torque_Nm")
    rows = zip(T.tolist(), ANGLE.tolist(), TORQUE.tolist(), strict=True)
    path.write_text(json.dumps([dict(zip(keys, row, strict=True)) for row in rows]))


def json_matrix(path: Path) -> None:
    rows = np.column_stack((T, ANGLE, TORQUE)).tolist()
    path.write_text(json.dumps([["time_s", "motor_angle_rad", "torque_Nm"], *rows]))


def numpy_structured(path: Path) -> None:
    kinds = [("time_s", "<f8"), ("motor_angle_rad", "<f8"), ("torque_Nm", "<f4")]
    rows = np.zeros(T.size, dtype=kinds)
    for (name, _), values in zip(kinds, (T, ANGLE, TORQUE), strict=True):
        rows[name] = values
    np.save(path, rows)


def numpy_matrix(path: Path) -> None:
    np.save(path, np.column_stack((T, ANGLE, TORQUE)))


def numpy_named(path: Path) -> None:
    np.savez_compressed(path, time_s=T, motor_angle_rad=ANGLE, torque_Nm=TORQUE, sample_rate=1000.0)


def mdf(path: Path) -> None:
    from asammdf import MDF, Signal

    with MDF(version="4.10") as file:
        signals = (("motor_angle", "rad", ANGLE), ("torque", "Nm", TORQUE))
        file.append([Signal(values, T, unit, name) for name, unit, values in signals])
        file.append([Signal(TORQUE[::10], T[::10], "degC", "temperature")])  # of another rate
        file.save(path, overwrite=True, compression=2)


def sinumerik_xml(path: Path) -> None:
    """Records with the attributes that changed; a value that is missing is the bits of a NaN."""
    lines = ['<?xml version="1.0" encoding="utf-8"?>', "<traceSession><traceData><dataFrame>"]
    names = (("f1", "actPos", "Actual position [deg]"), ("f2", "actTorque", "Torque [Nm]"))
    lines += [f'<dataSignal id="{key}" name="/NC/{name}" description="{text}"/>' for key, name, text in names]
    lines.append('<rec time="-0.001" f1="9221120237041090560" f2="9221120237041090560"/>')
    lines += [f'<rec time="{t:.4f}" f1="{a:.5f}" f2="{m:.5f}"/>' for t, a, m in zip(T, DEG, TORQUE, strict=True)]
    _lines(path, [*lines, "</dataFrame></traceData></traceSession>"])


def sinumerik_csv(path: Path) -> None:
    names = "Time;Actual position value encoder 1 [deg];Actual torque [Nm]"
    _lines(path, [names, *_rows(";", T, DEG, TORQUE, comma=True)])


def camonitor(path: Path) -> None:
    """A line for each change of a process variable."""
    lines = []
    later = ANGLE + 4e-4 * SPEED  # the variables are monitored one after the other
    for k, (angle, torque) in enumerate(zip(later, TORQUE, strict=True)):
        stamp = f"2024-03-01 12:00:{k // 1000:02d}.{k % 1000:03d}"
        lines += [
            f"AX1:Motor.TrqAct             {stamp}000 {torque:.6f}",
            f"AX1:Motor.PosAct             {stamp}400 {angle:.6f}",
        ]
        if k % 1000 == 700:
            lines.append(f"AX1:Motor.Status             {stamp}500 {k // 1000} STATE MINOR")
    _lines(path, lines)


def camonitor_on_change(path: Path) -> None:
    """Each variable at its own times, those of the position uneven, and only where its printed value has changed."""
    random = np.random.default_rng(4)
    lines = list[tuple[float, str]]()
    variables = ("TrqAct", TORQUE, 1e-3, 0.0), ("PosAct", ANGLE, 2e-3, 2e-4), ("Enabled", 1.0 * (T < 2.5), 1e-3, 0.0)
    for name, values, step_s, late_s in variables:
        times = np.arange(0.0, T[-1] + step_s, step_s)
        times = times + random.uniform(0.0, late_s, times.size) * (times > 0.0)
        texts = [
            f"{value:.6f}"
            for value in np.interp(times, [*T, 2 * T[-1] - T[-2]], [*values, 2 * values[-1] - values[-2]])
        ]
        for k, (at, text) in enumerate(zip(times, texts, strict=True)):
            if not k or text != texts[k - 1]:
                lines.append((at, f"AX1:Motor.{name} 2024-03-01 12:00:{at:09.6f} {text}"))
    _lines(path, [text for _, text in sorted(lines)])


def mr_configurator(path: Path) -> None:
    """Graph of a servo amplifier: about, names with units in brackets, percent of the rated torque."""
    about = ["MR Configurator2", "Model,MR-J4-40A", "Rated torque,1.3,Nm", "Sampling time,1.0,ms", ""]
    names = "Time[ms],Cumulative feedback pulses[deg],Motor speed[r/min],Torque[%]"
    columns = 1e3 * T, DEG, SPEED * 30.0 / np.pi, 100.0 * TORQUE / 1.3
    _lines(path, [*about, names, *_rows(",", *columns)])


def rostopic(path: Path) -> None:
    """`rostopic echo -p /joint_states`: nanoseconds since 1970, a column per element."""
    names = "%time,field.header.seq,field.header.stamp,field.name0,field.position0,field.velocity0,field.effort0"
    stamps = [1_700_000_000_000_000_000 + 1_000_000 * k for k in range(T.size)]
    rows = zip(stamps, ANGLE, SPEED, TORQUE, strict=True)
    _lines(path, [names, *(f"{s},{k},{s},joint1,{a:.6f},{v:.6f},{m:.6f}" for k, (s, a, v, m) in enumerate(rows))])


def bagpy(path: Path) -> None:
    """A bag as CSV by bagpy."""
    names = "Time,header.seq,header.stamp.secs,header.stamp.nsecs,header.frame_id,name_0,position_0,velocity_0,effort_0"
    rows = zip(ANGLE, SPEED, TORQUE, strict=True)
    lines = [
        f"{1.7e9 + 1e-3 * k + 2e-5 * (k % 7):.6f},{k},{1_700_000_000 + k // 1000},{k % 1000 * 1_000_000},base,joint1,"
        f"{a:.6f},{v:.6f},{m:.6f}"
        for k, (a, v, m) in enumerate(rows)
    ]
    _lines(path, [names, *lines])


def ros_messages(path: Path) -> None:
    """A message of JointState in each line."""
    rows = zip(ANGLE.tolist(), SPEED.tolist(), TORQUE.tolist(), strict=True)
    _lines(
        path,
        (
            json.dumps(
                {
                    "header": {"stamp": {"sec": 1_700_000_000 + k // 1000, "nanosec": k % 1000 * 1_000_000}},
                    "name": ["joint1"],
                    "position": [a],
                    "velocity": [v],
                    "effort": [m],
                }
            )
            for k, (a, v, m) in enumerate(rows)
        ),
    )


def ros2_csv(path: Path) -> None:
    """`ros2 topic echo --csv /joint_states`: no names."""
    rows = zip(ANGLE, SPEED, TORQUE, strict=True)
    stamps = [f"{1_700_000_000 + k // 1000},{k % 1000 * 1_000_000}" for k in range(T.size)]
    _lines(path, (f"{s},,joint1,{a:.6f},{v:.6f},{m:.6f}" for s, (a, v, m) in zip(stamps, rows, strict=True)))


def plotjuggler(path: Path) -> None:
    names = "__time,/joint_states/joint1/position,/joint_states/joint1/velocity,/joint_states/joint1/effort"
    _lines(
        path,
        [
            names,
            *(f"{1.7e9 + t:.6f},{a:.6f},{v:.6f},{m:.6f}" for t, a, v, m in zip(T, ANGLE, SPEED, TORQUE, strict=True)),
        ],
    )


def grafana(path: Path) -> None:
    """Download of a panel with formatted values: each cell has the unit that suits its size."""

    def formatted(value: float) -> str:
        return f"{value:.5f} N·m" if abs(value) >= 1.0 else f"{1e3 * value:.2f} mN·m"

    stamps = [f"2024-03-11 14:05:{k // 1000:02d}.{k % 1000:03d}" for k in range(T.size)]
    rows = [f"{s},{d:.4f} °,{formatted(m)}" for s, d, m in zip(stamps, DEG, TORQUE, strict=True)]
    _lines(path, ["sep=,", '"Time","angle","torque"', *rows], "\r\n")


def sinumerik_xml_on_change(path: Path) -> None:
    """Records without the values that are those of the record before; units beside the names."""
    lines = ['<?xml version="1.0"?>', '<traceSession version="2.0"><traceData dataFrames="1"><dataFrame id="1">']
    lines += ['<dataSignal id="f1" name="actPos" description="Actual position" units="deg"/>']
    lines += ['<dataSignal id="f2" name="actTorque" description="Actual torque" units="Nm"/>']
    texts = [[f"{a:.1f}" for a in DEG], [f"{round(m / 0.005) * 0.005:.3f}" for m in TORQUE]]
    for k, t in enumerate(T):
        given = [f' f{i + 1}="{one[k]}"' for i, one in enumerate(texts) if not k or one[k] != one[k - 1]]
        lines.append(f'<rec time="{t:.3f}"{"".join(given)}/>')
    _lines(path, [*lines, "</dataFrame></traceData></traceSession>"])


def archiver(path: Path) -> None:
    """Retrieval of the EPICS archiver appliance: stamps for each channel."""

    def points(values: np.ndarray, late_ns: int) -> list[dict[str, float]]:
        return [
            {"secs": 1_709_042_400 + k // 1000, "nanos": k % 1000 * 1_000_000 + late_ns, "val": v, "severity": 0}
            for k, v in enumerate(values.tolist())
        ]

    channels = ("AX1:TrqAct", "mNm", 1e3 * TORQUE, 0), ("AX1:PosAct", "deg", DEG + np.rad2deg(SPEED) * 3e-4, 300_000)
    content = [
        {"meta": {"name": name, "EGU": unit, "PREC": "4"}, "data": points(values, late_ns)}
        for name, unit, values, late_ns in channels
    ]
    path.write_text(json.dumps(content))


def influx(path: Path) -> None:
    """Annotated CSV: a table for each field, the unit as a tag."""
    above = ["#datatype,string,long,dateTime:RFC3339,dateTime:RFC3339,dateTime:RFC3339Nano,double,string,string,string"]
    above += ["#group,false,false,true,true,false,false,true,true,true", "#default,_result,,,,,,,,"]
    above += [",result,table,_start,_stop,_time,_value,_field,axis,unit"]
    rows = [
        f",,{table},2025-01-16T07:30:00Z,2025-01-16T07:31:00Z,2025-01-16T07:30:{k // 1000:02d}.{k % 1000:03d}Z,"
        f"{value:.6f},{name},M2,{unit}"
        for table, (name, unit, values) in enumerate((("angle", "deg", DEG), ("torque", "Nm", TORQUE)))
        for k, value in enumerate(values)
    ]
    _lines(path, above + rows, "\r\n")


def sql_historian(path: Path) -> None:
    """Rows of a query: tags in turn, with unit and quality; a value of bad quality."""
    lines = ["TimeStamp;TagName;Value;EngUnit;Quality"]
    for k, (degrees, torque) in enumerate(zip(DEG, TORQUE, strict=True)):
        stamp = f"2023-11-05 06:10:{k // 1000:02d}.{k % 1000:03d}"
        lines += [f"{stamp};M2.Angle;{degrees:.5f};deg;192", f"{stamp};M2.Torque;{torque:.5f};Nm;192"]
        lines += [f"{stamp};M2.Status;READY;;192"] if k % 500 == 0 else []
        lines += [f"{stamp};M2.Torque;99;Nm;0"] if k == 777 else []
    _lines(path, lines)


def arduino(path: Path) -> None:
    """Serial monitor with the time of the PC before each line; micros() starts again at 2^32."""
    lines = ["21:14:01.877 -> rig ready", "21:14:02.001 -> us,angle_rad,torque_Nm"]
    for k, (angle, torque) in enumerate(zip(ANGLE, TORQUE, strict=True)):
        host = f"21:14:{2 + k // 1000:02d}.{(k + k * 7 % 5) % 1000:03d}"
        lines.append(f"{host} -> {(2**32 - 1_234_567 + 1000 * k) % 2**32},{angle:.6f},{torque:.6f}")
    _lines(path, lines)


DIALECTS: dict[str, tuple[str, Callable[[Path], None]]] = {
    "TwinCAT Scope, a clock per channel": ("csv", twincat_pairs),
    "TwinCAT Scope, one clock": ("csv", twincat_one_clock),
    "TwinCAT Scope, full time stamps": ("csv", twincat_full_stamps),
    "TwinCAT Scope, points and commas": ("csv", twincat_points),
    "TwinCAT Scope, local time": ("csv", twincat_local_time),
    "TwinCAT Scope, without a header": ("txt", twincat_bare),
    "SINUMERIK Trace, XML": ("xml", sinumerik_xml),
    "SINUMERIK Trace, XML on change": ("xml", sinumerik_xml_on_change),
    "SINUMERIK Trace, CSV": ("csv", sinumerik_csv),
    "LinuxCNC halscope": ("csv", halscope),
    "LinuxCNC halsampler": ("log", halsampler),
    "EPOS Studio recorder": ("txt", epos_recorder),
    "ODrive, JSON": ("json", odrive_json),
    "ODrive, CSV": ("csv", odrive_csv),
    "moteus, JSON lines": ("jsonl", moteus_json_lines),
    "moteus, CSV": ("csv", moteus_csv),
    "EPICS camonitor": ("txt", camonitor),
    "EPICS camonitor, on change": ("log", camonitor_on_change),
    "EPICS archiver appliance": ("json", archiver),
    "InfluxDB, annotated CSV": ("csv", influx),
    "SQL historian": ("csv", sql_historian),
    "Grafana, formatted": ("csv", grafana),
    "Arduino, micros()": ("txt", arduino),
    "MR Configurator2": ("csv", mr_configurator),
    "ROS, rostopic echo -p": ("csv", rostopic),
    "ROS, PlotJuggler": ("csv", plotjuggler),
    "ROS, bagpy": ("csv", bagpy),
    "ROS, messages": ("jsonl", ros_messages),
    "ROS, ros2 topic echo --csv": ("csv", ros2_csv),
    "JSON, table": ("json", json_table),
    "JSON, records": ("json", json_records),
    "JSON, matrix": ("json", json_matrix),
    "NumPy, structured .npy": ("npy", numpy_structured),
    "NumPy, matrix .npy": ("npy", numpy_matrix),
    "NumPy, .npz": ("npz", numpy_named),
    "ASAM MDF 4": ("mf4", mdf),
    **CHANNEL_FILES,
}
