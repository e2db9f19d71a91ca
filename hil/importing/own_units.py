"""Take numbers of an unknown unit as they are, so that their axis can be looked at before the unit is known.

A motion in numbers of its own unit has the same effects at the same places; masses, friction and stiffness are
multiples, as if one of the numbers were the SI unit of its channel. If nothing tells the lead of a screw, 10 mm are
taken, and values at the motor are multiples too.
"""

from math import tau

from hil.channels import CHANNELS
from hil.importing.map_draft import Asked, MapDraft

# of keys that make one number the SI unit of its channel: one count 1 rad or 1 m, 1 A 1 N m or 1 N, 1 % the same
_ONE = {
    "counts_per_rev": tau,
    "counts_per_m": 1.0,
    "torque_constant_n_m_a": 1.0,
    "force_constant_n_a": 1.0,
    "rated": 100.0,
    "gain": 1.0,
}
_COUNTED = ("counts_per_rev", "counts_per_m")
COUNT_AS = "its numbers count as"  # in the note on a channel or a lead of unknown size


def take_own_units(draft: MapDraft) -> None:
    """Answer what a draft asks of the size of numbers, and note it as unsure; columns are asked still."""
    sizes = {(one.channel, key): value for one in draft.channels for key, value in one.entry.items()}
    without_column = {one.channel for one in draft.asked if one.key == "column"}
    left = list[Asked]()
    for one in draft.asked:
        if one.key == "lead_m":
            draft.lead_how = "taken, as nothing tells it"
            draft.unsure.append(
                f"lead_m: {COUNT_AS} turns of {1e3 * (draft.lead_m or 0.0):g} mm, so that values at the motor are "
                f"multiples; correct it: {one.what}"
            )
            continue
        unit = CHANNELS[one.channel].unit if one.channel else ""
        value = unit if one.key == "unit" else _ONE.get(one.key)
        if isinstance(value, float) and one.key in _COUNTED:  # of several in counts, the first is the measure
            first = next(each.channel for each in draft.asked if each.key == one.key)
            value *= float(str(sizes[one.channel, one.key])) / float(str(sizes[first, one.key]))
        if value is None or not one.channel or one.channel in without_column:
            left.append(one)
            continue
        (drafted,) = (each for each in draft.channels if each.channel == one.channel)
        drafted.entry[one.key] = value
        draft.unsure.append(
            f"{one.channel}: {COUNT_AS} {unit}, so that values with {unit} are multiples ({one.key}: "
            f"{value if one.key == 'unit' else f'{value:.9g}'}); correct it: {one.what}"
        )
    draft.asked[:] = left
