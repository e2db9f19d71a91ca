"""A drafted bench has the friction of the load and the owner's split; its fit tells the axis that was simulated."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from foreign_axis import write
from two_mass_axis import TwoMassAxis, columns

from hil.bench.bench_file import Bench, load_bench
from hil.commands.identify import identify
from hil.commands.import_ import import_
from hil.diagnosis.preparation.prepare import prepare
from hil.identification.nominal_fit import fit_nominal_parameters
from hil.recording.recording import read_recording

AXIS = TwoMassAxis()
OWNER = "Belt axis, 62.832 mm per motor turn. Carriage about 14.3 kg. Position loop on the motor encoder.\n"


@pytest.fixture(scope="module")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> dict[str, np.ndarray]:
    return columns(AXIS)


def drafted(folder: Path, recorded: dict[str, np.ndarray], owner: str) -> Bench:
    (folder / "readme.txt").write_text(owner)
    import_(write(folder / "log.csv", recorded), None, folder / "log.parquet", readme=folder / "readme.txt")
    identify([folder / "log.parquet"], folder / "axis.yaml")
    return load_bench(folder / "axis.yaml")


def shares(bench: Bench) -> tuple[float, float]:
    """Shares of Coulomb and viscous friction on the load."""
    coulomb, more = (bench.mechanisms[index].parameters["share"] for index in (-2, -1))
    return coulomb, coulomb + more * ((1.0 - coulomb) if more > 0.0 else coulomb)


@pytest.fixture(scope="module")
def told(tmp_path_factory: pytest.TempPathFactory, recorded: dict[str, np.ndarray]) -> tuple[Path, Bench]:
    """Folder of the recording, and the bench that is drafted with the owner's words."""
    folder = tmp_path_factory.mktemp("told")
    return folder, drafted(folder, recorded, OWNER)


def test_the_owner_s_load_is_held_and_splits_the_sum(told: tuple[Path, Bench]) -> None:
    bench = told[1]
    axis = bench.axis
    assert axis.held == ("table_mass_kg",)
    assert axis.table_mass_kg == pytest.approx(14.3)  # type: ignore[union-attr]
    assert axis.motor_mass_kg == pytest.approx(4.0, abs=0.6)  # type: ignore[union-attr]
    assert axis.stiffness_n_m == pytest.approx(AXIS.stiffness_n_m, rel=0.15)  # type: ignore[union-attr]
    assert [one.effect for one in bench.mechanisms] == ["table_side_friction", "table_side_viscous_friction"]
    assert shares(bench) == pytest.approx((18.0 / 24.0, 30.0 / 40.0), abs=0.15)


@pytest.mark.long
def test_without_the_owner_the_split_is_half(tmp_path: Path, recorded: dict[str, np.ndarray]) -> None:
    bench = drafted(tmp_path, recorded, "Belt axis, 62.832 mm per motor turn.\n")
    assert not bench.axis.held
    assert bench.axis.table_mass_kg == bench.axis.motor_mass_kg  # type: ignore[union-attr]


def test_the_second_encoder_tells_spring_and_friction_behind_the_motor(told: tuple[Path, Bench]) -> None:
    folder, bench = told
    fit = fit_nominal_parameters(prepare([read_recording(folder / "log.parquet")], [], bench).train, 30)
    axis = fit.bench.axis
    assert axis.stiffness_n_m / axis.table_mass_kg == pytest.approx(6e5 / 14.0, rel=0.05)  # type: ignore[union-attr]
    assert shares(fit.bench)[0] == pytest.approx(18.0 / 24.0, abs=0.05)


@pytest.mark.long
def test_noise_of_the_torque_is_not_in_the_second_encoder(tmp_path: Path) -> None:
    left = []
    for noise_n_m in (0.005, 0.2):
        folder = tmp_path / str(noise_n_m)
        folder.mkdir()
        bench = drafted(folder, columns(AXIS, noise_n_m=noise_n_m), OWNER)
        fit = fit_nominal_parameters(prepare([read_recording(folder / "log.parquet")], [], bench).train, 30)
        left.append(float(np.std(fit.residuals.channels[0]["table"])))
    assert left[1] == pytest.approx(left[0], rel=0.1)
