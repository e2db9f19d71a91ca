"""What a comparison says: in words, in lines for a terminal, and as a card for a notebook."""

from __future__ import annotations

from typing import TYPE_CHECKING

from hil.identification.noise_floor import FLOOR
from hil.quantities import digits, percent, quantity

if TYPE_CHECKING:
    from hil.identification.compare import Comparison
    from hil.identification.twin_deviation import Deviation

EXPLAINED: float = FLOOR**0.5  # rms over noise up to which a channel is explained; the threshold of the diagnosis
_PANELS = 3  # of a card: torque, and the deviations of position and torque


def statement(result: Comparison) -> str:
    """Say whether the twin explains the recording and, if not, which block deviates most."""
    if not result.held:
        return result.notes[0]
    torque, position = result.torque, result.channels[0]
    figures = (
        f"{torque.label} deviates by {quantity(torque.rms, torque.unit)} rms, "
        f"{digits(result.torque_over_noise)} × its noise; {position.label} by "
        f"{quantity(position.rms, position.unit)} rms"
    )
    if result.explained:
        return f"The twin explains this recording: {figures}."
    worst = [(block.deviation.rms / block.noise, block.deviation.name) for block in result.blocks if block.noise > 0.0]
    if worst and max(worst)[0] <= EXPLAINED:
        return (
            f"The control loop of the twin differs from the real one: {figures}. Drive and axis by themselves are "
            f"within {EXPLAINED:g} × their noise: check gains, periods, and where the loops run (drive.mode)."
        )
    where = f" Furthest from its noise: {max(worst)[1]} ({digits(max(worst)[0])} ×)." if worst else ""
    todo = "" if result.fit else " The parameters may be wrong: a fit corrects them (--fit, in Python fit=True)."
    return f"The twin leaves something out: {figures}.{where}{todo}"


def in_lines(result: Comparison) -> str:
    """Some lines with the verdict, and with rms, largest and relative deviation of each channel."""
    shown = _shown(result)
    width = max(len(channel.name) for channel in shown)
    lines = [
        f"Comparison of {result.recording.name} with the twin of {result.bench.name}: "
        f"{'explained' if result.explained else 'not explained'} (allowed {EXPLAINED:g} x noise: torque "
        f"{result.torque_over_noise:.2f}, table against motor {result.table_over_noise:.2f})",
        f"  {'measured less simulated':{width}}  {'rms':>10}  {'largest':>10}  relative",
    ]
    lines += [
        f"  {channel.name:{width}}  {channel.rms:10.3g}  {channel.peak:10.3g}  {100.0 * channel.relative:7.3f} %"
        for channel in shown
    ]
    return "\n".join([*lines, *(() if result.held else (f"  {result.notes[0]}",))])


def as_html(result: Comparison) -> str:
    """A card: the verdict in words, the deviations, and their picture."""
    from hil.figures.card import card
    from hil.figures.drawing import over_time
    from hil.identification.figures import block_panels, motion_panels

    panels = motion_panels(result)[-_PANELS:] if result.held else block_panels(result)[:_PANELS]
    picture = over_time("", result.measured.time_s, panels)
    head = "measured less simulated", "rms", "largest", "relative"
    rows = [
        (one.label, quantity(one.rms, one.unit), quantity(one.peak, one.unit), percent(one.relative))
        for one in _shown(result)
    ]
    title = f"{result.recording.name} compared with the twin of {result.bench.name}"
    return card(title, result.statement, picture, [head, *rows], result.explained)


def _shown(result: Comparison) -> tuple[Deviation, ...]:
    return result.channels or tuple(block.deviation for block in result.blocks)
