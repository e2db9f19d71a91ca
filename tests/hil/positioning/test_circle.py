"""ISO 230-4: circles with known errors, the narrowest ring, and two simulated axes along one circle."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from command_line import hil as command
from command_line import refused

import hil
from hil.bench.bench_file import Bench, load_bench
from hil.errors import InputError
from hil.positioning.circle_fit import least_squares_circle, narrowest_ring
from hil.recording.recording import Recording

R_M, PERIOD_S = 0.05, 0.002
SECOND_S = 1.0  # rest at both ends of a circle


def circle(
    *, x_scale: float = 0.0, play_m: float = 0.0, square_rad: float = 0.0, radius_m: float = 0.0
) -> list[Recording]:
    """Recordings of both axes: an anticlockwise and a clockwise circle of three turns, measured with known errors."""
    rest = np.zeros(round(SECOND_S / PERIOD_S))
    share = np.linspace(0.0, 1.0, 6001)
    angle = np.interp(share, *_eased(share)) * 6.0 * np.pi
    angles = np.concatenate([rest, angle, rest + angle[-1], angle[::-1], rest])
    command_x, command_y = R_M * np.cos(angles), R_M * np.sin(angles)
    late = [0.5 * play_m * np.sign(np.gradient(one)) for one in (command_x, command_y)]
    table_x = command_x * (1.0 + x_scale + radius_m / R_M) - late[0] + square_rad * command_y
    table_y = command_y * (1.0 + radius_m / R_M) - late[1]
    time_s = np.arange(angles.size) * PERIOD_S
    return [
        Recording(name, {"time_s": time_s, "position_command_m": one, "table_position_m": table}, PERIOD_S)
        for name, one, table in (("x", command_x, table_x), ("y", command_y, table_y))
    ]


def _eased(share: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Share of the way over the share of time: a tenth to speed up, a tenth to slow down."""
    speed = np.clip(np.minimum(share, 1.0 - share) / 0.1, 0.0, 1.0)
    way = np.concatenate([[0.0], np.cumsum(0.5 * (speed[1:] + speed[:-1]))])
    return share, way / way[-1]


def test_an_ideal_circle_has_no_deviation() -> None:
    found = hil.circular_accuracy(*circle())
    assert found.radius_m == pytest.approx(R_M)
    assert set(found.paths) == {1, -1}
    assert max(abs(value) for value in found.figures.values()) < 1e-12


def test_a_scale_error_of_one_axis_is_an_ellipse() -> None:
    """x = R (1 + a) cos p: the radius goes from R to R (1 + a)."""
    figures = hil.circular_accuracy(*circle(x_scale=2e-4)).figures
    for name in ("circular_anticlockwise_m", "circular_clockwise_m", "circular_bidirectional_m"):
        assert figures[name] == pytest.approx(2e-4 * R_M, rel=1e-3)
    assert figures["radial_greatest_clockwise_m"] == pytest.approx(2e-4 * R_M, rel=1e-3)
    assert figures["radial_least_clockwise_m"] == pytest.approx(0.0, abs=1e-8)
    assert figures["mean_radial_m"] == pytest.approx(1e-4 * R_M, rel=1e-3)


def test_axes_out_of_square_lengthen_one_diagonal() -> None:
    """x = R (cos p + q sin p): r = R (1 + q/2 sin 2p)."""
    figures = hil.circular_accuracy(*circle(square_rad=1e-4)).figures
    assert figures["circular_bidirectional_m"] == pytest.approx(1e-4 * R_M, rel=1e-3)
    assert figures["mean_radial_m"] == pytest.approx(0.0, abs=1e-9)


def test_play_parts_the_senses() -> None:
    """In each sense the path is late by half the play along both axes: r = R + g/2 (|sin p| cos p-like steps)."""
    play_m = 10e-6
    found = hil.circular_accuracy(*circle(play_m=play_m))
    for sense in (1, -1):
        path = found.paths[sense]
        angle = path.angle_rad
        late = (
            0.5
            * play_m
            * (np.cos(angle) * np.sign(np.sin(angle)) * sense - np.sin(angle) * np.sign(np.cos(angle)) * sense)
        )
        measured = np.hypot(path.x_m, path.y_m) - R_M
        inside = np.abs(np.sin(2.0 * angle)) > 0.05  # beside the turns of an axis
        np.testing.assert_allclose(measured[inside], late[inside], atol=2e-9)
    figures = found.figures
    assert figures["circular_bidirectional_m"] == pytest.approx(play_m, rel=0.02)
    assert figures["circular_anticlockwise_m"] <= figures["circular_bidirectional_m"]


def test_a_circle_that_is_too_large_is_the_mean_radial_deviation() -> None:
    figures = hil.circular_accuracy(*circle(radius_m=3e-6)).figures
    assert figures["mean_radial_m"] == pytest.approx(3e-6)
    assert figures["circular_bidirectional_m"] < 1e-12


def test_the_narrowest_ring_is_narrower_than_any_other() -> None:
    rng = np.random.default_rng(5)
    angle = np.linspace(0.0, 2.0 * np.pi, 400)
    radius = R_M + 4e-6 * np.cos(3 * angle) + rng.normal(scale=5e-7, size=angle.size)
    x, y = radius * np.cos(angle) + 12e-6, radius * np.sin(angle) - 7e-6
    ring = narrowest_ring(x, y)

    def width(a: float, b: float) -> float:
        return float(np.ptp(np.hypot(x - a, y - b)))

    assert ring.width_m == pytest.approx(width(ring.x_m, ring.y_m), rel=1e-4)
    around = [(ring.x_m + 1e-6 * dx, ring.y_m + 1e-6 * dy) for dx in (-1, 0, 1) for dy in (-1, 0, 1)]
    assert min(width(*one) for one in around) == pytest.approx(ring.width_m, rel=1e-3)
    fitted = least_squares_circle(x, y)
    assert ring.width_m <= width(fitted.x_m, fitted.y_m)
    assert (fitted.x_m, fitted.y_m) == pytest.approx((12e-6, -7e-6), abs=2e-7)


def test_recordings_that_make_no_circle_are_refused() -> None:
    x, y = circle()
    line = Recording("line", x.columns, x.period_s)
    with pytest.raises(InputError, match="no whole turn"):
        hil.circular_accuracy(x, line)
    with pytest.raises(InputError, match="one rate"):
        hil.circular_accuracy(x, Recording("slow", y.columns, 2 * PERIOD_S))


def test_two_benches_along_one_circle(tmp_path: Path) -> None:
    """Coulomb friction of both axes: four spikes outwards; half of it at the second axis: smaller ones there."""
    data = load_bench("reference").model_dump(mode="json")
    data["axis"]["coulomb_torque_n_m"] *= 0.5
    smooth = Bench.model_validate(data)
    benches = {"circle_x": load_bench("reference"), "circle_y": smooth}
    for name, bench in benches.items():
        run = hil.simulate(bench, hil.plan(hil.load_profile(name), bench.period_s), seed=1)
        hil.save(run, tmp_path / f"{name}.parquet")
    ran = command(tmp_path, "iso230", "--circle", "circle_x.parquet", "circle_y.parquet", "--out", "judged")
    assert ran.returncode == 0, ran.stderr
    assert "G(b)  bidirectional circular deviation" in ran.stdout
    numbers = json.loads((tmp_path / "judged" / "iso230.json").read_text())
    assert numbers["radius_m"] == pytest.approx(0.05, rel=1e-6)
    assert numbers["feed_m_s"] == pytest.approx(2.0 * np.pi * 0.05 / 4.0, rel=1e-3)
    assert set(numbers["spikes_m"]) == {"anticlockwise", "clockwise"}
    for spikes in numbers["spikes_m"].values():
        first, second = [spikes["0"], spikes["180"]], [spikes["90"], spikes["270"]]
        assert min(first) > 5e-6
        assert 0.0 < max(second) < 0.7 * min(first)
    page = (tmp_path / "judged" / "iso230.html").read_text()
    assert "ISO 230-4" in page
    assert page.count("data:image/png") == 1
    assert "no such file" in refused(tmp_path, "iso230", "--circle", "circle_x.parquet", "none.parquet")
