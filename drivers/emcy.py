"""EMCY messages decoded to text (CiA 301 table 26, CiA 402-2 error codes)."""

from typing import Final, NamedTuple

# The most specific entry is used: whole code, then upper byte, then upper nibble.
_CODES: Final = {
    0x2310: "continuous over-current", 0x2320: "short circuit or earth leakage", 0x3110: "mains over-voltage",
    0x3120: "mains under-voltage", 0x3210: "DC link over-voltage", 0x3220: "DC link under-voltage",
    0x4210: "excess device temperature", 0x4310: "excess drive temperature", 0x5530: "non-volatile memory",
    0x6320: "parameter error", 0x7121: "motor blocked", 0x7305: "incremental sensor 1 fault",
    0x7310: "speed controller fault", 0x7500: "communication", 0x8110: "CAN overrun, objects lost",
    0x8120: "CAN in error passive mode", 0x8130: "life guard or heartbeat error", 0x8140: "recovered from bus off",
    0x8150: "CAN-ID collision", 0x8210: "PDO not processed due to length error", 0x8220: "PDO length exceeded",
    0x8240: "unexpected SYNC data length", 0x8250: "RPDO time-out", 0x8311: "excess torque",
    0x8400: "velocity controller", 0x8611: "following error", 0x8612: "reference limit",
}  # fmt: skip
_BYTES: Final = {
    0x00: "error reset, no error", 0x10: "generic error", 0x21: "current, input side",
    0x22: "current inside the device", 0x23: "current, output side", 0x31: "mains voltage",
    0x32: "voltage inside the device", 0x33: "output voltage", 0x41: "ambient temperature",
    0x42: "device temperature", 0x61: "internal software", 0x62: "user software", 0x63: "data set",
    0x81: "communication", 0x82: "protocol error", 0x83: "torque control", 0x84: "velocity control",
    0x85: "position control", 0x86: "positioning", 0x90: "external error", 0xF0: "additional functions",
    0xFF: "device specific",
}  # fmt: skip
_NIBBLES: Final = {
    0x2: "current", 0x3: "voltage", 0x4: "temperature", 0x5: "device hardware", 0x6: "device software",
    0x7: "additional modules", 0x8: "monitoring",
}  # fmt: skip
_REGISTER: Final = ("generic", "current", "voltage", "temperature", "communication", "device profile", "reserved",
                    "manufacturer")  # fmt: skip


def error_text(code: int) -> str:
    """Error code of an EMCY or of object 0x603F, with its class in words."""
    text = _CODES.get(code) or _BYTES.get(code >> 8) or _NIBBLES.get(code >> 12) or "unknown class"
    return f"0x{code:04X} {text}"


class Emergency(NamedTuple):
    """An EMCY. code 0x00xx: errors reset. Devices that send fewer than 8 bytes have an empty `detail`."""

    time_s: float
    code: int
    register: int
    detail: bytes

    @property
    def active(self) -> bool:
        """Return True for an error, False for its reset."""
        return self.code & 0xFF00 != 0

    @property
    def text(self) -> str:
        """Message with code, class, error register and detail."""
        bits = [name for bit, name in enumerate(_REGISTER) if self.register >> bit & 1]
        register = f", error register: {', '.join(bits)}" if bits else ""
        detail = f", detail {self.detail.hex(' ')}" if any(self.detail) else ""
        return f"EMCY {error_text(self.code)}{register}{detail}"


def decode_emergency(data: bytes, time_s: float) -> Emergency:
    """Decode an EMCY frame of 0..8 bytes; missing bytes are zero."""
    padded = data.ljust(3, b"\0")
    return Emergency(time_s, int.from_bytes(padded[:2], "little"), padded[2], bytes(data[3:8]))
