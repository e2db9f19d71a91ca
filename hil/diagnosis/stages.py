"""Stages of a diagnosis as values, each made by one function of the one before:

    Prepared  -> Searched   -> Tested                 -> Judged        -> Reported
    prepare      search        test_on_held_out          judge            report

`hil.diagnosis.diagnose` calls them in this order.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from hil.bench.bench_file import Bench
    from hil.diagnosis.experiment import Experiment
    from hil.diagnosis.ledger import Considered
    from hil.diagnosis.preparation.usable_law import LawCheck
    from hil.diagnosis.result import Result, Verdict
    from hil.diagnosis.search.rivals import RivalFit
    from hil.diagnosis.structure_left import Dependence
    from hil.diagnosis.verdict.cross_validation import CrossValidation
    from hil.diagnosis.verdict.each_alone import Change
    from hil.diagnosis.verdict.unnamed import UnnamedTerm
    from hil.identification.dataset import Dataset
    from hil.identification.estimator import Fit
    from hil.identification.honest_refit import Refit
    from hil.identification.terms import Key, Term
    from hil.twin.axis import Steps

Progress = Callable[[str], None]


@dataclass(frozen=True, eq=False)
class Prepared:
    """Data sets for training and validation, and the bench that they are compared with.

    `bench` has the control law that may be used, and no encoder that was not recorded; `bench_file` is the bench as
    given.
    """

    train: Dataset
    held_out: Dataset  # without runs if nothing was held out
    bench: Bench
    bench_file: Bench
    law: LawCheck
    notes: tuple[str, ...] = ()
    told: Mapping[str, float] = field(default_factory=dict)  # values of the axis that its owner tells, by name

    def with_steps(self, steps: Steps) -> Prepared:
        """The same with other internal steps of the twin."""
        train, held_out = (replace(data, steps=steps) for data in (self.train, self.held_out))
        return replace(self, train=train, held_out=held_out)


@dataclass(frozen=True, eq=False)
class Searched:
    """Result of the search: the fit at the bench's parameters, the nominal refit, the final fit and its rivals."""

    prepared: Prepared
    given: Fit
    nominal: Fit
    final: Fit
    rivals: Mapping[Key, Sequence[RivalFit]] = field(default_factory=dict)
    needed: dict[Key, float] = field(default_factory=dict)  # evidence that each term is needed
    considered: tuple[Considered, ...] = ()  # every candidate that was fitted, with its ledger
    stopped_at: str = ""  # step of the search at which the time was over; empty if it was completed
    not_tried: tuple[str, ...] = ()  # ids that were not fitted beside the terms found

    @property
    def terms(self) -> tuple[Term, ...]:
        """The mechanisms found, with their fitted values."""
        return self.final.terms


@dataclass(frozen=True, eq=False)
class Tested:
    """The search, its terms after the tests on held-out recordings, and the refit of the nominal parameters."""

    searched: Searched
    proof: CrossValidation
    refit: Refit


@dataclass(frozen=True, eq=False)
class Judged:
    """The verdict, and the fits that it is reported with.

    `nominal` is the refit without new physics, `final` the hypothesis of the verdict: the terms found, the refit, or
    the bench file. `before` is what the mismatch is located and measured against.
    """

    tested: Tested
    of_plant: Verdict  # on the plant alone
    verdict: Verdict  # on plant and control law
    change: Change | None  # of the axis, where the terms do not explain the mismatch
    is_part: bool  # the terms explain a part of the mismatch
    nominal: Fit
    before: Fit
    final: Fit
    structure: tuple[Dependence, ...] = ()  # of what `final` leaves
    unnamed: tuple[UnnamedTerm, ...] = ()  # maps of it that hold on held-out recordings

    @property
    def has_findings(self) -> bool:
        """True if the terms of the final hypothesis are reported."""
        return self.is_part or self.of_plant == "missing_physics"

    @property
    def keeps_bench(self) -> bool:
        """True if no correction of the bench holds throughout: nothing is wrong, or the axis changed."""
        return self.of_plant == "no_mismatch" or self.change is not None


@dataclass(frozen=True, eq=False)
class Reported:
    """The result, the bench with corrected parameters and the new terms, and the next motion, if a question is open."""

    judged: Judged
    result: Result
    bench: Bench
    experiment: Experiment | None
