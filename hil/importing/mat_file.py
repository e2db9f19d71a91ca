"""Read variables of a MATLAB .mat file to version 7."""

import re
from pathlib import Path
from typing import Any

import numpy as np

from hil.arrays import FloatArray
from hil.errors import InputError, listed
from hil.importing.mat_size import check_mat_size


def load_mat(path: Path) -> dict[str, Any]:
    """Variables of a .mat file; fields of structures as NAME.FIELD, signals of Simulink by their label."""
    from scipy.io import loadmat

    check_mat_size(path)
    try:
        content = loadmat(path, struct_as_record=False, squeeze_me=False)
        variables: dict[str, Any] = {}
        for name, value in content.items():
            if not name.startswith("__"):
                _flatten(name, value, variables)
        return variables
    except NotImplementedError:
        raise InputError(
            f"{path}: is a .mat file of version 7.3 (HDF5), allowed up to version 7; "
            "save it in MATLAB with: save(NAME, '-v7')"
        ) from None
    except Exception as error:  # scipy raises many kinds for a damaged file
        raise InputError(f"{path}: is no readable .mat file ({error}); it is cut or damaged") from None


def _flatten(name: str, value: Any, into: dict[str, Any]) -> None:
    """Put a variable into `into`, its fields one by one if it is a structure or an array of structures."""
    structures = _structures(value)
    if not structures:
        into[name] = value
    for index, one in enumerate(structures):
        label = "".join(np.asarray(getattr(one, "label", "")).reshape(-1).astype(str))
        if label and hasattr(one, "values"):  # a signal of Simulink
            into[f"{name.rpartition('.')[0]}.{label}"] = one.values
            continue
        own = name if len(structures) == 1 else f"{name}.{index}"
        for key in one._fieldnames:
            _flatten(f"{own}.{key}", getattr(one, key), into)


def _structures(value: Any) -> list[Any]:
    """Structures in a variable, also in cells; none for numbers."""
    if hasattr(value, "_fieldnames"):
        return [value]
    values = np.asarray(value)
    if values.dtype != object or values.ndim == 0:  # without a dimension: an object that is no array, such as sparse
        return []
    return [one for item in values.reshape(-1) for one in _structures(item)]


def mat_column(path: Path, variables: dict[str, Any], name: str) -> FloatArray:
    """The vector `name`, or column i of the matrix of NAME[i] (n,). Raises InputError for another shape or type."""
    match = None if name in variables else re.fullmatch(r"(.+)\[(\d+)\]", name)
    values = _mat_variable(path, variables, match[1] if match else name)
    if match and values.ndim == 2 and int(match[2]) < values.shape[1]:
        return np.ascontiguousarray(values[:, int(match[2])])
    if not match and values.size == max(values.shape, default=0):
        return values.reshape(-1)
    raise InputError(
        f"{path}: {name}: the variable has the shape {' x '.join(map(str, values.shape))}, allowed a "
        f"vector, or NAME[i] for column i (from 0) of a matrix; correct the map"
    )


def mat_scalar(path: Path, variables: dict[str, Any], name: str) -> float:
    """The scalar `name`. Raises InputError for another shape, or no finite number."""
    values = _mat_variable(path, variables, name)
    if values.size != 1 or not np.isfinite(values).all():
        raise InputError(
            f"{path}: {name}: given {values.size} values, allowed one finite number; write the number into the map"
        )
    return float(values.reshape(-1)[0])


def _mat_variable(path: Path, variables: dict[str, Any], name: str) -> FloatArray:
    if name not in variables:
        raise InputError(f"{path}: column {name!r} is missing; the file has {listed(variables)}")
    values = np.asarray(variables[name])
    if values.dtype.kind not in "fiub":
        raise InputError(
            f"{path}: {name}: given values of the type {values.dtype}, allowed real numbers; "
            "save the vector itself, not a structure or a text"
        )
    return values.astype(np.float64)
