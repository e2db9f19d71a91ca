"""Data types that CiA 301, 402 and 406 fix for the objects used here: integers, of which some are signed."""

from typing import Final

from canopen.objectdictionary import ODVariable, datatypes

from drivers.object_index import ObjectIndex as Index

_SIGNED: Final = frozenset(
    {
        (Index.INTERPOLATION_TIME, 2),
        *(
            (index, 0)
            for index in (
                Index.ABORT_CONNECTION_OPTION, Index.QUICK_STOP_OPTION, Index.FAULT_REACTION_OPTION,
                Index.MODE_OF_OPERATION, Index.MODE_DISPLAY, Index.POSITION_DEMAND, Index.POSITION_ACTUAL,
                Index.VELOCITY_DEMAND, Index.VELOCITY_ACTUAL, Index.TARGET_TORQUE, Index.TORQUE_DEMAND,
                Index.TORQUE_ACTUAL, Index.TARGET_POSITION, Index.HOME_OFFSET, Index.HOMING_METHOD,
                Index.FOLLOWING_ERROR_ACTUAL, Index.TARGET_VELOCITY,
            )
        ),
    }
)  # fmt: skip
# CiA 406 has UNSIGNED32 for them; linear encoders send negative positions as a counter that has wrapped
COUNTERS: Final = frozenset({Index.ENCODER_PRESET, Index.ENCODER_POSITION, Index.ENCODER_OFFSET})
_PDO_PARAMETERS: Final = range(Index.RPDO_COMMUNICATION, Index.TPDO_MAPPING + 0x200)
_KNOWN: Final = frozenset(Index)
_SIZES: Final[dict[int, int]] = {kind: code.size for kind, code in ODVariable.STRUCT_TYPES.items()}
_NAMES: Final[dict[int, str]] = {
    kind: name for name, kind in vars(datatypes).items() if isinstance(kind, int) and not name.startswith("_")
}


def profile_type(index: int, subindex: int, data_type: int) -> int:
    """Type of an object with the sign that its profile fixes; any other object and type as it is."""
    if data_type not in datatypes.INTEGER_TYPES or not (index in _KNOWN or index in _PDO_PARAMETERS):
        return data_type
    kinds = datatypes.SIGNED_TYPES if is_signed(index, subindex) else datatypes.UNSIGNED_TYPES
    found: int = next(kind for kind in kinds if _SIZES[kind] == _SIZES[data_type])
    return found


def is_signed(index: int, subindex: int) -> bool:
    """True for an object of the profiles that is read as a signed integer."""
    return (index, subindex) in _SIGNED or index in COUNTERS


def size_of(data_type: int) -> int:
    """Bytes of an integer."""
    return _SIZES[data_type]


def data_type_name(data_type: int) -> str:
    """Name of a data type in CiA 301, as INTEGER32."""
    return _NAMES.get(data_type, f"0x{data_type:04X}")
