"""Observability of an axis: which of its inputs and outputs a recording and its bench make known."""

from collections.abc import Iterable
from dataclasses import dataclass, fields

import numpy as np

from hil.bench.bench_file import Bench
from hil.identification.derived_channels import position_is_measured, rows_are_ticks, torque_is_measured
from hil.recording.recording import Recording


@dataclass(frozen=True)
class Observability:
    """Inputs and outputs of the axis that are known, from the control law to the encoders.

    controller       set-points, positions -> torque command
    drive            torque command        -> torque
    motor and load   torque                -> motor position
    """

    closed_loop: bool = True  # the control law is known: the twin can be simulated from set-points alone
    law_testable: bool = True  # the recorded positions are fine enough to test the replay of the law
    torque_and_command: bool = True  # both were recorded; else one stands for the other
    torque_measured: bool = True  # else inertia and friction of the bench over the measured motion
    position_measured: bool = True  # of the motor; else the sum of its measured velocity
    rows_are_ticks: bool = True  # of the control loop: the torque of a row acts until the next one

    @property
    def hidden(self) -> frozenset[str]:
        """Channels whose block has an unknown input or output: their residual is 0."""
        command = () if self.closed_loop and self.law_testable else ("command",)
        return frozenset((*command, *(() if self.torque_measured else ("torque", "motor"))))

    @property
    def torque_between_rows_unknown(self) -> bool:
        """True if the rows are samples of a torque that drives the twin and changes between them."""
        return not self.closed_loop and self.torque_measured and not self.rows_are_ticks

    @property
    def noisy_torque_input(self) -> bool:
        """True if samples of the torque that is compared also drive the twin: their noise is in its motion too."""
        return self.torque_between_rows_unknown and not self.torque_and_command

    @property
    def exact_input(self) -> bool:
        """True if the input of the twin has no error: the torque command, recorded at the ticks beside the torque."""
        return self.torque_and_command and not self.torque_between_rows_unknown


def observability(recording: Recording, bench: Bench) -> Observability:
    """Observability of an axis by a recording whose channels are complete (`completed`)."""
    names, columns = recording.axis, recording.columns
    command, torque = columns.get(names.torque_command), columns[names.torque]
    return Observability(
        closed_loop=bench.law_known,
        torque_and_command=command is not None and not np.array_equal(command, torque),
        torque_measured=bench.law_known or torque_is_measured(recording),
        position_measured=position_is_measured(recording),
        rows_are_ticks=rows_are_ticks(recording),
    )


def common(known: Iterable[Observability]) -> Observability:
    """Observability by several recordings: known is what all of them make known."""
    known = list(known)
    return Observability(*(all(getattr(one, field.name) for one in known) for field in fields(Observability)))
