"""Values of a bench file that a diagnosis changed, rounded, each with its standard error and the value before."""

import math

from hil.bench.bench_file import Bench
from hil.bench.control_section import UNKNOWN, UnknownControl, delay_in_words
from hil.diagnosis.diagnosis import Diagnosis
from hil.diagnosis.value import Correction
from hil.diagnosis.verdict.corrections import not_split
from hil.errors import FieldPath
from hil.files.yaml_edit import YamlChange
from hil.identification.coordinates import DELAY, known_coordinates, known_values
from hil.identification.inference import standard_errors
from hil.quantities import digits, rounded_to_error, unit_of


def changed_values(diagnosis: Diagnosis, given: Bench) -> list[YamlChange]:
    """Changes of axis, control law and the bench's own mechanisms.

    A value at a bound is no correction, nor is a mass beside one: the one of the bench stays, with the reason.
    """
    found = [] if diagnosis.reported.judged.keeps_bench else _fitted(diagnosis, given)
    told = diagnosis.result.parameter_corrections
    law = diagnosis.bench.control
    if given.law_known and not isinstance(law, UnknownControl):
        for name in type(law).model_fields:
            before, after = getattr(given.control, name), getattr(law, name)
            if before != after:
                found.append(_change(("control", name), before, after, told.get(name)))
    return found


def _fitted(diagnosis: Diagnosis, given: Bench) -> list[YamlChange]:
    """Changes of the nominal parameters of the final fit."""
    final, told = diagnosis.final, diagnosis.result.parameter_corrections
    hypothesis = final.hypothesis
    paths: dict[str, FieldPath] = {name: ("axis", name) for name in given.axis.NOMINAL}
    for one, (at, name, _) in zip(known_coordinates(given.mechanisms), known_values(given.mechanisms), strict=True):
        paths[one.name] = ("mechanisms", at, "parameters", name)
    if isinstance(given.control, UnknownControl):
        paths[DELAY] = ("control", DELAY)
    errors = standard_errors(final) if final.jacobian.size else [0.0] * len(hypothesis.values)
    found = []
    for name, before, after, error in zip(
        hypothesis.nominal, hypothesis.bench_values, hypothesis.values, errors, strict=False
    ):
        if name not in paths or math.isclose(before, after, rel_tol=1e-9, abs_tol=1e-15):
            continue
        if name in diagnosis.result.not_identifiable:
            why = f"not identifiable: the fit ended at {digits(after)}, the bound of its range, which is no correction"
            found.append(YamlChange(paths[name], None, why))
        elif name in not_split(given, diagnosis.result.not_identifiable):
            why = f"the split of the masses is not told: the fit has {digits(after)} beside another one at its bound"
            found.append(YamlChange(paths[name], None, why))
        else:
            found.append(_change(paths[name], before, after, told.get(name), error))
    return found


def _change(path: FieldPath, before: object, after: object, told: Correction | None, error: float = 0.0) -> YamlChange:
    """A changed value; without `told` it was fitted, and the recordings do not tell it by itself."""
    if not isinstance(after, float):
        return YamlChange(path, after, f"by diagnosis; before {before}")
    unit = told.unit if told else unit_of(str(path[-1]))
    error = told.std if told else error
    sure = f"+-{error:.2g} {'' if unit == '1' else unit}".rstrip() if error else ""
    how = "by diagnosis" if told or path[-1] == DELAY else "fitted with the others, by itself not told"
    shown = f"{before:.6g}" if isinstance(before, float) else "0" if before is None else str(before)
    text = rounded_to_error(after, error)
    if path == ("control", DELAY):
        return YamlChange(("control",), {"law": UNKNOWN, DELAY: text}, f"{delay_in_words(after)}, {sure} {how}")
    return YamlChange(path, text if float(text) else repr(after), f"{sure} {how}; before {shown}".strip())
