"""The rig on every kind of bus."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import pytest
from drive_rig import Rig, in_process

from drivers.bus import BusConfig, PumpedPort, PythonCanPort, open_bus
from drivers.modelled_bus import ModelledBus


@pytest.fixture(params=["in-process", "modelled", "virtual"])
def make(request: pytest.FixtureRequest) -> Iterator[Callable[..., Rig]]:
    ports: list[PythonCanPort] = []

    def build(**options: Any) -> Rig:
        if request.param == "in-process":
            return in_process(**options)
        if request.param == "modelled":
            bus = ModelledBus(1_000_000)
            return Rig(bus.port(), bus.port(), reply_s=0.0005, **options)
        ports.extend(PythonCanPort(open_bus(BusConfig("virtual", "test_drive"))) for _ in range(2))
        return Rig(PumpedPort(ports[-2], ports[-1]), ports[-1], **options)

    yield build
    for port in ports:
        port.close()
