"""Write a drafted bench as YAML, each value with its error and how it was found."""

from hil.channels import AxisKind
from hil.drafting.bench_value import BenchValue
from hil.drafting.draft_bench import BenchDraft


def bench_text(draft: BenchDraft) -> str:
    """The bench as text of a YAML file."""
    axis = draft.axis
    lines = [
        f"# Bench of {draft.name}, drafted by hil identify from the recording alone.",
        "# +- is a standard error that counts what the model leaves. Replace what you know better.",
    ]
    lines += [f"# Please check: {note}" for note in draft.unsure]
    lines += ["schema_version: 1", f"name: {_name(draft.name)}", "axis:", f"  model: {axis.model}"]
    lines += [f"  {_line(value)}" for value in axis.values]
    held = f"  held: [{', '.join(axis.held)}]   # as the owner tells; without this line it is fitted too"
    lines += [held] if axis.held else []
    if draft.control:
        lines += ["control:", *(f"  {_line(value)}" for value in draft.control)]
    elif draft.torque_delay is None:
        lines += [f"control: unknown   # {draft.control_why}"]
    else:
        lines += ["control:", f"  law: unknown   # {draft.control_why}", f"  {_line(draft.torque_delay)}"]
    lines += ["encoders:"]
    if draft.motor_encoder is not None:
        lines += ["  motor:", f"    {_line(draft.motor_encoder)}"]
    if draft.table_encoder is not None:
        lines += ["  table:", f"    {_line(draft.table_encoder)}"]
    else:
        lines += [
            "  table: null   # no second encoder is recorded" if draft.kind is AxisKind.ROTARY else "  table: null"
        ]
    lines += ["mechanisms:"] if draft.mechanisms else []
    for effect, values in draft.mechanisms.items():
        lines += [f"  - effect: {effect}", "    parameters:", *(f"      {_line(value)}" for value in values)]
    lines += ["# Told by the recording beside these keys:", *(f"#   {note}" for note in draft.notes)]
    return "\n".join(lines) + "\n"


def _line(value: BenchValue) -> str:
    return f"{value.key}: {value.shown}   # {'; '.join(filter(None, (value.error, value.how)))}"


def _name(text: str) -> str:
    return '"' + text.replace("\\", "_").replace('"', "_") + '"'
