"""A value in a sentence is rounded by its error; one within its error is not told as a fact."""

from __future__ import annotations

import pytest

from hil.bench.bench_file import load_bench
from hil.diagnosis.sentence import TermErrors, sentence
from hil.identification.terms import Term
from hil.quantities import known_quantity


def said(effect: str, values: tuple[float, ...], errors: tuple[float, ...], strength: float = 0.0) -> str:
    return sentence(Term(effect, 0, values), load_bench("reference"), TermErrors(errors, strength or errors[0]))


@pytest.mark.parametrize(
    ("value", "error", "unit", "text"),
    [
        (0.776e-3, 0.11e-3, "rad", "0.8 mrad"),
        (36.0, 34.0, "s", "40 s"),
        (1.6808, 0.4, "N", "1.7 N"),
        (-3.752e-3, 0.217e-3, "s", "-3.8 ms"),
        (6.82e-6, 1e-9, "m", "6.82 µm"),
        (6.82e-6, 0.0, "m", "6.82 µm"),
        (0.0, 1.0, "s", "0.00 µs"),
        (0.999, 0.01, "s", "1000 ms"),
    ],
)
def test_a_quantity_is_rounded_at_the_first_digit_of_its_error(
    value: float, error: float, unit: str, text: str
) -> None:
    assert known_quantity(value, error, unit) == text


def test_a_sentence_rounds_its_values_by_their_errors() -> None:
    told = said("encoder_eccentricity", (0.7755e-3, -2.216), (0.111e-3, 0.09))
    assert "it errs by 0.8 mrad once per revolution" in told


def test_a_growth_that_goes_on_beyond_the_recording_is_told_by_its_rate() -> None:
    """0.0149 % within 662 s, +-0.33 % and +-14984 s, in a recording of 58 s: only the rate is known."""
    told = said("thermal_growth", (1.49e-4, 662.0), (3.3e-3, 14984.0, 0.1), strength=1.5e-5)
    assert told == (
        "The screw grows by 0.0014 % of its length per minute while it is recorded; where it ends is not told."
    )
    whole = said("thermal_growth", (1.49e-4, 20.0), (1e-6, 0.5, 0.1))
    assert whole == "The screw grows by 0.0149 % of its length as it warms up, within about 20.0 s."


def test_a_value_within_its_error_is_not_told() -> None:
    told = said("local_friction", (0.0722, 0.2145, 0.2406, 0.002), (0.0326, 1e-4, 1e-4, 0.004))
    assert "friction is higher by a share of 7 %" in told
    assert "it changes over a length that is not told at either end" in told


def test_a_value_at_its_bound_is_told_as_a_bound() -> None:
    told = said("local_friction", (0.0722, 0.2145, 0.2406, 0.001), (0.0326, 1e-4, 1e-4, 1e-9))
    assert "it changes over at most 1.00 mm at either end" in told


def test_a_strength_within_its_error_has_it_beside_it() -> None:
    assert "0.50 ± 0.90 N m" in said("constant_load", (0.5,), (0.9,))


def test_a_repetition_is_rounded_by_its_error() -> None:
    assert "71.5 times per revolution" in said("cogging_torque", (0.0116, 71.46, 0.0), (1e-4, 0.1, 0.1))


def test_a_harmonic_within_its_error_is_told_by_a_bound() -> None:
    values, errors = (11e-6, 0.3, 124e-6, 0.1, 6.8e-6, 0.2), (12e-6, 1.0, 8e-6, 0.1, 6.9e-6, 1.0)
    told = said("periodic_lead_error", values, errors)
    assert "by less than 23.0 µm once, 124 µm twice and less than 13.7 µm three times" in told
