"""A term that worsens a channel: it comes after others, and falls if it costs more than a tenth of what it explains."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from diagnosis_runs import bench

from hil.channels import AxisKind
from hil.diagnosis.acceptance import paying
from hil.diagnosis.search.addition import Addition, harm, removed
from hil.identification.residuals import ChannelEnergy


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
    return SimpleNamespace(residuals=SimpleNamespace(parts=parts, by_channel=channels))


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
