"""Notes of a diagnosis: on the figures, on terms that were dropped, on the fit, and on what was not observable."""

from collections.abc import Container

from hil.bench.bench_file import Bench
from hil.channels import AXIS_CHANNELS
from hil.diagnosis.criteria import CRITERIA
from hil.diagnosis.result import ChannelFit, Mode, TorqueLeft, Verdict
from hil.diagnosis.stages import Judged, Searched
from hil.diagnosis.wording import title, titles
from hil.identification.dataset import Dataset
from hil.identification.estimator import Fit, FitStatus
from hil.identification.honest_refit import holds, unstable
from hil.identification.measured import Measured
from hil.quantities import digits, percent
from hil.twin.library import LIBRARY
from hil.twin.mechanism import Block, Mechanism


def notes_on(
    judged: Judged,
    table: dict[str, ChannelFit],
    forms: Container[int],
    left: TorqueLeft | None,
    experiment: str,
    budget_s: float,
) -> list[str]:
    """All notes, in the order in which they are read."""
    searched, final = judged.tested.searched, judged.final
    notes = [*searched.prepared.notes, *_on_figures(judged, table), *_on_terms(judged, forms)]
    notes += [*on_fit(final), *on_torque(left)]
    notes += filter(None, (judged.tested.refit.note, experiment))
    notes += [] if final.data.observability.closed_loop else not_observable(searched.prepared.train)
    return [*notes, _stopped(searched, budget_s)] if searched.stopped_at else notes


def _on_figures(judged: Judged, table: dict[str, ChannelFit]) -> list[str]:
    """Notes on the figures of the fit: how they were simulated, and where their noise floor is from."""
    final, notes = judged.final, []
    closed_loop = final.data.observability.closed_loop
    if closed_loop and not all(holds(fit.hypothesis, final.data) for fit in (judged.nominal, final)):
        notes.append(unstable(final.data.runs[0]))
    lost = bool(notes)
    if any(entry.floor_from == "repeated_laps" for entry in table.values()):
        notes.append("The noise floor is the part of the residuals that does not repeat from lap to lap.")
    else:
        notes.append(
            "No motion repeats: the noise floor is the white noise of the sensors, in closed loop including the "
            "response of the axis to it. Random disturbances of the axis therefore count as mismatch."
        )
    blocks = [name for name, entry in table.items() if entry.mode is Mode.BLOCKS]
    if blocks and closed_loop and not lost:
        notes.append(
            f"Figures of {', '.join(blocks)} are block by block, with measured inputs: in closed loop the twin "
            "deviates from the recording by more than the noise although every block is at its floor (chaotic loop)."
        )
    return notes


def _on_terms(judged: Judged, forms: Container[int]) -> list[str]:
    """Notes on terms that were dropped or not validated, and on those that explain too little."""
    proof, searched = judged.tested.proof, judged.tested.searched
    unsure = f"its confidence is below {percent(CRITERIA.named)}"
    notes = [f"{title(ablation.term.effect)} was dropped: {ablation.refuted or unsure}." for ablation in proof.dropped]
    notes += [
        f"{title(ablation.term.effect)} has no visible effect in the held-out recordings: it is not validated by them."
        for index, ablation in enumerate(proof.ablations)
        if index not in forms and ablation.gain is not None and not ablation.shown
    ]
    if judged.verdict is Verdict.UNEXPLAINED and searched.terms and not judged.final.terms:
        tried = ", ".join(title(term.effect) for term in searched.terms)
        notes.append(f"The closest mechanisms ({tried}) explain less than half of the mismatch; none is reported.")
    return notes


def _stopped(searched: Searched, budget_s: float) -> str:
    """Note on a search that ended with its time budget."""
    others = titles(searched.not_tried) if searched.not_tried else "no mechanism"
    return (
        f"The search ended with its time budget of {digits(budget_s)} s before {searched.stopped_at}: this is the "
        f"best explanation so far; --budget SECONDS (budget_s in Python) gives it more. "
        f"Not fitted beside it: {others}. No next experiment was designed."
    )


def at_bound(fit: Fit) -> tuple[str, ...]:
    """Nominal parameters of a fit that ended at the bound of the allowed range."""
    nominal = {coordinate.name for coordinate in fit.hypothesis.coordinates[: fit.hypothesis.nominal_count]}
    return tuple(name for name in fit.at_bound if name in nominal)


def on_fit(final: Fit) -> list[str]:
    """Notes on a final fit that did not converge, or in which a parameter ended at its bound."""
    notes = []
    if final.status is FitStatus.OUT_OF_STEPS:
        notes.append("The final fit stopped before it converged: its parameters are the best so far.")
    nominal = at_bound(final)
    if nominal:
        notes.append(
            f"{', '.join(nominal)}: not identifiable from this motion. The fit ended at the bound of the allowed "
            "range, a third or three times the value of the bench file; the value is no correction, and "
            "bench.diagnosed.yaml has the one of the bench file. Beside a mass that ended there it has those of the "
            "other masses, too: their split is not told."
        )
    others = ", ".join(name.split(".")[-1] for name in final.at_bound if name not in nominal)
    if others:
        notes.append(f"In the final fit {others} ended at the bound of the allowed range.")
    return notes


def on_torque(left: TorqueLeft | None) -> list[str]:
    """Note if the twin predicts the torque of held-out motion worse than the plain model does, by the rule on it."""
    if left is None or left.final is None or left.final - left.plain <= CRITERIA.discrepancy:
        return []
    return [
        f"On held-out motion the twin leaves {percent(left.final)} of the torque's standard deviation, more than plain "
        f"least squares of inertia, friction and offset ({percent(left.plain)}): no term describes a "
        "torque on the axis, such as friction of another form, gravity or another arm, and the fit to the motion "
        "takes it for inertia or friction."
    ]


def not_observable(data: Dataset) -> list[str]:
    """Notes for recordings of a bench whose control law is unknown."""
    run, bench = data.runs[0], data.bench
    controller = titles([mechanism.id for mechanism in LIBRARY if mechanism.block is Block.CONTROLLER])
    return [
        "The control law is unknown: the plant was judged alone, block by block, from measured torque to measured "
        "motion. There is no figure in closed loop and no next experiment, and no mismatch was assigned to the "
        f"controller. {controller.capitalize()} cannot be tested: that needs recorded set-points, and the law under "
        "`control` of the bench file.",
        *_without_torque(run),
        *_with_one_encoder(run, bench),
    ]


def _without_torque(run: Measured) -> list[str]:
    names = AXIS_CHANNELS[run.kind]
    if not run.observability.torque_measured:
        return [
            f"No torque is recorded: only the transmission was judged, from {names.motor_position} to "
            f"{names.table_position}. Friction and loads of the motor side and the drive cannot be told, and of masses "
            f"and stiffness only their ratio; record {names.torque} or {names.torque_command}."
        ]
    if not run.observability.torque_and_command:
        return [
            f"Only one of {names.torque} and {names.torque_command} is recorded: an effect of the drive shows only as "
            "wrong motion. Record both to tell drive and motor apart."
        ]
    return []


def _on_motor(mechanism: Mechanism) -> bool:
    """True if a form of a mechanism shows in the motor's motion."""
    return any(variant.observable is not None and variant.observable(False) for variant in mechanism.variants)


def _with_one_encoder(run: Measured, bench: Bench) -> list[str]:
    if bench.has_table_encoder:
        return []
    hidden = titles([one.id for one in LIBRARY if one.search.needs_table and not _on_motor(one)])
    names = AXIS_CHANNELS[run.kind]
    return [
        f"Only one position is recorded: {hidden} cannot be tested; record both {names.motor_position} and "
        f"{names.table_position}."
    ]
