"""In the guest, once: what a first start does, as the service does it; by a simulated processor it takes minutes."""

from __future__ import annotations

import subprocess
import sys
import time
from pathlib import Path

HERE = Path(__file__).parent
HIL = Path(sys.executable).parent / "hil"


def main() -> None:
    """Let the user of the service check the kernels; writes results/prepared at the end."""
    began_s = time.monotonic()
    subprocess.run(
        ["systemd-run", "--quiet", "--wait", "--pipe", "--uid=hil", "--gid=hil", "--property=CacheDirectory=hil",
         "--property=CacheDirectoryMode=0700", "--setenv=NUMBA_CACHE_DIR=/var/cache/hil",
         "--setenv=NUMBA_CPU_NAME=generic", "--setenv=NUMBA_CPU_FEATURES=", str(HIL), "warm-up"],
        check=True)  # fmt: skip
    print(f"vm: kernels checked in {time.monotonic() - began_s:.0f} s", flush=True)
    (HERE / "results/prepared").touch()


if __name__ == "__main__":
    main()
