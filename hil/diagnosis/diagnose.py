"""Diagnose recordings: detect, locate and classify a mismatch, name the missing physics, and validate it."""

import time
from collections.abc import Sequence

from hil.bench.bench_file import Bench
from hil.diagnosis.diagnosis import Diagnosis
from hil.diagnosis.preparation.prepare import prepare
from hil.diagnosis.preparation.structure import as_one_inertia, as_plant_alone, without_open_delay
from hil.diagnosis.reporting import report
from hil.diagnosis.search.forward_selection import search
from hil.diagnosis.stages import Judged, Prepared, Progress
from hil.diagnosis.time_left import usual_budget_s, with_time_left
from hil.diagnosis.verdict.inside_time import test_inside_time
from hil.diagnosis.verdict.judge import judge
from hil.diagnosis.verdict.middle_held_out import goes_on, names_more, with_middle_held_out
from hil.diagnosis.verdict.reproduction import behind_plain, with_less_torque
from hil.errors import InputError
from hil.identification.parallel import one_blas_thread
from hil.recording.recording import Recording

SEARCH_SHARE = 0.7  # of a budget for the search; the rest for held-out recordings, location and report


@one_blas_thread
def diagnose(
    train: Sequence[Recording],
    validate: Sequence[Recording],
    bench: Bench,
    progress: Progress = lambda text: None,
    budget_s: float | None = None,
) -> Diagnosis:
    """Diagnose recordings of one axis against its bench, and validate the result on recordings of another motion.

    Without `validate` a third of each recording is held out. `progress` gets the name of each step and the time
    left. After most of `budget_s` of processor time (default: `usual_budget_s`) the search ends with the best
    explanation so far: the answer does not depend on how busy the machine is, but may on how fast. Raises InputError
    with all reasons if the recordings cannot be diagnosed.
    """
    budget_s = usual_budget_s(sum(map(len, train))) if budget_s is None else budget_s
    if not budget_s > 0.0:
        raise InputError(f"budget: given {budget_s:g} s, allowed above 0 s")
    begin_s, end_s = time.monotonic(), time.process_time() + SEARCH_SHARE * budget_s
    progress = with_time_left(progress, begin_s, budget_s)
    progress("checking the recordings")
    prepared = prepare(train, validate, bench)

    def answer(prepared: Prepared) -> Judged:
        searched = search(prepared, progress, end_s)
        if time.process_time() < end_s and (at_once := without_open_delay(searched)):
            progress("searching again without a delay of the torque that is left open")
            searched = search(at_once, progress, end_s)
        progress("testing on held-out recordings")
        return judge(test_inside_time(searched))

    judged = answer(prepared)
    in_time = time.process_time() < end_s
    if in_time and goes_on(judged) and (inside := with_middle_held_out(judged.tested.searched.prepared)):
        progress("searching again with the middle of the recordings held out")
        again = answer(inside)
        judged = again if names_more(again, judged) else judged
    for simpler in (as_one_inertia, as_plant_alone):
        in_time = time.process_time() < end_s
        if in_time and behind_plain(judged) and (other := simpler(judged.tested.searched.prepared)):
            progress("comparing with a simpler twin")
            judged = with_less_torque(judged, answer(other))
    return Diagnosis(report(judged, progress, begin_s, budget_s))
