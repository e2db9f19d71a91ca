"""Coordinates of a hypothesis: their scale, their steps, and the values of mechanisms that the bench knows."""

from __future__ import annotations

import numpy as np
import pytest
from diagnosis_runs import bench, dataset, recorded

from hil.bench.bench_file import MechanismEntry, load_bench
from hil.bench.control_section import UnknownControl
from hil.identification.coordinates import CHATTER_STEP, LAST_EDGE_STEP_S
from hil.identification.hypothesis import Hypothesis
from hil.identification.measured import take
from hil.identification.nominal_fit import fit_nominal
from hil.identification.terms import Term

OWNER = bench()
LOAD = Term("constant_load", 0, (0.3,))


def test_another_scale_of_the_coordinates_changes_no_residual() -> None:
    """Terms are started at 0.05 N m and 200 us and moved away from there; then they are scaled by their values."""
    data = dataset([take(recorded(OWNER, LOAD), OWNER)], OWNER)
    terms = (Term("constant_load", 0, (0.05,)), Term("current_loop_lag", 0, (2e-4,)))
    start = Hypothesis(OWNER, terms)
    moved = start.moved(start.x + 0.3)
    assert moved.rebased.values == pytest.approx(moved.values)
    np.testing.assert_allclose(moved.rebased.residuals(data).vector, moved.residuals(data).vector, atol=1e-6)
    assert moved.without(0).values == pytest.approx([*moved.values[: moved.nominal_count], moved.values[-1]])
    assert moved.with_term(Term("backlash", 0, (3e-6,))).without(2).values == moved.values


def test_values_of_known_mechanisms_are_fitted_and_numbered() -> None:
    """Two of one effect: the second one's values have its number; an event is not fitted."""
    entries = (
        MechanismEntry(effect="periodic_lead_error", parameters={"amplitude_m": 3e-6, "phase_rad": 0.1}),
        MechanismEntry(
            effect="cogging_torque", parameters={"amplitude_n_m": 0.1, "cycles_per_rev": 6.0, "phase_rad": 0.0}
        ),
        MechanismEntry(
            effect="cogging_torque", parameters={"amplitude_n_m": 0.2, "cycles_per_rev": 12.0, "phase_rad": 0.0}
        ),
        MechanismEntry(effect="external_force", parameters={"force_n": 5.0, "start_s": 1.0, "end_s": 2.0}),
    )
    hypothesis = Hypothesis(OWNER.model_copy(update={"mechanisms": entries}))
    known = hypothesis.nominal[len(OWNER.axis.NOMINAL) :]
    assert {"cogging_torque.amplitude_n_m", "cogging_torque_2.amplitude_n_m"} <= set(known)
    assert len(known) == 8
    assert hypothesis.values == pytest.approx(hypothesis.bench_values)
    names = list(hypothesis.nominal)
    x = hypothesis.x.copy()
    x[names.index("cogging_torque_2.amplitude_n_m")] *= 1.5
    changed = hypothesis.moved(x).resolved.bench.mechanisms
    assert changed[2].parameters["amplitude_n_m"] == pytest.approx(0.3)
    assert [one.active() for one in (*changed[:2], changed[3])] == [one.active() for one in (*entries[:2], entries[3])]


@pytest.mark.parametrize("held", [("table_mass_kg",), OWNER.axis.NOMINAL[1:]])
def test_values_that_the_owner_holds_are_not_refitted(held: tuple[str, ...]) -> None:
    """The others take up what the bench has wrong."""
    wrong = {"table_mass_kg": 1.1 * OWNER.axis.table_mass_kg, "held": held}
    owner = OWNER.model_copy(update={"axis": OWNER.axis.model_copy(update=wrong)})
    found = fit_nominal(dataset([take(recorded(OWNER, LOAD), owner)], owner))
    assert {one.name for one in found.parameters} == set(OWNER.axis.NOMINAL) - set(held)
    assert all(getattr(found.bench.axis, name) == getattr(owner.axis, name) for name in held)


def test_differences_are_wide_where_a_nut_may_chatter() -> None:
    owner = load_bench("reference_7dof")
    plain = Hypothesis(owner).steps(0.1, 20.0, LAST_EDGE_STEP_S)
    loose = Hypothesis(owner, (Term("backlash", 0, (4e-6,)),)).steps(0.1, 20.0, LAST_EDGE_STEP_S)
    assert plain.max() < CHATTER_STEP
    assert np.all(loose[: plain.size] == CHATTER_STEP)


@pytest.mark.parametrize("given_s", [0.0, 2e-4])
def test_a_delay_of_the_torque_that_the_bench_file_does_not_give_is_of_the_recordings(given_s: float) -> None:
    """One that it gives is a parameter like the others."""
    control = UnknownControl(law="unknown", velocity_period_s=OWNER.period_s, torque_delay_s=given_s)
    start = Hypothesis(OWNER.model_copy(update={"control": control}), (LOAD,))
    fitted = start.moved(start.x + 0.2)
    given, file = (dict(zip(start.nominal, one.values, strict=False)) for one in (fitted.given, start))
    assert given.pop("torque_delay_s") == pytest.approx(given_s or 0.2 * OWNER.period_s)
    assert given == pytest.approx({name: file[name] for name in given})
    assert fitted.given.terms == fitted.terms


@pytest.mark.parametrize("times", [1e-2, 1e4])
def test_friction_that_the_bench_leaves_out_has_a_step_in_every_unit_of_the_torque(times: float) -> None:
    """Torque in per cent of the rated, or in N m: the friction of a step is that many times the other."""
    without = OWNER.axis.model_copy(update={"coulomb_torque_n_m": 0.0, "viscous_torque_n_m_s_rad": 0.0})
    masses = {name: times * getattr(without, name) for name in without.MASSES}

    def steps(axis: object) -> list[float]:
        start = Hypothesis(OWNER.model_copy(update={"axis": axis}))
        sizes = zip(start.coordinates, start.steps(0.1, 4.0, LAST_EDGE_STEP_S), strict=True)
        return [one.value(one.x(0.0) + step) for one, step in sizes if one.left_out]

    two = steps(without)
    assert len(two) == 2
    assert steps(without.model_copy(update=masses)) == pytest.approx([times * one for one in two])
