"""Noise apart: the energy of the reference's residual stays, and no inertia gains by answering less."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from diagnosis_runs import bench, changed, recorded
from foreign_axis import INERTIA_KG_M2, axis, csv_text, renamed, write

from hil.bench.bench_file import load_bench
from hil.bench.control_section import UnknownControl
from hil.commands.identify import identify
from hil.commands.import_ import import_
from hil.diagnosis.preparation.prepare import prepare
from hil.identification.estimator import Fit
from hil.identification.noise_apart import noise_apart
from hil.identification.nominal_fit import fit_nominal_parameters
from hil.identification.residual_scales import inertia
from hil.identification.terms import Term
from hil.identification.torque_left import fit_plain
from hil.recording.recording import read_recording

KNOWN = bench()
OWNER = KNOWN.model_copy(update={"control": UnknownControl(law="unknown")})


def measured() -> Fit:
    """A twin fitted to an axis whose torque was measured with much noise."""
    recording = changed(recorded(KNOWN, times=2, torque_noise_n_m=0.3), torque_command_n_m=None)
    recording = replace(recording, metadata={**recording.metadata, "source": "log.csv"})
    return fit_nominal_parameters(prepare([recording], [], OWNER).train)


def test_no_inertia_gains_by_answering_less() -> None:
    fit = measured()
    plain = fit_plain(fit.data)
    assert plain is not None
    given = fit.hypothesis.given
    data = noise_apart(fit.data, given, plain)
    (before,), (after,) = given.residuals(fit.data).channels, given.residuals(data).channels
    assert np.mean(after["motor"] ** 2) == pytest.approx(np.mean(before["motor"] ** 2), rel=1e-6)
    for name in set(before) - {"motor"}:
        np.testing.assert_allclose(after[name], before[name], atol=1e-15)
    apart = replace(fit.estimator, data=data).fit(given)
    true = inertia(KNOWN)
    assert inertia(apart.bench) == pytest.approx(true, rel=0.02)
    assert abs(inertia(apart.bench) - true) < abs(inertia(fit.bench) - true)


def of_a_coarse_encoder(folder: Path, added_n_m: float = 0.0) -> Fit:
    """The fit below the noise of an axis without a spring, whose motion needs a mean over many rows.

    With a torque of 12 cycles per turn in its measured torque.
    """
    columns, count = axis(6000), 2.0 * np.pi / 2000.0
    columns["torque"] += np.random.default_rng(1).normal(0.0, 0.05, columns["torque"].size)
    columns["torque"] -= added_n_m * np.sin(12.0 * columns["angle"] + 0.5)
    columns["angle"] = count * np.round(columns["angle"] / count)
    named = renamed(columns, t="time_s", angle="motor_angle_rad", torque="torque_Nm")
    return below_noise(write(folder / "log.csv", named))


def below_noise(source: Path) -> Fit:
    """The fit below the noise of the axis of a foreign recording, drafted from it."""
    folder = source.parent
    import_(source, None, folder / "log.parquet", None, None)
    identify([folder / "log.parquet"], folder / "axis.yaml")
    fit = fit_nominal_parameters(
        prepare([read_recording(folder / "log.parquet")], [], load_bench(folder / "axis.yaml")).train
    )
    plain = fit_plain(fit.data)
    assert plain is not None
    assert fit.within_noise
    return replace(fit.estimator, data=noise_apart(fit.data, fit.hypothesis, plain)).fit(fit.hypothesis)


def test_what_a_mean_takes_off_the_motion_is_no_inertia(tmp_path: Path) -> None:
    assert inertia(of_a_coarse_encoder(tmp_path).bench) == pytest.approx(INERTIA_KG_M2, rel=2e-3)


def test_a_torque_keeps_the_size_that_the_mean_takes_off_it(tmp_path: Path) -> None:
    without = of_a_coarse_encoder(tmp_path, 0.04)
    found = without.estimator.fit(without.hypothesis.with_term(Term("cogging_torque", 0, (0.02, 12.0, 0.0))))
    assert found.terms[-1].values[0] == pytest.approx(0.04, rel=0.3)


def test_a_torque_constant_that_falls_is_told_by_moves_as_short_as_the_mean(tmp_path: Path) -> None:
    """Moves of 15 to 30 ms beside a mean of 21 ms; set-points make them, 2 ms ahead."""
    rate_hz, ratio_mm, falls, rng = 4000.0, 10.0 / (2.0 * np.pi), 0.02, np.random.default_rng(4)
    parts = [np.zeros(200)]
    for number in range(80):
        rows = int(rng.integers(60, 120))
        top = (-1.0) ** number * rng.uniform(10.0, 60.0)
        parts += [top * np.sin(np.pi * np.arange(rows) / rows) ** 2, np.zeros(40)]
    speed = np.concatenate(parts)
    force = INERTIA_KG_M2 * np.gradient(speed, 1.0 / rate_hz) + 0.01 * speed + 0.4 * np.sign(speed)
    torque = force.copy()
    for _ in range(30):  # u (1 - c u^2) = force
        torque = force + falls * torque**3 / force.max() ** 2
    angle = np.cumsum(speed) / rate_hz
    columns = {
        "time_s": np.arange(speed.size) / rate_hz,
        "set_mm": ratio_mm * np.concatenate([angle[8:], np.full(8, angle[-1])]),
        "motor_angle_rad": np.round(angle / 1e-4) * 1e-4,
        "torque_Nm": torque + rng.normal(0.0, 0.03 * np.std(torque), speed.size),
    }
    source = tmp_path / "log.csv"
    source.write_text(csv_text(columns, above="# lead 10 mm\n"))
    without = below_noise(source)
    known = falls / force.max() ** 2
    found = without.estimator.fit(without.hypothesis.with_term(Term("torque_constant_saturation", 0, (0.3 * known,))))
    assert found.terms[-1].values[0] == pytest.approx(known, rel=0.5)
    assert inertia(found.bench) == pytest.approx(INERTIA_KG_M2, rel=5e-3)
