"""A diagnosis as a card for a notebook: the statement, what was found, and the evidence for the first finding."""

from __future__ import annotations

from typing import TYPE_CHECKING

from hil.diagnosis.statement import explained
from hil.diagnosis.wording import named, parameter_of, spoken_key, whole_name
from hil.figures.card import card
from hil.quantities import digits, percent, with_error

if TYPE_CHECKING:
    from hil.diagnosis.diagnosis import Diagnosis

HEAD = "", "value", "standard error", "unit", "bench file"


def diagnosis_card(diagnosis: Diagnosis) -> str:
    """Return the card. Without a finding its picture is that of the residuals."""
    result = diagnosis.result
    rows = list[tuple[str, ...]]()
    for finding in result.findings:
        rows.append((named(finding), percent(finding.confidence), "confidence that it is there", "", ""))
        rows += [
            (parameter_of(finding.effect, name).spoken, *with_error(one.value, one.std), one.unit, "")
            for name, one in finding.parameters.items()
        ]
    rows += [
        (spoken_key(name), *with_error(one.value, one.std), one.unit, digits(one.nominal, 4))
        for name, one in result.parameter_corrections.items()
    ]
    names = ", ".join(dict.fromkeys(whole_name(run.name) for run in diagnosis.train.runs))
    picture = diagnosis.plot("finding" if result.findings else "residuals")
    table = [HEAD, *rows] if rows else []
    return card(f"Diagnosis of {names}", result.statement, picture, table, explained(result))
