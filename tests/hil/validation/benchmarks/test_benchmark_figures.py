"""Tables and JSON of `hil bench`: ratios, comparison with an earlier run, width."""

from __future__ import annotations

import io
import json
import re
from pathlib import Path

import pytest
from command_line import process, refused
from rich.console import Console

from hil.errors import InputError
from hil.report import console
from hil.validation.benchmarks import summary
from hil.validation.benchmarks.diagnosis_stages import STAGES, StageWatch
from hil.validation.benchmarks.figure import Figure, Reference, ReferenceKind

TIME = Figure("cycle through python-can, p50", "cycle, python-can, p50", 20.0, "us", 15.0, True, "how it is timed",
              (Reference("frames alone", ReferenceKind.LIMIT, 5.0),))  # fmt: skip
SPEED = Figure("twin of two masses", "virtual bench, frames", 12_345.0, "x real time", 10_000.0, False, "one step",
               (Reference("scipy solve_ivp", ReferenceKind.PEER, 5.0), Reference("axis alone", ReferenceKind.LIMIT, 20_000.0)))  # fmt: skip # noqa: E501
PLAIN = Figure("seconds of a stage", "diag., next experiment", 0.25, "s", at_most=True)
FIGURES = (TIME, SPEED, PLAIN)


def test_ratio_is_how_many_times_as_fast() -> None:
    assert TIME.times_as_fast(5.0) == 0.25  # 20 us beside 5 us
    assert SPEED.times_as_fast(5.0) == 2469.0
    assert (TIME.met, SPEED.met, PLAIN.met) == (False, True, None)


def test_each_reference_has_a_line() -> None:
    assert summary.rows(FIGURES) == [
        ("cycle, python-can, p50", "20.0 us", "≤ 15", "frames alone", "5.00 us", "0.25"),
        ("virtual bench, frames", "12 345 x", "≥ 10 000", "scipy solve_ivp", "5.00 x", "2 469"),
        ("", "", "", "axis alone", "20 000 x", "0.62"),
        ("diag., next experiment", "0.25 s", "", "", "", ""),
    ]


def test_output_fits_80_columns_and_breaks_no_row(monkeypatch: pytest.MonkeyPatch) -> None:
    text = io.StringIO()
    monkeypatch.setattr(console, "out", Console(file=text, width=80, highlight=False, soft_wrap=True))
    rows = summary.rows(FIGURES)
    console.table(summary.HEADERS, rows)
    lines = text.getvalue().splitlines()
    assert len(lines) == len(rows) + 1
    assert "virtual bench, frames" in lines[2]
    notes = "\n".join(summary.notes(FIGURES)).splitlines()
    assert max(map(len, lines + notes)) <= summary.WIDTH
    assert "targets missed: cycle, python-can, p50" in notes


def test_figures_with_one_note_are_named_together() -> None:
    pair = [Figure(part, f"cycle, {part}", 1.0, "us", detail="timed") for part in ("p50", "p99")]
    assert summary.notes(pair)[-1] == "cycle: timed"


def test_comparison_with_an_earlier_run(tmp_path: Path) -> None:
    file = tmp_path / "then.json"
    then = [{"name": TIME.name, "value": 30.0}, {"name": SPEED.name, "value": None}, {"name": "gone", "value": 1.0}]
    file.write_text(json.dumps({"figures": then}))
    (compared,) = summary.against(FIGURES, summary.read_earlier(file))
    assert (compared["name"], compared["then"], compared["now"]) == (TIME.name, 30.0, 20.0)
    assert compared["ratio"] == 1.5  # faster now
    assert summary.against_rows([compared]) == [(TIME.label, "30.0 us", "20.0 us", "1.500")]


@pytest.mark.parametrize("text", ["", "[]", "{}", '{"figures": [{"value": 1}]}', '{"figures": [{"name": "a", "value": "b"}]}'])  # fmt: skip # noqa: E501
def test_an_earlier_run_without_figures_is_refused(tmp_path: Path, text: str) -> None:
    file = tmp_path / "then.json"
    file.write_text(text)
    with pytest.raises(InputError, match=r"then\.json: no figures in it"):
        summary.read_earlier(file)


def test_a_missing_earlier_run_is_refused_before_measuring(tmp_path: Path) -> None:
    assert "none.json: cannot be read" in refused(tmp_path, "bench", "--against", "none.json")


def test_stages_sum_their_steps_in_order() -> None:
    watch = StageWatch()
    for step in ("screening the library", "fitting a", "screening the library beside 1 terms", "fitting b", "new step"):
        watch(step)
    watch.end()
    assert list(watch.seconds) == ["screen", "fits", "new step"]
    assert all(seconds >= 0.0 for seconds in watch.seconds.values())


def test_every_step_of_the_diagnosis_belongs_to_a_stage() -> None:
    folder = Path(__file__).parents[4] / "hil" / "diagnosis"
    steps = [
        step
        for path in folder.rglob("*.py")
        for step in re.findall(r'(?:progress|step)\(f?"([^"]+)"', path.read_text())
    ]
    assert len(steps) > 8
    assert [step for step in steps if not step.startswith(tuple(STAGES))] == []


@pytest.mark.long
def test_the_command_prints_json_and_compares(tmp_path: Path) -> None:
    first = process(tmp_path, "bench", "--json", "--out", "first.json")
    assert first.returncode == 0, first.stderr
    printed = json.loads(first.stdout)
    assert printed == json.loads((tmp_path / "first.json").read_text())
    by_name = {figure["name"]: figure for figure in printed["figures"]}
    assert by_name["whole bench in virtual time"]["beside"][0]["kind"] == "limit"
    second = process(tmp_path, "bench", "--against", "first.json", "--out", "second.json")
    assert second.returncode == 0, second.stderr
    compared = json.loads((tmp_path / "second.json").read_text())["against"]["figures"]
    assert {one["name"] for one in compared} == set(by_name)
