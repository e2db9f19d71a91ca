"""Process data objects: mapping entries and their packing by `struct` (CiA 301, little-endian, 0.1 us per frame)."""

from collections.abc import Sequence
from dataclasses import dataclass
from struct import Struct
from typing import Final

# COB-ID flags in the communication parameters 0x1400.. and 0x1800.., sub-index 1.
PDO_INVALID: Final = 1 << 31
PDO_NO_RTR: Final = 1 << 30

EVENT_DRIVEN: Final = 255  # transmission type: an RPDO acts at once
EVERY_SYNC: Final = 1  # transmission type: a TPDO answers every SYNC, an RPDO acts at the next SYNC

_CODES: Final = {(8, False): "B", (16, False): "H", (32, False): "I", (64, False): "Q",
                 (8, True): "b", (16, True): "h", (32, True): "i", (64, True): "q"}  # fmt: skip


@dataclass(frozen=True, slots=True)
class Entry:
    """A mapped object. As UNSIGNED32: index (16) | sub-index (8) | length in bits (8)."""

    index: int
    subindex: int
    bits: int
    signed: bool = False

    @property
    def word(self) -> int:
        """Value of the mapping object 0x1600.., 0x1A00.. ."""
        return self.index << 16 | self.subindex << 8 | self.bits

    @property
    def code(self) -> str:
        """Format letter of `struct`; ValueError for a length no machine type has."""
        try:
            return _CODES[self.bits, self.signed]
        except KeyError:
            raise ValueError(
                f"PDO entry 0x{self.index:04X}:{self.subindex}: must be 8, 16, 32 or 64 bits, got {self.bits}"
            ) from None


def layout(entries: Sequence[Entry]) -> Struct:
    """Packer of a PDO. ValueError if the entries exceed 8 bytes or a length is not 8, 16, 32 or 64 bits."""
    packer = Struct("<" + "".join(entry.code for entry in entries))
    if packer.size > 8:
        raise ValueError(f"PDO: must be at most 8 bytes, got {packer.size}")
    return packer


def saturate(value: int, bits: int) -> int:
    """Signed value limited to its range: a set-point too large must not wrap into the other direction."""
    limit = 1 << (bits - 1)
    return -limit if value < -limit else limit - 1 if value >= limit else value
