"""A recording as a pandas DataFrame; pandas is loaded here only, and need not be installed."""

from __future__ import annotations

from typing import TYPE_CHECKING

from hil.arrays import FloatArray
from hil.channels import CHANNELS
from hil.errors import InputError

if TYPE_CHECKING:
    from pandas import DataFrame


def data_frame(name: str, columns: dict[str, FloatArray], period_s: float) -> DataFrame:
    """Return the columns (n,) over their time. Raises InputError if pandas is not installed."""
    try:
        from pandas import DataFrame, Index
    except ImportError:
        raise InputError(
            f"{name}: to_pandas needs pandas, which is not installed; install it: pip install 'hil-servo[notebook]'"
        ) from None
    channels = {channel: values for channel, values in columns.items() if channel != "time_s"}
    frame = DataFrame(channels, index=Index(columns["time_s"], name="time_s"))
    frame.attrs = {"name": name, "period_s": period_s, "units": {one: CHANNELS[one].unit for one in channels}}
    return frame
