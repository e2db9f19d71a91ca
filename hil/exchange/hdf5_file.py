"""Write an HDF5 file with h5py: a dataset per channel with its unit, on the time as dimension scale."""

from pathlib import Path

from hil.channels import CHANNELS
from hil.exchange.content import METADATA, Content
from hil.files.optional_library import optional_library


def write_hdf5(path: Path, content: Content) -> None:
    """Write compressed datasets; the metadata are a text of their own, because an attribute holds 64 kB."""
    library = optional_library(path, "h5py", "h5py", "exchange")
    with library.File(path, "w") as file:
        file.create_dataset(METADATA, data=content.metadata, dtype=library.string_dtype())
        for name, values in content.columns.items():
            # bytes of equal significance side by side compress better than whole floats; a checksum shows damage
            dataset = file.create_dataset(name, data=values, compression="gzip", shuffle=True, fletcher32=True)
            channel = CHANNELS[name]
            dataset.attrs.update({"units": channel.unit, "meaning": channel.meaning, "sign": channel.sign})
            if name == "time_s":
                dataset.make_scale(name)
            else:
                dataset.dims[0].attach_scale(file["time_s"])
