"""Every member that the loop calls is asked of a device when it is made, not when the loop first calls it."""

from __future__ import annotations

from types import new_class

import pytest

from drivers.port import Drive, Encoder, Master


@pytest.mark.parametrize(("port", "names"), [
    (Master, {"start", "sync", "poll"}),
    (Drive, {"set_up", "clear_fault", "read", "command", "confirm_off", "check", "error_code", "status"}),
    (Encoder, {"set_up", "read", "check", "close"}),
])  # fmt: skip
def test_a_class_that_lacks_one_member_of_a_port_cannot_be_made(port: type, names: set[str]) -> None:
    def make(present: set[str]) -> None:
        new_class("Device", (port,), exec_body=lambda members: members.update(dict.fromkeys(present)))()

    for missing in names:
        with pytest.raises(TypeError, match=rf"abstract method '?{missing}\b"):
            make(names - {missing})
    make(names)
