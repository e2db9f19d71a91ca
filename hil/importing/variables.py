"""Read files that hold variables by name: MATLAB, NumPy, ASAM MDF 4, HDF5, MCAP, TDMS and ULog."""

import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.lib import format as npy_format

from hil.files.input_file import check_values, parsing
from hil.importing.hdf5_file import load_hdf5
from hil.importing.mat_file import load_mat
from hil.importing.mcap_file import load_mcap
from hil.importing.mdf_file import load_mdf
from hil.importing.tdms_file import load_tdms
from hil.importing.ulog_file import load_ulog

Loaded = tuple[dict[str, Any], dict[str, str]]
_LOADERS: dict[str, Callable[[Path], Loaded]] = {
    ".mat": lambda path: load_hdf5(path) if _is_hdf5(path) else (load_mat(path), {}),
    ".npy": lambda path: (_numpy(path), {}),
    ".npz": lambda path: (_numpy(path), {}),
    ".mf4": load_mdf,
    ".h5": load_hdf5,
    ".hdf5": load_hdf5,
    ".mcap": load_mcap,
    ".tdms": load_tdms,
    ".ulg": load_ulog,
}
VARIABLE_ENDINGS = tuple(_LOADERS)


class Variables(NamedTuple):
    """Arrays by name, and their units where the file gives them."""

    arrays: dict[str, Any]
    units: dict[str, str]


def load_variables(path: Path) -> Variables:
    """Read `path` by its ending. Raises InputError: damaged, too many values, or a library that is not installed."""
    return Variables(*_LOADERS[path.suffix.lower()](path))


def _is_hdf5(path: Path) -> bool:
    """True for a .mat file of version 7.3, which is an HDF5 file behind a head of 512 bytes."""
    with path.open("rb") as file:
        return file.read(520)[512:] == b"\x89HDF\r\n\x1a\n"


def _numpy(path: Path) -> dict[str, Any]:
    """Arrays of a .npy or .npz file; fields of a structured array as variables. What it says of its size is checked."""
    with parsing(path, "NumPy file"):
        return _named_arrays(path)


def _named_arrays(path: Path) -> dict[str, Any]:
    found = dict[str, Any]()
    if path.suffix.lower() == ".npy":
        _check_array(path, path.open("rb"))
        found = {path.stem: np.load(path, allow_pickle=False)}
    else:
        with zipfile.ZipFile(path) as archive:
            names = [name for name in archive.namelist() if name.endswith(".npy")]
            values = sum(_check_array(path, archive.open(name)) for name in names)
            check_values(path, values, f"{values} values")
        with np.load(path, allow_pickle=False) as arrays:  # other members are no arrays and of any size
            found = {name.removesuffix(".npy"): arrays[name] for name in names}
    variables = dict[str, Any]()
    for name, array in found.items():
        fields = array.dtype.names or ()
        variables |= {field: array[field] for field in fields} if fields else {name: array}
    return variables


def _check_array(path: Path, file: Any) -> int:
    """Number of values that the head of an array announces. Raises InputError for too many."""
    with file:
        version = npy_format.read_magic(file)
        read = npy_format.read_array_header_1_0 if version == (1, 0) else npy_format.read_array_header_2_0
        shape, _, dtype = read(file)
    values = int(np.prod([float(size) for size in shape])) * max(1, dtype.itemsize // 8)
    check_values(path, values, f"an array of {' x '.join(map(str, shape))}")
    return values
