"""Gains, notch and margins of the identified axis, against poles and against the simulated axis."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from command_line import hil as command
from compensated_benches import there_and_back
from hypothesis import given
from hypothesis import strategies as st

import hil
from hil.bench.bench_file import Bench, load_bench
from hil.compensating.loop_tuning import LoopMargins, is_stable, margin_rows, margins_of, tune
from hil.report.compare_report import write_bench


def bench_of(mechanisms: tuple[dict[str, Any], ...] = (), **axis: float) -> Bench:
    """The reference bench without friction, in reality too."""
    data = load_bench("reference").model_dump(mode="json")
    data["axis"] |= {"coulomb_torque_n_m": 1e-6} | axis
    return Bench.model_validate(data | {"mechanisms": list(mechanisms), "simulation": {"effects": list(mechanisms)}})


def following_m(bench: Bench) -> float:
    """Largest following error at the end of a motion of the simulated axis."""
    run = hil.simulate(bench, there_and_back(bench, 0.02, 0.05), seed=1)
    return float(np.abs(run["position_command_m"] - bench.axis.ratio_m_rad * run["motor_position_rad"])[-300:].max())


def louder(bench: Bench, factor: float) -> Bench:
    gains = bench.known_control.gains(bench.axis.ratio_m_rad)
    more = gains._replace(
        velocity_gain_n_m_s_rad=factor * gains.velocity_gain_n_m_s_rad,
        integral_gain_n_m_rad=factor * gains.integral_gain_n_m_rad,
    )
    return bench.model_copy(update={"control": bench.known_control.with_gains(more)})


@given(
    poles=st.lists(st.floats(-0.95, 0.95), min_size=1, max_size=3),
    zero=st.floats(-1.5, 1.5),
    gain=st.floats(0.01, 3.0),
    integrators=st.integers(0, 2),
)
def test_nyquist_agrees_with_the_poles(poles: list[float], zero: float, gain: float, integrators: int) -> None:
    opened = np.poly([*poles, *[1.0] * integrators])
    above = gain * np.poly([zero])
    closed = opened.copy()
    closed[-above.size :] += above
    largest = float(np.abs(np.roots(closed)).max())
    if np.polyval(above, 1.0) <= 0.05 or abs(largest - 1.0) < 0.02:
        return  # a falling integrator, or at the edge
    z = np.exp(2j * np.pi * np.geomspace(1e-5, 0.499, 20000))
    assert is_stable(np.polyval(above, z) / np.polyval(opened, z)) == (largest < 1.0)


def test_the_simulated_axis_swings_beyond_the_gain_margin() -> None:
    bench = bench_of()
    gain = 10.0 ** (margins_of(bench, (), bench.known_control.gains(bench.axis.ratio_m_rad)).velocity.gain_db / 20.0)
    calm, swinging = (following_m(louder(bench, factor * gain)) for factor in (0.85, 1.15))
    assert swinging > 10.0 * calm


def least(found: LoopMargins) -> float:
    return min(found.least)


def test_proposed_gains_keep_the_margins_on_every_draw_and_follow_better() -> None:
    bench = bench_of()
    draws = tuple(bench_of(stiffness_n_m=share * bench.axis.stiffness_n_m) for share in (0.6, 1.5))
    as_it_is, proposed, *_ = tune(bench, draws)
    assert proposed.gains.integral_gain_n_m_rad > as_it_is.gains.integral_gain_n_m_rad
    alone = tune(bench, ())[1]
    assert proposed.gains.integral_gain_n_m_rad <= alone.gains.integral_gain_n_m_rad
    assert least(proposed) > 0.49  # 0.5 before the gains are rounded
    tuned = bench.model_copy(update={"control": bench.known_control.with_gains(proposed.gains)})
    motion = there_and_back(bench, 0.05, 0.1)
    before, after = (hil.simulate(one, motion, seed=1) for one in (bench, tuned))

    def rms(run: Any) -> float:
        return float(np.std(run["position_command_m"] - bench.axis.ratio_m_rad * run["motor_position_rad"]))

    assert rms(after) < rms(before)


def test_a_dead_time_costs_gain() -> None:
    late = {"effect": "transport_delay", "parameters": {"delay_s": 0.002}}
    prompt, delayed = (tune(bench_of(mechanisms), ())[1].gains for mechanisms in ((), (late,)))
    assert delayed.integral_gain_n_m_rad < 0.5 * prompt.integral_gain_n_m_rad


def test_a_lag_of_the_velocity_costs_gain() -> None:
    slow = {"effect": "velocity_filter_lag", "parameters": {"time_constant_s": 0.005}}
    prompt, delayed = (tune(bench_of(mechanisms), ())[1].gains for mechanisms in ((), (slow,)))
    assert delayed.integral_gain_n_m_rad < 0.5 * prompt.integral_gain_n_m_rad


@pytest.mark.parametrize(("position", "velocity"), [(5000.0, 1.0), (1.0, 100.0), (1.0, 1e-4)])
def test_from_gains_that_are_unstable_or_far_off_it_comes_to_the_same(position: float, velocity: float) -> None:
    bench = bench_of()
    gains = bench.known_control.gains(bench.axis.ratio_m_rad)
    wrong = gains._replace(
        position_gain_1_s=position * gains.position_gain_1_s,
        velocity_gain_n_m_s_rad=velocity * gains.velocity_gain_n_m_s_rad,
        integral_gain_n_m_rad=velocity * gains.integral_gain_n_m_rad,
    )
    as_it_is, proposed, *_ = tune(bench.model_copy(update={"control": bench.known_control.with_gains(wrong)}), ())
    assert least(as_it_is) < 0.5
    assert proposed.gains == pytest.approx(tune(bench, ())[1].gains)
    texts = [row[3] for row in margin_rows([as_it_is], "N m")]
    assert ("unstable" in texts) == (least(as_it_is) == 0.0)


def test_a_notch_is_proposed_where_a_mode_limits_the_velocity_loop() -> None:
    bench = load_bench("reference_7dof")
    _, proposed, notched = tune(bench, ())
    assert notched.notch is not None
    assert proposed.notch is None
    modes = bench.twin().modal.frequency_rad_s / (2.0 * np.pi)
    assert np.min(np.abs(modes - notched.notch.frequency_hz)) < 0.1
    assert notched.gains.integral_gain_n_m_rad > 1.2 * proposed.gains.integral_gain_n_m_rad
    assert least(notched) > 0.49


def test_the_command_prints_margins_and_takes_the_gains_on_demand(tmp_path: Path) -> None:
    bench = load_bench("reference")
    entry = {"effect": "periodic_lead_error", "parameters": {"amplitude_m": 8e-6, "phase_rad": 0.5}}
    diagnosed = Bench.model_validate(bench.model_dump(mode="json") | {"mechanisms": [entry]})
    write_bench(diagnosed, tmp_path / "bench.diagnosed.yaml")
    arguments = ("--profile", "reversal", "--fade-in", "0.2", "--tune")
    ran = command(tmp_path, "compensate", "bench.diagnosed.yaml", *arguments)
    assert ran.returncode == 0, ran.stderr
    assert "proposed" in ran.stdout
    assert "by the gains alone" in ran.stdout
    written = load_bench(tmp_path / "bench.compensated.yaml")
    assert written.gains.position_gain_1_s > bench.gains.position_gain_1_s
    assert written.tables().tables
