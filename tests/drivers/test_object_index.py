"""Indices of the objects as CiA 301, 402-2 and 406 give them."""

from __future__ import annotations

from drivers.object_index import ObjectIndex

STANDARD = """
1000 device type|1003 error history|1005 sync cob id|1006 communication cycle period|1016 consumer heartbeat time
1017 producer heartbeat time|1018 identity|1019 sync counter overflow|1029 error behaviour|1400 rpdo communication
1600 rpdo mapping|1800 tpdo communication|1a00 tpdo mapping|6007 abort connection option|603f error code
6040 controlword|6041 statusword|605a quick stop option|605e fault reaction option|6060 mode of operation
6061 mode display|6062 position demand|6064 position actual|6065 following error window|606b velocity demand
606c velocity actual|6071 target torque|6072 max torque|6074 torque demand|6075 rated current|6076 rated torque
6077 torque actual|607a target position|607c home offset|6085 quick stop deceleration|608f position encoder resolution
6098 homing method|6099 homing speeds|609a homing acceleration|60c2 interpolation time|60f4 following error actual
60ff target velocity|6502 supported modes|6000 encoder operating parameters|6002 encoder measuring range
6003 encoder preset|6004 encoder position|6005 encoder step settings|6501 encoder single turn resolution
6503 encoder alarms|6509 encoder offset
"""


def test_indices_are_those_of_the_standards() -> None:
    entries = [entry.split(" ", 1) for entry in STANDARD.strip().replace("\n", "|").split("|")]
    expected = {name.upper().replace(" ", "_"): int(index, 16) for index, name in entries}
    assert {name: int(index) for name, index in ObjectIndex.__members__.items()} == expected
