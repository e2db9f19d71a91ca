"""Tables that no longer fit the axis are told, with the angle at which they would."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import hil
from hil.bench.bench_file import Bench, load_bench
from hil.compensating.compensate import plan_compensation, section_of
from hil.compensating.old_tables import old_tables, reach_of_recording
from hil.motion.profile import load_profile
from hil.motion.trajectory import plan

FADE_S = 0.3


def bench_of(phase_rad: float, amplitude_n_m: float = 0.4, **sections: Any) -> Bench:
    """The reference bench as a diagnosis found its cogging."""
    values = {"amplitude_n_m": amplitude_n_m, "cycles_per_rev": 6.0, "phase_rad": phase_rad}
    mechanisms = [{"effect": "cogging_torque", "parameters": values}]
    return Bench.model_validate(load_bench("reference").model_dump(mode="json") | {"mechanisms": mechanisms} | sections)


def test_a_table_at_another_angle_and_one_that_is_gone_are_told() -> None:
    first = bench_of(0.4)
    motion = plan(load_profile("identification"), first.period_s)
    section = section_of(plan_compensation(first, motion, None, FADE_S), Path("bench.diagnosed.yaml"), "2026-01-31")
    reach = reach_of_recording(hil.simulate(first, motion, seed=1), first)

    def told(bench: Bench) -> list[str]:
        return list(old_tables(bench, reach))

    assert not told(bench_of(0.45, compensation=section))
    (moved,) = told(bench_of(2.2, compensation=section))
    assert "'torque over angle' no longer fits" in moved
    assert "turned by -17" in moved  # 1.8 rad of a wave, of which six are a turn
    (gone,) = told(bench_of(0.4, 1e-6, compensation=section))
    assert "nothing like it" in gone
    short = replace(reach, high_m=reach.low_m + 0.5 * reach.turn_m)
    (unchecked,) = old_tables(bench_of(0.4, compensation=section), short)
    assert "not checked" in unchecked
