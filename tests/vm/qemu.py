"""Boot a disk under qemu with a task and return its results."""

from __future__ import annotations

import os
import shutil
import subprocess
import tarfile
import time
from collections.abc import Callable
from pathlib import Path

MEMORY_MB = 3072  # kernels are compiled in it
CORES = 2  # one for the loop, one for the rest, as `hil install-service` divides them
_RESULTS_BYTES = 1 << 29
SPOKEN = "vm: "  # lines of the guest's console that are for the user


class Machine:
    """A virtual machine without network; `kernel` gives kernel and initial file system when it boots."""

    def __init__(self, folder: Path, kernel: Callable[[], tuple[Path, Path]], say: Callable[[str], None]) -> None:
        self._folder, self._kernel, self._say = folder, kernel, say
        self.console = folder / "console.log"
        # /dev/kvm without the processor's own virtualisation (a cloud machine) runs enlightened kernels only
        hardware = {"vmx", "svm"} & set(Path("/proc/cpuinfo").read_text().split())
        self.accelerated = bool(hardware) and os.access("/dev/kvm", os.R_OK | os.W_OK)

    @property
    def text(self) -> str:
        """How the processor is simulated, in words."""
        return "KVM" if self.accelerated else "TCG: no usable /dev/kvm here, 10 to 30 times slower than with it"

    def run(self, disk: Path, task: Path, *, keep: bool = False, limit_s: float) -> Path:
        """Boot, run the task, power off; returns the folder of the results. keep: changes of the disk stay.

        Raises SystemExit if the guest has not ended within limit_s.
        """
        results, output = self._folder / "results", self._folder / "results.tar"
        output.unlink(missing_ok=True)
        with output.open("wb") as file:
            file.truncate(_RESULTS_BYTES)
        kernel, initrd = self._kernel()
        # without arch-capabilities: a guest within a virtual machine may not set its MSR (qemu 7.2 then ends)
        native = ["-accel", "kvm", "-cpu", "host,arch-capabilities=off"]
        simulated = ["-accel", "tcg,thread=multi", "-cpu", "max", "-machine", "hpet=off"]
        processor = native if self.accelerated else simulated
        # a simulated processor's counter is steady; the kernel would read a timer chip for each look at the clock
        clock = "" if self.accelerated else "tsc=reliable clocksource=tsc"
        command = [
            "qemu-system-x86_64", *processor, "-smp", str(CORES), "-m", str(MEMORY_MB), "-display", "none",
            "-serial", "stdio", "-monitor", "none", "-no-reboot", "-nic", "none", "-device", "virtio-rng-pci",
            "-kernel", str(kernel), "-initrd", str(initrd),
            "-append", f"root=/dev/vda rw console=ttyS0 quiet panic=-1 {clock}",
            "-drive", f"file={disk},format=raw,if=virtio,cache=unsafe,snapshot={'off' if keep else 'on'}",
            "-drive", f"file={task},format=raw,if=virtio,readonly=on",
            "-drive", f"file={output},format=raw,if=virtio,cache=unsafe",
        ]  # fmt: skip
        began_s = time.monotonic()
        with (
            self.console.open("w") as log,
            subprocess.Popen(command, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
                             text=True, errors="replace") as process,
        ):  # fmt: skip
            assert process.stdout is not None
            deadline = _Deadline(process, limit_s)
            for line in process.stdout:
                log.write(line)
                log.flush()
                if SPOKEN in line:
                    self._say(line.split(SPOKEN, 1)[1].strip())
            deadline.cancel()
        if process.returncode or deadline.passed:
            raise SystemExit(
                f"the guest did not end by itself after {time.monotonic() - began_s:.0f} s; see {self.console}"
            )
        shutil.rmtree(results, ignore_errors=True)
        results.mkdir()
        with tarfile.open(output) as tar:
            tar.extractall(results, filter="data")
        output.unlink()
        return results


class _Deadline:
    """Ends the process after limit_s."""

    def __init__(self, process: subprocess.Popen[str], limit_s: float) -> None:
        import threading

        self.passed = False
        self._timer = threading.Timer(limit_s, self._end, [process])
        self._timer.daemon = True
        self._timer.start()

    def _end(self, process: subprocess.Popen[str]) -> None:
        self.passed = True
        process.kill()

    def cancel(self) -> None:
        self._timer.cancel()
