"""Mechanisms that a diagnosis found, as items of a bench file: values with errors, evidence, and reasons for doubt."""

from typing import NamedTuple

from hil.bench.bench_file import MechanismEntry
from hil.diagnosis.criteria import CRITERIA
from hil.diagnosis.diagnosis import Diagnosis
from hil.diagnosis.result import Finding
from hil.diagnosis.verdict.strength import strength_over_error
from hil.diagnosis.wording import title, titles, unit_in
from hil.files.yaml_edit import GAP, comment_lines
from hil.identification.inference import standard_errors
from hil.quantities import digits, percent, rounded_to_error
from hil.twin.library import BY_ID
from hil.twin.parameter import Parameter


class FoundItem(NamedTuple):
    """An item of the list `mechanisms`: its rounded values, its lines, and why it is in comments; "" if it is not."""

    entry: MechanismEntry
    text: str
    doubt: str


def found_items(diagnosis: Diagnosis) -> list[FoundItem]:
    """Items of the permanent terms, then of the maps of what has no name."""
    final, result = diagnosis.final, diagnosis.result
    found = {id(diagnosis.term_of(at)): finding for at, finding in enumerate(result.findings)}
    permanent = [at for at, term in enumerate(final.terms) if not term.windows]
    first = len(diagnosis.bench.mechanisms) - len(permanent) - len(result.unnamed)
    entries = diagnosis.bench.mechanisms[first:]
    errors = standard_errors(final) if final.terms else []
    items = []
    for at, entry in zip(permanent, entries, strict=False):
        own, law = found.get(id(final.terms[at])), BY_ID[entry.effect].corrects(final.terms[at].variant)
        finding = own or next(one for one in result.findings if one.effect == law)
        told = f"found by diagnosis, {digits(strength_over_error(final, at))} x its standard error; "
        told += f"confidence {percent(finding.confidence)}"
        told += "" if own else f", of {title(law)}, whose form it corrects"
        bound = {name.partition(".")[2] for name in final.at_bound if name.startswith(f"{at}.")}
        items.append(_item(diagnosis, entry, told, _doubt(finding), errors[final.hypothesis.columns(at)], bound))
    for entry, one in zip(entries[len(permanent) :], result.unnamed, strict=True):
        told = (
            f"found by diagnosis, without a name: a map of the residual, which falls from {digits(one.held_out_before)}"
        )
        items.append(
            _item(diagnosis, entry, f"{told} to {digits(one.held_out_after)} rms on held-out motion", "", [], set())
        )
    return items


def _doubt(finding: Finding) -> str:
    """Why a finding is in comments: it is not likely, or one of several that the motion does not tell apart."""
    reasons = []
    if finding.confidence < CRITERIA.likely:
        reasons.append(f"its confidence is below {percent(CRITERIA.likely)}")
    if finding.equivalents:
        reasons.append(f"this motion does not tell it from {titles(finding.equivalents)}")
    return " and ".join(reasons)


def _item(
    diagnosis: Diagnosis, entry: MechanismEntry, told: str, doubt: str, errors: list[float], bound: set[str]
) -> FoundItem:
    """Lines of an item. `errors` are the standard errors of its parameters, none where they are not known."""
    mechanism = BY_ID[entry.effect]
    values = dict[str, float]()
    lines = [f"- effect: {entry.effect}", *([f"  variant: {entry.variant}"] if entry.variant else []), "  parameters:"]
    for at, parameter in enumerate(mechanism.parameters):
        text, comment = _value(diagnosis, parameter, entry.parameters[parameter.name], errors[at] if errors else 0.0)
        comment += "; at the bound of its range: not identifiable" if parameter.name in bound else ""
        values[parameter.name] = float(text)
        lines.append(f"    {parameter.name}: {text}{GAP}# {comment}")
    text = "\n".join(lines) + "\n"
    if doubt:
        text = (
            f"# doubtful: {doubt}\n# The values of the axis were fitted with it: to have the twin of the report, take "
            f"these lines out of comments.\n{comment_lines(text)}"
        )
    return FoundItem(entry.model_copy(update={"parameters": values}), f"# {told}\n{text}", doubt)


def _value(diagnosis: Diagnosis, parameter: Parameter, value: float, error: float) -> tuple[str, str]:
    """Text of a value, within the range of its parameter, and its comment."""
    text, unit = rounded_to_error(value, error), unit_in(diagnosis.given_bench, parameter)
    text = text if parameter.low <= float(text) <= parameter.high else repr(value)
    unit = "" if unit == "1" else unit
    return text, f"+-{error:.2g} {unit}".rstrip() if error else unit or "without unit"
