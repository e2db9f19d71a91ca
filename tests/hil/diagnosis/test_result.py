"""diagnosis.json is as documented, its schema is current; confidence grows with what speaks for a name."""

from __future__ import annotations

import json
from typing import Any

import jsonschema
import pytest
from example_result import EXAMPLE
from hypothesis import given
from hypothesis import strategies as st

from hil.diagnosis.result import SCHEMA_FILE, Result, schema
from hil.diagnosis.verdict.confidence import confidence

KEYS = {
    "schema_version",
    "verdict",
    "location",
    "missing",
    "parameter_corrections",
    "fit",
    "not_testable",
    "unexplained",
    "next_experiment",
    "runtime_s",
}
LOCATION = {
    "block",
    "element",
    "channels",
    "phases",
    "windows_s",
    "position_m",
    "speed_m_s",
    "frequency_hz",
    "period_m",
    "order_per_rev",
}


def test_the_shipped_schema_is_current() -> None:
    assert json.loads(SCHEMA_FILE.read_text(encoding="utf-8")) == json.loads(json.dumps(schema())), (
        "run hil.diagnosis.result.write_schema()"
    )


def test_a_result_is_valid_by_its_schema_and_has_the_documented_keys() -> None:
    data = json.loads(json.dumps(Result.model_validate(EXAMPLE).as_json()))
    jsonschema.validate(data, schema())
    assert set(data) >= KEYS
    assert set(data["location"]) == LOCATION
    assert set(data["fit"]["torque_n_m"]["validate"]) >= {"before_rms", "after_rms", "noise_floor_rms"}
    assert data["next_experiment"] is None


@pytest.mark.parametrize(
    ("path", "value"),
    [
        (("verdict",), "maybe"),
        (("unexplained", "share"), 1.5),
        (("schema_version",), 2),
        (("missing", 0, "confidence"), float("nan")),
        (("fit", "torque_n_m", "mode"), "open_loop"),
    ],
)
def test_what_the_interface_does_not_allow_is_refused(path: tuple[str | int, ...], value: Any) -> None:
    data = json.loads(json.dumps(Result.model_validate(EXAMPLE).as_json()))
    part = data
    for key in path[:-1]:
        part = part[key]
    part[path[-1]] = value
    with pytest.raises(ValueError, match="validation error"):
        Result.model_validate(data)


LEFT, FACTORS, MARGINS = st.floats(0.0, 1e3), st.floats(0.0, 1e6), st.floats(-1e3, 1e7)


@given(LEFT, FACTORS, MARGINS, LEFT, FACTORS, MARGINS)
def test_confidence_grows_with_each_thing_that_speaks_for_a_name(
    left: float, factor: float, margin: float, less: float, more: float, clearer: float
) -> None:
    low = confidence(left, factor, margin)
    assert 0.0 <= low <= 1.0
    assert confidence(min(left, less), max(factor, more), max(margin, clearer)) >= low


def test_confidence_tells_a_sure_name_from_a_guess() -> None:
    assert confidence(1.0, 10.0, 1e4) > 0.95
    assert confidence(1.0, 1.01, 1e4) < 0.8
    assert confidence(1.6, 1.05, 1e4) < 0.8
    assert confidence(8.0, 1.05, 1e4) < 0.2
    assert confidence(8.0, 46.0, 1e4) > 0.95  # there, though much is left unexplained
    assert confidence(1.0, 10.0, 10.0) < confidence(1.0, 10.0, 1e3)
