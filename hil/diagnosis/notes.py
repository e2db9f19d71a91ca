"""Notes of a diagnosis: on the noise floor, on terms that were dropped, and on how search and fit ended."""

from collections.abc import Container

from hil.diagnosis.result import ChannelFit, Mode, TorqueLeft, Verdict
from hil.diagnosis.search.forward_selection import Explanation
from hil.diagnosis.verdict.cross_validation import CrossValidation
from hil.diagnosis.wording import title, titles
from hil.identification.estimator import Fit, FitStatus
from hil.identification.honest_refit import holds, unstable
from hil.quantities import digits, percent


def notes_on(
    table: dict[str, ChannelFit],
    proof: CrossValidation,
    forms: Container[int],
    verdict: Verdict,
    explanation: Explanation,
    final: Fit,
) -> list[str]:
    """Notes on the figures, on terms that were dropped or not validated, and on those that explain too little."""
    lost = (
        []
        if not final.data.observability.closed_loop
        else [
            unstable(run)
            for run in final.data.runs[:1]
            if not all(holds(fit.hypothesis, final.data) for fit in (explanation.nominal, final))
        ]
    )
    notes = [*lost]
    if any(entry.floor_from == "repeated_laps" for entry in table.values()):
        notes.append("The noise floor is the part of the residuals that does not repeat from lap to lap.")
    else:
        notes.append(
            "No motion repeats: the noise floor is the white noise of the sensors, in closed loop including the "
            "response of the axis to it. Random disturbances of the axis therefore count as mismatch."
        )
    blocks = [name for name, entry in table.items() if entry.mode is Mode.BLOCKS]
    if blocks and explanation.nominal.data.observability.closed_loop and not lost:
        notes.append(
            f"Figures of {', '.join(blocks)} are block by block, with measured inputs: in closed loop the twin "
            "deviates from the recording by more than the noise although every block is at its floor (chaotic loop)."
        )
    notes += [f"{title(ablation.term.effect)} was dropped: {ablation.refuted}." for ablation in proof.dropped]
    notes += [
        f"{title(ablation.term.effect)} has no visible effect in the held-out recordings: it is not validated by them."
        for index, ablation in enumerate(proof.ablations)
        if index not in forms and ablation.gain is not None and not ablation.shown
    ]
    if verdict is Verdict.UNEXPLAINED and explanation.terms and not final.terms:
        tried = ", ".join(title(term.effect) for term in explanation.terms)
        notes.append(f"The closest mechanisms ({tried}) explain less than half of the mismatch; none is reported.")
    return notes


def stopped(explanation: Explanation, budget_s: float) -> str:
    """Note on a search that ended with its time budget."""
    others = titles(explanation.not_tried) if explanation.not_tried else "no mechanism"
    return (
        f"The search ended with its time budget of {digits(budget_s)} s before {explanation.stopped_at}: this is the "
        f"best explanation so far. Not fitted beside it: {others}. No next experiment was designed."
    )


def at_bound(found: Fit) -> tuple[str, ...]:
    """Nominal parameters of a fit that ended at the bound of the allowed range."""
    nominal = {coordinate.name for coordinate in found.hypothesis.coordinates[: found.hypothesis.nominal_count]}
    return tuple(name for name in found.at_bound if name in nominal)


def ended(final: Fit) -> list[str]:
    """Notes on a final fit that did not converge, or in which a parameter ended at its bound."""
    notes = []
    if final.status is FitStatus.OUT_OF_STEPS:
        notes.append("The final fit stopped before it converged: its parameters are the best so far.")
    nominal = at_bound(final)
    if nominal:
        notes.append(
            f"{', '.join(nominal)}: not identifiable from this motion. The fit ended at the bound of the allowed "
            "range, a third or three times the value of the bench file; the value is no correction, but the one with "
            "which bench.diagnosed.yaml fits."
        )
    others = ", ".join(name.split(".")[-1] for name in final.at_bound if name not in nominal)
    if others:
        notes.append(f"In the final fit {others} ended at the bound of the allowed range.")
    return notes


def on_torque(left: TorqueLeft | None) -> list[str]:
    """Note if the twin predicts the torque of held-out motion worse than the plain model does."""
    if left is None or left.final is None or left.final <= left.plain:
        return []
    return [
        f"On held-out motion the twin leaves {percent(left.final)} of the torque's standard deviation, more than plain "
        f"least squares of inertia, friction and offset ({percent(left.plain)}): no term describes a "
        "torque on the axis, such as friction of another form, gravity or another arm, and the fit to the motion "
        "takes it for inertia or friction."
    ]
