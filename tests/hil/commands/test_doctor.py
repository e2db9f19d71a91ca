"""hil doctor: what it finds in /proc and /sys of machines of several kinds, and its exit code."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from command_line import hil

from hil.commands import doctor as command
from hil.loop.can_interfaces import can_findings
from hil.loop.machine import Level, Machine, MachineFinding, grant_findings
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
        (1000, True, said(), [("CAN can0 txqueuelen", "advice")]),
        (2, True, said(), [("CAN can0 txqueuelen", "advice")]),
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
