"""Names of parameters in words carry no unit: that of a linear axis is another one."""

from __future__ import annotations

import pytest

from hil.diagnosis.wording import spoken_key
from hil.twin.library import BY_ID, LIBRARY

UNITS = {"n", "m", "s", "rad", "hz", "rev", "m2", "n2", "s2", "rad2", "1", "per"}


@pytest.mark.parametrize("mechanism", LIBRARY, ids=lambda one: one.id)
def test_a_spoken_name_has_no_unit_and_is_its_own(mechanism) -> None:
    names = [one.spoken for one in mechanism.parameters]
    assert all(names)
    assert len(set(names)) == len(names)
    assert not [name for name in names if name.split()[-1] in UNITS]


@pytest.mark.parametrize(
    ("effect", "names"),
    [
        ("cogging_torque", ["amplitude", "cycles", "phase"]),
        ("load_dependent_friction", ["share"]),
        ("local_friction", ["fraction", "begin", "end", "flank"]),
        ("nonlinear_viscous_friction", ["quadratic"]),
        ("torque_constant_saturation", ["coefficient"]),
        ("cumulative_lead_error", ["slope"]),
        ("friction_gradient", ["slope"]),
        ("torque_constant_gradient", ["slope"]),
        ("end_stop", ["stiffness", "edge"]),
    ],
)
def test_spoken_names(effect: str, names: list[str]) -> None:
    assert [one.spoken for one in BY_ID[effect].parameters] == names


def test_a_key_of_corrections_is_spoken_only_of_a_mechanism() -> None:
    assert spoken_key("constant_load.load_torque_n_m") == "constant load: load torque"
    assert spoken_key("coulomb_torque_n_m") == "coulomb_torque_n_m"
