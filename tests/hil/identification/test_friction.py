"""Friction identification returns what was put in, finds constant feeds only, and says when it cannot."""

from __future__ import annotations

from math import pi

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from hil.channels import AxisKind
from hil.errors import InputError
from hil.identification.friction import constant_feed_stretches, identify_friction
from hil.recording.recording import Recording

PERIOD_S = 1e-3
RADIUS_M = 0.010 / (2 * pi)
INERTIA_KG_M2 = 1.8e-3


def sweep(
    feeds_m_s: tuple[float, ...],
    coulomb: float = 1.1,
    viscous: float = 0.0064,
    offset: float = 0.2,
    noise: float = 0.0,
    lag_s: float = 0.027,
    plateau_s: float = 0.6,
) -> Recording:
    """Feeds with ramps between them; the axis follows with a lag, so that torque has transients."""
    pieces = [np.zeros(200)]
    for feed in feeds_m_s:
        ramp = feed * np.sin(np.linspace(0, pi / 2, 150)) ** 2
        pieces += [ramp, np.full(round(plateau_s / PERIOD_S), feed), ramp[::-1], np.zeros(100)]
    command: NDArray[np.float64] = np.concatenate(pieces)
    velocity = np.zeros_like(command)
    for k in range(1, command.size):
        velocity[k] = velocity[k - 1] + (command[k - 1] - velocity[k - 1]) * PERIOD_S / lag_s
    speed = velocity / RADIUS_M
    torque = INERTIA_KG_M2 * np.gradient(speed, PERIOD_S) + coulomb * np.sign(speed) + viscous * speed + offset
    torque += noise * np.random.default_rng(5).normal(size=torque.size)
    columns = {
        "time_s": np.linspace(0.0, (command.size - 1) * PERIOD_S, command.size),
        "position_command_m": np.cumsum(command) * PERIOD_S,
        "velocity_command_m_s": command,
        "motor_position_rad": np.cumsum(speed) * PERIOD_S,
        "torque_n_m": torque,
    }
    return Recording("sweep", columns, PERIOD_S)


FEEDS = (0.01, -0.01, 0.05, -0.05, 0.12, -0.12, 0.3, -0.3)


@given(coulomb=st.floats(0.2, 5), viscous=st.floats(0.001, 0.05), offset=st.floats(-0.5, 0.5))
@settings(max_examples=15)
def test_known_friction_is_found_within_the_noise(coulomb: float, viscous: float, offset: float) -> None:
    result = identify_friction(sweep(FEEDS, coulomb, viscous, offset, noise=0.01))
    assert len(result.points) == len(FEEDS)
    assert result.kind is AxisKind.ROTARY
    assert result.coulomb == pytest.approx(coulomb, rel=0.02)
    assert result.viscous == pytest.approx(viscous, rel=0.02)
    assert result.offset == pytest.approx(offset, abs=0.005)
    for value, error, truth in (
        (result.coulomb, result.coulomb_std_error, coulomb),
        (result.viscous, result.viscous_std_error, viscous),
        (result.offset, result.offset_std_error, offset),
    ):
        assert abs(value - truth) < 6 * error + 1e-3 * abs(truth)


def test_the_transient_would_falsify_the_result_if_it_were_not_cut() -> None:
    slow = sweep(FEEDS, lag_s=0.027)
    assert identify_friction(slow).viscous == pytest.approx(0.0064, rel=0.01)
    # with the transient the mean torque holds the end of the acceleration, which grows with the feed
    assert identify_friction(slow, settling_s=0.0).viscous > 1.05 * 0.0064


def test_low_speeds_can_be_left_out() -> None:
    result = identify_friction(sweep(FEEDS), speed_min=0.02 / RADIUS_M)
    assert sorted({round(abs(point.feed_m_s), 3) for point in result.points}) == [0.05, 0.12, 0.3]
    assert result.torque(np.array([-10.0, 10.0])) == pytest.approx([-1.1 - 0.064 + 0.2, 1.1 + 0.064 + 0.2], rel=1e-3)


@pytest.mark.parametrize(
    "feeds",
    [
        (0.01, 0.05, 0.12, 0.3),  # one direction
        (0.05, -0.05, 0.05, -0.05),  # one speed
        (0.05, -0.05),  # too few
    ],
)
def test_a_recording_that_cannot_tell_is_refused(feeds: tuple[float, ...]) -> None:
    with pytest.raises(InputError, match=r"sweep: velocity_command_m_s: given \d forward and \d backward"):
        identify_friction(sweep(feeds))


def test_plateaus_that_are_too_short_do_not_count() -> None:
    with pytest.raises(InputError, match=r"given 0 forward and 0 backward .* longer than 0\.26 s"):
        identify_friction(sweep(FEEDS, plateau_s=0.2))


@given(plateaus=st.lists(st.tuples(st.floats(0.001, 0.5), st.sampled_from((-1, 1))), min_size=1, max_size=6))
def test_stretches_are_constant_maximal_and_hold_every_plateau(plateaus: list[tuple[float, int]]) -> None:
    pieces = []
    ends = []
    for feed, sign in plateaus:
        ramp = sign * feed * np.sin(np.linspace(0, pi / 2, 60)) ** 2
        pieces += [ramp, np.full(300, sign * feed), ramp[::-1], np.zeros(50)]
        ends.append(sum(piece.size for piece in pieces) - 110)
    velocity = np.concatenate(pieces)
    stretches = constant_feed_stretches(velocity)
    for first, end in stretches:
        values = velocity[first:end]
        assert np.all(np.abs(values - values[0]) <= 1e-3 * abs(values[0]) + 2e-6)
        assert np.all(values != 0)
    long = [(first, end) for first, end in stretches if end - first > 200]
    assert len(long) == len(plateaus)
    for (first, end), plateau_end in zip(long, ends, strict=True):
        assert first <= plateau_end - 290
        assert end >= plateau_end


def test_the_figure_shows_points_line_and_values() -> None:
    result = identify_friction(sweep(FEEDS, noise=0.01))
    figure = result.plot()
    top, bottom = figure.axes
    assert top.lines[0].get_xdata() == pytest.approx([point.speed for point in result.points])
    assert top.get_ylabel() == "mean torque [N m]"
    assert bottom.get_xlabel() == "motor speed [rad/s]"
    assert f"Coulomb {result.coulomb:.5f} ± " in top.texts[0].get_text()
    assert "N m s/rad" in top.texts[0].get_text()
    figure.canvas.draw()
