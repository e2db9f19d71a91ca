"""A ledger: the answers of rules on one candidate, accepted or refuted, with their figures."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Generic, NamedTuple, TypeVar

from hil.identification.terms import Key, Term

Figures = Mapping[str, float | str]
Answer = tuple[bool, Figures]
SHAPE = "shape below the noise"  # name of the rule on what acts below the noise of a row
EXPLAINS = "explains the mismatch"  # name of the rule on all terms together
_M = TypeVar("_M", contravariant=True)


@dataclass(frozen=True)
class Rule(Generic[_M]):
    """One condition of a name.

    `asks` says what holds where it accepts, `refusal` why a mechanism is not named where it refutes; both may name
    figures in braces. `test` is a pure function of measured quantities and the criteria; it returns None where the rule
    does not apply.
    """

    name: str
    asks: str
    refusal: str
    test: Callable[[_M, Any], Answer | None]


class LedgerEntry(NamedTuple):
    """Answer of one rule on one candidate, in words, and its figures."""

    rule: str
    accepted: bool
    text: str
    figures: Figures


Ledger = tuple[LedgerEntry, ...]


@dataclass(frozen=True)
class Considered:
    """A candidate that was fitted, by the key of its term, beside which other terms, and its ledger.

    `added`: the search went on with it.
    """

    key: Key
    beside: tuple[str, ...]
    ledger: Ledger
    added: bool = False

    @classmethod
    def of(cls, terms: Sequence[Term], ledger: Ledger, index: int = -1) -> "Considered":
        """One of the terms of a fit, by default the last."""
        term = terms[index]
        return cls(term.key, tuple(one.effect for one in terms if one is not term), ledger)

    @property
    def accepted(self) -> bool:
        """True if no rule refuted it."""
        return accepted(self.ledger)

    def asked(self, more: Ledger) -> "Considered":
        """The candidate with the answers of further rules; those after a refusal are left out."""
        return replace(self, ledger=(*self.ledger, *more)) if self.accepted else self


def examine(rules: Sequence[Rule[_M]], measured: _M, criteria: Any) -> Ledger:
    """Ask rules in their order, up to the first that refutes: later ones cost simulations."""
    entries = []
    for rule in rules:
        answer = rule.test(measured, criteria)
        if answer is None:
            continue
        accepts, figures = answer
        entries.append(
            LedgerEntry(rule.name, accepts, (rule.asks if accepts else rule.refusal).format(**figures), figures)
        )
        if not accepts:
            break
    return tuple(entries)


def accepted(ledger: Ledger) -> bool:
    """True if no rule refuted."""
    return all(entry.accepted for entry in ledger)


def refusal(ledger: Ledger) -> str:
    """Reason of the rule that refuted; empty if none did."""
    return next((entry.text for entry in ledger if not entry.accepted), "")
