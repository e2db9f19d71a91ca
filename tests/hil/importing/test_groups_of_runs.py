"""Groups of a file that are runs of one axis, one after the other, and those that are not."""

from pathlib import Path

import numpy as np
import pytest
from channel_files import ANGLE, TORQUE, T
from exported import needs

from hil.importing.by_map import import_recording
from hil.importing.channel_groups import Group, one_length
from hil.importing.draft_map import draft_map
from hil.importing.map_text import map_text

UNITS = {"angle": "rad", "torque": "Nm"}


@pytest.mark.parametrize("library", [pytest.param("h5py", marks=needs(".h5"))])
@pytest.mark.parametrize("stamps", [False, True])
def test_two_runs_in_one_file_are_parts_of_one_recording(library: str, stamps: bool, tmp_path: Path) -> None:
    module, path = pytest.importorskip(library), tmp_path / "axis.h5"
    with module.File(path, "w") as file:
        for name, rows in (("run_01", slice(None)), ("run_02", slice(0, 1500))):
            for channel, values in (("angle", ANGLE), ("torque", TORQUE)):
                file[f"{name}/{channel}"] = values[rows]
                file[f"{name}/{channel}"].attrs["unit"] = UNITS[channel]
            file[name].attrs["sample_rate_Hz"] = 1.0 / float(T[1] - T[0])
            if stamps:
                file[f"{name}/time"] = T[rows]
                file[f"{name}/time"].attrs["unit"] = "s"
    (tmp_path / "map.yaml").write_text(map_text(draft_map(path)))
    one, other = import_recording(path, tmp_path / "map.yaml").parts()
    assert np.allclose(one.columns["motor_position_rad"], ANGLE)
    assert np.allclose(other.columns["motor_position_rad"], ANGLE[:1500])
    assert np.allclose(other.columns["torque_n_m"], TORQUE[:1500])


def test_runs_in_other_units_stay_apart(tmp_path: Path) -> None:
    values = {"angle": np.arange(10.0), "torque": np.arange(10.0)}
    groups = [Group(f"run_{number}", values, {"angle": unit}, False) for number, unit in ((1, "rad"), (2, "deg"))]
    arrays, units = one_length(tmp_path / "axis.h5", groups)
    assert set(arrays) == {"run_1.angle", "run_1.torque", "run_2.angle", "run_2.torque"}
    assert units == {"run_1.angle": "rad", "run_2.angle": "deg"}


@pytest.mark.parametrize(
    ("names", "channels"),
    [
        (("axis_1", "axis_2"), (("angle", "torque"), ("angle", "torque"))),  # two axes
        (("run_1", "run_2"), (("angle", "torque"), ("angle", "torque", "speed"))),  # other channels
        (("run_1", "run_2"), (("angle",), ("angle",))),
    ],
)
def test_groups_that_may_be_another_axis_stay_apart(
    names: tuple[str, str], channels: tuple[tuple[str, ...], tuple[str, ...]], tmp_path: Path
) -> None:
    groups = [
        Group(name, {channel: np.arange(10.0) for channel in own}, {}, False)
        for name, own in zip(names, channels, strict=True)
    ]
    arrays, _ = one_length(tmp_path / "axis.h5", groups)
    assert {f"{name}.angle" for name in names} <= set(arrays)
