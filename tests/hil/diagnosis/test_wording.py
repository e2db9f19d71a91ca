"""Sentences of findings."""

import pytest
from example_result import EXAMPLE

from hil.bench.bench_file import load_bench
from hil.diagnosis.result import AT_FLOOR, Location, Result
from hil.diagnosis.sentence import sentence
from hil.diagnosis.statement import explained, statement
from hil.diagnosis.turning import of_load
from hil.diagnosis.wording import spoken, wave, where
from hil.identification.terms import Term
from hil.twin.library import LIBRARY


def test_a_negative_delay_is_early() -> None:
    bench = load_bench("reference")
    for delay_s, said in ((-7.45e-6, "7.45 µs early"), (7.45e-6, "7.45 µs late")):
        text = sentence(Term("channel_time_skew", 0, (delay_s,)), bench)
        assert text.startswith(f"The channel table_position is recorded {said}")


@pytest.mark.parametrize("mechanism", [one for one in LIBRARY if one.text.reversed], ids=lambda one: one.id)
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
    far, near = (found.model_copy(update={"position_m": one}) for one in ((288.62, 304.6), (0.0662, 0.0756)))
    assert where(far, turns=True)["position"] == "288.6 to 304.6 rad"
    assert where(near, turns=False)["position"] == "66.20 to 75.60 mm"


def test_a_sentence_says_whether_the_measured_torque_shows_an_effect() -> None:
    shown, hidden = (
        sentence(Term("current_loop_lag", variant, (1e-3,)), load_bench("reference")) for variant in (0, 1)
    )
    assert shown.endswith("(the measured torque shows it).")
    assert hidden.endswith("(the measured torque does not show it).")
    gate = sentence(Term("torque_dead_zone", 2, (0.1,)), load_bench("reference"))
    assert gate.endswith("(the measured torque shows it; gate).")


def test_values_of_a_motor_driven_by_its_voltage_are_volts() -> None:
    text = sentence(Term("torque_dead_zone", 0, (0.347,)), load_bench("dc_motor"))
    assert "below 0.347 V" in text


def test_times_of_a_window_have_two_decimals_early_and_late() -> None:
    text = sentence(Term("external_force", 0, (45.0, 6.2, 13.125)), load_bench("emps"))
    assert "From 6.20 s to 13.12 s" in text


def test_a_rotary_load_is_counted_in_radians() -> None:
    assert of_load("5 µm too far for each metre of travel", True) == "5 µrad too far for each radian of travel"
    assert of_load("ball screw, nut and linear encoder", True) == "gear, coupling and load encoder"


@pytest.mark.parametrize(
    ("nominal", "value", "unit", "said"),
    [
        (335.0, 301.5, "kg", "x -10.0 %"),
        (0.02, -0.0001, "rad", "x -0.100 mrad instead of 20.0 mrad"),
        (-0.5, 0.25, "N m", "x 0.250 N m instead of -0.500 N m"),
        (0.0, 0.25, "N m", "x 0.250 N m instead of 0.00 mN m"),
    ],
)
def test_a_change_is_a_share_only_where_a_ratio_says_something(
    nominal: float, value: float, unit: str, said: str
) -> None:
    correction = {"nominal": nominal, "value": value, "std": 1e-6, "unit": unit}
    result = Result.model_validate(
        {**EXAMPLE, "verdict": "parameter_error", "parameter_corrections": {"x": correction}, "not_testable": ()}
    )
    assert statement(result) == f"No physics is missing; parameters of the bench file are wrong: {said}."


def finding(effect: str, confidence: float, sentence: str) -> dict[str, object]:
    found = {"effect": effect, "confidence": confidence, "sentence": sentence, "equivalents": ()}
    return EXAMPLE["missing"][0] | found


FLOOR = {"description": AT_FLOOR, "share": 0.0}


def test_the_statement_says_what_is_sure_and_mentions_what_may_be() -> None:
    found = (
        finding("cogging_torque", 0.95, "The motor cogs."),
        finding("torque_ripple", 0.3, "The torque ripples."),
        finding("end_stop", 0.25, "There is a stop."),
        finding("gravity_torque", 0.1, "Gravity pulls."),
    )
    result = Result.model_validate(EXAMPLE | {"missing": found, "unexplained": FLOOR})
    assert statement(result) == (
        "Missing physics: The motor cogs. Perhaps also torque ripple (30.0 %) and end stop (25.0 %). "
        "With it the residual of the torque on held-out recordings falls from 80.0 mN m rms to its noise."
    )
    assert explained(result)


def test_a_residual_above_its_noise_is_told_with_it_and_is_not_explained() -> None:
    figures = {"before_rms": 0.08, "after_rms": 0.03, "noise_floor_rms": 0.01, "owner_rms": 0.2}
    fit = {"torque_n_m": EXAMPLE["fit"]["torque_n_m"] | {"train": figures, "validate": figures}}
    left = {"description": "Residuals above the noise (rms): torque 3.00 times.", "share": 0.1}
    result = Result.model_validate(EXAMPLE | {"fit": fit, "unexplained": left})
    assert statement(result).endswith(
        "falls from 80.0 mN m to 30.0 mN m rms; its noise is 10.0 mN m. "
        "Not explained: residuals above the noise (rms): torque 3.00 times."
    )
    assert not explained(result)


def test_a_finding_that_is_not_likely_is_called_doubtful() -> None:
    result = Result.model_validate(EXAMPLE | {"missing": (finding("end_stop", 0.2, "There is a stop."),)})
    assert statement(result).startswith(
        "Missing physics, doubtful by its confidence (20.0 %): There is a stop. With it"
    )


@pytest.mark.parametrize(
    ("channel", "words"),
    [
        ("motor_position_rad", "motor position"),
        ("torque_command_n_m", "torque command"),
        ("table_position_m", "table position"),
        ("force_n", "force"),
    ],
)
def test_a_channel_is_named_without_its_unit(channel: str, words: str) -> None:
    assert spoken(channel) == words


def test_what_turns_slower_than_the_motor_repeats_once_in_some_revolutions() -> None:
    assert wave(12.0, load_bench("reference"), 1e-3) == "12.0 times per revolution"
    assert wave(0.497, load_bench("reference"), 2e-3) == "once in 2.01 revolutions"
