"""Error codes in words, as CiA 301 (table 26) and CiA 402-2 have them; the parts of an EMCY."""

from __future__ import annotations

import pytest

from drivers.emcy import decode_emergency, error_text

TABLE = """
0000 error reset, no error|00ff error reset, no error|1000 generic error|1001 generic error|2100 current, input side
2200 current inside the device|2300 current, output side|2310 continuous over-current
2320 short circuit or earth leakage|2000 current|2900 current|3000 voltage|3100 mains voltage|3110 mains over-voltage
3120 mains under-voltage|3200 voltage inside the device|3210 DC link over-voltage|3220 DC link under-voltage
3300 output voltage|4000 temperature|4100 ambient temperature|4200 device temperature
4210 excess device temperature|4310 excess drive temperature|4300 temperature|5000 device hardware
5530 non-volatile memory|6000 device software|6100 internal software|6200 user software|6300 data set
6320 parameter error|7000 additional modules|7121 motor blocked|7305 incremental sensor 1 fault
7310 speed controller fault|7500 communication|8000 monitoring|8100 communication|8110 CAN overrun, objects lost
8120 CAN in error passive mode|8130 life guard or heartbeat error|8140 recovered from bus off|8150 CAN-ID collision
8200 protocol error|8210 PDO not processed due to length error|8220 PDO length exceeded
8240 unexpected SYNC data length|8250 RPDO time-out|8300 torque control|8311 excess torque|8400 velocity controller
8480 velocity control|8500 position control|8600 positioning|8611 following error|8612 reference limit
9000 external error|f000 additional functions|ff00 device specific|ffff device specific|a000 unknown class
0100 unknown class|9100 unknown class
"""


@pytest.mark.parametrize("entry", TABLE.strip().replace("\n", "|").split("|"))
def test_the_class_of_a_code_is_the_most_specific_one(entry: str) -> None:
    code, words = entry.split(" ", 1)
    assert error_text(int(code, 16)) == f"0x{code.upper()} {words}"


REGISTER = (
    "generic",
    "current",
    "voltage",
    "temperature",
    "communication",
    "device profile",
    "reserved",
    "manufacturer",
)


@pytest.mark.parametrize("bit", range(8))
def test_each_bit_of_the_error_register_has_a_name(bit: int) -> None:
    emergency = decode_emergency(bytes([0x10, 0x23, 1 << bit, 1, 2, 3, 4, 5]), 0.25)
    assert emergency == (0.25, 0x2310, 1 << bit, b"\x01\x02\x03\x04\x05")
    assert emergency.text == (
        f"EMCY 0x2310 continuous over-current, error register: {REGISTER[bit]}, detail 01 02 03 04 05"
    )


@pytest.mark.parametrize(("code", "active"), [(0x0000, False), (0x00FF, False), (0x0100, True), (0xFF00, True)])
def test_a_code_of_zero_in_its_upper_byte_ends_an_error(code: int, active: bool) -> None:
    assert decode_emergency(code.to_bytes(2, "little"), 0.0).active is active
