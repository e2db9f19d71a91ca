"""A bench file is refused where it contradicts itself or where a value is in the wrong unit."""

from __future__ import annotations

from pathlib import Path

import pytest

from hil.bench.axis_models import TwoMass
from hil.bench.bench_file import load_bench
from hil.errors import InputError
from hil.files.shipped import shipped_files

CHAIN = """\
lead_m: 0.01
inertias_kg_m2: [4.0e-4, 1.0e-4, 8.0e-4]
stiffnesses_n_m_rad: [4.0e+3]
coulomb_torque_n_m: 1.1
viscous_torque_n_m_s_rad: 0.0064
control: {position_gain_1_s: 36.84, velocity_gain_n_m_s_rad: 0.27}
"""


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("lead_m: 0.010", "lead_m: 10", r"axis.lead_m: given 10, allowed less than or equal to 1 "),
        ("position_period_s: 0.004", "position_period_s: 4", r"control.position_period_s: given 4, allowed .* 0.1 "),
        (
            "lead_m: 0.010",
            "held: [lead_m]\n  lead_m: 0.010",
            r"axis.held: given lead_m, allowed motor_mass_kg, table_mass_kg",
        ),
        ("lead_m: 0.010", f"held: [{', '.join(TwoMass.NOMINAL)}]\n  lead_m: 0.010", r"axis.held: given every key"),
        ("{resolution_m: 0.5e-6}", "{resolution_m: 0.5}", r"encoders.table.resolution_m: given 0.5, allowed .* 0.001 "),
    ],
)
def test_a_value_that_cannot_be_is_refused(tmp_path: Path, old: str, new: str, message: str) -> None:
    text = shipped_files("bench")["reference"].read_text()
    assert old in text
    path = tmp_path / "bench.yaml"
    path.write_text(text.replace(old, new))
    with pytest.raises(InputError, match=rf"bench\.yaml:\d+: {message}"):
        load_bench(path)


def test_feedback_needs_its_encoder(tmp_path: Path) -> None:
    text = shipped_files("bench")["reference"].read_text()
    path = tmp_path / "bench.yaml"
    path.write_text(text.replace("encoders:", "  position_feedback: table\nencoders:"))
    assert load_bench(path).gains.position_from_table
    path.write_text(path.read_text().replace("{resolution_m: 0.5e-6}", "null"))
    with pytest.raises(InputError, match=r"control.position_feedback: given table, allowed motor"):
        load_bench(path)


def test_a_chain_has_one_spring_less_than_inertias(tmp_path: Path) -> None:
    path = tmp_path / "chain.yaml"
    path.write_text(CHAIN)
    with pytest.raises(InputError, match=r"chain\.yaml:3: stiffnesses_n_m_rad: given 1 values, allowed 2"):
        load_bench(path)
    path.write_text(CHAIN.replace("[4.0e+3]", "[4.0e+3, 140.0]"))
    assert load_bench(path).axis.model == "serial_chain"


def test_a_mechanism_acts_no_more_often_than_it_may(tmp_path: Path) -> None:
    entry = "\n  - {effect: cogging_torque, parameters: {amplitude_n_m: 0.1, cycles_per_rev: %d, phase_rad: 0.0}}"
    text = shipped_files("bench")["reference"].read_text()
    path = tmp_path / "bench.yaml"
    path.write_text(text + "\nmechanisms:" + "".join(entry % order for order in (6, 12, 24, 36)))
    assert len(load_bench(path).twin().active) == 4
    path.write_text(path.read_text() + entry % 18)
    with pytest.raises(InputError, match=r"mechanisms: given cogging_torque 5 times, allowed 4"):
        load_bench(path)
