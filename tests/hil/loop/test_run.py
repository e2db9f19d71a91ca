"""Whole runs by `run_profile`: what is recorded beside the rows, what is refused, and friction found on the bench."""

from __future__ import annotations

import subprocess
import sys
import threading
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from bench_runs import MOVE, bench_with
from patient_bench import needs_every_tick, patient_bench

from hil.bench.bench_file import Bench
from hil.errors import FieldError, HilError, InputError
from hil.files.shipped import shipped_files
from hil.identification.friction import identify_friction
from hil.loop.clock import WallClock
from hil.loop.run import run_profile
from hil.loop.simulated_bench import load_simulated
from hil.motion.profile import load_profile
from hil.recording.recording import read_recording

ROOT = Path(__file__).parents[3]


def test_a_recording_says_how_it_was_made(tmp_path: Path) -> None:
    bench = bench_with()
    ran = run_profile(bench, MOVE, tmp_path, "run", virtual=True, seed=42)
    assert ran.complete
    metadata = read_recording(ran.recording).metadata
    assert metadata["seed"] == 42
    assert Bench.model_validate(metadata["bench"]) == bench
    assert type(MOVE).model_validate(metadata["profile"]) == MOVE
    assert [segment["kind"] for segment in metadata["segments"]] == ["dwell", "sine_squared", "dwell"]
    assert metadata["ended"] == "complete: the profile is done"
    assert metadata["start_time"] == "virtual time"
    assert {"python", "numpy", "canopen", "hil-servo"} <= set(metadata["versions"])


def test_a_second_run_into_a_folder_says_its_name(tmp_path: Path) -> None:
    first = run_profile(bench_with(), MOVE, tmp_path, "run", virtual=True)
    second = run_profile(bench_with(), MOVE, tmp_path, "run", virtual=True)
    assert not first.notes
    assert second.recording == tmp_path / "run_2.parquet"
    assert any("stays; this run is run_2.parquet" in note for note in second.notes)


def test_wall_clock_gives_the_same_motion_and_a_jitter_certificate(tmp_path: Path) -> None:
    wall = run_profile(patient_bench(), MOVE, tmp_path, "wall", force=True)
    virtual = run_profile(patient_bench(), MOVE, tmp_path, "virtual", virtual=True)
    assert wall.complete
    needs_every_tick(wall)
    recording, other = read_recording(wall.recording), read_recording(virtual.recording)
    for channel in set(recording.columns) - {"lateness_s", "cycle_s"}:
        assert np.array_equal(recording[channel], other[channel]), channel
    conditions = recording.metadata["real_time"]
    assert conditions["jitter_before_arming"]["ticks"] > 0
    assert "machine" in conditions
    assert (recording["cycle_s"] > 0.0).all()


@pytest.mark.parametrize("drive", [{}, {"interface": "virtual", "channel": "threads"}])
def test_the_loop_has_the_only_thread_of_its_process(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, drive: dict[str, Any]
) -> None:
    """Bus, devices, recorder and command line start no Python thread that could take the interpreter from the loop."""
    seen, wait = set[int](), WallClock.wait

    def counted(self: WallClock, tick: int) -> float:
        seen.add(threading.active_count())
        return wait(self, tick)

    before = threading.active_count()  # those of the test runner
    monkeypatch.setattr(WallClock, "wait", counted)
    run_profile(patient_bench(**drive), MOVE, tmp_path, "run", force=True)
    assert seen == {before}


@pytest.mark.parametrize("interface", ["virtual", "udp_multicast"])
def test_python_can_buses_carry_the_same_run(tmp_path: Path, interface: str) -> None:
    channel = "239.74.163.78" if interface == "udp_multicast" else "test_run"
    virtual_ok = interface == "virtual"  # udp takes real time to arrive
    bench = patient_bench(interface=interface, channel=channel)
    ran = run_profile(bench, MOVE, tmp_path, "bus", virtual=virtual_ok, force=True)
    if not virtual_ok and not ran.complete:
        pytest.skip(f"this machine stood still or has no multicast: {ran.outcome.reason}")
    needs_every_tick(ran)
    recording = read_recording(ran.recording)
    assert abs(recording["table_position_m"][-1] - 0.05) < 20e-6
    if virtual_ok:
        other = read_recording(run_profile(patient_bench(), MOVE, tmp_path, "inside", virtual=True).recording)
        for name in recording.columns:
            assert np.array_equal(recording[name], other[name]), name


@pytest.mark.parametrize("name", ["reference", "reference_7dof"])
def test_friction_found_on_the_bench_is_that_of_the_axis(tmp_path: Path, name: str) -> None:
    true = {"coulomb_torque_n_m": 1.25, "viscous_torque_n_m_s_rad": 0.0071}  # the owner believes 1.1 and 0.0064
    bench = load_simulated(name)
    bench = bench.model_copy(update={"simulation": bench.simulation.model_copy(update={"axis": true})})
    ran = run_profile(bench, load_profile(ROOT / "profiles/friction_sweep.yaml"), tmp_path, "sweep", virtual=True)
    result = identify_friction(read_recording(ran.recording))
    assert result.coulomb == pytest.approx(1.25, rel=0.02)
    assert result.viscous == pytest.approx(0.0071, rel=0.02)


@pytest.mark.parametrize(
    "name", sorted(name for name, path in shipped_files("bench").items() if "simulation:" in path.read_text())
)
def test_shipped_benches_run(tmp_path: Path, name: str) -> None:
    assert run_profile(load_simulated(name), MOVE, tmp_path, "run", virtual=True).complete


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"drive": {"travel_m": (-0.01, 0.04)}}, r"set-points from 0 to 0.05 m, allowed -0.01 to 0.04 m"),
        (
            {"drive": {"limits": {"velocity_m_s": 0.09, "acceleration_m_s2": 3.0, "jerk_m_s3": 200.0}}},
            r"limits.velocity_m_s: given set-points up to 0.1, allowed 0.09 \(drive.limits.velocity_m_s of the bench\)",
        ),
        ({"encoders": {"motor": {"counts_per_rev": 4096, "direction": -1}}}, r"0x607E"),
        ({"drive": {"mode": "csp"}, "control": {"position_feedback": "table"}}, r"csp with position_feedback: table"),
        ({"control": {"velocity_setpoint": "backward_difference"}}, r"velocity_setpoint.*allowed for recordings alone"),
        ({"control": {"setpoint_delay_s": 0.004}}, r"setpoint_delay_s.*given 0.004, allowed 0 for a run"),
    ],
)
def test_what_cannot_be_run_is_refused_and_leaves_nothing(tmp_path: Path, changes: Any, message: str) -> None:
    with pytest.raises(FieldError, match=message):
        run_profile(bench_with(**changes), MOVE, tmp_path / "out", "run", virtual=True)
    assert not (tmp_path / "out").exists()


def test_real_bench_is_never_run_in_virtual_time(tmp_path: Path) -> None:
    data = bench_with().model_dump() | {"simulation": None}
    data["drive"] |= {"interface": "socketcan", "channel": "absent0"}  # nothing that could be opened
    with pytest.raises(FieldError, match="real bench in virtual time"):
        run_profile(Bench.model_validate(data), MOVE, tmp_path, "run", virtual=True)


def test_a_drive_that_does_not_answer(tmp_path: Path) -> None:
    data = bench_with().model_dump() | {"simulation": None}
    data["drive"] |= {"interface": "virtual", "channel": "no_device"}
    with pytest.raises(HilError, match="no SDO answer"):
        run_profile(Bench.model_validate(data), MOVE, tmp_path, "run")


@pytest.mark.parametrize(
    ("lines", "field"),
    [
        ("simulation:\n  effects:\n  - {effect: backlsh, parameters: {}}", r"simulation.effects\[0\].*backlsh"),
        (
            "simulation:\n  effects:\n  - {effect: backlash, parameters: {gap: 1.0e-5}}",
            r"simulation.effects\[0\].*gap_m",
        ),
        ("simulation:\n  axis: {motor_mass_kg: -3.0}", r"simulation.axis.motor_mass_kg.*greater than 0"),
        ("simulation:\n  sensors: {table_noise: 1.0}", r"simulation.sensors.*table_noise"),
        (
            "simulation: {}\ndrive: {travel_m: [0.3, 0.1]}",
            r"drive.travel_m: given \[0.3, 0.1\], allowed \[lower, upper\]",
        ),
        ("simulation: {}\ndrive: {node_id: 6}", r"drive.node_id: .*different ones"),
    ],
)
def test_a_wrong_bench_is_refused_with_file_and_line(tmp_path: Path, lines: str, field: str) -> None:
    text = shipped_files("bench")["reference"].read_text().split("drive:")[0]
    path = tmp_path / "bench.yaml"
    path.write_text(text + lines + "\n")
    with pytest.raises(InputError, match=rf"bench\.yaml:\d+: {field}"):
        load_simulated(path)


def test_command_line(tmp_path: Path) -> None:
    hil = [sys.executable, "-m", "hil.cli"]
    done = subprocess.run(
        [*hil, "run", str(ROOT / "profiles/reference_100mm_7.yaml"), "--virtual", "--out", str(tmp_path / "out")],
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    assert str(tmp_path / "out/reference_100mm_7.parquet") in done.stdout
    believed = tmp_path / "believed.yaml"
    believed.write_text(shipped_files("bench")["reference"].read_text().split("drive:")[0])
    stopped = subprocess.run(
        [*hil, "run", str(ROOT / "profiles/reference.yaml"), "--bench", str(believed), "--virtual"],
        capture_output=True,
        text=True,
        cwd=tmp_path,
        check=False,
    )
    assert stopped.returncode == 2
    assert "drive: given nothing" in stopped.stderr
    assert "Traceback" not in stopped.stderr
