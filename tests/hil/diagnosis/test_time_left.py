"""A diagnosis with a time budget: it ends with the best answer so far and says what was not tried."""

import json
import math
from pathlib import Path
from types import SimpleNamespace

import jsonschema
import pytest
from diagnosis_runs import bench, recorded

from hil.diagnosis import time_left
from hil.diagnosis.diagnose import diagnose
from hil.diagnosis.result import Verdict, schema
from hil.diagnosis.time_left import with_time_left
from hil.errors import InputError
from hil.identification.terms import Term
from hil.report.diagnosis_report import write_diagnosis
from hil.twin.library import LIBRARY


def test_a_search_without_time_names_nothing_and_lists_what_was_not_tried(tmp_path: Path) -> None:
    run = recorded(bench(), Term("cogging_torque", 0, (0.2, 4.0, 0.3)), times=3)
    diagnosis = diagnose([run], [], bench(), budget_s=1e-6)
    result, ended = diagnosis.result, diagnosis.result.time_budget
    assert ended is not None
    assert ended.not_tried == tuple(mechanism.id for mechanism in LIBRARY)
    assert result.verdict is Verdict.UNEXPLAINED
    assert result.statement.startswith("The time budget ended before the mismatch was explained")
    assert result.next_experiment is None
    assert "best explanation so far" in " ".join(result.notes)
    write_diagnosis(diagnosis, tmp_path)
    written = json.loads((tmp_path / "diagnosis.json").read_text())
    jsonschema.validate(written, schema())
    assert written["time_budget"]["stopped_before"].startswith("refitting")
    assert "ended by its time budget" in (tmp_path / "report.html").read_text()


@pytest.mark.parametrize("budget_s", [0.0, -1.0, math.nan])
def test_a_budget_that_is_no_time_is_refused(budget_s: float) -> None:
    with pytest.raises(InputError, match=r"budget: given .*, allowed above 0 s"):
        diagnose([recorded(bench(), times=3)], [], bench(), budget_s=budget_s)


@pytest.mark.parametrize(
    ("step", "budget_s", "said"),
    [
        ("screening the library beside 0 terms", math.inf, " (about 1567 s left)"),
        ("screening the library beside 0 terms", 130.0, " (about 30 s left)"),
        ("testing on held-out recordings", 130.0, " (about 5 s left)"),
        ("fitting backlash", 90.0, ""),
        ("locating", 130.0, ""),
    ],
)
def test_the_time_left_of_a_search_is_at_most_that_of_the_budget(
    step: str, budget_s: float, said: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(time_left, "time", SimpleNamespace(monotonic=lambda: 100.0))
    steps = list[str]()
    with_time_left(steps.append, begin_s=0.0, budget_s=budget_s)(step)
    assert steps == [step + said]
