"""Write a MATLAB .mat file of version 7 with scipy: a column vector per channel, `units`, and the metadata as text."""

from pathlib import Path

from hil.channels import CHANNELS
from hil.exchange.content import METADATA, Content


def write_mat(path: Path, content: Content) -> None:
    """Write compressed variables; units.NAME and meaning.NAME are texts."""
    from scipy.io import savemat

    variables = {name: values[:, None] for name, values in content.columns.items()}
    about = {
        "units": {name: CHANNELS[name].unit for name in variables},
        "meaning": {name: CHANNELS[name].meaning for name in variables},
        METADATA: content.metadata,
    }
    savemat(path, variables | about, do_compression=True, long_field_names=True)
