"""The control section of a bench file: units, and what is unknown."""

from __future__ import annotations

from pathlib import Path

import pytest
from diagnosis_runs import bench, recorded

from hil.bench.bench_file import load_bench
from hil.bench.control_section import Control
from hil.errors import InputError
from hil.identification.compare import compare


def test_the_section_keeps_its_units() -> None:
    control = Control(
        position_gain_1_s=10.0, velocity_gain_ma_rpm=2.0, torque_constant_n_m_a=0.5, velocity_integral_time_ms=6.0
    )
    gains = control.gains(1e-3)
    halved = gains._replace(velocity_gain_n_m_s_rad=0.5 * gains.velocity_gain_n_m_s_rad)
    learnt = control.with_gains(halved)
    assert learnt.velocity_gain_ma_rpm == pytest.approx(1.0)
    assert learnt.velocity_integral_time_ms == pytest.approx(3.0)
    assert learnt.gains(1e-3) == pytest.approx(halved)


@pytest.mark.parametrize(
    "control", ["", "control: unknown\n", "control: {position_gain_1_s: 36.84, velocity_gain_n_m_s_rad: unknown}\n"]
)
def test_a_bench_file_says_what_is_unknown(tmp_path: Path, control: str) -> None:
    path = tmp_path / "axis.yaml"
    axis = (
        "model: rigid\n  mass_kg: 700.0\n  lead_m: 0.01\n  coulomb_torque_n_m: 1.0\n  viscous_torque_n_m_s_rad: 0.006\n"
    )
    path.write_text(f"axis:\n  {axis}{control}encoders: {{table: null}}\n")
    found = load_bench(path)
    assert not found.law_known
    assert found.sampled(0.002).gains.period_s == 0.002
    assert not compare(recorded(bench(), times=4), found).channels  # block by block only


def test_a_mistyped_key_beside_an_unknown_value_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "axis.yaml"
    path.write_text(
        "lead_m: 0.01\nmass_kg: 700.0\ncoulomb_torque_n_m: 1.0\nviscous_torque_n_m_s_rad: 0.006\n"
        "control:\n  position_gain_1_s: unknown\n  torque_limit: 12\n"
    )
    with pytest.raises(InputError, match=r"axis\.yaml:7: control\.torque_limit: given an unknown key"):
        load_bench(path)
