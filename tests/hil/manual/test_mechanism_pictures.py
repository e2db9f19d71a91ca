"""Pictures of mechanisms: each shows a change that the axis has, larger than rounding."""

from __future__ import annotations

import numpy as np
import pytest

from hil.manual.pictures import change_by, draw
from hil.twin.library import BY_ID, LIBRARY
from hil.twin.mechanism import Mechanism


@pytest.mark.parametrize("mechanism", LIBRARY, ids=lambda mechanism: mechanism.id)
def test_a_mechanism_changes_what_its_picture_shows(mechanism: Mechanism) -> None:
    bench, change = change_by(mechanism)
    torque, table = (float(np.abs(values).max()) for values in (change.torque, change.table))
    assert torque > 1e-3 or table > 1e-7
    assert torque < bench.gains.torque_limit_n_m  # the loops stay stable
    assert np.isfinite(change.torque).all()


def test_a_picture_has_labels_with_units() -> None:
    upper, _, lower, right = draw(BY_ID["periodic_lead_error"]).axes
    assert upper.get_ylabel() == "change of\ntorque [N m]"
    assert lower.get_ylabel() == "change of\ntable position [µm]"
    assert right.get_xlabel() == "position set-point [mm]"
