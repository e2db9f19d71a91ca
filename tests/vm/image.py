"""Make the disk of the virtual machine: Debian with a PREEMPT_RT kernel, systemd, rt-tests, and the project's wheel.

    packages of Debian -> build/vm/root -> locked dependencies in its /opt/hil-servo/.venv
    wheel, units and kernels (`guest/install.sh`, in a chroot) -> a first boot (`guest/prepare.py`) -> prepared.ext4

Each step is done again only if what it depends on has changed. Needs root: files of the guest belong to its users.
"""

from __future__ import annotations

import hashlib
import os
import shutil
import subprocess
import sys
import tarfile
import tempfile
from collections.abc import Callable
from pathlib import Path

from qemu import Machine

ROOT = Path(__file__).parents[2]
GUEST = Path(__file__).parent / "guest"
SUITE = "bookworm"  # its Python is 3.11, as the project's
PACKAGES = (
    "linux-image-rt-amd64", "systemd-sysv", "udev", "dbus", "kmod", "iproute2", "procps", "can-utils", "rt-tests",
    "python3.11", "python3.11-venv",
)  # fmt: skip
NEEDED = {  # program -> package of Debian
    "qemu-system-x86_64": "qemu-system-x86",
    "mmdebstrap": "mmdebstrap",
    "mke2fs": "e2fsprogs",
}
# Kernels compiled here must run in the guest, whose processor may be a simulated one.
PROCESSOR = {"NUMBA_CPU_NAME": "generic", "NUMBA_CPU_FEATURES": ""}
_PROCESSOR = " ".join(f"{name}={value}" for name, value in PROCESSOR.items())
INSTALLED = "/opt/hil-servo"  # in the guest
DISK_SIZE = "4G"  # sparse; a third is used
_START = """[Unit]
Description=Task of the virtual machine
After=multi-user.target systemd-networkd.service
[Service]
ExecStart=/bin/sh /usr/local/sbin/vm-task
StandardOutput=journal+console
StandardError=journal+console
TimeoutStartSec=infinity
[Install]
WantedBy=multi-user.target
"""
_TASK = f"""# The task is a tar file on the second disk, the results go to the third one.
mkdir -p /run/vm/results
tar -C /run/vm -xf /dev/vdb
cd /run/vm && {INSTALLED}/.venv/bin/python -u "$(cat /run/vm/task)"
tar -C /run/vm/results -cf /dev/vdc .
sync
systemctl poweroff
"""


def missing_programs() -> str:
    """Return a sentence on what this computer lacks for the virtual machine; empty if nothing."""
    packages = [package for program, package in NEEDED.items() if shutil.which(program, path=_path()) is None]
    if packages:
        return f"make vm-test needs {', '.join(packages)}: sudo apt install {' '.join(packages)}"
    if os.geteuid() != 0:
        return "make vm-test makes files of other users for the guest: run it as root (sudo make vm-test)"
    if sys.version_info[:2] != (3, 11):
        return "make vm-test needs Python 3.11 as the guest has it: make PYTHON=python3.11 vm-test"
    return ""


def _path() -> str:
    return os.environ.get("PATH", "") + ":/usr/sbin:/sbin"


def prepared(folder: Path, machine: Machine, say: Callable[[str], None]) -> Path:
    """Return the disk with all installed, made as far as it is not in `folder`."""
    root, half, ready = folder / "root", folder / "half.ext4", folder / "prepared.ext4"
    if _stale(root / "etc/vm-packages", packages := " ".join((SUITE, *PACKAGES))):
        say("Debian with a PREEMPT_RT kernel (some minutes) ...")
        shutil.rmtree(root, ignore_errors=True)
        _call("mmdebstrap", "--quiet", "--variant=minbase", f"--include={','.join(PACKAGES)}", SUITE, root)
        (root / "etc/vm-packages").write_text(packages)
    wheel = _wheel(folder / "wheel")
    lock = _digest(ROOT / "requirements.lock", ROOT / "pyproject.toml")
    if _stale(root / "etc/vm-lock", lock):
        say("locked dependencies ...")
        _install_dependencies(root, wheel, folder / "wheels")
        (root / "etc/vm-lock").write_text(lock)
    state = folder / "prepared.digest"
    bench = "axis.yaml" if machine.accelerated else "axis_slow.yaml"
    wanted = bench + packages + lock + _digest(Path(__file__), *_sources(), GUEST / "install.sh", GUEST / "prepare.py",
                                       *sorted(GUEST.glob("*.yaml")))  # fmt: skip
    if _stale(state, wanted) or not ready.exists():
        say("wheel, units, compiled kernels (two minutes) ...")
        state.unlink(missing_ok=True)
        _install_project(root, wheel, bench)
        _configure(root)
        half.unlink(missing_ok=True)
        _call("mke2fs", "-q", "-t", "ext4", "-L", "vm", "-d", root, half, DISK_SIZE)
        say("first boot ...")
        made = machine.run(half, task_disk(folder / "task.tar", "prepare.py", []), keep=True, limit_s=2400.0)
        if not (made / "prepared").exists():
            raise SystemExit(f"the guest could not be prepared; see {machine.console}")
        half.rename(ready)
        state.write_text(wanted)
    return ready


def task_disk(path: Path, task: str, files: list[Path]) -> Path:
    """Write the tar file with the guest's programs, the name of the one to run, and further files."""
    with tempfile.TemporaryDirectory() as folder, tarfile.open(path, "w") as tar:
        (name := Path(folder) / "task").write_text(task)
        for file in (name, *sorted(GUEST.iterdir()), *files):
            if file.is_file():
                tar.add(file, file.name)
    return path


def kernel(folder: Path) -> tuple[Path, Path]:
    """Return kernel and initial file system of the guest."""
    boot = folder / "root/boot"
    return max(boot.glob("vmlinuz-*")), max(boot.glob("initrd.img-*"))


def _install_dependencies(root: Path, wheel: Path, wheels: Path) -> None:
    wheels.mkdir(exist_ok=True)
    pip = (sys.executable, "-m", "pip", "--disable-pip-version-check", "--quiet")
    _call(*pip, "download", "--dest", wheels, "--constraint", ROOT / "requirements.lock", wheel)
    venv = f"{INSTALLED}/.venv"
    inside = root / "opt/wheels"
    shutil.rmtree(inside, ignore_errors=True)
    shutil.copytree(wheels, inside)
    shutil.copy(wheel, inside)
    shutil.copy(ROOT / "requirements.lock", inside)
    _call("chroot", root, "python3.11", "-m", "venv", "--clear", venv)
    _call(
        "chroot", root, f"{venv}/bin/python", "-m", "pip", "--isolated", "install", "--quiet", "--no-index",
        "--find-links=/opt/wheels", "--constraint=/opt/wheels/requirements.lock", f"/opt/wheels/{wheel.name}",
    )  # fmt: skip
    shutil.rmtree(inside)


def _install_project(root: Path, wheel: Path, bench: str) -> None:
    """Install wheel and units as docs/service.md says, and compile the kernels, for any processor, by this one."""
    inside = root / "opt/vm"
    shutil.rmtree(inside, ignore_errors=True)
    inside.mkdir(parents=True)
    for file in (wheel, GUEST / bench, GUEST / "move.yaml", GUEST / "install.sh"):
        shutil.copy(file, inside)
    shutil.rmtree(root / "var/cache/hil", ignore_errors=True)
    _call("chroot", root, "/usr/bin/env", *(f"{name}={value}" for name, value in PROCESSOR.items()),
          "sh", "-e", "/opt/vm/install.sh", bench)  # fmt: skip


def _configure(root: Path) -> None:
    """Host name, start of the task, frames of vcan through the queue of the interface (netem), no stale journal."""
    files = {
        "etc/hostname": "bench\n",
        "etc/hosts": "127.0.0.1 localhost bench\n",
        "etc/fstab": "/dev/vda / ext4 defaults 0 1\n",
        "etc/modprobe.d/vcan.conf": "options vcan echo=1\n",
        "etc/systemd/system/vm-task.service": _START,
        "usr/local/sbin/vm-task": _TASK,
        "etc/systemd/system/hil-bench@.service.d/processor.conf": f"[Service]\nEnvironment={_PROCESSOR}\n",
        "etc/systemd/system/vm-task.service.d/processor.conf": f"[Service]\nEnvironment={_PROCESSOR}\n",
    }
    for name, text in files.items():
        path = root / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)
    _call("systemctl", f"--root={root}", "enable", "--quiet", "vm-task.service")


def _wheel(folder: Path) -> Path:
    """Build the wheel from the files under version control, apart from what a build before has left."""
    shutil.rmtree(folder, ignore_errors=True)
    with tempfile.TemporaryDirectory() as copy:
        for source in _sources():
            target = Path(copy) / source.relative_to(ROOT)
            target.parent.mkdir(parents=True, exist_ok=True)
            shutil.copy(source, target)
        pip = (sys.executable, "-m", "pip", "--disable-pip-version-check", "--quiet")
        _call(*pip, "wheel", "--no-deps", "--wheel-dir", folder, copy)
    return next(folder.glob("hil_servo-*.whl"))


def _sources() -> list[Path]:
    listed = subprocess.run(
        ["git", "ls-files", "hil", "drivers", "pyproject.toml", "README.md", "LICENSE*"],
        cwd=ROOT, capture_output=True, text=True, check=True)  # fmt: skip
    return [path for line in listed.stdout.splitlines() if (path := ROOT / line).is_file()]


def _digest(*files: Path) -> str:
    digest = hashlib.sha256()
    for file in files:
        digest.update(f"{file.name}\n".encode() + file.read_bytes())
    return digest.hexdigest()


def _stale(path: Path, wanted: str) -> bool:
    return not path.exists() or path.read_text() != wanted


def _call(*command: str | Path) -> None:
    try:
        subprocess.run([str(word) for word in command], check=True, env=os.environ | {"PATH": _path()})
    except subprocess.CalledProcessError as error:
        raise SystemExit(f"{' '.join(str(word) for word in command)}: failed ({error.returncode})") from None
