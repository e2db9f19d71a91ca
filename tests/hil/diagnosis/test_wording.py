"""Sentences of findings."""

import pytest

from hil.bench.bench_file import load_bench
from hil.diagnosis.result import Location
from hil.diagnosis.turning import of_load
from hil.diagnosis.wording import sentence, where
from hil.identification.terms import Term
from hil.twin.library import LIBRARY


def test_a_negative_delay_is_early() -> None:
    bench = load_bench("reference")
    for delay_s, said in ((-7.45e-6, "7.45 µs early"), (7.45e-6, "7.45 µs late")):
        text = sentence(Term("channel_time_skew", 0, (delay_s,)), bench)
        assert text.startswith(f"The channel table_position is recorded {said}")


@pytest.mark.parametrize("mechanism", [one for one in LIBRARY if one.reversed], ids=lambda one: one.id)
def test_the_sentence_of_a_negative_strength_has_the_same_values(mechanism) -> None:
    values = [0.5 * parameter.high for parameter in mechanism.parameters]
    forwards = sentence(Term(mechanism.id, 0, tuple(values)), load_bench("reference"))
    values[mechanism.strength] *= -1.0
    backwards = sentence(Term(mechanism.id, 0, tuple(values)), load_bench("reference"))
    assert forwards != backwards
    assert len(set(forwards.split()) ^ set(backwards.split())) <= 3
    assert "-" not in backwards


def test_a_negative_strength_of_a_form_with_its_own_sentence_is_below() -> None:
    text = sentence(Term("asymmetric_friction", 1, (-0.5,)), load_bench("reference"))
    assert "it is 0.500 N m below the mean" in text


def test_a_harmonic_far_below_the_largest_is_told_by_its_bound() -> None:
    text = sentence(Term("periodic_lead_error", 0, (7e-6, 0.0, 1e-9, 0.0, 3e-7, 0.0)), load_bench("reference"))
    assert "by 7.00 µm once, less than 0.0700 µm twice and 0.300 µm three times" in text


def test_a_load_that_turns_has_torques_and_speeds_of_its_own() -> None:
    assert of_load("a force of {force_n} acts on the table", True) == "a torque of {force_n} acts on the load"
    assert of_load("force [N]", True) == "torque [N m]"
    assert of_load("torque [N m]", True) == "torque [N m]"
    assert of_load("force [N]", False) == "force [N]"
    found = Location(block="table", element="guideways", channels=(), speed_m_s=(0.5, 2.0))
    assert where(found, turns=True)["speed"] == "0.5 to 2 rad/s"
    assert where(found, turns=False)["speed"] == "30 to 120 m/min"


def test_a_sentence_says_whether_the_measured_torque_shows_an_effect() -> None:
    shown, hidden = (
        sentence(Term("current_loop_lag", variant, (1e-3,)), load_bench("reference")) for variant in (0, 1)
    )
    assert shown.endswith("(the measured torque shows it).")
    assert hidden.endswith("(the measured torque does not show it).")
    gate = sentence(Term("torque_dead_zone", 2, (0.1,)), load_bench("reference"))
    assert gate.endswith("(the measured torque shows it; gate).")
