"""bench.diagnosed.yaml: the owner's file with what was found, which says of the recordings what the diagnosis says."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from diagnosis_runs import bench, recorded

from hil.bench.bench_file import Bench, load_bench
from hil.bench.hardware import SimulationSection
from hil.diagnosis.diagnose import diagnose
from hil.diagnosis.diagnosis import Diagnosis
from hil.diagnosis.result import Finding
from hil.files.shipped import shipped_files
from hil.identification.compare import compare
from hil.identification.dataset import Dataset
from hil.identification.hypothesis import Hypothesis
from hil.identification.terms import Term
from hil.loop.simulated_bench import load_simulated, true_axis
from hil.report.diagnosed_bench import write_diagnosed_bench

OWNER = load_bench("reference")
SOURCE = shipped_files("bench")["reference"]
COGGING = Term("cogging_torque", 0, (0.2, 6.0, 0.4))
TRUTH = bench(table_mass_kg=410.0, coulomb_torque_n_m=1.0)
TRAIN, HELD_OUT = (recorded(TRUTH, COGGING, times=2, seed=seed, name=f"run_{seed}") for seed in (1, 2))


@pytest.fixture(scope="module")
def found() -> Diagnosis:
    return diagnose([TRAIN], [HELD_OUT], OWNER)


def written(found: Diagnosis, folder: Path, source: Path | None = SOURCE) -> tuple[str, Bench]:
    path = folder / "bench.diagnosed.yaml"
    write_diagnosed_bench(found, path, source)
    return path.read_text(encoding="utf-8"), load_simulated(path)


def line(text: str, key: str) -> str:
    (only,) = (one for one in text.splitlines() if one.lstrip().startswith(f"{key}:"))
    return only


def with_finding(found: Diagnosis, **changed: object) -> Diagnosis:
    """The diagnosis with another opinion of its finding."""
    (finding,) = found.result.missing
    other = Finding.model_validate(finding.model_dump() | changed)
    result = found.result.model_copy(update={"missing": (other,)})
    return Diagnosis(replace(found.reported, result=result))


def rms(hypothesis: Hypothesis, data: Dataset) -> dict[str, float]:
    (channels,) = hypothesis.residuals(data).channels
    return {name: float(np.sqrt(np.mean(values**2))) for name, values in channels.items()}


def test_comments_and_order_of_the_owner_are_kept(found: Diagnosis, tmp_path: Path) -> None:
    text, _ = written(found, tmp_path)
    lines = text.splitlines()
    at = 0
    for one in SOURCE.read_text(encoding="utf-8").splitlines():
        key, comment = one.partition(":")[0], one.partition("#")[2]
        at = next(n for n in range(at, len(lines)) if lines[n].startswith(key) and lines[n].endswith(comment)) + 1
    assert line(text, "lead_m") == "  lead_m: 0.010"


def test_a_changed_value_has_its_error_and_the_value_before(found: Diagnosis, tmp_path: Path) -> None:
    text, again = written(found, tmp_path)
    mass = found.result.parameter_corrections["table_mass_kg"]
    assert f"+-{mass.std:.2g} kg by diagnosis; before 384 " in line(text, "table_mass_kg")
    shown = line(text, "table_mass_kg").split()[1]
    assert abs(float(shown) - mass.value) <= 0.05 * mass.std + 1e-12
    assert again.axis.model_dump()["table_mass_kg"] == float(shown)
    strength = found.result.missing[0].parameters["amplitude_n_m"]
    assert f"+-{strength.std:.2g} N m" in line(text, "amplitude_n_m")
    assert "# found by diagnosis, " in text
    assert "x its standard error; confidence " in text


def test_its_twin_leaves_what_the_diagnosis_reports(found: Diagnosis, tmp_path: Path) -> None:
    _, again = written(found, tmp_path)
    reported = rms(found.final.hypothesis, found.held_out)
    for name, value in rms(Hypothesis(again), found.held_out).items():
        assert value == pytest.approx(reported[name], rel=0.01), name
    entry = found.result.fit["torque_n_m"]
    assert entry.mode == "closed_loop"
    assert entry.validate_ is not None
    torque = compare(HELD_OUT, again).channel("torque_n_m")
    assert torque.rms == pytest.approx(entry.validate_.after_rms, rel=0.01)


@pytest.mark.long
def test_a_second_diagnosis_with_it_finds_nothing(found: Diagnosis, tmp_path: Path) -> None:
    _, again = written(found, tmp_path)
    second = diagnose([TRAIN], [HELD_OUT], again)
    assert second.result.verdict == "no_mismatch"
    text, _ = written(second, tmp_path, tmp_path / "bench.diagnosed.yaml")
    assert "name: reference_diagnosed\n" in text


@pytest.mark.parametrize(
    ("changed", "reason"),
    [({"confidence": 0.3}, "its confidence is below 50"), ({"equivalents": ("torque_ripple",)}, "not tell it from")],
)
def test_a_doubtful_mechanism_is_in_comments(
    found: Diagnosis, tmp_path: Path, changed: dict[str, object], reason: str
) -> None:
    text, again = written(with_finding(found, **changed), tmp_path)
    assert not again.mechanisms
    assert reason in text
    bare = text[: text.index("# mechanisms:")] + "".join(
        f"{one.removeprefix('# ')}\n"
        for one in text[text.index("# mechanisms:") :].splitlines()
        if not one.startswith("# found") and not one.startswith("# doubtful") and not one.startswith("# The values")
    )
    (tmp_path / "taken.yaml").write_text(bare, encoding="utf-8")
    assert [entry.effect for entry in load_bench(tmp_path / "taken.yaml").mechanisms] == ["cogging_torque"]


def test_a_parameter_at_its_bound_stays_as_it_was(found: Diagnosis, tmp_path: Path) -> None:
    result = found.result.model_copy(update={"not_identifiable": ("table_mass_kg",)})
    text, again = written(Diagnosis(replace(found.reported, result=result)), tmp_path)
    assert line(text, "table_mass_kg").split("#")[0].strip() == "table_mass_kg: 384.0"
    assert "not identifiable: the fit ended at 4" in line(text, "table_mass_kg")
    assert again.axis.model_dump()["table_mass_kg"] == 384.0
    assert again.axis.model_dump()["motor_mass_kg"] == OWNER.axis.model_dump()["motor_mass_kg"]
    assert "the split of the masses is not told" in line(text, "motor_mass_kg")


def test_the_simulated_axis_stays_the_same_machine(found: Diagnosis, tmp_path: Path) -> None:
    text, again = written(found, tmp_path)
    assert again.simulation is not None
    assert true_axis(again.axis, again.simulation) == true_axis(OWNER.axis, SimulationSection())
    assert "stands in for the machine" in line(text, "simulation")


def test_a_bench_without_a_file_and_one_of_another_layout_say_the_same(found: Diagnosis, tmp_path: Path) -> None:
    _, expected = written(found, tmp_path)
    (tmp_path / "owner.json.yaml").write_text(OWNER.model_dump_json(), encoding="utf-8")
    for source in (None, tmp_path / "owner.json.yaml"):
        text, again = written(found, tmp_path, source)
        assert again == expected
        assert "before 384" in text
