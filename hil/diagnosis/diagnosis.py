"""A finished diagnosis, with the stages that figures and reports are drawn from."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

from hil.arrays import FloatArray
from hil.bench.bench_file import Bench
from hil.diagnosis.experiment import Experiment
from hil.diagnosis.result import Finding, Mode, Result
from hil.diagnosis.stages import Reported, Searched
from hil.diagnosis.turning import labelled
from hil.diagnosis.verdict.fit_table import channel_residuals
from hil.diagnosis.wording import title, titles
from hil.errors import InputError
from hil.identification.dataset import Dataset
from hil.identification.estimator import Fit
from hil.identification.measured import Measured
from hil.identification.terms import Term
from hil.quantities import digits

if TYPE_CHECKING:
    from hil.figures.drawing import Drawing


@dataclass(frozen=True, eq=False)
class Diagnosis:
    """Result of a diagnosis: `result` is the content of diagnosis.json, `bench` has the corrected parameters and the
    new terms, `experiment` is the next motion, None if no question is open.
    """

    reported: Reported

    @property
    def result(self) -> Result:
        """Verdict, findings with standard errors, location, figures on held-out recordings, notes."""
        return self.reported.result

    @property
    def bench(self) -> Bench:
        """Bench with corrected parameters and the new terms."""
        return self.reported.bench

    @property
    def experiment(self) -> Experiment | None:
        """Motion that separates what is open; None if nothing is."""
        return self.reported.experiment

    @property
    def findings(self) -> tuple[Finding, ...]:
        """What was found, each with `parameters`: name -> value, standard_error and unit."""
        return self.result.findings

    @property
    def searched(self) -> Searched:
        """The search, with the fit at the values of the bench file."""
        return self.reported.judged.tested.searched

    @property
    def given_bench(self) -> Bench:
        """The bench that the recordings were compared with, with the control law that could be used."""
        return self.searched.prepared.bench

    @property
    def train(self) -> Dataset:
        """Recordings, or parts of them, that were fitted."""
        return self.searched.prepared.train

    @property
    def held_out(self) -> Dataset:
        """Recordings that nothing was fitted to; without runs if nothing was held out."""
        return self.searched.prepared.held_out

    @property
    def nominal(self) -> Fit:
        """Refit of the nominal parameters without new physics."""
        return self.reported.judged.nominal

    @property
    def final(self) -> Fit:
        """Hypothesis of the verdict: the terms found, or the nominal twin if there is no finding."""
        return self.reported.judged.final

    def term_of(self, index: int) -> Term:
        """The term of the final hypothesis that the finding `index` reports."""
        finding = self.result.findings[index]
        terms = self.final.terms
        if finding.windows:
            return next(term for term in terms if term.windows)
        strength = next(iter(finding.parameters.values())).value
        return next(term for term in terms if term.effect == finding.effect and term.values[0] == strength)

    def plot(
        self, what: Literal["residuals", "location", "finding", "change"] = "residuals", number: int = 1
    ) -> Drawing:
        """Draw the residuals before and after, the location of the mismatch, the evidence for finding `number`, or that
        for a change of the axis.

        Residuals are those of the first held-out recording. Raises InputError if there is no such finding or change.
        """
        from hil.diagnosis.pictures import findings, location
        from hil.figures.drawing import over_time

        turns = self.given_bench.axis.turns
        if what == "change":
            from hil.diagnosis.pictures.change import change_figure

            return labelled(change_figure(self), turns)
        if what == "location":
            return labelled(location.location_figure(self), turns)
        if what == "finding":
            if not 1 <= number <= len(self.result.findings):
                raise InputError(f"number: given {number}, allowed 1 to {len(self.result.findings)} findings")
            return findings.finding_figure(self, self.term_of(number - 1)).figure
        run = (*self.held_out.runs, *self.train.runs)[0]
        return over_time(f"{run.name}: measured - twin", run.time_s, location.residual_panels(self, run))

    def __repr__(self) -> str:
        lines = [f"Diagnosis: {self.result.verdict}", f"  {self.result.statement}"]
        for finding in self.result.findings:
            lines.append(f"  {title(finding.effect)}, confidence {finding.confidence:.2f}")
            lines += [
                f"    {name} = {digits(entry.value)} ± {digits(entry.std)} {entry.unit}"
                for name, entry in finding.parameters.items()
            ]
            if finding.equivalents:
                lines.append(f"    not distinguishable from {titles(finding.equivalents)} by this motion")
        lines += [
            f"  {name} = {digits(entry.value)} ± {digits(entry.std)} {entry.unit} (bench file {digits(entry.nominal)})"
            for name, entry in self.result.parameter_corrections.items()
        ]
        return "\n".join(lines)

    def _repr_html_(self) -> str:
        from hil.diagnosis.diagnosis_card import diagnosis_card

        return diagnosis_card(self)

    def residuals(self, fit: Fit, run: Measured, mode: Mode = Mode.BLOCKS) -> dict[str, FloatArray]:
        """Residuals (n,) of a fit on one of the recordings, by channel."""
        data = self.train if run in self.train.runs else self.held_out
        return channel_residuals(fit.hypothesis, data, mode)[data.runs.index(run)]
