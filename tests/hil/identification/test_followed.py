"""Behind the measured motor: a heavy motor keeps springs and dampers of the axis, and follows the measured one."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from foreign_axis import write
from two_mass_axis import TwoMassAxis, columns

import hil
from hil.bench.bench_file import load_bench
from hil.commands.identify import identify
from hil.commands.import_ import import_
from hil.diagnosis.preparation.prepare import prepare
from hil.diagnosis.search.facts import axis_facts
from hil.identification.dataset import Dataset
from hil.identification.followed import _with_heavy_motor, second_encoder
from hil.identification.hypothesis import Hypothesis
from hil.identification.residual_scales import follows
from hil.identification.terms import Term
from hil.recording.recording import read_recording
from hil.twin.axis import TWIN_STEPS
from hil.twin.library import BY_ID
from hil.twin.structure.modal import modal

_TRUE = """schema_version: 1
name: true values
axis:
  model: two_mass
  lead_m: 0.06283185
  motor_mass_kg: 1.0
  table_mass_kg: 14.0
  stiffness_n_m: 6.0e+5
  damping_ratio: 0.2
  coulomb_torque_n_m: 0.04
  viscous_torque_n_m_s_rad: 4.0e-3
control: unknown
encoders:
  motor:
    counts_per_rev: 65536
  table:
    resolution_m: 1.0e-7
mechanisms:
  - effect: table_side_friction
    parameters:
      share: 0.5
  - effect: table_side_viscous_friction
    parameters:
      share: 0.5
"""
AXIS = TwoMassAxis(motor_kg=1.0, load_friction_n=24.0, motor_friction_n=2.0)


@pytest.fixture(scope="module")
def drafted(tmp_path_factory: pytest.TempPathFactory) -> Dataset:
    folder = tmp_path_factory.mktemp("axis")
    (folder / "readme.txt").write_text("Belt axis, 62.832 mm per motor turn. Carriage about 14 kg.\n")
    source = write(folder / "log.csv", columns(AXIS, noise_n_m=0.1))
    import_(source, None, folder / "log.parquet", readme=folder / "readme.txt")
    identify([folder / "log.parquet"], folder / "axis.yaml")
    return prepare([read_recording(folder / "log.parquet")], [], load_bench(folder / "axis.yaml")).train


def test_a_heavy_motor_keeps_spring_and_damper() -> None:
    chain = hil.load_bench("reference").axis.physics().chain
    own, heavy = modal(chain), modal(_with_heavy_motor(chain))
    load = chain.inertia_kg_m2[chain.table, chain.table]
    stiffness = chain.stiffness_n_m_rad[chain.table, chain.table]
    assert heavy.frequency_rad_s[1] == pytest.approx((stiffness / load) ** 0.5, rel=1e-3)
    reduced = load * (1.0 - load / chain.inertia_kg_m2.sum())
    damper = 2.0 * own.damping_ratio[1] * own.frequency_rad_s[1] * reduced
    assert 2.0 * heavy.damping_ratio[1] * heavy.frequency_rad_s[1] * load == pytest.approx(damper, rel=1e-2)


def test_only_springs_with_a_noisy_torque_and_a_fine_encoder_are_judged_so(drafted: Dataset) -> None:
    (run,), observer_s = drafted.runs, drafted.observer_s
    assert follows(run, True, observer_s)
    assert not follows(run, False, observer_s)
    assert not follows(run, True, 2.0 * observer_s)
    assert not follows(replace(run, table_m=np.empty(0)), True, observer_s)


def test_no_torque_is_in_the_second_encoder(drafted: Dataset) -> None:
    (run,), hypothesis = drafted.runs, Hypothesis(drafted.bench)
    other = replace(run, torque=np.zeros_like(run.torque), torque_command=np.zeros_like(run.torque))
    left, without = (second_encoder(hypothesis, one, drafted.observer_s, TWIN_STEPS)["table"] for one in (run, other))
    np.testing.assert_array_equal(left, without)
    driven = [hypothesis.driven(one, drafted.observer_s)["table"] for one in (run, other)]
    assert not np.allclose(*driven)


def test_rows_that_are_far_apart_leave_little_behind_the_motor(tmp_path: Path) -> None:
    """True values and a mode of 33 Hz at rows of 6 ms: a torque that is held for a row left 4 times the noise."""
    axis = TwoMassAxis(motor_kg=1.0, load_friction_n=2.0, load_viscous_n_s_m=30.0, motor_friction_n=2.0)
    rows = {name: column[::3] for name, column in columns(axis, noise_n_m=0.1, scale_mm=1e-4).items()}
    source = write(tmp_path / "log.csv", rows)
    (tmp_path / "bench.yaml").write_text(_TRUE)
    import_(source, None, tmp_path / "log.parquet")
    data = prepare([read_recording(tmp_path / "log.parquet")], [], load_bench(tmp_path / "bench.yaml")).train
    (run,) = data.runs
    assert follows(run, True, data.observer_s)
    left = second_encoder(Hypothesis(data.bench), run, data.observer_s, TWIN_STEPS)["table"][run.evaluated]
    assert float(np.std(left)) < 2.5 * run.noise.table_m


def test_a_light_motor_leaves_little_behind_it(drafted: Dataset) -> None:
    (run,), hypothesis = drafted.runs, Hypothesis(drafted.bench)
    left = second_encoder(hypothesis, run, drafted.observer_s, TWIN_STEPS)["table"][run.evaluated]
    assert float(np.std(left)) < 3.0 * run.noise.table_m


@pytest.mark.parametrize(
    "effect", ["torque_constant_saturation", "torque_saturation", "torque_ripple", "cogging_torque"]
)
def test_what_changes_the_torque_alone_is_not_in_the_second_encoder(drafted: Dataset, effect: str) -> None:
    (run,), hypothesis = drafted.runs, Hypothesis(drafted.bench)
    values = BY_ID[effect].typical_values(axis_facts(drafted.bench, drafted.runs))
    with_term = hypothesis.with_term(Term(effect, 0, values))
    both = (with_term, hypothesis)
    left, without = (second_encoder(one, run, drafted.observer_s, TWIN_STEPS)["table"] for one in both)
    np.testing.assert_allclose(left, without, atol=0.01 * run.noise.table_m)
