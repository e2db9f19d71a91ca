"""Resolution and noise of the recorded channels, and the delay between torque command and torque."""

import numpy as np

from hil.identification.sensor_noise import white_noise
from hil.importing.relations import lead_rows
from hil.recording.recording import Recording

MOST_LEAD_ROWS = 50  # of a command before the measured torque: tens of ms


def noise_of(recording: Recording, channel: str) -> float:
    """Standard deviation of the white noise of a channel in its unit."""
    return white_noise(recording[channel])


def torque_delay_s(recording: Recording) -> float | None:
    """Delay of the measured torque against its command [s]; None if only one of them was recorded."""
    names = recording.axis
    if names.torque not in recording.columns or names.torque_command not in recording.columns:
        return None
    torque, command = recording[names.torque], recording[names.torque_command]
    if np.array_equal(torque, command):
        return None
    return lead_rows(command, torque, MOST_LEAD_ROWS) * recording.period_s
