"""A term that worsens a channel: it comes after others, and falls if it costs more than a tenth of what it explains."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from diagnosis_runs import bench
from foreign_axis import LEAD_M, axis, write

from hil.bench.bench_file import load_bench
from hil.channels import AxisKind
from hil.commands.identify import identify
from hil.commands.import_ import import_
from hil.diagnosis.acceptance import paying
from hil.diagnosis.criteria import CRITERIA
from hil.diagnosis.preparation.prepare import prepare
from hil.diagnosis.search.addition import Addition, harm, removed, share_of_form
from hil.identification.nominal_fit import fit_nominal_parameters
from hil.identification.residuals import ChannelEnergy
from hil.identification.terms import Term
from hil.recording.recording import read_recording


def fit(motor: float, table: float) -> Any:
    """What is compared of a fit: mean square over noise of two channels in one run of 1000 rows."""
    run = SimpleNamespace(motor=np.zeros(1000), evaluated=slice(None), kind=AxisKind.ROTARY)
    ratios = ({"motor": motor, "table": table},)
    return SimpleNamespace(noise_ratios=ratios, data=SimpleNamespace(runs=(run,)), bench=bench())


GIVEN = fit(200.0, 1000.0)


@pytest.mark.parametrize(
    ("with_term", "without", "refutes"),
    [
        (fit(10.0, 5.0), fit(100.0, 5.0), set()),
        (fit(10.0, 5.0), fit(100.0, 3.0), set()),  # 2 lost, 90 gained
        (fit(90.0, 8.0), fit(100.0, 3.0), {"table_position_m"}),  # 5 lost, 10 gained
        (fit(10.0, 1.4), fit(100.0, 1.0), set()),  # within the noise
        (fit(10.0, 1300.0), fit(9000.0, 900.0), {"table_position_m"}),  # worse than by the bench file
    ],
)
def test_harm_is_weighed_against_what_a_term_explains(with_term: Any, without: Any, refutes: set[str]) -> None:
    assert paying(harm(with_term, without, GIVEN)) == refutes


def energies(motor: float, table: float) -> Any:
    """Residuals of 100 rows in two channels with these energies."""
    parts = {(0, name): np.full(100, np.sqrt(energy / 100.0)) for name, energy in (("motor", motor), ("table", table))}
    channels = {name: ChannelEnergy(float(part @ part), 100, 100.0) for (_, name), part in parts.items()}
    return SimpleNamespace(residuals=SimpleNamespace(parts=parts, by_channel=channels), terms=())


def test_what_is_removed_counts_over_the_noise_of_its_own_channel() -> None:
    """A quiet channel that the term does not touch makes it no smaller."""
    before, after = energies(100.0, 110.0), energies(100.0, 90.0)
    assert removed(before, after, before) == pytest.approx(0.2)


def test_what_a_term_explains_of_the_torque_counts_beside_a_burst_of_position(monkeypatch: pytest.MonkeyPatch) -> None:
    base: Any = energies(1000.0, 100.0)
    base.excess_by_channel, base.data = {"motor": 900.0, "table": 0.0}, SimpleNamespace(rows=200)
    for torque, share in (((0.6, 1.0), 0.64), (None, 10.0 / 900.0)):
        monkeypatch.setattr(Addition, "torque", torque)
        assert Addition(energies(990.0, 100.0), base, base, base).explained == pytest.approx(share)


def test_the_form_of_a_sensor_error_is_a_function_of_it_and_of_its_rate() -> None:
    time_s = np.linspace(0.0, 10.0, 5000)
    position = np.cumsum(np.interp(time_s % 4.0, [0.0, 0.3, 1.7, 2.0, 2.3, 3.7, 4.0], [0, 1, 1, 0, -1, -1, 0]))
    speed = np.gradient(position)
    assert share_of_form(speed**3, speed) > 0.95
    assert share_of_form(np.sin(position / 5.0 + 0.3), speed) < 0.1
    turning = np.linspace(0.0, 60.0, 5000)
    assert share_of_form(np.cos(2.0 * turning), np.cos(turning)) > 0.9  # its second harmonic
    assert share_of_form(np.zeros(5000), speed) == 1.0


LATE_S, PERIOD_M, SIZE_M = 3e-3, 2.3e-3, 4e-6


def test_an_encoder_that_is_late_does_not_hide_its_periodic_error(tmp_path: Path) -> None:
    """A hundredth of the lateness in energy and less is no other form of it."""
    columns = axis(9000)
    place_m = LEAD_M / (2.0 * np.pi) * columns["angle"]
    place_m = place_m + SIZE_M * np.sin(2.0 * np.pi * place_m / PERIOD_M)
    late_m = np.interp(columns["t"] - LATE_S, columns["t"], place_m)
    table = {"time_s": columns["t"], "motor_angle_rad": columns["angle"], "torque_Nm": columns["torque"]}
    table["scale_mm"] = np.round(1e3 * late_m / 1e-4) * 1e-4
    import_(write(tmp_path / "log.csv", table), None, tmp_path / "log.parquet", None, None)
    identify([tmp_path / "log.parquet"], tmp_path / "axis.yaml")
    prepared = prepare([read_recording(tmp_path / "log.parquet")], [], load_bench(tmp_path / "axis.yaml"))
    nominal = fit_nominal_parameters(prepared.train)
    given = nominal.estimator.evaluate(nominal.hypothesis.given)
    late, error = Term("channel_time_skew", 0, (2e-3,)), Term("scale_interpolation_error", 0, (2e-6, PERIOD_M, 0.1))
    base = nominal.estimator.fit(nominal.hypothesis.with_term(late))
    fit = nominal.estimator.fit(base.hypothesis.with_term(error))
    assert base.terms[0].values[0] == pytest.approx(LATE_S, rel=0.02)
    assert fit.terms[1].values[0] == pytest.approx(SIZE_M, rel=0.1)
    added = nominal.residuals.parts[0, "table"] - base.residuals.parts[0, "table"]
    assert base.cost - fit.cost < CRITERIA.form * float(added @ added)
    assert Addition(fit, base, nominal, given).removed > CRITERIA.material_alone
