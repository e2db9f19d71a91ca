"""The public API: `import hil` is light, every public name is documented, and the example of the README works."""

from __future__ import annotations

import ast
import inspect
import json
import re
import subprocess
import sys
from importlib.metadata import version
from pathlib import Path

import numpy as np
import pytest
from own_recordings import COGGING_LEARN, COGGING_PROVE
from processes import DEADLINE_S
from typer.testing import CliRunner

import hil
from hil.cli import app

ROOT = Path(__file__).parents[2]
HEAVY = ("numpy", "scipy", "numba", "matplotlib", "bokeh", "pyarrow", "pydantic")
VERBS = [
    "load_bench",
    "load_profile",
    "plan",
    "simulate",
    "run",
    "read_recording",
    "draft_map",
    "import_recording",
    "identify",
    "compare",
    "fit_nominal",
    "identify_friction",
    "frf",
    "positioning_accuracy",
    "circular_accuracy",
    "diagnose",
    "explain",
    "design_experiment",
    "investigate",
    "register",
    "save",
]
NOUNS = [
    "Bench",
    "Profile",
    "Trajectory",
    "Recording",
    "Twin",
    "Mechanism",
    "LIBRARY",
    "Comparison",
    "FrequencyResponse",
    "PositioningAccuracy",
    "CircularAccuracy",
    "Diagnosis",
    "Verdict",
]
ERRORS = ["HilError", "InputError", "FieldError"]
MOVE = hil.Profile.model_validate(
    {
        "schema_version": 1,
        "limits": {"velocity_m_s": 0.4, "acceleration_m_s2": 2.2, "jerk_m_s3": 100.0},
        "segments": [
            {"kind": "dwell", "duration_s": 0.1},
            {"kind": "sine_squared", "to_m": 0.03, "feed_m_s": 0.1},
            {"kind": "dwell", "duration_s": 0.1},
        ],
    }
)


def fresh(code: str) -> str:
    """Output of the code in a new interpreter."""
    ran = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, cwd=ROOT, timeout=DEADLINE_S, check=True
    )
    return ran.stdout


def test_import_loads_nothing_heavy() -> None:
    assert not json.loads(
        fresh(f"import hil, sys, json; dir(hil); print(json.dumps([n for n in {HEAVY} if n in sys.modules]))")
    )


def test_the_errors_load_nothing_heavy() -> None:
    assert not json.loads(
        fresh(f"import hil, sys, json; hil.InputError; print(json.dumps([n for n in {HEAVY} if n in sys.modules]))")
    )


def test_neither_planning_nor_simulating_loads_plotting() -> None:
    code = (
        "import hil, sys; bench = hil.load_bench('reference'); "
        "hil.plan(hil.load_profile('profiles/jog.yaml'), bench.period_s); hil.simulate; "
        "print([name for name in ('matplotlib', 'bokeh', 'scipy.optimize') if name in sys.modules])"
    )
    assert fresh(code).strip() == "[]"


def test_all_is_complete() -> None:
    assert sorted(hil.__all__) == sorted([*VERBS, *NOUNS, *ERRORS, "__version__"])
    assert set(hil.__all__) <= set(dir(hil))
    tree = ast.parse(Path(hil.__file__).read_text())
    typed = next(node for node in tree.body if isinstance(node, ast.If))
    names = {alias.name for node in ast.walk(typed) if isinstance(node, ast.ImportFrom) for alias in node.names}
    assert names == set(hil.__all__) - {"__version__"}  # mypy and editors see the same names


@pytest.mark.parametrize("name", [*VERBS, *NOUNS, *ERRORS])
def test_a_public_name_is_what_it_is_called_and_comes_from_this_project(name: str) -> None:
    value = getattr(hil, name)
    if name == "LIBRARY":
        assert all(isinstance(mechanism, hil.Mechanism) for mechanism in value)
        return
    assert value.__name__ == name
    assert value.__module__.startswith("hil.")


@pytest.mark.parametrize("name", [*VERBS, *NOUNS[:6], *NOUNS[7:], *ERRORS])
def test_a_public_name_is_documented(name: str) -> None:
    value = getattr(hil, name)
    text = value.__doc__ or ""
    assert len(text.split()) > 2
    assert not text.startswith(f"{name}(")  # the default docstring of a dataclass
    if name in VERBS:
        assert name == "design_experiment" or "Raises" in text or "InputError" in text, "errors are not documented"
        signature = inspect.signature(value)
        assert signature.return_annotation is not inspect.Signature.empty
        assert all(parameter.annotation is not inspect.Parameter.empty for parameter in signature.parameters.values())


def test_a_name_that_is_not_public_is_refused() -> None:
    with pytest.raises(AttributeError, match="no attribute 'diagnoze'"):
        hil.diagnoze  # type: ignore[attr-defined]  # noqa: B018


def test_no_module_hides_a_verb() -> None:
    """Importing hil.X binds the module X in the package, over a verb of that name."""
    modules = {path.stem for path in Path(hil.__file__).parent.iterdir()}
    assert not modules & set(hil.__all__)


def test_the_version_is_one_everywhere() -> None:
    assert hil.__version__ == version("hil-servo")
    printed = CliRunner().invoke(app, ["--version"]).output
    # after the release the state of the repository, as v0.4.0-12-g1234abc
    assert re.fullmatch(rf"hil-servo {re.escape(hil.__version__)}( \(\S*[0-9a-f]{{7,}}(, changed)?\))?\n", printed)


@pytest.fixture(scope="module")
def recording() -> hil.Recording:
    bench = hil.load_bench("reference")
    return hil.simulate(bench, hil.plan(MOVE, bench.period_s), seed=1)


def test_simulate_records_the_set_points_and_what_the_axis_did(recording: hil.Recording) -> None:
    bench = hil.load_bench("reference")
    trajectory = hil.plan(MOVE, bench.period_s)
    assert len(recording) == len(trajectory)
    np.testing.assert_allclose(recording["position_command_m"], trajectory.position_m, atol=1e-12)
    np.testing.assert_allclose(recording["table_position_m"], trajectory.position_m, atol=3e-4)  # the following error
    assert recording["table_position_m"][-1] == pytest.approx(0.03, abs=1e-5)  # friction holds it short of the target
    again, other = (hil.simulate(bench, trajectory, seed=seed) for seed in (1, 2))
    assert np.array_equal(again["torque_n_m"], recording["torque_n_m"])
    assert not np.array_equal(other["torque_n_m"], recording["torque_n_m"])


def test_simulate_gives_the_rows_that_run_records(recording: hil.Recording, tmp_path: Path) -> None:
    ran = hil.run(hil.load_bench("reference"), MOVE, tmp_path, virtual=True, seed=1)
    for channel in ("position_command_m", "motor_position_rad", "table_position_m", "torque_n_m"):
        assert np.array_equal(ran[channel], recording[channel]), channel


def test_simulate_refuses_another_period_and_an_axis_that_cannot_follow() -> None:
    bench = hil.load_bench("reference")
    with pytest.raises(hil.FieldError, match=r"period_s: given a trajectory with 0.002 s, allowed 0.001 s"):
        hil.simulate(bench, hil.plan(MOVE, 0.002))
    data = bench.model_dump() | {"drive": {"following_error_m": 1e-6}}
    with pytest.raises(hil.HilError, match="simulated run stopped"):
        hil.simulate(hil.Bench.model_validate(data), hil.plan(MOVE, bench.period_s))


def test_run_says_where_a_recording_of_a_stopped_run_is(tmp_path: Path) -> None:
    data = hil.load_bench("reference").model_dump() | {"drive": {"following_error_m": 1e-6}}
    with pytest.raises(hil.HilError, match=r"learn stopped: .*learn\.parquet"):
        hil.run(hil.Bench.model_validate(data), MOVE, tmp_path, "learn", virtual=True)


def test_fit_nominal_takes_a_recording_and_corrects_a_bench(recording: hil.Recording) -> None:
    believed = hil.load_bench("reference")
    true_n_m = believed.axis.coulomb_torque_n_m  # type: ignore[union-attr]
    wrong = believed.model_copy(
        update={"axis": believed.axis.model_copy(update={"coulomb_torque_n_m": 1.3 * true_n_m})}
    )
    found = hil.fit_nominal(recording, wrong)
    values = {parameter.name: parameter.value for parameter in found.parameters}
    assert values["coulomb_torque_n_m"] == pytest.approx(true_n_m, rel=0.01)
    assert found.bench.axis.coulomb_torque_n_m == values["coulomb_torque_n_m"]  # type: ignore[union-attr]


def test_results_print_as_a_few_lines(recording: hil.Recording) -> None:
    bench = hil.load_bench("reference")
    trajectory = hil.plan(MOVE, bench.period_s)
    assert str(recording).startswith(f"Recording simulated: rotary axis, {len(recording)} rows at 1 ms")
    assert "position 0.000 to 30.000 mm; largest velocity 0.1 m/s" in str(trajectory)
    text = str(hil.compare(recording, bench))
    assert "with the twin of reference: explained" in text
    assert re.search(r"^  torque_n_m +\S+ +\S+ +\S+ %$", text, re.MULTILINE)
    assert all(len(str(value).splitlines()) < 12 for value in (recording, trajectory, text))


@pytest.mark.long
def test_a_diagnosis_of_the_shipped_recordings_names_the_concealed_cogging() -> None:
    learn, prove = hil.read_recording(COGGING_LEARN), hil.read_recording(COGGING_PROVE)
    diagnosis = hil.diagnose(learn, hil.load_bench("reference"), held_out=prove)
    assert diagnosis.result.verdict is hil.Verdict.MISSING_PHYSICS
    (finding,) = diagnosis.result.missing
    assert finding.effect == "cogging_torque"
    assert finding.parameters["amplitude_n_m"].value == pytest.approx(0.08, rel=0.02)
    assert finding.parameters["cycles_per_rev"].value == pytest.approx(12.0, rel=1e-3)
    assert diagnosis.bench.mechanisms[0].effect == "cogging_torque"
    text = str(diagnosis)
    assert text.startswith("Diagnosis: missing_physics")
    assert "amplitude_n_m = 0.08" in text
    assert hil.design_experiment(diagnosis) is diagnosis.experiment


def test_investigate_refuses_a_folder_in_use(tmp_path: Path) -> None:
    (tmp_path / "old").write_text("")
    with pytest.raises(hil.InputError, match="is not empty"):
        hil.investigate({"move": MOVE}, hil.load_bench("reference"), tmp_path, virtual=True)


@pytest.mark.long
def test_investigate_keeps_the_recordings_of_its_rounds(tmp_path: Path) -> None:
    profile = hil.load_profile(ROOT / "profiles" / "reference.yaml")
    found = hil.investigate({"move": profile}, hil.load_bench("reference"), tmp_path / "out", rounds=1, virtual=True)
    assert (tmp_path / "out" / "round_1" / "move.parquet").is_file()
    assert found.rounds[0].motions == ("move",)
    assert found.diagnosis.result.verdict is hil.Verdict.NO_MISMATCH


def test_the_example_of_the_readme_runs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """All of it but the diagnosis, which takes half a minute and has a test of its own."""
    (block,) = re.findall(r"```python\n(.*?)```", (ROOT / "README.md").read_text(), re.DOTALL)
    lines = [line for line in block.splitlines() if line.strip()]
    assert len(lines) <= 12
    assert sum("diagnose" in line or "diagnosis" in line for line in lines) <= 3
    monkeypatch.chdir(tmp_path)
    names: dict[str, object] = {}
    exec("\n".join(line for line in lines if "diagnos" not in line and ".plot(" not in line), names)
    assert isinstance(names["recording"], hil.Recording)
    assert isinstance(names["comparison"], hil.Comparison)
    for line in (line for line in lines if ".plot(" in line and "diagnos" not in line):
        subject = re.search(r"(\w+)\.plot\(", line)
        assert subject
        if hasattr(names[subject[1]], "plot"):
            exec(line, names)
