"""diagnosis.json is as documented, and its schema is current."""

from __future__ import annotations

import json
from typing import Any

import jsonschema
import pytest
from example_result import EXAMPLE

from hil.diagnosis.result import SCHEMA_FILE, Result, schema

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
