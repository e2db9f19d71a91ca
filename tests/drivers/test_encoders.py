"""Counts, direction, resolution and wrap-around; the CiA 406 client against the simulated encoder."""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import accumulate

import pytest
from drive_rig import Mass
from hypothesis import given
from hypothesis import strategies as st

from drivers.canopen_encoder import CanopenEncoder, EncoderSettings
from drivers.canopen_master import CanopenMaster
from drivers.counting import Unwrapper
from drivers.inprocess import InProcessBus
from drivers.port import Condition, ConfigurationError
from drivers.sim.encoder_node import SimulatedEncoder

STEP_M = 0.5e-6


@given(st.integers(2, 1000) | st.integers(2, 1 << 40), st.integers(-(1 << 40), 1 << 40), st.data())
def test_unwrapped_counts_are_the_true_ones_for_any_range(modulus: int, start: int, data: st.DataObject) -> None:
    reach = (modulus - 1) // 2  # less than half a turn of the counter between two readings
    moves = data.draw(st.lists(st.integers(-reach, reach), max_size=30))
    unwrapper = Unwrapper(modulus, start % modulus)
    for true in accumulate(moves, initial=start):
        assert unwrapper.update(true % modulus) - start % modulus == true - start


@given(st.integers(2, 10_000), st.lists(st.integers(-(1 << 33), 1 << 33), max_size=20))
def test_signed_and_unsigned_readings_are_the_same(modulus: int, raws: list[int]) -> None:
    a, b = Unwrapper(modulus), Unwrapper(modulus)
    for raw in raws:
        assert a.update(raw) == b.update(raw % modulus)


def test_a_counter_of_one_count_is_refused() -> None:
    with pytest.raises(ValueError, match="modulus must be at least 2 counts, got 1"):
        Unwrapper(1)


@dataclass
class Bench:
    """An encoder alone on a bus."""

    settings: EncoderSettings
    range_counts: int = 0

    def __post_init__(self) -> None:
        bus = InProcessBus()
        self.master = CanopenMaster(bus.port())
        self.plant = Mass(lead_m=2 * math.pi)  # table position = motor position
        self.node = SimulatedEncoder(bus.port(), self.plant, step_m=STEP_M, range_counts=self.range_counts)
        self.encoder = CanopenEncoder(self.master, self.settings)
        self.tick = 0

    def measure(self, position_m: float) -> float:
        self.plant.motor_position_rad = position_m
        self.tick += 1
        self.master.sync(self.tick * 1e-3)
        sample = self.encoder.read(self.tick * 1e-3)
        assert sample.condition is Condition.OK
        assert sample.time_s == self.tick * 1e-3
        assert sample.counts * STEP_M == pytest.approx(sample.position_m)
        return sample.position_m


@pytest.mark.parametrize("range_counts", [0, 1 << 16, 100_000])
@pytest.mark.parametrize("sign", [1, -1])
def test_position_over_many_wraps_in_either_direction(range_counts: int, sign: int) -> None:
    bench = Bench(EncoderSettings(reversed=sign < 0), range_counts)
    bench.encoder.set_up()
    bench.master.start(0.0)
    zero_m = bench.measure(0.0)
    for k in range(1, 400):
        position_m = 0.011 * k * (-1 if k > 200 else 1) + (2 * 0.011 * 200 if k > 200 else 0)  # out 2.2 m and back
        assert bench.measure(position_m) - zero_m == pytest.approx(sign * position_m, abs=STEP_M)


def test_the_32_bit_wrap_is_seen_as_motion() -> None:
    bench = Bench(EncoderSettings())
    wrap_m = (1 << 31) * STEP_M
    bench.plant.motor_position_rad = wrap_m - 0.001
    bench.encoder.set_up()
    bench.master.start(0.0)
    assert bench.measure(wrap_m + 0.001) == pytest.approx(wrap_m + 0.001, abs=STEP_M)
    assert bench.node.values[0x6004_00] < 0


def test_preset_takes_effect_on_the_device() -> None:
    bench = Bench(EncoderSettings())
    bench.encoder.set_up()
    bench.master.start(0.0)
    bench.measure(0.25)
    bench.encoder.preset(0.1)
    assert bench.measure(0.25) == pytest.approx(0.1)
    assert bench.measure(0.26) == pytest.approx(0.11)


@pytest.mark.parametrize(("heard_ms", "lost"), [(60, False), (61, True)])
def test_an_encoder_without_heartbeat_is_lost_after_three(heard_ms: int, lost: bool) -> None:
    bench = Bench(EncoderSettings(heartbeat_s=0.02))
    bench.encoder.set_up()
    bench.master.start(0.0)
    bench.measure(0.0)
    bench.node.values[0x1017_00] = 0
    condition = bench.encoder.read(0.001 + 1e-3 * heard_ms).condition
    assert condition is (Condition.HEARTBEAT_LOST if lost else Condition.OK)


def test_a_step_of_zero_is_refused() -> None:
    bench = Bench(EncoderSettings())
    bench.node.values[0x6005_01] = 0
    with pytest.raises(ConfigurationError, match=r"object 0x6005:01.*given: 0 m; allowed: > 0 m"):
        bench.encoder.set_up()


def test_another_resolution_than_believed_is_refused() -> None:
    with pytest.raises(ConfigurationError, match=r"encoder node 6.*another measuring step.*5e-07 m; allowed: 1e-06 m"):
        Bench(EncoderSettings(step_m=1e-6)).encoder.set_up()
