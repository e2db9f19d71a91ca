"""Behind the measured motor: a heavy motor keeps springs and dampers of the axis, and follows the measured one."""

from __future__ import annotations

from dataclasses import replace

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
from hil.twin.library import BY_ID
from hil.twin.structure.modal import modal

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
    left, without = (second_encoder(hypothesis, one, drafted.observer_s, False)["table"] for one in (run, other))
    np.testing.assert_array_equal(left, without)
    driven = [hypothesis.driven(one, drafted.observer_s)["table"] for one in (run, other)]
    assert not np.allclose(*driven)


def test_a_light_motor_leaves_little_behind_it(drafted: Dataset) -> None:
    (run,), hypothesis = drafted.runs, Hypothesis(drafted.bench)
    left = second_encoder(hypothesis, run, drafted.observer_s, False)["table"][run.evaluated]
    assert float(np.std(left)) < 3.0 * run.noise.table_m


@pytest.mark.parametrize(
    "effect", ["torque_constant_saturation", "torque_saturation", "torque_ripple", "cogging_torque"]
)
def test_what_changes_the_torque_alone_is_not_in_the_second_encoder(drafted: Dataset, effect: str) -> None:
    (run,), hypothesis = drafted.runs, Hypothesis(drafted.bench)
    values = BY_ID[effect].typical_values(axis_facts(drafted.bench, drafted.runs))
    with_term = hypothesis.with_term(Term(effect, 0, values))
    left, without = (second_encoder(one, run, drafted.observer_s, False)["table"] for one in (with_term, hypothesis))
    np.testing.assert_allclose(left, without, atol=0.01 * run.noise.table_m)
