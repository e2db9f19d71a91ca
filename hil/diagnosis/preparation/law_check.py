"""Check that the control law of a bench reproduces the torque commands of recordings, before the plant is judged.

Each block is judged on measured inputs, so a wrong law says nothing about the machine. The law is

    kept       where it replays the commands to their noise, or with a mechanism of the library that acts on its inputs
    learnt     where other gains or delays do
    beside     windows of a command that is added behind it, where it is kept or learnt without these
    set aside  where it cannot be replayed (no set-points, another sampling period), or no gains reproduce the commands

A loop cannot use positions of the future: commands that fit later positions tell that a channel is recorded late, a
mechanism; those that fit earlier ones tell a delay of the loop, a setting. The twin simulates no such delay, so that
the plant is then judged alone.

If the recorded positions are coarser than those that the loop saw, the noise of the replay counts as noise.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import combinations
from typing import NamedTuple

from hil.bench.bench_file import Bench
from hil.diagnosis.criteria import CRITERIA
from hil.diagnosis.preparation.added_command import added_windows, axis_felt, without_added
from hil.diagnosis.preparation.usable_law import LawCheck, set_aside
from hil.diagnosis.search.facts import axis_facts
from hil.diagnosis.value import Correction
from hil.identification.law.fit import counting_noise, fit_law
from hil.identification.law.result import LawFit, preferred, sure
from hil.identification.measured import Measured
from hil.identification.terms import Term
from hil.quantities import digits, unit_of
from hil.twin.library import LIBRARY
from hil.twin.mechanism import Stage

_COARSE = (
    "The control law reproduces the commands to the noise that the steps of the recorded positions make in a replay. "
    "It was not tested further, because the control loop may have seen finer positions."
)
_SETPOINT_DELAY, _FEEDBACK_DELAY = "setpoint_delay_s", "feedback_delay_s"


def check_law(runs: Sequence[Measured], bench: Bench) -> LawCheck:
    """Check the control law of a bench on prepared recordings; loop by loop where the speed set-point is recorded."""
    if not bench.law_known:
        return LawCheck(bench)
    given = fit_law(runs, bench, free=False)
    if given.ratio <= CRITERIA.floor:
        return LawCheck(bench)
    beside = None if _is_coarse(runs, given) else _beside_windows(runs, bench, given)
    return beside or _without_windows(runs, bench, given)


def _beside_windows(runs: Sequence[Measured], bench: Bench, given: LawFit) -> LawCheck | None:
    """The law beside windows of an added command that it leaves; None without any, or if it is not that law."""
    windows = added_windows(runs, bench, given.settings)
    if not windows:
        return None
    bare = [without_added(run, windows) for run in runs]
    law = _without_windows(bare, bench, fit_law(bare, bench, free=False))
    if law.mismatch:
        return None
    owner = law.bench if law.bench.law_known and _SETPOINT_DELAY not in law.corrections else bench
    if axis_felt(runs, windows):
        alone = set_aside(bench, "a command is added behind it, which the twin does not simulate")
        law = replace(law, bench=alone.bench, notes=(*alone.notes, *law.notes), coarse=False)
    return replace(law, added_to=owner)


def _without_windows(runs: Sequence[Measured], bench: Bench, given: LawFit) -> LawCheck:
    """Check the law on commands without windows; `given`: as it stands in the bench."""
    if given.ratio <= CRITERIA.floor:
        return LawCheck(bench)
    if _is_coarse(runs, given):
        return LawCheck(bench, coarse=True, notes=(_COARSE,))
    found = list[LawFit]()
    # a recorded speed set-point may be another one: then the chain of both loops tells more
    for by_loop in (True, False) if all(run.speed_set_point.size for run in runs) else (False,):
        found.append(_best(runs, bench, given, by_loop))
        if found[-1].ratio <= CRITERIA.floor:
            return _accepted(bench, found[-1])
        if _is_coarse(runs, found[-1]):
            law = _accepted(bench, found[-1])
            return replace(law, coarse=True, notes=(*law.notes, _COARSE))
    for one in found:
        if one.left <= CRITERIA.replayed:
            return _accepted(bench, one)
    return _refused(bench, given, found[0])


def _best(runs: Sequence[Measured], bench: Bench, given: LawFit, by_loop: bool) -> LawFit:
    """The simplest law that leaves noise, else one that leaves counting noise, else that of the best criterion.

    A simpler law that leaves counting noise is preferred if that of more parts removes less than half of this excess.
    """
    tried = [fit_law(runs, bench, free=False, by_loop=True) if by_loop else given]
    right = list[LawFit]()
    for level in _candidates(runs, bench):
        fits = [fit_law(runs, bench, one.terms, free=one.free, delays=one.delays, by_loop=by_loop) for one in level]
        tried += fits
        right = [one for one in fits if one.ratio <= CRITERIA.floor]
        if right:
            break
    coarse = next((one for one in tried if one not in right and _is_coarse(runs, one)), None)
    if not right:
        return coarse or preferred(tried)
    found = preferred(right)
    return coarse if coarse and found.ratio - 1.0 > CRITERIA.most_left * (coarse.ratio - 1.0) else found


def _is_coarse(runs: Sequence[Measured], found: LawFit) -> bool:
    """True if noise that the recorded positions make in a replay explains what the law leaves."""
    allowed = [1.0 + (counting_noise(run, found.gains) / run.noise.torque) ** 2 for run in runs]
    each = zip(found.runs, allowed, strict=True)
    return (
        max(float(part @ part) / part.size / most for run, most in each for part in run if part.size) <= CRITERIA.floor
    )


class _Candidate(NamedTuple):
    terms: tuple[Term, ...] = ()
    free: bool = False
    delays: int = 0


def _candidates(runs: Sequence[Measured], bench: Bench) -> list[list[_Candidate]]:
    """Laws in the order of the number of parameters: mechanisms on the controller's inputs, free gains, delays."""
    facts = axis_facts(bench, runs)
    table = bench.gains.position_from_table
    single = [
        Term(mechanism.id, index, mechanism.typical_values(facts))
        for mechanism in LIBRARY
        for index, variant in enumerate(mechanism.variants)
        if variant.stage in (Stage.VELOCITY_FILTER, Stage.CHANNEL)
        and (variant.observable is None or variant.observable(table))
        and mechanism.id not in {entry.effect for entry in bench.mechanisms}
    ]
    # two variants of one mechanism shift the same channels
    pairs = [pair for pair in combinations(single, 2) if pair[0].effect != pair[1].effect]
    levels = []
    for free in (False, True):
        late = [_Candidate((), free, delays) for delays in (1, 2)]
        # gains make up for a delay that is left out
        levels += [[_Candidate((), free), *late]] if free else []
        levels += [[*([] if free else late), *(_Candidate((term,), free) for term in single)]]
        levels += [[_Candidate(pair, free) for pair in pairs]]
    return levels


def _accepted(bench: Bench, found: LawFit) -> LawCheck:
    """The bench with the settings found, if they differ from its own; without its law if the loop is late."""
    corrections = _of_velocity_loop(bench, found) | _of_position_loop(bench, found) | _of_delays(bench, found)
    if not corrections:
        return LawCheck(bench)
    advice = (
        "Check the controller's settings in the bench file: the torque commands follow the control law with "
        f"{_told(corrections)}."
    )
    if _FEEDBACK_DELAY in corrections:
        law = set_aside(bench, "its positions are older than those of the recording, which the twin does not simulate")
        return replace(law, corrections=corrections, notes=(advice, *law.notes), advice=advice)
    control = bench.known_control.with_gains(found.gains)
    if _SETPOINT_DELAY in corrections:
        control = control.model_copy(update={_SETPOINT_DELAY: corrections[_SETPOINT_DELAY].value})
    return LawCheck(
        bench.model_copy(update={"control": control}),
        corrections,
        (f"{advice} The twin uses these values.",),
        advice=advice,
    )


def _of_position_loop(bench: Bench, found: LawFit) -> dict[str, Correction]:
    position, feedforward, _, _ = bench.known_control.gain_names
    errors = found.errors
    return _gain(bench, found, position, errors.position_gain) | _gain(bench, found, feedforward, errors.feedforward)


def _of_velocity_loop(bench: Bench, found: LawFit) -> dict[str, Correction]:
    _, _, velocity, integral = bench.known_control.gain_names
    errors = found.errors
    return _gain(bench, found, velocity, errors.velocity_gain) | _gain(bench, found, integral, errors.integral_gain)


def _gain(bench: Bench, found: LawFit, name: str, error: float) -> dict[str, Correction]:
    control = bench.known_control
    nominal, value = getattr(control, name), getattr(control.with_gains(found.gains), name)
    if nominal is None:
        return {}
    share = name == "velocity_feedforward"
    std = error * (1.0 if share else abs(value))
    if abs(value - nominal) <= max(CRITERIA.sigmas * std, CRITERIA.setting * (1.0 if share else abs(nominal))):
        return {}
    return {name: Correction(nominal=nominal, value=value, std=std, unit=unit_of(name))}


def _of_delays(bench: Bench, found: LawFit) -> dict[str, Correction]:
    settings, errors, period_s = found.settings, found.errors, bench.period_s
    corrections = {}
    for name, rows, error, nominal in (
        (_SETPOINT_DELAY, settings.setpoint_rows, errors.setpoint_rows, bench.known_control.setpoint_delay_s),
        (_FEEDBACK_DELAY, settings.feedback_rows, errors.feedback_rows, 0.0),
    ):
        # a fit has a delay of the set-points only where it needs one, sure or not: the law has it then
        if sure(rows, error if name == _FEEDBACK_DELAY else 0.0):
            value = nominal + period_s * rows
            corrections[name] = Correction(nominal=nominal, value=value, std=period_s * error, unit=unit_of(name))
    return corrections


def _refused(bench: Bench, given: LawFit, best: LawFit) -> LawCheck:
    """The bench without its law, with the settings of a loop that follows them alone."""
    control = bench.known_control.with_gains(best.gains)
    gains = ", ".join(
        f"{name} {digits(getattr(control, name), 4)}" for name in control.gain_names if getattr(control, name)
    )
    why = (
        f"it leaves {100.0 * given.left:.0f} % of the torque command (rms), with the best gains "
        f"({gains}) {100.0 * best.left_of_command:.0f} %"
    )
    corrections: dict[str, Correction] = {}
    if best.left_of_speed:
        why += (
            f" in the velocity loop and {100.0 * best.left_of_speed:.0f} % in the speed set-point of the position loop"
        )
        corrections |= _of_velocity_loop(bench, best) if best.left_of_command <= CRITERIA.replayed else {}
        corrections |= _of_position_loop(bench, best) if best.left_of_speed <= CRITERIA.replayed else {}
    told = f" One loop follows its settings with {_told(corrections)}." if corrections else ""
    advice = f"Check the controller's settings: the control law of the bench is not that of the recording, {why}.{told}"
    return replace(set_aside(bench, why), corrections=corrections, advice=advice, mismatch=True)


def _told(corrections: Mapping[str, Correction]) -> str:
    return ", ".join(
        f"{name} {digits(entry.value, 4)} instead of {digits(entry.nominal, 4)}" for name, entry in corrections.items()
    )
