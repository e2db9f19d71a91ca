"""Explanations beside the named one: the same chance for each, and what is said of those that are not named."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from diagnosis_runs import bench, dataset, fitted, recorded

from hil.bench.bench_file import Bench
from hil.channels import AxisKind
from hil.diagnosis.diagnose import diagnose
from hil.diagnosis.search import rivals
from hil.diagnosis.search.addition import Addition
from hil.diagnosis.search.next_term import Round, first_standing
from hil.diagnosis.search.rivals import RivalFit, chosen
from hil.diagnosis.verdict.findings import rival_in_words
from hil.identification.hypothesis import Hypothesis
from hil.identification.inference import bic_gain, bic_margin
from hil.identification.measured import take
from hil.identification.terms import Term
from hil.recording.recording import Recording

PERIOD_S, STEPS, DEAD_TICKS = 1e-3, 10, 3
MASS_KG, COULOMB_N, VISCOUS_N_S_M = 45.0, 80.0, 120.0
GANTRY = Bench.model_validate(
    {
        "schema_version": 1,
        "name": "gantry",
        "axis": {
            "model": "one_mass",
            "mass_kg": 43.0,
            "coulomb_force_n": 84.0,
            "viscous_force_n_s_m": 130.0,
        },
        "control": "unknown",
        "encoders": {"motor": {"resolution_m": 1e-6}, "table": None},
    }
)


def late_drive() -> Recording:
    """A stage whose drive has a dead time of three periods; the noise of its encoder is in the force command."""
    rng, step_s = np.random.default_rng(5), PERIOD_S / STEPS
    time_s = np.arange(6000) * PERIOD_S
    wanted = 0.1 * (1.0 - np.cos(2.0 * math.pi * time_s / 3.0))
    feed = np.gradient(wanted, PERIOD_S)
    position = speed = integral = filtered = before = 0.0
    waiting, rows = [0.0] * DEAD_TICKS, []
    for place, ahead in zip(wanted, feed, strict=True):
        read = round((position + rng.normal(0.0, 3e-7)) / 1e-6) * 1e-6
        filtered += 0.5 * ((read - before) / PERIOD_S - filtered)
        before = read
        error = 25.0 * (place - read) + ahead - filtered
        integral += 54000.0 * PERIOD_S * error
        waiting.append(4500.0 * error + integral)
        force = waiting.pop(0)
        rows.append((read, waiting[-1], force + rng.normal(0.0, 3.0)))
        for _ in range(STEPS):
            speed += (force - VISCOUS_N_S_M * speed) / MASS_KG * step_s
            speed = math.copysign(max(abs(speed) - COULOMB_N / MASS_KG * step_s, 0.0), speed)
            position += speed * step_s
    columns = dict(zip(("motor_position_m", "force_command_n", "force_n"), np.array(rows).T, strict=True))
    return Recording(name="gantry", period_s=PERIOD_S, columns=columns)


def test_a_dead_time_of_several_periods_is_not_taken_for_a_lag() -> None:
    """A fit from a fraction of a period ends at the first of the minima, one at each period."""
    (found,) = diagnose([late_drive()], [], GANTRY).result.missing
    # this slow motion does not tell whether the force or only its record is late
    assert {found.effect, *found.equivalents} == {"transport_delay", "channel_time_skew"}
    assert found.parameters["delay_s"].value == pytest.approx(DEAD_TICKS * PERIOD_S, abs=2e-4)
    lag = next(one for one in found.rivals if one.effect == "current_loop_lag")
    assert "in its place" in lag.evidence


OWNER = bench()
LOAD, OTHER = Term("constant_load", 0, (0.4,)), Term("friction_gradient", 0, (0.3,))


def test_evidence_is_on_the_side_of_the_fit_with_less_cost() -> None:
    data = dataset([take(recorded(OWNER, LOAD), OWNER)], OWNER)
    right, wrong = (fitted(Hypothesis(OWNER, (term,)), data, evaluations=4) for term in (LOAD, OTHER))
    assert bic_margin(right, wrong) == bic_gain(right, wrong) > 0.0
    assert bic_margin(wrong, right) == -bic_margin(right, wrong)


def test_what_explains_more_is_named_unless_there_is_an_objection(monkeypatch: pytest.MonkeyPatch) -> None:
    data = dataset([take(recorded(OWNER, LOAD), OWNER)], OWNER)
    base = fitted(Hypothesis(OWNER), data, evaluations=4)
    fits = [fitted(Hypothesis(OWNER, (term,)), data, evaluations=8) for term in (LOAD, OTHER)]
    search = Round(base, base, base)
    right, wrong = map(search.addition, fits)
    choice = chosen(wrong, [right, wrong], search)
    assert choice.named.fit.terms[-1].effect == LOAD.effect
    (rival,) = choice.rivals
    assert rival.terms[-1].effect == OTHER.effect
    assert rival.evidence > 0.0
    assert not rival.tied
    assert [(one.effect, one.accepted) for one in choice.considered] == [(LOAD.effect, True), (OTHER.effect, False)]

    monkeypatch.setattr(rivals, "first_standing", lambda additions: additions[-1])
    monkeypatch.setattr(
        rivals, "objection", lambda one, *_: "it is excluded" if one.fit.terms[-1].effect != OTHER.effect else ""
    )
    choice = chosen(wrong, [right, wrong], search)
    assert choice.named.fit.terms[-1].effect == OTHER.effect
    (rival,) = choice.rivals
    assert rival.evidence < 0.0
    assert rival.objection == "it is excluded"
    assert not rival.tied
    assert choice.considered[1].ledger[-1].text == "it is excluded"


def explained(cost: float, motor: float, table: float) -> Any:
    """Stand-in for a fit: its cost, and the mean squares of motor and table residuals over their noise."""
    run = SimpleNamespace(motor=np.zeros(1000), evaluated=slice(None), kind=AxisKind.ROTARY)
    data = SimpleNamespace(runs=(run,))
    ratios = ({"motor": motor, "table": table},)
    return SimpleNamespace(cost=cost, rows=2000, excess=0.0, terms=(), data=data, noise_ratios=ratios, bench=OWNER)


def test_a_little_harm_does_not_set_aside_what_explains_nearly_all(monkeypatch: pytest.MonkeyPatch) -> None:
    """An eccentric pulley explained nine tenths of what play left, and a third more remained in the motor."""
    for name, value in {"evidence": 1000.0, "gain": 1e6, "unrepeated": (0.0, 0.0), "inside": None}.items():
        monkeypatch.setattr(Addition, name, value)
    search = Round(base := explained(5e5, 12.0, 1000.0), base, explained(6e5, 16.0, 1100.0))
    most, play = (search.addition(fit) for fit in (explained(4e4, 16.0, 75.0), explained(3e5, 6.0, 60.0)))
    assert first_standing([most, play]) is most
    below = search.addition(explained(4e4, 25.0, 75.0))  # worse than by the bench file
    assert first_standing([below, play]) is play


@pytest.mark.parametrize(
    ("rival", "said"),
    [
        (
            {"evidence": 10628.0, "more": 0.2},
            "leaves residuals of 0.900 × the noise (rms), backlash in its place 0.800 ×; evidence against it 10628",
        ),
        ({"evidence": -881.0, "objection": "it is excluded"}, "evidence for it 881, where 10 is very strong, but it"),
        ({"evidence": -881.0, "behind": "it has more parameters"}, "evidence for it 881, where 10 is very strong, but"),
        ({"evidence": 1114.0, "more": 0.001}, "evidence against it 1114, where 10 is very strong, but the difference"),
        ({"evidence": 3.0}, "not distinguishable from backlash by this motion: leaves residuals of 0.900 ×"),
    ],
)
def test_the_sentence_says_what_decides(rival: dict[str, Any], said: str) -> None:
    other = RivalFit((Term("preload_loss", 0, (1e-5, 0.4)),), 0.81, named=0.64, **rival)
    assert said in rival_in_words(other, Term("backlash", 0, (1e-5,)))
    assert other.tied == (not other.objection and (other.evidence < 10.0 or other.more < 0.005))
