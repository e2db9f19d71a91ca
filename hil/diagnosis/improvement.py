"""Sentence on what a finding improves: the residual of a channel that was above its noise, else the torque left."""

from hil.diagnosis.ledger import SHAPE
from hil.diagnosis.result import FitFigures, Result
from hil.diagnosis.wording import by_chance, spoken
from hil.identification.noise_floor import FLOOR
from hil.quantities import digits, percent, quantity


def improvement(result: Result) -> str:
    """Say what falls with the findings: of the channels above their noise the one that improves most, else the torque.

    A channel within its noise before says nothing, whatever it does.
    """
    figures = {name: entry.validate_ or entry.train for name, entry in result.fit.items()}
    above = {name: one for name, one in figures.items() if _above(one.best_before_rms, one)}
    if not above:
        return _below_the_noise(result)
    name, found = max(above.items(), key=lambda item: item[1].best_before_rms / max(item[1].after_rms, 1e-300))
    entry = result.fit[name]
    before, after, noise = (
        quantity(value, entry.unit) for value in (found.best_before_rms, found.after_rms, found.noise_floor_rms)
    )
    where = "held-out" if entry.validate_ else "these"
    what = f"With it the residual of the {spoken(name)} on {where} recordings"
    if before == after:
        return f"{what} stays at {after} rms."
    if found.after_rms >= found.best_before_rms:
        return f"{what} does not fall: {after} instead of {before} rms."
    if not _above(found.after_rms, found):
        return f"{what} falls from {before} rms to its noise."
    return f"{what} falls from {before} to {after} rms; its noise is {noise}."


def _above(rms: float, found: FitFigures) -> bool:
    return rms**2 > FLOOR * found.noise_floor_rms**2


def _below_the_noise(result: Result) -> str:
    told, left = list[str](), result.torque_left
    if left and left.final is not None:
        before = left.before or 0.0
        if left.final < before and percent(left.final) != percent(before):
            told.append(
                f"with it the torque left unexplained on held-out motion falls from {digits(100.0 * before)} to "
                f"{percent(left.final)}"
            )
    chances = [chance for one in result.findings if (chance := _chance(result, one.effect)) is not None]
    if chances:
        what = "its effect is" if len(result.findings) == 1 else "each effect is"
        by = by_chance(max(chances))
        told.append(f"{what} below the noise of one row, and clear from all rows together ({by})")
    text = "; ".join(told) or "without it every residual was within its noise, too"
    return f"{text[:1].upper()}{text[1:]}."


def _chance(result: Result, effect: str) -> float | None:
    """Probability by chance of the shape of a finding, as it was asked last; None where it was not."""
    asked = [
        rule.figures.get("chance")
        for one in result.considered
        if one.named and one.effect == effect
        for rule in one.rules
        if rule.rule == SHAPE and rule.accepted
    ]
    found = [one for one in asked if isinstance(one, float)]
    return found[-1] if found else None
