"""CiA 402: the torque offset of every tick of a motion, as object 0x60B2.

    0x60B2 = torque / rated torque x 1000, rounded, INTEGER16       rated torque: object 0x6076 in mN m (mN)

In the cyclic modes the drive adds it to the torque of its velocity loop (CSP, CSV) or to the target torque (CST). The
file has a row per tick of the profile: this bench's whole compensation torque (friction, inertia, load, cogging), with
the fade-in and the limits of its section. The position correction stands beside it in SI: 0x60B0 takes it in the
position units of the drive, which the bench does not have.

Source: IEC 61800-7-201 (CiA 402-2), objects 0x6076, 0x60B0, 0x60B2.
"""

import numpy as np

from hil.compensating.controllers.controller_task import ControllerFiles, ControllerTask
from hil.control.compensation import follow
from hil.control.compensation_tables import pack
from hil.errors import HilError

PER_MILLE = 1000.0
LARGEST = 32767  # INTEGER16


def for_cia402(task: ControllerTask) -> ControllerFiles:
    """Write the stream. Raises HilError without a rated torque, or for an offset beyond INTEGER16, or a voltage."""
    if task.torque_unit == "V":
        raise HilError("cia402: given a motor that is driven by its voltage, allowed one by its torque: use --for csv")
    if task.rated_torque is None:
        raise HilError(
            "cia402: given a bench without drive.rated_torque_n_m, allowed one with it: 0x60B2 is in 1/1000 of it; "
            "write the value of object 0x6076 there"
        )
    motion = task.motion
    set_points = (np.array(one) for one in (motion.position_m, motion.velocity_m_s, motion.acceleration_m_s2))
    added = follow(pack(task.compensation, motion.period_s), *set_points)
    offset = np.rint(PER_MILLE * added.torque / task.rated_torque)
    if np.abs(offset).max() > LARGEST:
        raise HilError(
            f"cia402: given a torque up to {np.abs(added.torque).max():.4g}, allowed up to "
            f"{LARGEST / PER_MILLE * task.rated_torque:.4g}; correct drive.rated_torque_n_m"
        )
    torque = "force_offset_n" if task.torque_unit == "N" else "torque_offset_n_m"
    length = "rad" if task.turns else "m"
    columns = (motion.time_s, motion.position_m, added.torque, offset, added.position_m)
    lines = [f"time_s,position_{length},{torque},object_60B2_per_mille,position_correction_{length}"]
    lines += [
        f"{time_s:.6f},{place:.9g},{value:.6g},{number:.0f},{correction:.6g}"
        for time_s, place, value, number, correction in zip(*(one.tolist() for one in columns), strict=True)
    ]
    return ControllerFiles({"cia402.csv": "\n".join(lines) + "\n"})
