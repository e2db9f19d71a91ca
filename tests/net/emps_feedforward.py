"""Torque feed-forward for a real axis, off line: learnt on the first two thirds of EMPS, it predicts the last third.

    python tests/net/emps_feedforward.py          from the root of the repository, recordings beside it

The axis is diagnosed with its last third held out, the tables of `hil compensate` are made of the diagnosed bench, and
what they add over the measured motion is compared with the measured force, where the axis slides. Beside it plain least
squares (inertia, Coulomb, viscous, offset) of the same two thirds. Share of the force's standard deviation left (rms).
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from less_known import load

from hil.compensating.derive import derive, reach_of
from hil.control.compensation import follow
from hil.control.compensation_tables import pack
from hil.diagnosis.diagnose import diagnose
from hil.diagnosis.preparation.prepare import prepare
from hil.identification.intended_motion import measured_motion
from hil.identification.torque_left import fit_plain
from hil.motion.trajectory import plan
from hil.validation.proof.draw.demo import PROVE


def main() -> None:
    """Print the shares."""
    train, _, bench = load("emps")
    diagnosed = diagnose(train, [], bench).bench
    prepared = prepare(train, [], bench)
    plain = fit_plain(prepared.train)
    assert plain is not None
    run = prepared.held_out.runs[0]
    motion = measured_motion(run)
    moved, rows = motion.moved, motion.sliding(plain.slowest)
    reach = replace(
        reach_of(diagnosed, plan(PROVE, diagnosed.period_s)),
        low_m=float(moved.position.min()),
        high_m=float(moved.position.max()),
        velocity_m_s=float(np.abs(moved.velocity).max()),
        acceleration_m_s2=float(np.abs(moved.acceleration).max()),
    )
    derived = derive(diagnosed, reach, 1e-9)
    added = follow(pack(derived.compensation, run.period_s), moved.position, moved.velocity, moved.acceleration).torque
    deviation = float(np.std(motion.torque[rows]))
    least = plain.predict(moved)
    print(f"tables: {', '.join(table.name for table in derived.compensation.tables)}")
    for name, torque in (("tables of the diagnosis", added), ("plain least squares", least)):
        left = float(np.sqrt(np.mean((motion.torque - torque)[rows] ** 2)))
        print(f"{name:24} leave {100.0 * left / deviation:5.2f} % of the force, {left:.2f} N rms")


if __name__ == "__main__":
    main()
