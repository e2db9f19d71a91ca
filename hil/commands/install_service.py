"""hil install-service: the systemd units, the CAN interface and the rights of a bench."""

from __future__ import annotations

import os
import re
import sys
from importlib.resources import files
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from hil.report.console import err, out

if TYPE_CHECKING:
    from hil.bench.bench_file import Bench

UNITS = Path("etc/systemd/system")
_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9_-]{0,62}")  # safe in file names and as an instance of a unit, unescaped
_INTERFACE = re.compile(r"[A-Za-z0-9_.]{1,15}")  # 15: IFNAMSIZ of linux/if.h
_DEVICE = re.compile(r"/dev/[A-Za-z0-9_./:+-]+")
_HIDDEN = ("/home", "/root", "/run/user", "/tmp", "/var/tmp")  # ProtectHome= and PrivateTmp= of the unit
# After bus-off the controller returns to the bus by itself after this time: later than the loop has found the fault,
# sooner than its quick stop gives up (2 s), so that the drive still hears it.
RESTART_S = 0.1


def install_service(
    bench: Annotated[str, typer.Argument(help="Bench file or name of a shipped bench.", show_default=False)],
    profile: Annotated[
        Path, typer.Option(help="Profile that the service runs: file or shipped name.", show_default=False)
    ],
    name: Annotated[str, typer.Option(help="Name of the service. Default: the bench's name.")] = "",
    cores: Annotated[
        str, typer.Option(help="Cores of the service, as 2-3; the loop takes an isolated one or the last of them.")
    ] = "",
    root: Annotated[Path, typer.Option(help="Folder of the system to install into, for images.")] = Path("/"),
    dry_run: Annotated[bool, typer.Option("--dry-run", help="Print the files, write nothing.")] = False,
) -> None:
    """Write a systemd service hil-bench@NAME that runs a profile on a bench, and the CAN interface it needs."""
    from drivers.eds_text import decode, read_bytes
    from hil.errors import FieldError, InputError
    from hil.files.output import write_text
    from hil.files.shipped import given_or_shipped
    from hil.files.yaml_model import located
    from hil.loop.devices import check_runnable
    from hil.loop.eds_files import check_eds_files
    from hil.loop.simulated_bench import load_simulated
    from hil.motion.profile import load_profile

    loaded, source = load_simulated(bench), given_or_shipped(bench, "bench")
    profile = given_or_shipped(profile, "profile")
    load_profile(profile)
    name = name or loaded.name
    if not _NAME.fullmatch(name):
        raise InputError(f"--name: given {name!r}, allowed up to 63 letters, digits, - and _; give a shorter name")
    try:
        check_runnable(loaded)
        check_eds_files(loaded)
        texts = unit_files() | bench_files(loaded, name, cores)
    except FieldError as error:
        raise located(source, error) from None
    if hidden := _hidden_programs():
        if root == Path("/"):
            raise InputError(hidden)
        err.print(f"Note: {hidden}", markup=False)
    here = Path("etc/hil") / name
    texts |= {here / "bench.yaml": source.read_text("utf-8"), here / "profile.yaml": profile.read_text("utf-8")}
    texts |= {here / eds: decode(read_bytes(eds)) for eds in _device_files(loaded, source)}
    for path, text in sorted(texts.items()):
        target = root / path
        before = target.read_text("utf-8") if target.is_file() else None
        state = "new" if before is None else "unchanged" if before == text else "changed"
        out.print(f"{state:9} {target}")
        if dry_run and state != "unchanged":
            out.print("".join(f"    {line}\n" for line in text.splitlines()))
        elif state != "unchanged":
            try:
                target.parent.mkdir(parents=True, exist_ok=True)
            except OSError as error:
                raise InputError(f"{target.parent}: cannot be made ({error.strerror}); run it with sudo") from None
            write_text(target, text)
            target.chmod(0o644)  # the service reads them as another user
    out.print(f"\n{'Nothing was written. After the installation' if dry_run else 'Nothing was started. Now'}:\n")
    out.print(_next_steps(name, any("network" in path.parts for path in texts)))


def unit_files() -> dict[Path, str]:
    """Return the files that all benches share, by their path below the root."""
    programs = Path(sys.executable).parent
    text = {unit.name: unit.read_text("utf-8").replace("@BIN@", str(programs)) for unit in _shipped()}
    return {UNITS / unit: text[unit] for unit in text if unit.startswith("hil-bench")} | {
        Path("etc/sysusers.d/hil.conf"): text["hil-sysusers.conf"],
        Path("etc/udev/rules.d/70-hil.rules"): text["hil-udev.rules"],
    }


def _hidden_programs() -> str:
    """Sentence on programs in a folder that the sandbox hides; empty for others."""
    programs = Path(sys.executable).parent
    if not any(programs.is_relative_to(hidden) for hidden in _HIDDEN):
        return ""
    return (
        f"{programs}: the service cannot see programs in {', '.join(_HIDDEN)}; install hil-servo elsewhere, as "
        "README says for /opt/hil-servo, and run its hil install-service"
    )


def bench_files(bench: Bench, name: str, cores: str) -> dict[Path, str]:
    """Return the files of one bench: cores and devices of its service, and its CAN interface.

    Raises FieldError for a bus that the sandbox does not reach.
    """
    from hil.bench.hardware import DriveSection
    from hil.errors import FieldError, InputError

    section = bench.drive or DriveSection()
    if section.interface not in ("socketcan", "inprocess"):
        raise FieldError(
            ("drive", "interface"), f"given {section.interface}, allowed socketcan in a service, which has no network"
        )
    cores = cores or _last_cores(os.cpu_count() or 1)
    if not re.fullmatch(r"\d+([-,]\d+)*", cores):
        raise InputError(f"--cores: given {cores!r}, allowed a list such as 2-3 or 1,3")
    unit, service, found = [], [f"CPUAffinity={cores}"], {}
    if section.interface == "socketcan":
        can = section.channel
        if not _INTERFACE.fullmatch(can):
            raise FieldError(("drive", "channel"), f"given {can!r}, allowed the name of a CAN interface, as can0")
        unit += [f"{key}=sys-subsystem-net-devices-{can}.device" for key in ("Requires", "After")]
        found = _can_files(can, section.bitrate)
    encoder = section.encoder
    if bench.has_table_encoder and encoder.interface == "serial" and encoder.device and bench.simulation is None:
        if not _DEVICE.fullmatch(encoder.device):
            raise FieldError(("drive", "encoder", "device"), f"given {encoder.device!r}, allowed as /dev/ttyUSB0")
        service.append(f"DeviceAllow={encoder.device} rw")
    lines = ["# Of this bench; written by `hil install-service`.", "[Unit]", *unit, "", "[Service]", *service]
    return {UNITS / f"hil-bench@{name}.service.d" / "bench.conf": "\n".join(lines) + "\n", **found}


def _can_files(interface: str, bitrate: int) -> dict[Path, str]:
    """Return the files of systemd-networkd for a CAN interface; one named vcan... is a virtual one and is made."""
    folder, head = Path("etc/systemd/network"), f"[Match]\nName={interface}\n"
    network = folder / f"80-hil-{interface}.network"
    if interface.startswith("vcan"):
        return {
            folder / f"80-hil-{interface}.netdev": f"[NetDev]\nName={interface}\nKind=vcan\n",
            network: f"{head}[Link]\nActivationPolicy=up\n",
        }
    return {network: f"{head}\n[CAN]\nBitRate={bitrate}\nRestartSec={1e3 * RESTART_S:.0f}ms\n"}


def _device_files(bench: Bench, source: Path) -> list[Path]:
    """Return the EDS files of a bench that stand relative to the working folder; absolute ones stay where they are."""
    from hil.errors import FieldError
    from hil.files.yaml_model import located

    section = bench.drive
    given = [] if section is None else [(("eds",), section.eds), (("encoder", "eds"), section.encoder.eds)]
    found = []
    for field, eds in given:
        if eds is None:
            continue
        path = Path(eds)
        hidden = path.is_absolute() and any(path.is_relative_to(folder) for folder in _HIDDEN)
        if hidden or ".." in path.parts or not path.is_file():
            reason = "allowed an existing file below the working folder, or elsewhere but in home and temporary folders"
            raise located(source, FieldError(("drive", *field), f"given {eds}, {reason}"))
        if not path.is_absolute():
            found.append(path)
    return found


def _last_cores(count: int) -> str:
    """Return the last two cores: one for the loop, one for its recorder and all before it arms."""
    return f"{max(0, count - 2)}-{count - 1}"


def _shipped() -> list[Path]:
    return sorted(Path(str(unit)) for unit in files("hil").joinpath("units").iterdir())


def _next_steps(name: str, can: bool) -> str:
    """Return the commands that put the files into force."""
    steps = [
        "sudo systemd-sysusers",
        "sudo udevadm control --reload && sudo udevadm trigger --name-match=cpu_dma_latency",
        *(["sudo systemctl enable systemd-networkd && sudo systemctl restart systemd-networkd"] if can else []),
        "sudo systemctl daemon-reload",
        f"sudo systemctl start hil-bench@{name}              # moves the axis",
        f"journalctl -u hil-bench@{name}                     # what it did; recordings: /var/lib/hil/{name}",
        f"sudo systemctl enable --now hil-bench@{name}.timer # every morning",
        f"sudo rm /var/lib/hil-faults/{name}                 # after a failure, when its cause is mended",
    ]
    return "\n".join(f"    {step}" for step in steps)
