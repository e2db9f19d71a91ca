"""hil doctor: what it finds in /proc and /sys of machines of several kinds, and its exit code."""

from __future__ import annotations

import json
import os
import resource
from pathlib import Path
from typing import Any

import pytest
from command_line import hil

from hil.commands import doctor as command
from hil.loop.can_interfaces import can_findings
from hil.loop.machine import Level, Machine, MachineFinding, grant_findings, limits_now
from hil.loop.realtime import Grant

TUNED = {
    "proc/sys/kernel/version": "#1 SMP PREEMPT_RT Debian 6.1.0-9",
    "proc/sys/kernel/osrelease": "6.1.0-9-rt-amd64",
    "proc/cpuinfo": "flags\t\t: fpu tsc",
    "proc/interrupts": "     CPU0 CPU1 CPU2 CPU3\n 16: 9 0 0 0 IO-APIC can0\n 17: 5 0 0 7 nvme\nLOC: 1 2 3 4 Local",
    "proc/irq/16/smp_affinity_list": "0-3",
    "proc/irq/17/smp_affinity_list": "0-2",
    "proc/sys/kernel/sched_rt_runtime_us": "950000",
    "proc/sys/kernel/sched_rt_period_us": "1000000",
    "sys/devices/system/cpu/online": "0-3",
    "sys/devices/system/cpu/isolated": "3",
    "sys/devices/system/cpu/cpu0/cpufreq/scaling_governor": "performance",
    "sys/devices/system/cpu/cpu3/cpufreq/scaling_governor": "performance",
    "sys/devices/system/cpu/cpu3/topology/thread_siblings_list": "3",
    "sys/devices/system/clocksource/clocksource0/current_clocksource": "tsc",
}
# The state of one setting of another machine, what is found, and words of the command that changes it.
CASES = {
    "stock kernel": ({"proc/sys/kernel/version": "#1 SMP PREEMPT_DYNAMIC"}, "kernel", "advice", "linux-image-rt"),
    "guest": ({"proc/cpuinfo": "flags\t\t: fpu hypervisor"}, "machine", "advice", "real PC"),
    "powersave": (
        {"sys/devices/system/cpu/cpu3/cpufreq/scaling_governor": "powersave"}, "CPU governor", "advice", "performance"),
    "hpet": (
        {"sys/devices/system/clocksource/clocksource0/current_clocksource": "hpet"}, "clock source", "advice", "tsc"),
    "not isolated": (
        {"sys/devices/system/cpu/isolated": ""}, "isolated cores", "advice", "isolcpus=domain,managed_irq,3"),
    "interrupt": ({"proc/irq/17/smp_affinity_list": "0-3"}, "interrupts", "advice", "for irq in 17; do echo 0,1,2"),
    "sibling": (
        {"sys/devices/system/cpu/cpu3/topology/thread_siblings_list": "1,3"}, "hyper-threading", "advice",
        "cpu1/online"),
    "never throttled": ({"proc/sys/kernel/sched_rt_runtime_us": "-1"}, "RT throttling", "advice", "=950000"),
    "throttled": ({"proc/sys/kernel/sched_rt_runtime_us": "100000"}, "RT throttling", "change", "=950000"),
}  # fmt: skip


def machine(root: Path, changes: dict[str, str] | None = None) -> Machine:
    """Write /proc and /sys of a machine whose loop runs on core 3."""
    for name, text in (TUNED | (changes or {})).items():
        path = root / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text + "\n")
    return Machine(root, core=3)


def test_a_tuned_machine_is_fine(tmp_path: Path) -> None:
    found = machine(tmp_path).findings()
    assert {finding.level for finding in found} == {Level.FINE}
    assert {finding.command for finding in found} == {""}
    assert {"kernel", "CPU governor", "isolated cores", "interrupts", "RT throttling"} <= {one.subject for one in found}


@pytest.mark.parametrize("case", CASES)
def test_each_setting_is_found_alone(tmp_path: Path, case: str) -> None:
    changes, subject, level, words = CASES[case]
    other = [finding for finding in machine(tmp_path, changes).findings() if finding.level is not Level.FINE]
    assert [(one.subject, one.level) for one in other] == [(subject, level)]
    assert words in other[0].command
    assert other[0].why


MORE = {
    "real-time kernel of another name": (
        {"proc/sys/kernel/version": "#1 SMP", "sys/kernel/realtime": "1"}, "kernel", "fine", "PREEMPT_RT"),
    "no real-time kernel": (
        {"proc/sys/kernel/version": "#1 SMP", "sys/kernel/realtime": "0"}, "kernel", "advice",
        "6.1.0-9-rt-amd64 without PREEMPT_RT"),
    "one core": (
        {"sys/devices/system/cpu/online": "3", "sys/devices/system/cpu/isolated": ""}, "isolated cores", "advice",
        "only one core"),
    "two cores": (
        {"sys/devices/system/cpu/online": "2-3", "sys/devices/system/cpu/isolated": ""}, "isolated cores", "advice",
        "none"),
    "interrupts of two cores": (
        {"sys/devices/system/cpu/online": "2-3"}, "interrupts", "fine", "none of a device on core 3"),
    "isolated": ({}, "isolated cores", "fine", "3; the loop takes 3"),
    "siblings": (
        {"sys/devices/system/cpu/cpu3/topology/thread_siblings_list": "1-3,9"}, "hyper-threading", "advice",
        "core 3 shares its units with 1,2"),  # the ninth is off
    "two governors": (
        {"sys/devices/system/cpu/cpu0/cpufreq/scaling_governor": "schedutil",
         "sys/devices/system/cpu/cpu3/cpufreq/scaling_governor": "performance"}, "CPU governor", "advice",
        "performance, schedutil"),
    "throttled just enough": (
        {"proc/sys/kernel/sched_rt_runtime_us": "400000"}, "RT throttling", "fine", "400000 of 1000000 us"),
    "throttled a little too much": (
        {"proc/sys/kernel/sched_rt_runtime_us": "399999"}, "RT throttling", "change",
        "399999 of 1000000 us; at 2000 Hz the loop waits actively for 20 %"),
    "never scheduled": (
        {"proc/sys/kernel/sched_rt_runtime_us": "0"}, "RT throttling", "change",
        "0 of 1000000 us; at 2000 Hz the loop waits actively for 20 %"),
    "two interrupts": (
        {"proc/interrupts": " CPU0 CPU3\n 16: 9 4 can0\n 17: 5 7 nvme\n 18: 1 0 x\n 19: 2", **{
            f"proc/irq/{irq}/smp_affinity_list": "0-3" for irq in (16, 17, 18)}}, "interrupts", "advice",
        "2 of devices reach core 3: 16, 17"),
}  # fmt: skip


@pytest.mark.parametrize("case", MORE)
def test_states_in_words(tmp_path: Path, case: str) -> None:
    changes, subject, level, state = MORE[case]
    found = [one for one in machine(tmp_path, changes).findings() if one.subject == subject]
    assert [(one.level, one.state) for one in found] == [(level, state)]


def test_the_limits_of_this_process_in_words(monkeypatch: pytest.MonkeyPatch) -> None:
    limits = {resource.RLIMIT_RTPRIO: (80, 99), resource.RLIMIT_MEMLOCK: (resource.RLIM_INFINITY, -1)}
    monkeypatch.setattr(resource, "getrlimit", limits.__getitem__)
    for uid, user in ((0, "root"), (1000, "user 1000")):
        monkeypatch.setattr(os, "geteuid", lambda uid=uid: uid)
        assert limits_now() == f"rtprio 80, memlock unlimited bytes, {user}"


def test_a_machine_that_tells_nothing_is_no_error(tmp_path: Path) -> None:
    found = Machine(tmp_path, core=0).findings()
    assert {finding.level for finding in found} <= {Level.FINE, Level.ADVICE}


def test_a_refused_grant_names_the_command() -> None:
    found = list(grant_findings((Grant("SCHED_FIFO 80", "Operation not permitted"), Grant("memory locked"))))
    assert [one.level for one in found] == [Level.CHANGE, Level.FINE]
    assert "rtprio 80" in found[0].command


def interface(root: Path, queue: int, up: bool = True, device: bool = True) -> None:
    folder = root / "sys/class/net/can0"
    (folder / "device").mkdir(parents=True) if device else folder.mkdir(parents=True)
    for name, text in {"type": "280", "flags": "0x40081" if up else "0x40080", "tx_queue_len": str(queue)}.items():
        (folder / name).write_text(text + "\n")
    other = root / "sys/class/net/eth0"
    other.mkdir()
    (other / "type").write_text("1\n")


def said(state: str = "ERROR-ACTIVE", restart_ms: int = 100) -> dict[str, Any]:
    """What `ip -details -json link show can0` tells of a controller."""
    data = {"state": state, "restart_ms": restart_ms, "bittiming": {"bitrate": 1000000}}
    return {"can0": {"ifname": "can0", "linkinfo": {"info_kind": "can", "info_data": data}}}


def not_fine(found: list[MachineFinding]) -> list[tuple[str, str]]:
    return [(one.subject, one.level) for one in found if one.level is not Level.FINE]


@pytest.mark.parametrize(
    ("queue", "up", "details", "expected"),
    [
        (10, True, said(), []),
        (10, False, said(), [("CAN can0", "change")]),
        (10, True, said("BUS-OFF"), [("CAN can0", "change")]),
        (10, True, said(restart_ms=0), [("CAN can0 restart-ms", "change")]),
        *((queue, True, said(), [("CAN can0 txqueuelen", "advice")]) for queue in (0, 7, 33, 1000)),
        *((queue, True, said(), []) for queue in (8, 32)),
        (10, True, {}, [("CAN can0", "advice")]),  # without iproute2
    ],
)
def test_can_interfaces(
    tmp_path: Path, queue: int, up: bool, details: dict[str, Any], expected: list[tuple[str, str]]
) -> None:
    interface(tmp_path, queue, up)
    found = list(can_findings(tmp_path, details))
    assert not_fine(found) == expected
    assert all(one.command for one in found if one.level is not Level.FINE)


@pytest.mark.parametrize(("queue", "why"), [
    (7, "too short: a cycle's frames are refused (ENOBUFS)"), (8, "8 frames take 1 ms"), (200, "200 frames take 26 ms"),
])  # fmt: skip
def test_what_a_queue_of_frames_means(tmp_path: Path, queue: int, why: str) -> None:
    interface(tmp_path, queue)
    found = list(can_findings(tmp_path, said()))
    assert [(one.subject, one.state) for one in found] == [
        ("CAN can0", "up, 1000000 bit/s, ERROR-ACTIVE"), ("CAN can0 restart-ms", "100"),
        ("CAN can0 txqueuelen", str(queue)),
    ]  # fmt: skip
    assert why in found[-1].why


@pytest.mark.parametrize(("up", "details", "command"), [
    (False, said(), "sudo ip link set can0 up type can bitrate 1000000 restart-ms 100  # lasting: hil install-service"),
    (True, said(restart_ms=0), "sudo ip link set can0 down && sudo ip link set can0 type can restart-ms 100 && "
                               "sudo ip link set can0 up"),
    (True, said("BUS-OFF"), "measure 60 ohm between CAN_H and CAN_L; ip -details -statistics link show can0"),
])  # fmt: skip
def test_commands_for_an_interface(tmp_path: Path, up: bool, details: dict[str, Any], command: str) -> None:
    interface(tmp_path, 10, up)
    assert [one.command for one in can_findings(tmp_path, details) if one.command] == [command]


def test_a_machine_without_can_needs_none(tmp_path: Path) -> None:
    interface(tmp_path, 10)
    (tmp_path / "sys/class/net/can0/type").write_text("1\n")
    assert [(one.level, one.state) for one in can_findings(tmp_path)] == [(Level.FINE, "no interface")]


@pytest.mark.parametrize(("text", "found"), [
    (json.dumps([said("BUS-OFF")["can0"]]), [("CAN can0", "change")]),
    *((text, [("CAN can0", "advice")]) for text in ("no JSON", "[]")),
])  # fmt: skip
def test_ip_is_asked_for_what_stands_in_netlink(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, text: str, found: list[tuple[str, str]]
) -> None:
    interface(tmp_path, 10)
    program = tmp_path / "bin/ip"
    program.parent.mkdir()
    program.write_text(f"#!/bin/sh\n[ \"$*\" = '-details -json link show dev can0' ] && echo '{text}'\n")
    program.chmod(0o755)
    monkeypatch.setenv("PATH", f"{program.parent}:/bin:/usr/bin")
    assert not_fine(list(can_findings(tmp_path))) == found


def test_a_virtual_can_interface_has_no_bit_rate_to_complain_of(tmp_path: Path) -> None:
    interface(tmp_path, 1000, device=False)
    details = {"can0": {"linkinfo": {"info_kind": "vcan"}}}
    assert not_fine(list(can_findings(tmp_path, details))) == []


@pytest.mark.parametrize(("level", "code"), [(Level.FINE, 0), (Level.ADVICE, 0), (Level.CHANGE, 1)])
def test_the_exit_code_says_if_something_has_to_be_changed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, level: Level, code: int
) -> None:
    found = MachineFinding(level, "subject", "[state]", "because", "do it")
    monkeypatch.setattr(command, "_findings", lambda: iter([found]))
    ran = hil(tmp_path, "doctor")
    assert ran.returncode == code
    assert f"{level:7} subject: [state]\n        because\n     -> do it\n" in ran.stdout
    as_json = hil(tmp_path, "doctor", "--json")
    assert as_json.returncode == code
    assert json.loads(as_json.stdout)["findings"] == [found._asdict()]


def test_this_machine_is_examined(tmp_path: Path) -> None:
    ran = hil(tmp_path, "doctor", "--json")
    findings = json.loads(ran.stdout)["findings"]
    assert ran.returncode == any(one["level"] == "change" for one in findings)
    assert {"kernel", "RT throttling", "compiled kernels", "SCHED_FIFO 80"} <= {one["subject"] for one in findings}
    for one in findings:
        assert one["state"]
        assert one["why"]
        assert one["command"] or one["level"] == "fine"
