"""Faults before the axis may move: at set-up, and a profile beyond the limits of the bench. Nothing may be enabled."""

from __future__ import annotations

import random
import tempfile
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from observed_run import MOVE

from drivers.cia402 import POWERED
from drivers.modelled_bus import ModelledBus
from drivers.sim.sdo_server import AbortCode, SdoAbort
from hil.bench.bench_file import Bench
from hil.bench.hardware import SetPointLimits
from hil.errors import HilError
from hil.loop.devices import Rig
from hil.loop.run import run_profile

REQUESTS = 60  # SDO requests of a set-up, about


def _refused_mode(rig: Rig, rng: random.Random) -> None:
    def refuse(index: int, subindex: int, value: int) -> None:
        if value:
            raise SdoAbort(AbortCode.INVALID_VALUE)

    rig.nodes.drive.dictionary.on_write(0x6060, refuse)


def _at_request(rng: random.Random, node: Any, then: Callable[[Callable[[bytes], Any], bytes], Any]) -> None:
    answer, left = node._sdo.answer, [rng.randrange(REQUESTS)]

    def hostile(request: bytes) -> Any:
        left[0] -= 1
        return then(answer, request) if left[0] < 0 else answer(request)

    node._sdo.answer = hostile


def _abort(rig: Rig, rng: random.Random) -> None:
    code = rng.choice(list(AbortCode))
    _at_request(rng, rng.choice((rig.nodes.drive, rig.nodes.encoder)),
                lambda answer, request: b"\x80" + request[1:4] + int(code).to_bytes(4, "little"))  # fmt: skip


def _time_out(rig: Rig, rng: random.Random) -> None:
    _at_request(rng, rng.choice((rig.nodes.drive, rig.nodes.encoder)), lambda answer, request: None)


def _nothing(rig: Rig, rng: random.Random) -> None:
    """The fault is the profile."""


SET_UP: Mapping[str, Callable[[Rig, random.Random], None]] = {
    "mode refused": _refused_mode,
    "SDO abort at set-up": _abort,
    "SDO time-out at set-up": _time_out,
    "profile beyond limits": _nothing,
}


def run_set_up(name: str, bench: Bench, rng: random.Random) -> list[str]:
    """What is wrong with a run that must not begin; [] if nothing is."""
    if name == "profile beyond limits":
        limits = {"velocity_m_s": 1.0, "acceleration_m_s2": 10.0, "jerk_m_s3": 1000.0}
        limits[rng.choice(("velocity_m_s", "acceleration_m_s2"))] *= 0.01
        section = bench.drive.model_copy(update={"limits": SetPointLimits(**limits)})
        bench = bench.model_copy(update={"drive": section})
    wrong, enabled = [], []
    bus = ModelledBus()
    rig = Rig(bench, bus=bus)
    try:
        node = rig.nodes.drive
        bus.port().listen(0x205, lambda can_id, data, now_s: enabled.append(data) if data[0] & 8 else None)
        before_m = rig.nodes.plant.table_position_m
        SET_UP[name](rig, rng)
        try:
            with tempfile.TemporaryDirectory() as folder:
                run_profile(bench, MOVE, Path(folder), "run", virtual=True, rig=rig)
            if name == "mode refused" or name == "profile beyond limits":
                wrong.append("it ran")
        except HilError:
            if enabled:
                wrong.append("the drive was commanded to enable")
            if node.state in POWERED:
                wrong.append("the power stage is on")
            if rig.nodes.plant.table_position_m != before_m:
                wrong.append("the axis moved")
    finally:
        rig.close()
    return wrong
