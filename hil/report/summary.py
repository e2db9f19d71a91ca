"""Summary of a diagnosis on the terminal."""

from hil.diagnosis.result import Finding, Result, TorqueLeft
from hil.diagnosis.wording import named, spoken
from hil.quantities import digits, known_quantity, percent, quantity
from hil.report.console import out, table


def print_diagnosis(result: Result) -> None:
    """Print residuals before and after, what was found, and the statement."""
    held_out = result.fit and next(iter(result.fit.values())).validate_
    rows = [
        (
            spoken(name),
            *(
                quantity(value, entry.unit)
                for value in (figures.best_before_rms, figures.after_rms, figures.noise_floor_rms)
            ),
        )
        for name, entry in result.fit.items()
        for figures in (entry.validate_ or entry.train,)
    ]
    left = result.torque_left
    if left and left.final is not None:
        before = "" if left.before is None else percent(left.before)
        rows.append(("torque not explained", before, percent(left.final), ""))
    table(("rms, held out" if held_out else "rms", "before", "after", "noise floor"), rows)
    if left and left.final is not None:
        out.print(
            f"  torque on held-out motion, over its deviation (rms); plain least squares leave {percent(left.plain)}"
        )
    if result.time_budget:
        out.print(
            f"\nThe search ended with its time budget of {digits(result.time_budget.budget_s)} s before "
            f"{result.time_budget.stopped_before}: best answer so far. To go on, call it with --budget SECONDS, more "
            "than these."
        )
    if result.findings:
        out.print()
        table(
            ("found", "size", "confidence that it is there"),
            [(named(finding), _size(finding), percent(finding.confidence)) for finding in result.findings],
        )
    if result.not_identifiable:
        out.print(f"Not identifiable from this motion: {', '.join(result.not_identifiable)}; no correction is given.")
    out.print(f"\n{result.statement}\n")


def _size(finding: Finding) -> str:
    """The first parameter of a finding, its strength, or its rate; empty for windows, which have one each."""
    if finding.rate:
        return f"{finding.rate} per minute"
    first = next(iter(finding.parameters.values()), None)
    if first is None:
        return ""
    told = not first.std or abs(first.value) >= first.std
    return known_quantity(first.value, first.std or 0.0, first.unit) if told else "not told by itself"


def torque_line(left: TorqueLeft) -> str:
    """One line: the residual torque on held-out motion of each twin, and by the plain model."""
    shares = {
        "bench file": left.owner,
        "refitted": left.refitted,
        "after": left.final,
        "plain least squares": left.plain,
    }
    given = ", ".join(f"{name} {percent(share)}" for name, share in shares.items() if share is not None)
    return f"Residual torque on held-out motion, of the torque's standard deviation: {given}."
