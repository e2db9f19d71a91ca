"""Write an ASAM MDF 4 file with asammdf: one group of channels, the metadata as an embedded attachment."""

import warnings
from pathlib import Path

from hil.channels import CHANNELS
from hil.exchange.content import METADATA, Content
from hil.files.optional_library import optional_library


def write_mdf(path: Path, content: Content) -> None:
    """Write MDF 4.10, which most programs read, with compressed blocks."""
    library = optional_library(path, "asammdf", "asammdf", "mf4")
    time_s = content.columns["time_s"]
    signals = [
        library.Signal(values, time_s, CHANNELS[name].unit, name, comment=CHANNELS[name].meaning)
        for name, values in content.signals.items()
    ]
    with warnings.catch_warnings(), library.MDF(version="4.10") as file:
        warnings.simplefilter("ignore")  # of the library about itself
        file.start_time = content.start
        file.append(signals, acq_name="hil", comment="hil-servo", common_timebase=True)
        file.attach(content.metadata.encode(), file_name=f"{METADATA}.json", mime="application/json")
        file.save(path, overwrite=True, compression=2)
