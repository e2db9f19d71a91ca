"""The control law gives the same bits compiled, inlined, and in plain Python."""

from __future__ import annotations

import numpy as np
import pytest

from hil.bench.bench_file import load_bench
from hil.control import cascade


@pytest.mark.parametrize(
    "changes",
    [
        {},
        {"position_from_table": True},
        {"two_sample_mean": True},
        {"filter_coefficient": 0.4},
        {"torque_limit_n_m": 5.0},
    ],
)
def test_replay_step_and_python_agree_bit_by_bit(changes: dict[str, object]) -> None:
    gains = load_bench("reference").gains._replace(**changes)
    random = np.random.default_rng(3)
    n = 3000
    position, motor = np.cumsum(random.normal(0, 1e-4, n)), np.cumsum(random.normal(0, 1e-3, n))
    velocity, table = random.normal(0, 0.1, n), 0.0016 * motor
    start = cascade.init(motor[0])
    replayed, _ = cascade.replay(gains, start, position, velocity, motor, table)
    compiled = plain = start
    stepped, python = np.empty(n), np.empty(n)
    for k in range(n):
        inputs = cascade.Inputs(position[k], velocity[k], motor[k], table[k])
        compiled, out = cascade.step(gains, compiled, inputs)
        stepped[k] = out.torque_n_m
        plain, out = cascade.step.py_func(gains, plain, inputs)
        python[k] = out.torque_n_m
    assert np.ptp(replayed) > 1.0
    assert np.array_equal(replayed, stepped)
    assert np.array_equal(replayed, python)
