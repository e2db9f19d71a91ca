"""Notes on what a diagnosis without a control law or a channel cannot tell, and what would tell it."""

from hil.bench.bench_file import Bench
from hil.channels import AXIS_CHANNELS
from hil.diagnosis.wording import titles
from hil.identification.dataset import Dataset
from hil.identification.measured import Measured
from hil.twin.library import LIBRARY
from hil.twin.mechanism import Block, Mechanism


def untold(data: Dataset) -> list[str]:
    """Notes for recordings of a bench whose control law is unknown."""
    run, bench = data.runs[0], data.bench
    controller = titles([mechanism.id for mechanism in LIBRARY if mechanism.block is Block.CONTROLLER])
    return [
        "The control law is unknown: the plant was judged alone, block by block, from measured torque to measured "
        "motion. There is no figure in closed loop and no next experiment, and no mismatch was assigned to the "
        f"controller. {controller.capitalize()} cannot be tested: that needs recorded set-points, and the law under "
        "`control` of the bench file.",
        *_of_torque(run),
        *_of_encoders(run, bench),
    ]


def _of_torque(run: Measured) -> list[str]:
    names = AXIS_CHANNELS[run.kind]
    if not run.observability.torque_measured:
        return [
            f"No torque is recorded: only the transmission was judged, from {names.motor_position} to "
            f"{names.table_position}. Friction and loads of the motor side and the drive cannot be told, and of masses "
            f"and stiffness only their ratio; record {names.torque} or {names.torque_command}."
        ]
    if not run.observability.torque_and_command:
        return [
            f"Only one of {names.torque} and {names.torque_command} is recorded: an effect of the drive shows only as "
            "wrong motion. Record both to tell drive and motor apart."
        ]
    return []


def _on_motor(mechanism: Mechanism) -> bool:
    """True if a form of a mechanism shows in the motor's motion."""
    return any(variant.observable is not None and variant.observable(False) for variant in mechanism.variants)


def _of_encoders(run: Measured, bench: Bench) -> list[str]:
    if bench.has_table_encoder:
        return []
    hidden = titles([one.id for one in LIBRARY if one.search.needs_table and not _on_motor(one)])
    names = AXIS_CHANNELS[run.kind]
    return [
        f"Only one position is recorded: {hidden} cannot be tested; record both {names.motor_position} and "
        f"{names.table_position}."
    ]
