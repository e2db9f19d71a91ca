"""The ledger of evidence: one set of constants, and rules that accept or refute measured quantities."""

from __future__ import annotations

import math
from dataclasses import FrozenInstanceError, fields
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from hil.diagnosis import acceptance
from hil.diagnosis.acceptance import ADDED, COMPARED, EXPLAINED, FORM, HARMLESS, HELD_OUT, RULES, VALUES, promises
from hil.diagnosis.criteria import CRITERIA, Criteria
from hil.diagnosis.ledger import Considered, accepted, examine, refusal
from hil.diagnosis.reproduced import REPRODUCED
from hil.diagnosis.search.addition import Harm
from hil.diagnosis.search.events import InsideWindows
from hil.diagnosis.verdict.reproduction import Reproduced
from hil.identification.residuals import ChannelEnergy

# A new constant needs a sealed draw that improves beyond its interval, or it takes the place of another (CONTRIBUTING).
CONSTANTS = 49
RULE_COUNT = 20

ROOT = Path(acceptance.__file__).parent


def addition(**quantities: Any) -> Any:
    """A term that passes every rule, but for the quantities given."""
    usual = {
        "evidence": 500.0,
        "removed": 0.9,
        "explained": 0.9,
        "log_chance": None,
        "beside": 0,
        "unrepeated": (100.0, 100.0),
        "inside": None,
        "torque": (0.024, 0.02),
        "harm": {},
    }
    return SimpleNamespace(**(usual | quantities))


def test_the_number_of_constants_and_rules_does_not_grow() -> None:
    assert len(fields(Criteria)) <= CONSTANTS
    assert len(RULES) <= RULE_COUNT


def test_criteria_are_frozen_and_each_rule_has_its_own_name() -> None:
    with pytest.raises(FrozenInstanceError):
        CRITERIA.evidence = 1.0  # type: ignore[misc]
    assert len({rule.name for rule in RULES}) == len(RULES)
    assert all(rule.asks and rule.refusal for rule in RULES)


def test_every_constant_of_evidence_is_used() -> None:
    sources = "".join(path.read_text() for path in ROOT.rglob("*.py"))
    unused = [one.name for one in fields(Criteria) if f".{one.name}" not in sources]
    assert unused == []


@pytest.mark.parametrize(
    ("quantities", "rule"),
    [
        ({"evidence": 19.9}, "evidence"),
        ({"evidence": math.nan}, "evidence"),
        ({"removed": 0.039}, "material energy"),
        ({"explained": 0.019}, "share of the mismatch"),
        ({"explained": 0.09, "beside": 2}, "share of the mismatch"),
        ({"log_chance": math.log(0.011), "evidence": 1e6}, "shape below the noise"),
        ({"unrepeated": (106.0, 100.0)}, "repeated laps"),
        ({"torque": (0.026, 0.02)}, "torque"),
        ({"inside": InsideWindows(0.01, 1.0, 5.0, 1.0, False)}, "constant force"),
        ({"inside": InsideWindows(0.001, 1.0, 1.0, 1.0, False, 0.009)}, "constant force"),  # at each acceleration
    ],
)
def test_a_term_is_refuted_by_the_first_rule_that_it_fails(quantities: dict[str, Any], rule: str) -> None:
    ledger = examine(ADDED, addition(**quantities), CRITERIA)
    assert not accepted(ledger)
    assert ledger[-1].rule == rule
    assert refusal(ledger) == ledger[-1].text
    assert all(entry.accepted for entry in ledger[:-1])


@pytest.mark.parametrize(
    "quantities",
    [
        {},
        {"evidence": 20.0},
        {"removed": 0.04},
        {"explained": 0.1, "beside": 2},
        {"explained": None},  # nothing is above the noise
        {"log_chance": math.log(4e-5), "evidence": 0.0, "removed": 0.0},  # the noise of a row says nothing of thousands
        {"unrepeated": (105.0, 100.0)},
        {"inside": InsideWindows(0.2, 1.0, 50.0, 1.0, True)},  # one push may have any form
        {"inside": InsideWindows(0.01, 1.0, 3.9, 1.0, False)},  # as well as outside
        {"inside": InsideWindows(0.002, 1.0, 50.0, 1.0, False)},  # nearly whole
    ],
)
def test_a_term_at_the_bounds_is_accepted(quantities: dict[str, Any]) -> None:
    assert accepted(examine(ADDED, addition(**quantities), CRITERIA))


@given(st.floats(0.0, 1e6), st.floats(0.0, 1e3))
def test_more_evidence_and_energy_never_turn_accepted_into_refuted(evidence: float, removed: float) -> None:
    before, after = (
        accepted(examine(ADDED, addition(evidence=evidence + 10.0 * more, removed=removed + more), CRITERIA))
        for more in (0.0, 1.0)
    )
    assert after or not before


def test_both_rules_on_laps_give_what_differs_without_the_term_over_that_with_it() -> None:
    held_out: Any = SimpleNamespace(gain=None, laps=0.5)
    entries = examine(FORM, addition(unrepeated=(100.0, 50.0)), CRITERIA)[0], examine(HELD_OUT, held_out, CRITERIA)[0]
    assert [entry.figures for entry in entries] == [{"without_over_with": 0.5}] * 2


def test_form_and_values_are_asked_alone_too() -> None:
    assert accepted(examine(FORM, addition(evidence=-1.0), CRITERIA))
    assert not accepted(examine(VALUES, False, CRITERIA))


def test_a_channel_that_pays_is_named() -> None:
    harm = {"motor": Harm(((2.0, 1.0, 3.0),), -20.0, 100.0), "table": Harm(((1.0, 9.0, 9.0),), 100.0, 100.0)}
    (entry,) = examine(HARMLESS, addition(harm=harm), CRITERIA)
    assert not entry.accepted
    assert entry.text == "with it the training recordings are reproduced worse in motor"


@pytest.mark.parametrize(
    ("evidence", "more", "objection", "by_shape", "tied"),
    [
        (9.9, 1.0, "", False, True),
        (500.0, 0.004, "", False, True),
        (500.0, 0.004, "", True, True),  # below the noise it is a share of the torque
        (500.0, 0.006, "", True, False),
        (500.0, float("inf"), "", True, False),  # the torque says nothing
        (10.0, 0.005, "", False, False),
        (-3.0, 0.0, "it is late", False, False),
    ],
)
def test_a_rival_is_tied_or_refuted(evidence: float, more: float, objection: str, by_shape: bool, tied: bool) -> None:
    rival: Any = SimpleNamespace(evidence=evidence, more=more, objection=objection, by_shape=by_shape)
    assert accepted(examine(COMPARED, rival, CRITERIA)) is tied


@pytest.mark.parametrize(
    ("quantities", "rule"),
    [
        ({"gain": -1.0, "acts": True}, "held-out recordings"),
        ({"gain": -11.0}, "held-out recordings"),
        ({"laps": 0.94}, "repeated laps, held out"),
        ({"clear": False}, "strength"),
        ({"quiet": True}, "motion without noise"),
        ({"torque": (0.026, 0.02)}, "torque"),
        ({"torque": (0.016, 0.02), "gain": -11.0}, "held-out recordings"),  # hardly less torque
    ],
)
def test_held_out_recordings_refute(quantities: dict[str, Any], rule: str) -> None:
    usual = {
        "gain": None,
        "acts": False,
        "laps": None,
        "clear": True,
        "quiet": False,
        "torque": (0.024, 0.02),
        "harm": {},
    }
    passing: Any = SimpleNamespace(**usual)
    assert accepted(examine(HELD_OUT, passing, CRITERIA))
    refuted: Any = SimpleNamespace(**(usual | quantities))
    assert examine(HELD_OUT, refuted, CRITERIA)[-1].rule == rule


def test_less_torque_held_out_outweighs_the_position() -> None:
    usual = {"laps": None, "clear": True, "quiet": False, "harm": {}, "acts": True, "gain": -200.0}
    term: Any = SimpleNamespace(**usual, torque=(0.30, 0.81))
    assert accepted(examine(HELD_OUT, term, CRITERIA))


def test_open_inputs_leave_something_beside_a_right_name() -> None:
    measured = {"left": 0.3, "above": 4.0, "open_inputs": False, "at_floor": False, "told": 0.3, "below_noise": False}
    closed: Any = SimpleNamespace(**measured)
    opened: Any = SimpleNamespace(**(measured | {"open_inputs": True}))
    assert not accepted(examine(EXPLAINED, closed, CRITERIA))
    assert accepted(examine(EXPLAINED, opened, CRITERIA))


@pytest.mark.parametrize(("left", "told", "stands"), [(0.96, 0.0, True), (0.96, 0.96, False), (1.0, 0.0, False)])
def test_noise_of_any_colour_beside_a_name_that_explains_something_is_no_mismatch(
    left: float, told: float, stands: bool
) -> None:
    of = {"left": left, "told": told, "above": 20.0, "open_inputs": False, "at_floor": False, "below_noise": False}
    above: Any = SimpleNamespace(**of)
    assert accepted(examine(EXPLAINED, above, CRITERIA)) is stands
    below: Any = SimpleNamespace(**(of | {"below_noise": True}))  # the energy of a row says nothing of its terms
    assert accepted(examine(EXPLAINED, below, CRITERIA))


def test_a_score_must_promise_evidence_and_energy() -> None:
    rows = 1000
    share = 1.0 - math.exp(-CRITERIA.evidence / rows)

    def promised(share: float, energy: float, noise: float = 1000.0) -> bool:
        channels = {"table": ChannelEnergy(energy, rows, noise), "motor": ChannelEnergy(1e9, rows, 1000.0)}
        return promises({"table": share, "motor": 0.0}, channels)

    assert promised(1.01 * share, 1e6)
    assert not promised(0.99 * share, 1e6)
    assert not promised(1.01 * share, CRITERIA.material_alone * rows)
    assert promised(1.01 * share, CRITERIA.material_alone * rows, 0.01 * rows)  # the noise is an upper bound


@pytest.mark.parametrize(
    ("quantities", "rule"),
    [
        ({"worst": 1.6}, "within the noise"),
        ({"worst": 9.1, "noisy": True}, "within the noise"),
        ({"held_out": 4.1}, "within the noise, held out"),
        ({"held_out": 9.1, "noisy": True}, "within the noise, held out"),
        ({"structure": "over the speed"}, "structure"),
        ({"torque": (0.026, 0.02)}, "plain model"),
    ],
)
def test_a_twin_that_leaves_something_reproduces_nothing(quantities: dict[str, Any], rule: str) -> None:
    usual = {"worst": 1.5, "noisy": False, "held_out": 3.9, "structure": "", "torque": (0.024, 0.02)}
    assert accepted(examine(REPRODUCED, Reproduced(**usual), CRITERIA))
    coloured = usual | {"worst": 8.9, "noisy": True, "held_out": 8.9}
    assert accepted(examine(REPRODUCED, Reproduced(**coloured), CRITERIA))
    assert examine(REPRODUCED, Reproduced(**(usual | quantities)), CRITERIA)[-1].rule == rule


def test_answers_after_a_refusal_are_left_out() -> None:
    passed, failed = (examine(ADDED, addition(evidence=value), CRITERIA) for value in (500.0, 1.0))
    one = Considered(("any", 0, 0), (), passed)
    assert one.asked(failed).ledger == (*passed, *failed)
    assert one.asked(failed).asked(passed).ledger == (*passed, *failed)
