"""Notes on terms that were dropped: each with its reason."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest

from hil.diagnosis.notes import _on_terms
from hil.diagnosis.result import Verdict


@pytest.mark.parametrize(
    ("refuted", "reason"),
    [("its strength is below its standard error",) * 2, ("", "its confidence is below 20.0 %")],
)
def test_a_term_that_was_dropped_has_a_reason(refuted: str, reason: str) -> None:
    ablation = SimpleNamespace(term=SimpleNamespace(effect="friction_drift"), refuted=refuted)
    proof = SimpleNamespace(dropped=(ablation,), ablations=())
    tested = SimpleNamespace(proof=proof, searched=SimpleNamespace(terms=()))
    judged: Any = SimpleNamespace(tested=tested, verdict=Verdict.NO_MISMATCH, final=SimpleNamespace(terms=()))
    assert _on_terms(judged, {}) == [f"friction drift was dropped: {reason}."]
