"""Tables for other controllers: read back here by the rules of each controller, and applied to an axis with errors."""

from __future__ import annotations

import csv
import io
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from command_line import hil as command
from compensated_benches import there_and_back

import hil
from hil.bench.bench_file import Bench, load_bench
from hil.compensating.compensate import plan_compensation
from hil.compensating.controllers.cia402 import for_cia402
from hil.compensating.controllers.controller_task import ControllerTask
from hil.compensating.controllers.linuxcnc import for_linuxcnc
from hil.compensating.controllers.plain_csv import for_csv
from hil.compensating.controllers.sinumerik import for_sinumerik
from hil.compensating.controllers.twincat import for_twincat
from hil.control.compensation_tables import Adds, Compensation, CompensationLimits, CompensationTable, Over
from hil.errors import HilError
from hil.manual.keys import EXAMPLES
from hil.report.compare_report import write_bench

LEAD_M, AMPLITUDE_M, PHASE, SLOPE, GAP_M = 0.010, 8e-6, 0.5, 40e-6, 12e-6
COULOMB, KP, TI, RATED = 1.1, 0.267, 0.0062, 4.0
LOW_M, HIGH_M = -0.02, 0.15
LIMITS = CompensationLimits(10.0, 1e9, 1.0, 1e9, 0.0, 0.001)
PLACES_M = np.linspace(LOW_M, HIGH_M, 5003)
ANGLES = np.arange(256) * 2.0 * np.pi / 256


def axis_error(place_m: np.ndarray, way: int) -> np.ndarray:
    """Motor position less table position [m]: lead error of a turn, 40 um/m of stretch, and play."""
    turn = AMPLITUDE_M * np.sin(2.0 * np.pi * place_m / LEAD_M + PHASE)
    return np.asarray(turn + SLOPE * place_m + 0.5 * way * GAP_M)


def task_of(*tables: CompensationTable, **changes: object) -> ControllerTask:
    bench = load_bench("reference")
    gains = bench.gains._replace(velocity_gain_n_m_s_rad=KP, integral_gain_n_m_rad=KP / TI)
    compensation = Compensation(tables, LIMITS, 2.0 * np.pi / LEAD_M)
    motion = there_and_back(bench, 0.02, 0.1)
    return replace(
        ControllerTask("x", compensation, gains, motion, LOW_M, HIGH_M, rated_torque=RATED),
        **changes,  # type: ignore[arg-type]
    )


def table(adds: Adds, over: Over, at: np.ndarray, forward: np.ndarray, backward: np.ndarray) -> CompensationTable:
    return CompensationTable(f"{adds.name} over {over.name}".lower(), adds, over, at, forward, backward)


TURN = AMPLITUDE_M * np.sin(ANGLES + PHASE)
ENDS = np.array([LOW_M, HIGH_M])
LEAD_TABLE = table(Adds.POSITION, Over.ANGLE, ANGLES, TURN, TURN)
PLAY_TABLE = table(Adds.POSITION, Over.POSITION, ENDS, SLOPE * ENDS + 0.5 * GAP_M, SLOPE * ENDS - 0.5 * GAP_M)
SPEEDS = np.array([-0.5, -0.001, 0.001, 0.5])
FRICTION = np.array([-3.0, -COULOMB, COULOMB, 3.0])
FRICTION_TABLE = table(Adds.TORQUE, Over.VELOCITY, SPEEDS, FRICTION, FRICTION)
COGGING_TABLE = table(Adds.TORQUE, Over.ANGLE, ANGLES, 0.1 * np.cos(6 * ANGLES), 0.1 * np.cos(6 * ANGLES))


def error_left(motor_m: dict[int, np.ndarray]) -> float:
    """Largest less smallest positioning error over both directions [m], where the motor goes to these places."""
    table_m = {}
    for way, motor in motor_m.items():
        place = PLACES_M.copy()
        for _ in range(3):  # x + e(x) = motor
            place = motor - axis_error(place, way)
        table_m[way] = place - PLACES_M
    return float(np.ptp(np.concatenate(list(table_m.values()))))


BEFORE_M = error_left({1: PLACES_M, -1: PLACES_M})


def linuxcnc_motor(text: str, kind: int) -> dict[int, np.ndarray]:
    """Of usrmotLoadComp and compute_screw_comp: motor position command in m for the places."""
    nominal, trims = list[float](), list[tuple[float, float]]()
    for line in text.splitlines():
        numbers = line.split()
        if len(numbers) < 3:
            break
        at, forward, backward = (float(one) for one in numbers[:3])
        assert not nominal or at > nominal[-1]
        assert len(nominal) < 256
        nominal.append(at)
        trims.append((forward, backward) if kind else (at - forward, at - backward))
    columns = {1: [one[0] for one in trims], -1: [one[1] for one in trims]}
    return {way: PLACES_M + 1e-3 * np.interp(1e3 * PLACES_M, nominal, column) for way, column in columns.items()}


def test_linuxcnc_reads_its_file_and_the_error_is_gone() -> None:
    files = for_linuxcnc(task_of(LEAD_TABLE, PLAY_TABLE, COGGING_TABLE))
    ini = dict(re.findall(r"^(\w+) = (\S+)$", files.texts["linuxcnc.ini"], re.MULTILINE))
    assert ini == {"COMP_FILE": "x.linuxcnc.comp", "COMP_FILE_TYPE": "1"}
    motor = linuxcnc_motor(files.texts["linuxcnc.comp"], int(ini["COMP_FILE_TYPE"]))
    assert BEFORE_M > 30e-6
    assert error_left(motor) < 0.05 * BEFORE_M
    wrong_way = {way: 2.0 * PLACES_M - one for way, one in motor.items()}
    assert error_left(wrong_way) > 1.9 * BEFORE_M
    assert [one.table for one in files.not_taken] == ["torque over angle"]
    assert "no torque output" in files.not_taken[0].reason


def test_type_0_would_have_the_measured_positions() -> None:
    """The same trims as nominal less position: what the documentation calls the default."""
    text = for_linuxcnc(task_of(LEAD_TABLE, PLAY_TABLE)).texts["linuxcnc.comp"]
    as_type_0 = [
        f"{at} {at - forward:.7f} {at - backward:.7f}"
        for at, forward, backward in (map(float, line.split()) for line in text.splitlines())
    ]
    for way, motor in linuxcnc_motor("\n".join(as_type_0), 0).items():
        np.testing.assert_allclose(motor, linuxcnc_motor(text, 1)[way], atol=2e-10)


def test_where_only_the_direction_counts_linuxcnc_gets_its_backlash() -> None:
    play = np.full(2, 0.5 * GAP_M)
    files = for_linuxcnc(task_of(table(Adds.POSITION, Over.POSITION, ENDS, play, -play)))
    assert set(files.texts) == {"linuxcnc.ini"}
    (backlash,) = re.findall(r"^BACKLASH = (\S+)$", files.texts["linuxcnc.ini"], re.MULTILINE)
    half_mm = 0.5 * float(backlash)  # control.c: +- half of it
    left = {way: axis_error(PLACES_M, way) - way * 1e-3 * half_mm for way in (1, -1)}
    np.testing.assert_allclose(left[1], left[-1], atol=1e-12)


def sinumerik_motor(text: str) -> dict[int, np.ndarray]:
    """K3: actual value = encoder + table value, which becomes the set-point; after a reversal less the backlash."""
    found = dict(re.findall(r"^\$(\S+\[.*\])=(\S+)", text, re.MULTILINE))
    points = {int(n): float(v) for n, v in re.findall(r"^\$AA_ENC_COMP\[0,(\d+),AX1\]=(\S+)$", text, re.MULTILINE)}
    assert list(points) == list(range(len(points)))
    low, high, step = (float(found[f"AA_ENC_COMP_{name}[0,AX1]"]) for name in ("MIN", "MAX", "STEP"))
    assert (high - low) / step == pytest.approx(len(points) - 1, abs=1e-9)
    assert found["AA_ENC_COMP_IS_MODULO[0,AX1]"] == "0"
    value_mm = np.interp(1e3 * PLACES_M, low + step * np.arange(len(points)), list(points.values()))
    backlash_mm = float(found.get("MA_BACKLASH[0,AX1]", 0.0))
    return {way: PLACES_M - 1e-3 * (value_mm + backlash_mm * (way < 0)) for way in (1, -1)}


def test_sinumerik_reads_its_file_and_the_error_is_gone() -> None:
    files = for_sinumerik(task_of(LEAD_TABLE, PLAY_TABLE, COGGING_TABLE))
    text = files.texts["sinumerik.ini"]
    assert error_left(sinumerik_motor(text)) < 0.05 * BEFORE_M
    assert text.startswith(";")
    assert text.endswith("M17\n")
    assert float(re.findall(r"^\$MA_BACKLASH\[0,AX1\]=(\S+)$", text, re.MULTILINE)[0]) == pytest.approx(0.012)
    assert [one.table for one in files.not_taken] == ["torque over angle"]


def test_sinumerik_compensates_friction_by_a_pulse_that_its_velocity_loop_turns_into_twice_coulomb() -> None:
    text = for_sinumerik(task_of(FRICTION_TABLE)).texts["sinumerik.ini"]
    (pulse_mm_min,) = re.findall(r"CONST_MAX\[0,AX1\]=(\S+)", text)
    (time_s,) = re.findall(r"FRICT_COMP_TIME\[0,AX1\]=(\S+)", text)
    step_s = 1e-5
    speed = float(pulse_mm_min) / 60e3 * 2.0 * np.pi / LEAD_M * np.exp(-np.arange(5000) * step_s / float(time_s))
    torque = KP * (speed + np.cumsum(speed) * step_s / TI)
    np.testing.assert_allclose(torque, 2.0 * COULOMB, rtol=2e-3)


def test_without_an_integral_part_there_is_no_pulse() -> None:
    task = task_of(FRICTION_TABLE)
    files = for_sinumerik(replace(task, gains=task.gains._replace(integral_gain_n_m_rad=0.0)))
    assert not files.texts
    assert "integral" in files.not_taken[0].reason


def test_twincat_reads_its_tables_and_the_error_is_gone() -> None:
    files = for_twincat(task_of(LEAD_TABLE, PLAY_TABLE, FRICTION_TABLE))
    motor = {}
    for way, name in ((1, "positive"), (-1, "negative")):
        rows = list(csv.DictReader(io.StringIO(files.texts[f"twincat-{name}.csv"]), delimiter=";"))
        at, value = (np.array([float(row[key]) for row in rows]) for key in ("Position", "Compensation"))
        assert np.ptp(np.diff(at)) < 1e-6  # equidistant
        motor[way] = PLACES_M - 1e-3 * np.interp(1e3 * PLACES_M, at, value)  # subtracted from the set value
    assert error_left(motor) < 0.05 * BEFORE_M
    entries = dict(line.split() for line in files.texts["twincat-cnc.lis"].splitlines() if " " in line)
    count = int(entries["kw.ssfk.kw_nr_max"])
    columns = {
        name: np.array([int(entries[f"kw.ssfk.table[{n}].{name}"]) for n in range(count)]) * 1e-7
        for name in ("setpoint", "pos", "neg")
    }
    of_list = {
        way: PLACES_M - np.interp(PLACES_M, columns["setpoint"], columns[name])
        for way, name in ((1, "pos"), (-1, "neg"))
    }
    assert entries["kw.ssfk.bilateral"] == "1"
    assert error_left(of_list) < 0.06 * BEFORE_M
    assert [one.table for one in files.not_taken] == ["torque over velocity"]
    assert set(for_twincat(task_of(LEAD_TABLE)).texts) == {"twincat-both.csv", "twincat-cnc.lis"}


def test_a_load_that_turns_is_in_degrees() -> None:
    sag = table(Adds.POSITION, Over.POSITION, np.array([0.0, np.pi]), np.array([0.0, 1e-3]), np.array([0.0, 2e-3]))
    task = task_of(sag, low_m=0.0, high_m=np.pi, turns=True)
    last = [float(one) for one in for_linuxcnc(task).texts["linuxcnc.comp"].splitlines()[-1].split()]
    assert last == pytest.approx([180.0, np.degrees(1e-3), np.degrees(2e-3)], rel=1e-5)
    assert "$AA_ENC_COMP_MAX[0,AX1]=180.0000" in for_sinumerik(task).texts["sinumerik.ini"]
    assert ",rad,position,rad," in for_csv(task).texts["csv"]


def test_a_table_that_is_too_fine_is_not_written() -> None:
    task = replace(task_of(LEAD_TABLE), high_m=LOW_M + 5.0)  # 500 turns on 256 points
    files = for_linuxcnc(task)
    assert not files.texts
    assert "too fast along the travel for its 256 points" in files.not_taken[0].reason
    assert for_sinumerik(replace(task, high_m=LOW_M + 1.0)).texts  # 10 points a turn


def test_the_stream_of_cia_402_is_what_the_loop_adds() -> None:
    section = load_bench(EXAMPLES / "bench-compensated.yaml").model_dump(mode="json")["compensation"]
    bench = Bench.model_validate(load_bench("reference").model_dump(mode="json") | {"compensation": section})
    motion = there_and_back(bench, 0.05, 0.2)
    run = hil.simulate(bench, motion, seed=1)
    task = ControllerTask("x", bench.tables(), bench.gains, motion, 0.0, 0.1, rated_torque=RATED)
    rows = list(csv.DictReader(io.StringIO(for_cia402(task).texts["cia402.csv"])))
    offset = np.array([int(row["object_60B2_per_mille"]) for row in rows])
    assert np.abs(offset).max() > 100
    assert np.abs(offset / 1000.0 * RATED - run["compensation_torque_n_m"]).max() <= 0.5e-3 * RATED * (1 + 1e-9)
    added = np.array([float(row["position_correction_m"]) for row in rows])
    np.testing.assert_allclose(added, run["compensation_position_m"], rtol=1e-5, atol=1e-15)
    with pytest.raises(HilError, match="rated_torque_n_m"):
        for_cia402(replace(task, rated_torque=None))
    with pytest.raises(HilError, match="allowed up to"):
        for_cia402(replace(task, rated_torque=1e-4))


def test_the_table_of_linuxcnc_moves_a_simulated_axis_to_its_targets() -> None:
    """The other equations of the simulated axis, with the file applied to its set-points as LinuxCNC does."""
    bench = load_bench("reference").model_dump(mode="json")
    lead = {"effect": "periodic_lead_error", "parameters": {"amplitude_m": AMPLITUDE_M, "phase_rad": PHASE}}
    plain = Bench.model_validate(bench | {"simulation": {"effects": [lead]}})
    diagnosed = Bench.model_validate(bench | {"mechanisms": [lead]})
    motion = there_and_back(plain, 0.027, 0.01)
    made = plan_compensation(diagnosed, motion, None, 0.2).compensation
    task = ControllerTask("x", made, plain.gains, motion, 0.0, 0.03)
    nominal, forward, _ = np.loadtxt(io.StringIO(for_linuxcnc(task).texts["linuxcnc.comp"]), unpack=True)
    moved = motion.position_m + 1e-3 * np.interp(1e3 * motion.position_m, nominal, forward)
    corrected = replace(motion, position_m=moved)
    sliding = np.abs(motion.velocity_m_s) > 0.0099  # beside the reversals, at which friction moves the table
    turn = 2.0 * np.pi * motion.position_m / LEAD_M
    shapes = np.column_stack([np.sin(turn), np.cos(turn), np.ones_like(turn), np.sign(motion.velocity_m_s)])[sliding]
    left = []
    for one in (motion, corrected):
        error = hil.simulate(plain, one, seed=6)["table_position_m"] - motion.position_m
        (sin, cos, *_), *_ = np.linalg.lstsq(shapes, error[sliding])
        left.append(np.hypot(sin, cos))
    assert left[0] == pytest.approx(AMPLITUDE_M, rel=0.1)
    assert left[1] < 0.2 * left[0]


def test_the_plain_file_has_every_knot_with_its_unit() -> None:
    tables = (LEAD_TABLE, PLAY_TABLE, FRICTION_TABLE)
    rows = list(csv.DictReader(io.StringIO(for_csv(task_of(*tables)).texts["csv"])))
    for one in tables:
        mine = [row for row in rows if row["table"] == one.name]
        for name, values in (("knot", one.at), ("forward", one.forward), ("backward", one.backward)):
            np.testing.assert_allclose([float(row[name]) for row in mine], values, rtol=1e-8, atol=1e-20)
    units = {(row["table"], row["value_unit"], row["knot_unit"]) for row in rows}
    assert ("torque over velocity", "N m", "m/s") in units
    assert ("position over angle", "m", "rad") in units


def test_the_command_writes_them_beside_the_bench(tmp_path: Path) -> None:
    bench = load_bench("reference").model_dump(mode="json")
    lead = {"effect": "periodic_lead_error", "parameters": {"amplitude_m": 8e-6, "phase_rad": 0.5}}
    write_bench(Bench.model_validate(bench | {"mechanisms": [lead]}), tmp_path / "found.diagnosed.yaml")
    (tmp_path / "move.yaml").write_text(
        "schema_version: 1\nlimits: {velocity_m_s: 0.6, acceleration_m_s2: 2.5, jerk_m_s3: 120}\n"
        "segments:\n- {kind: dwell, duration_s: 0.5}\n- {kind: sine_squared, to_m: 0.05, feed_m_s: 0.1}\n"
    )
    arguments = ("compensate", "found.diagnosed.yaml", "--profile", "move.yaml", "--fade-in", "0.2")
    ran = command(tmp_path, *arguments, "--for", "linuxcnc", "--for", "csv")
    assert ran.returncode == 0, ran.stderr
    assert {path.name for path in tmp_path.glob("found.compensated*")} == {
        "found.compensated.yaml",
        "found.compensated.csv",
        "found.compensated.linuxcnc.comp",
        "found.compensated.linuxcnc.ini",
    }
    assert "Not for linuxcnc: inertia" in ran.stdout
