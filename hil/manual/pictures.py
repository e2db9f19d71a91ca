"""Pictures of mechanisms: what one changes in torque and table position of an axis that repeats a motion.

Both axes are twins in closed loop on the same set-points, one with the mechanism, one without it.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np
from matplotlib import rc_context
from matplotlib.figure import Figure

from hil.arrays import FloatArray
from hil.bench.bench_file import Bench, load_bench
from hil.figures.drawing import style_axis
from hil.figures.panels import DEVIATION
from hil.manual.keys import EXAMPLES
from hil.motion.profile import load_profile
from hil.motion.trajectory import plan
from hil.quantities import reading_unit
from hil.twin.library import LIBRARY
from hil.twin.mechanism import Mechanism
from hil.twin.parameter import Dimension
from hil.twin.physics import Active
from hil.twin.scene import AxisFacts

TIMES = 3.0  # the strength that an engineer would call a defect; not of a time, which makes the loops unstable
ROUNDING = 1e-9  # N m, m, rad: less is no change
WAVES = 4.0  # of a periodic mechanism over the position: more would be a black area
SETTLED_S = 0.3  # before it, the loops answer to the start
# values of a motion of 6 s over 100 mm (turning: 4 rad) with up to 5 N m, where typical ones lie outside of it
_WITHIN: dict[str, dict[str, float]] = json.loads(Path(__file__).with_suffix(".json").read_text(encoding="utf-8"))


class MechanismChange(NamedTuple):
    """Time, table position, and what a mechanism changes in torque and table position, each (n,); its wavelength."""

    time_s: FloatArray
    position_m: FloatArray
    torque: FloatArray
    table: FloatArray
    wavelength_m: float  # 0 without one


def change_by(mechanism: Mechanism) -> tuple[Bench, MechanismChange]:
    """The axis of an example on which the mechanism can act, and what it changes there."""
    kind = "turning" if mechanism.turning else "screw"
    bench = load_bench(EXAMPLES / f"bench-{kind}-simple.yaml")
    trajectory = plan(load_profile(EXAMPLES / f"profile-{kind}-laps.yaml"), bench.period_s)
    facts = AxisFacts(
        bench.axis.physics().coulomb_n_m,
        bench.axis.ratio_m_rad,
        1.0,
        bench.gains.torque_limit_n_m / 3.0,
        bench.encoders.table.resolution_m if bench.encoders.table else None,
        len(trajectory) * bench.period_s,
    )
    values = dict(zip(mechanism.names, mechanism.complete(mechanism.typical_values(facts)), strict=True))
    strength = mechanism.parameters[mechanism.strength]
    if strength.dimension is not Dimension.TIME:
        values[strength.name] = min(TIMES * values[strength.name], strength.high)
    values |= _WITHIN.get(mechanism.id, {})
    twin = bench.twin()
    without, acting = (
        type(twin)(twin.physics, twin.gains, active).simulate(trajectory.position_m, trajectory.velocity_m_s)
        for active in ((), (Active(mechanism.id, tuple(values.values())),))
    )
    rows = slice(round(SETTLED_S / bench.period_s), None)
    return bench, MechanismChange(
        trajectory.time_s[rows],
        trajectory.position_m[rows],
        _without_rounding(acting.torque - without.torque)[rows],
        _without_rounding(acting.table_position_m - without.table_position_m)[rows],
        mechanism.wavelength_m(tuple(values.values()), facts),
    )


def _without_rounding(values: FloatArray) -> FloatArray:
    return values if abs(values).max() > ROUNDING else np.zeros_like(values)


def draw(mechanism: Mechanism) -> Figure:
    """Draw what a mechanism changes over time and over the position."""
    bench, change = change_by(mechanism)
    length = "rad" if bench.axis.turns else "m"
    figure = Figure(figsize=(9.0, 4.0), layout="constrained")
    axes = figure.subplots(2, 2, sharey="row", sharex="col")
    step_m = abs(np.gradient(change.position_m))  # rows further apart than an eighth of a wave do not show it
    shown_rows = step_m < change.wavelength_m / 8.0 if change.wavelength_m else step_m >= 0.0
    along_m = np.where(shown_rows, change.position_m, np.nan)
    travel = reading_unit(length, float(abs(change.position_m).max()))
    for row, (values, unit, name) in enumerate(
        ((change.torque, "N m", "change of\ntorque"), (change.table, length, "change of\ntable position"))
    ):
        factor, shown = reading_unit(unit, float(abs(values).max()))
        for column, along in enumerate((change.time_s, along_m * travel.factor)):
            axes[row, column].plot(along, values * factor, color=DEVIATION, linewidth=0.9)
            style_axis(axes[row, column], f"{name} [{shown}]" if column == 0 else "")
    middle, waves = 0.502 * float(change.position_m.max()), WAVES * change.wavelength_m
    if 0.0 < waves < middle:
        axes[1, 1].set_xlim(middle * travel.factor, (middle + waves) * travel.factor)
    axes[1, 0].set_xlabel("time [s]")
    axes[1, 1].set_xlabel(f"position set-point [{travel.unit}]")
    return figure


def draw_mechanisms(folder: Path) -> Iterator[Path]:
    """Draw the picture of every mechanism as FOLDER/ID.svg."""
    for mechanism in LIBRARY:
        path = folder / f"{mechanism.id}.svg"
        with rc_context({"svg.fonttype": "path", "svg.hashsalt": "hil"}):  # text as curves; the same file every time
            draw(mechanism).savefig(path, metadata={"Date": None})
        yield path
