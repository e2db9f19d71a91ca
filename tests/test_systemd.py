"""The units of hil install-service are sound and closed, as systemd itself sees them."""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path

import pytest
from bench_runs import bench_with
from command_line import Ran, hil, refused

from drivers.sdo_setup import EDS_FOLDER
from hil.bench.bench_file import load_bench
from hil.commands.install_service import UNITS, bench_files
from hil.errors import FieldError, InputError
from hil.loop.realtime import PRIORITY

ROOT = Path(__file__).parents[1]
PROFILE = str(ROOT / "profiles" / "identification.yaml")
REFERENCE = (ROOT / "hil" / "benches" / "reference.yaml").read_text().split("\nsimulation:")[0] + "\n"
MOST_EXPOSED = {"hil-bench@.service": 2.5, "hil-bench-failed@.service": 2.5}
SYSTEMD = pytest.mark.skipif(shutil.which("systemd-analyze") is None, reason="needs systemd-analyze of systemd")


def bench_file(folder: Path, **drive: str) -> Path:
    """A bench axis1 on the CAN interface can0, without a simulation."""
    values = {"interface": "socketcan", "channel": "can0"} | drive
    lines = "\n".join(f"  {name}: {value}" for name, value in values.items())
    path = folder / "axis1.yaml"
    path.write_text(REFERENCE.replace("name: reference", "name: axis1").replace("  interface: inprocess", lines, 1))
    return path


def install(folder: Path, *arguments: str) -> tuple[Ran, Path]:
    ran = hil(folder, "install-service", str(bench_file(folder)), "--profile", PROFILE, "--root", "root", *arguments)
    return ran, folder / "root"


def analyze(*arguments: str | Path) -> str:
    """What systemd-analyze prints; its exit code is 0 for bad units too."""
    ran = subprocess.run(["systemd-analyze", *arguments], capture_output=True, text=True, check=False)
    return ran.stdout + ran.stderr


def complaints(unit: Path) -> str:
    return analyze("verify", "--man=no", unit)


@SYSTEMD
@pytest.mark.parametrize("name", ["hil-bench@axis1.service", "hil-bench@axis1.timer", "hil-bench-failed@axis1.service"])
def test_unit_is_sound(tmp_path: Path, name: str) -> None:
    _, root = install(tmp_path)
    unit = root / UNITS / name
    assert complaints(unit) == ""
    template = root / UNITS / (name.split("@")[0] + "@" + unit.suffix)
    key = "Persistent" if unit.suffix == ".timer" else "NoNewPrivileges"
    template.write_text(template.read_text().replace(f"{key}=", f"{key}=maybe"))
    assert "maybe" in complaints(unit)  # a bad one is noticed


@SYSTEMD
def test_the_settings_of_a_bench_are_sound(tmp_path: Path) -> None:
    _, root = install(tmp_path)
    settings = root / UNITS / "hil-bench@axis1.service.d" / "bench.conf"
    settings.write_text(settings.read_text().replace("CPUAffinity=", "CPUAffinity=x"))
    assert "CPU" in complaints(root / UNITS / "hil-bench@axis1.service")


@SYSTEMD
@pytest.mark.parametrize("name", MOST_EXPOSED)
def test_unit_is_closed(tmp_path: Path, name: str) -> None:
    _, root = install(tmp_path)
    judged = analyze("security", "--offline=true", "--no-pager", root / UNITS / name)
    exposure = float(judged.rsplit("Overall exposure level for ", 1)[1].split(":")[1].split()[0])
    assert 0.0 < exposure <= MOST_EXPOSED[name], judged


def keys(unit: Path) -> dict[str, list[str]]:
    """Values of each key of a unit file, in their order."""
    found: dict[str, list[str]] = {}
    for line in unit.read_text().splitlines():
        if "=" in line and not line.startswith(("#", " ")):
            key, value = line.split("=", 1)
            found.setdefault(key, []).append(value)
    return found


def test_a_bench_is_never_armed_again_by_itself(tmp_path: Path) -> None:
    _, root = install(tmp_path)
    unit = keys(root / UNITS / "hil-bench@.service")
    assert unit["Restart"] == ["no"]
    assert unit["OnFailure"] == ["hil-bench-failed@%i.service"]
    assert unit["AssertPathExists"] == ["!/var/lib/hil-faults/%i"]
    latch = (root / UNITS / "hil-bench-failed@.service").read_text()
    assert '"/var/lib/hil-faults/$$0"' in latch
    assert keys(root / UNITS / "hil-bench@.timer")["Persistent"] == ["no"]


def test_the_loop_gets_what_it_asks_for(tmp_path: Path) -> None:
    _, root = install(tmp_path, "--cores", "2-3")
    unit = keys(root / UNITS / "hil-bench@.service")
    assert unit["Type"] == ["notify"]
    assert unit["WatchdogSec"] == ["2"]
    assert unit["LimitRTPRIO"] == [str(PRIORITY)]
    assert unit["LimitMEMLOCK"] == ["infinity"]
    assert unit["RestrictAddressFamilies"] == ["AF_CAN AF_UNIX"]
    assert (unit["KillSignal"], unit["SuccessExitStatus"]) == (["SIGINT"], ["130"])
    assert keys(root / UNITS / "hil-bench@axis1.service.d" / "bench.conf")["CPUAffinity"] == ["2-3"]


def test_the_can_interface_gets_bit_rate_and_restart(tmp_path: Path) -> None:
    _, root = install(tmp_path)
    assert (root / "etc/systemd/network/80-hil-can0.network").read_text() == (
        "[Match]\nName=can0\n\n[CAN]\nBitRate=1000000\nRestartSec=100ms\n"
    )
    needed = keys(root / UNITS / "hil-bench@axis1.service.d" / "bench.conf")
    assert needed["Requires"] == needed["After"] == ["sys-subsystem-net-devices-can0.device"]


def test_a_virtual_can_interface_is_made() -> None:
    bench = bench_with(drive={"interface": "socketcan", "channel": "vcan0"}).model_copy(update={"simulation": None})
    found = {path.name: text for path, text in bench_files(bench, "axis1", "").items()}
    assert "Kind=vcan" in found["80-hil-vcan0.netdev"]
    assert "BitRate" not in found["80-hil-vcan0.network"]


def test_a_serial_encoder_is_let_through(tmp_path: Path) -> None:
    encoder = {"interface": "serial", "device": "/dev/ttyUSB0"}
    bench = bench_with(drive={"interface": "socketcan", "channel": "can0", "encoder": encoder})
    for simulation, expected in ((None, ["/dev/ttyUSB0 rw"]), (bench.simulation, None)):
        texts = bench_files(bench.model_copy(update={"simulation": simulation}), "axis1", "")
        (tmp_path / "bench.conf").write_text(texts[UNITS / "hil-bench@axis1.service.d" / "bench.conf"])
        assert keys(tmp_path / "bench.conf").get("DeviceAllow") == expected


def test_installing_says_what_it_does_and_changes_no_more(tmp_path: Path) -> None:
    first, root = install(tmp_path)
    files = sorted(path for path in root.rglob("*") if path.is_file())
    assert first.returncode == 0, first.stderr
    assert [line for line in first.stdout.splitlines() if line.startswith("new ")] == [
        f"new       {path.relative_to(tmp_path)}" for path in files
    ]
    assert "sudo systemctl start hil-bench@axis1" in first.stdout
    assert load_bench(root / "etc/hil/axis1/bench.yaml").name == "axis1"
    (root / UNITS / "hil-bench@.timer").write_text("[Timer]\n")
    again, _ = install(tmp_path)
    assert [line.split()[0] for line in again.stdout.splitlines()[: len(files)]].count("unchanged") == len(files) - 1
    assert f"changed   root/{UNITS / 'hil-bench@.timer'}" in again.stdout
    assert {path.stat().st_mode & 0o777 for path in files} == {0o644}


def test_a_dry_run_prints_the_files_and_writes_none(tmp_path: Path) -> None:
    ran, root = install(tmp_path, "--dry-run")
    assert ran.returncode == 0
    assert not root.exists()
    assert "    ExecStart=" in ran.stdout
    assert "    BitRate=1000000" in ran.stdout
    assert "Nothing was written" in ran.stdout


def test_device_files_beside_the_bench_are_taken_along(tmp_path: Path) -> None:
    eds = tmp_path / "devices" / "drive.eds"
    eds.parent.mkdir()
    text = f"; Größe in µm\n{(EDS_FOLDER / 'servo_drive.eds').read_text()}"
    eds.write_bytes(text.encode("cp1252"))
    bench = bench_file(tmp_path, eds="devices/drive.eds")
    ran = hil(tmp_path, "install-service", str(bench), "--profile", PROFILE, "--root", "root")
    assert ran.returncode == 0, ran.stderr
    assert (tmp_path / "root/etc/hil/axis1/devices/drive.eds").read_text("utf-8") == text


@pytest.mark.parametrize(
    ("drive", "arguments", "message"),
    [
        ({}, ("--name", "../../etc"), "--name: given '../../etc'"),
        ({}, ("--name", ".."), "--name: given '..'"),
        ({}, ("--cores", "2; reboot"), "--cores: given '2; reboot'"),
        ({"interface": "udp_multicast"}, (), "drive.interface: given udp_multicast, allowed socketcan"),
        ({"channel": '"can0\\nExecStart=x"'}, (), "drive.channel: given"),
        ({"channel": "../can0"}, (), "drive.channel: given '../can0'"),
        (
            {"encoder": '{interface: serial, device: "/dev/ttyUSB0\\nExecStart=x"}'},
            (),
            "drive.encoder.device: given",
        ),
        ({"eds": "../drive.eds"}, (), "drive.eds: given ../drive.eds"),
        ({"eds": "missing.eds"}, (), "drive.eds: given missing.eds"),
    ],
)
def test_what_would_leave_its_place_is_refused(
    tmp_path: Path, drive: dict[str, str], arguments: tuple[str, ...], message: str
) -> None:
    bench = bench_file(tmp_path, **drive)
    said = refused(tmp_path, "install-service", str(bench), "--profile", PROFILE, "--root", "root", *arguments)
    assert message in said


def test_a_program_that_the_sandbox_hides_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("sys.executable", "/home/me/.venv/bin/python")
    ran = hil(tmp_path, "install-service", str(bench_file(tmp_path)), "--profile", PROFILE, "--dry-run")
    assert ran.returncode == InputError.exit_code
    assert "/home/me/.venv/bin: the service cannot see programs in /home" in ran.stderr
    ran, root = install(tmp_path)  # an image may have the programs elsewhere
    assert ran.returncode == 0
    assert "Note: /home/me/.venv/bin: the service cannot see" in ran.stderr
    assert root.exists()


def test_a_bus_that_the_sandbox_does_not_reach_is_refused() -> None:
    with pytest.raises(FieldError, match="allowed socketcan in a service"):
        bench_files(bench_with(drive={"interface": "virtual"}), "axis1", "")
