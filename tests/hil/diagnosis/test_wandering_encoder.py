"""A second encoder that wanders far above its white noise: what depends on nothing does not hide a right name."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from foreign_axis import LEAD_M, axis, write
from scipy.signal import lfilter

from hil.arrays import FloatArray
from hil.bench.bench_file import load_bench
from hil.commands.identify import identify
from hil.commands.import_ import import_
from hil.diagnosis.ledger import accepted
from hil.diagnosis.preparation.prepare import prepare
from hil.diagnosis.stages import Prepared
from hil.diagnosis.structure_left import like_noise, structure_left
from hil.diagnosis.verdict.held_out import with_own_noise
from hil.diagnosis.verdict.judge import explanation
from hil.diagnosis.verdict.reproduction import reproduction
from hil.identification.nominal_fit import fit_nominal_parameters
from hil.identification.terms import Term
from hil.recording.recording import read_recording

ROWS, AMPLITUDE_M, WANDER_M, CORRELATION_S = 9000, 2e-6, 2e-6, 0.03


def drafted(folder: Path, columns: dict[str, FloatArray], place_m: FloatArray) -> Prepared:
    """A recording of an axis whose second encoder reads places (n,) in counts of 0.1 um, and its drafted bench."""
    table = {"time_s": columns["t"], "motor_angle_rad": columns["angle"], "torque_Nm": columns["torque"]}
    table["scale_mm"] = np.round(1e3 * place_m / 1e-4) * 1e-4
    import_(write(folder / "log.csv", table), None, folder / "log.parquet", None, None)
    identify([folder / "log.parquet"], folder / "axis.yaml")
    return prepare([read_recording(folder / "log.parquet")], [], load_bench(folder / "axis.yaml"))


def test_wander_beside_a_lead_error_is_noise_though_the_torque_has_a_structure(tmp_path: Path) -> None:
    columns, random = axis(ROWS), np.random.default_rng(4)
    angle, decay = columns["angle"], float(np.exp(-1e-3 / CORRELATION_S))
    wander_m = lfilter([np.sqrt(1.0 - decay**2) * WANDER_M], [1.0, -decay], random.standard_normal(ROWS))
    place_m = LEAD_M / (2.0 * np.pi) * angle + AMPLITUDE_M * np.sin(angle) + wander_m
    torque = columns["torque"] + 0.05 * np.sin(angle / 5.0)  # a structure of the torque
    table = {"time_s": columns["t"], "motor_angle_rad": angle, "torque_Nm": torque}
    table["scale_mm"] = np.round(1e3 * place_m / 1e-4) * 1e-4
    import_(write(tmp_path / "log.csv", table), None, tmp_path / "log.parquet", None, None)
    identify([tmp_path / "log.parquet"], tmp_path / "axis.yaml")
    prepared = prepare([read_recording(tmp_path / "log.parquet")], [], load_bench(tmp_path / "axis.yaml"))
    base, held_out = fit_nominal_parameters(prepared.train), prepared.held_out
    start = Term("periodic_lead_error", 0, (1e-6, 0.1, 0.0, 0.0, 0.0, 0.0))
    fit = base.estimator.fit(base.hypothesis.with_term(start))
    assert fit.terms[0].values[0] == pytest.approx(
        AMPLITUDE_M, abs=0.6e-6
    )  # two errors of the mean of some 100 independent rows
    assert fit.noise_ratios[0]["table"] > 25.0
    left = structure_left(fit, held_out)
    assert {one.channel for one in left} == {"torque"}
    assert like_noise(fit, left) == {"table"}
    assert accepted(explanation(base, fit, held_out))
    weighted = with_own_noise(fit, held_out)
    assert weighted.noise_ratios[0]["table"] == pytest.approx(1.0, rel=0.05)


def test_what_goes_with_the_motion_is_no_noise(tmp_path: Path) -> None:
    columns = axis(ROWS)
    angle = columns["angle"]
    place_m = LEAD_M / (2.0 * np.pi) * angle + AMPLITUDE_M * np.sin(angle) + 3e-6 * np.sign(columns["speed"])
    prepared = drafted(tmp_path, columns, place_m)
    base = fit_nominal_parameters(prepared.train)
    assert "table" not in like_noise(base, structure_left(base, prepared.held_out))
    assert not accepted(reproduction(base, prepared.held_out))


def test_a_twin_beside_an_encoder_that_wanders_alone_lacks_nothing(tmp_path: Path) -> None:
    columns, random = axis(ROWS), np.random.default_rng(5)
    decay = float(np.exp(-1e-3 / CORRELATION_S))
    wander_m = lfilter([np.sqrt(1.0 - decay**2) * WANDER_M], [1.0, -decay], random.standard_normal(ROWS))
    place_m = LEAD_M / (2.0 * np.pi) * columns["angle"] + wander_m
    prepared = drafted(tmp_path, columns, place_m)
    base = fit_nominal_parameters(prepared.train)
    assert base.noise_ratios[0]["table"] > 25.0
    assert accepted(reproduction(base, prepared.held_out))


@pytest.mark.parametrize("turns", [2.2, 0.7])
def test_an_error_as_slow_as_the_motion_is_no_noise(turns: float, tmp_path: Path) -> None:
    """A wheel off centre behind an unknown gear: of so slow a remainder too few values are independent."""
    columns = axis(ROWS)
    angle = columns["angle"]
    place_m = LEAD_M / (2.0 * np.pi) * angle + 20e-6 * np.sin(2.0 * np.pi * turns * angle / np.ptp(angle))
    prepared = drafted(tmp_path, columns, place_m)
    base = fit_nominal_parameters(prepared.train)
    assert not accepted(reproduction(base, prepared.held_out))
    if turns > 2.0:
        left = structure_left(base, prepared.held_out)
        assert any("place within its period" in one.question.name for one in left if one.channel == "difference")
