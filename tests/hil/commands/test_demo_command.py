"""`hil demo` as a newcomer meets it: what it conceals it finds, and it says so."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
import threading
from pathlib import Path

import pytest
from command_line import hil, refused

from hil.recording.recording import read_recording
from hil.validation.proof.draw.demo import CONCEALED


def test_the_demo_finds_what_it_conceals(tmp_path: Path) -> None:
    ran = hil(tmp_path, "demo", "--virtual", "--effect", "backlash", "--seed", "7", "--out", "demo")
    assert ran.returncode == 0, ran.stderr
    assert "backlash" not in ran.stderr.split("fitting")[0]  # nothing is said before it is found
    assert "The twin leaves something out" in ran.stdout.split("Diagnosis")[0]
    assert "Concealed: backlash; found: backlash. It found what was concealed." in ran.stdout
    for report in ("compare.html", "report.html"):
        assert str(tmp_path / "demo" / report) in ran.stdout
        assert (tmp_path / "demo" / report).is_file()
    recorded = read_recording(tmp_path / "demo" / "learn.parquet").metadata["bench"]["simulation"]
    truth, found = recorded["effects"][0], json.loads((tmp_path / "demo" / "diagnosis.json").read_text())
    value = found["missing"][0]["parameters"]["gap_m"]["value"]
    assert value == pytest.approx(truth["parameters"]["gap_m"], rel=0.03)
    assert found["parameter_corrections"]["table_mass_kg"]["value"] == pytest.approx(
        recorded["axis"]["table_mass_kg"], rel=0.02
    )
    diagnosed = (tmp_path / "demo" / "bench.diagnosed.yaml").read_text()
    assert "effects" not in diagnosed.partition("simulation:")[0]  # the truth is that of the machine alone


@pytest.mark.long
@pytest.mark.parametrize("effect", CONCEALED)
def test_the_demo_finds_each_of_its_effects(tmp_path: Path, effect: str) -> None:
    ran = hil(tmp_path, "demo", "--virtual", "--effect", effect, "--seed", "5", "--out", "demo")
    assert ran.returncode == 0, ran.stderr
    assert "It found what was concealed." in ran.stdout


def test_the_demo_refuses_an_effect_that_it_does_not_know(tmp_path: Path) -> None:
    message = refused(tmp_path, "demo", "--effect", "ghost")
    assert message.startswith("--effect: given ghost, allowed periodic_lead_error, backlash")


@pytest.mark.long
def test_a_machine_that_stalls_gets_the_demo_in_virtual_time(tmp_path: Path) -> None:
    command = [sys.executable, "-m", "hil.cli", "demo", "--effect", "backlash", "--seed", "7", "--out", "demo"]
    with subprocess.Popen(command, cwd=tmp_path, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as demo:
        assert demo.stderr is not None
        kept = threading.Event()

        def stall() -> None:
            while not kept.wait(0.2):
                demo.send_signal(signal.SIGSTOP)
                kept.wait(0.2)
                demo.send_signal(signal.SIGCONT)

        stalling = threading.Thread(target=stall)
        said = ""
        for line in demo.stderr:
            said += line
            if "simulated CANopen bus" in line and not stalling.ident:
                stalling.start()
            if "again in virtual time" in line:
                break
        kept.set()
        stalling.join()
        stdout, rest = demo.communicate()
    assert demo.returncode == 0, said + rest
    assert said.count("Failed in wall-clock time") == 1
    assert "It found what was concealed." in stdout
