"""What of this machine limits the punctuality of the loop, and the command that changes it.

Each check reads /proc and /sys below a root folder, and returns findings; nothing is changed. Levels: `fine`;
`advice`, which makes the loop more punctual; `change`, without which runs fail or the loop lacks what it asks for.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from enum import StrEnum
from pathlib import Path
from typing import NamedTuple

from hil.loop.clock import SPIN_S
from hil.loop.realtime import PRIORITY, Grant, core_list, loop_core

FASTEST_PERIOD_S = 0.0005  # the highest rate that this program is meant for
# Adds words to the kernel's command line (Debian, Ubuntu).
_BOOT_WITH = (
    """sudo sed -i 's/^GRUB_CMDLINE_LINUX_DEFAULT="/&{} /' /etc/default/grub && sudo update-grub && sudo reboot"""
)


class Level(StrEnum):
    """Whether something has to be changed."""

    FINE = "fine"
    ADVICE = "advice"
    CHANGE = "change"


class MachineFinding(NamedTuple):
    """One property of the machine: its state, why it matters, and the command that changes it ("" if fine)."""

    level: Level
    subject: str
    state: str
    why: str
    command: str = ""


class Machine:
    """The machine whose /proc and /sys are below `root`; `core` is the loop's. cores: all that may be used."""

    def __init__(self, root: Path = Path("/"), core: int | None = None) -> None:
        self.root = root
        self.online = core_list(self.read("sys/devices/system/cpu/online"))
        self.core = loop_core() if core is None else core

    def read(self, path: str) -> str:
        """Read a file below the root; "" where it is absent or may not be read."""
        try:
            return (self.root / path).read_text().strip()
        except OSError:
            return ""

    def findings(self) -> list[MachineFinding]:
        """Run all checks."""
        checks = (self.kernel, self.virtual, self.governor, self.clock_source, self.isolation, self.interrupts,
                  self.sibling, self.throttling)  # fmt: skip
        return [finding for check in checks for finding in check()]

    def kernel(self) -> Iterator[MachineFinding]:
        version = self.read("proc/sys/kernel/version")
        why = "other kernels delay a real-time process while they work for others, by milliseconds at times"
        if "PREEMPT_RT" in version or self.read("sys/kernel/realtime") == "1":
            yield MachineFinding(Level.FINE, "kernel", "PREEMPT_RT", why)
        else:
            release = self.read("proc/sys/kernel/osrelease")
            yield MachineFinding(
                Level.ADVICE, "kernel", f"{release} without PREEMPT_RT", why,
                "sudo apt install linux-image-rt-amd64 && sudo reboot  # Ubuntu: sudo pro enable realtime-kernel",
            )  # fmt: skip

    def virtual(self) -> Iterator[MachineFinding]:
        if " hypervisor" in self.read("proc/cpuinfo"):
            yield MachineFinding(
                Level.ADVICE, "machine", "virtual", "its host takes the processor away without this kernel knowing",
                "run the bench on a real PC; in a guest these settings do not reach the host",
            )  # fmt: skip

    def governor(self) -> Iterator[MachineFinding]:
        files = (self.root / "sys/devices/system/cpu").glob("cpu[0-9]*/cpufreq/scaling_governor")
        governors = {self.read(str(file.relative_to(self.root))) for file in files}
        why = "a core that slows down when idle computes late after waking up"
        if not governors:
            yield MachineFinding(Level.FINE, "CPU governor", "this kernel does not change the frequency", why)
        elif governors == {"performance"}:
            yield MachineFinding(Level.FINE, "CPU governor", "performance", why)
        else:
            yield MachineFinding(
                Level.ADVICE, "CPU governor", ", ".join(sorted(governors)), why,
                "echo performance | sudo tee /sys/devices/system/cpu/cpu*/cpufreq/scaling_governor",
            )  # fmt: skip

    def clock_source(self) -> Iterator[MachineFinding]:
        source = self.read("sys/devices/system/clocksource/clocksource0/current_clocksource")
        why = "the loop reads the clock while it waits for a tick; hpet and acpi_pm take microseconds for it"
        slow = source in ("hpet", "acpi_pm", "jiffies")
        if source:
            command = _BOOT_WITH.format("tsc=reliable") if slow else ""
            yield MachineFinding(Level.ADVICE if slow else Level.FINE, "clock source", source, why, command)

    def isolation(self) -> Iterator[MachineFinding]:
        isolated = core_list(self.read("sys/devices/system/cpu/isolated"))
        why = "on an isolated core no other process runs beside the loop"
        if isolated:
            yield MachineFinding(Level.FINE, "isolated cores", f"{_text(isolated)}; the loop takes {self.core}", why)
        elif len(self.online) > 1:
            rest = _text(self.online - {self.core})
            words = (f"isolcpus=domain,managed_irq,{self.core} nohz_full={self.core} rcu_nocbs={self.core} "
                     f"irqaffinity={rest}")  # fmt: skip
            yield MachineFinding(Level.ADVICE, "isolated cores", "none", why, _BOOT_WITH.format(words))
        else:
            yield MachineFinding(
                Level.ADVICE, "isolated cores", "only one core", why, "take a machine with two or more cores"
            )

    def interrupts(self) -> Iterator[MachineFinding]:
        """Interrupts that have fired on the loop's core and may go on doing so."""
        rows = [line.split() for line in self.read("proc/interrupts").splitlines()]
        place = rows[0].index(f"CPU{self.core}") + 1 if rows and f"CPU{self.core}" in rows[0] else None
        why = "an interrupt on the loop's core delays the loop"
        if place is None or len(self.online) < 2:
            return
        busy = [
            row[0][:-1]
            for row in rows[1:]
            if row[0][:-1].isdigit()
            and len(row) > place
            and row[place] != "0"
            and self.core in core_list(self.read(f"proc/irq/{row[0][:-1]}/smp_affinity_list"))
        ]
        if not busy:
            yield MachineFinding(Level.FINE, "interrupts", f"none of a device on core {self.core}", why)
            return
        rest = _text(self.online - {self.core})
        command = (
            f"sudo systemctl disable --now irqbalance; for irq in {' '.join(busy)}; do "
            f"echo {rest} | sudo tee /proc/irq/$irq/smp_affinity_list; done  # until the next boot"
        )
        yield MachineFinding(
            Level.ADVICE,
            "interrupts",
            f"{len(busy)} of devices reach core {self.core}: {', '.join(busy)}",
            why,
            command,
        )

    def sibling(self) -> Iterator[MachineFinding]:
        siblings = core_list(self.read(f"sys/devices/system/cpu/cpu{self.core}/topology/thread_siblings_list"))
        if others := siblings & self.online - {self.core}:
            yield MachineFinding(
                Level.ADVICE, "hyper-threading", f"core {self.core} shares its units with {_text(others)}",
                "what runs on the sibling slows the loop down",
                " && ".join(f"echo 0 | sudo tee /sys/devices/system/cpu/cpu{one}/online" for one in sorted(others)),
            )  # fmt: skip

    def throttling(self) -> Iterator[MachineFinding]:
        text = self.read("proc/sys/kernel/sched_rt_runtime_us")
        period = self.read("proc/sys/kernel/sched_rt_period_us")
        if not text or not period:
            return
        runtime_us, period_us = int(text), int(period)
        why = (
            "the kernel stops real-time processes for the rest of each period, so that one that runs away can be ended"
        )
        spun = SPIN_S / FASTEST_PERIOD_S
        command = "sudo sysctl kernel.sched_rt_runtime_us=950000"
        if runtime_us < 0:
            yield MachineFinding(Level.ADVICE, "RT throttling", "off: a loop that runs away blocks its core",
                                 why, command)  # fmt: skip
        elif runtime_us < 2 * spun * period_us:  # spinning, and as much again for the work of a tick
            state = f"{runtime_us} of {period_us} us; at {1 / FASTEST_PERIOD_S:.0f} Hz the loop waits actively for "
            yield MachineFinding(Level.CHANGE, "RT throttling", f"{state}{100 * spun:.0f} %", why, command)
        else:
            yield MachineFinding(Level.FINE, "RT throttling", f"{runtime_us} of {period_us} us", why)


def grant_findings(grants: tuple[Grant, ...]) -> Iterator[MachineFinding]:
    """Yield what `real_time` was granted or refused, with the command that grants it."""
    limits = "/etc/security/limits.d/hil.conf  # then log in again; a service of hil install-service has it"
    what = {
        "SCHED_FIFO": ("every other process may delay the loop",
                       f"echo \"$USER - rtprio {PRIORITY}\" | sudo tee -a {limits}"),
        "memory": ("a page that is fetched from the disk delays the loop by milliseconds",
                   f"echo \"$USER - memlock unlimited\" | sudo tee -a {limits}"),
        "no deep sleep": ("a core in deep sleep needs 100 us and more to wake up",
                          "sudo setfacl -m u:$USER:w /dev/cpu_dma_latency  # hil install-service: for services"),
    }  # fmt: skip
    for grant in grants:
        reasons = next((value for key, value in what.items() if grant.setting.startswith(key)), None)
        why, command = reasons or ("the loop asks for it when it arms", "see docs/service.md")
        if grant.refused:
            yield MachineFinding(Level.CHANGE, grant.setting, f"refused: {grant.refused}", why, command)
        else:
            yield MachineFinding(Level.FINE, grant.setting, "granted", why)


def _text(cores: set[int]) -> str:
    return ",".join(map(str, sorted(cores)))


def limits_now() -> str:
    """Return the limits of this process for real-time priority and locked memory as text."""
    import resource

    def soft(which: int) -> str:
        value = resource.getrlimit(which)[0]
        return "unlimited" if value == resource.RLIM_INFINITY else str(value)

    user = "root" if os.geteuid() == 0 else f"user {os.geteuid()}"
    return f"rtprio {soft(resource.RLIMIT_RTPRIO)}, memlock {soft(resource.RLIMIT_MEMLOCK)} bytes, {user}"
