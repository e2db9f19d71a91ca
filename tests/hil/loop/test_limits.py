"""Limits are bits and places of the memory are places, each its own."""

from __future__ import annotations

from hil.loop.limits import Bounds, Facts, Limit, Memory


def test_each_limit_is_a_bit_of_its_own() -> None:
    assert [int(limit) for limit in Limit.__members__.values()] == [0, *(1 << bit for bit in range(20))]


def test_each_memory_has_a_place_of_its_own() -> None:
    assert [int(place) for place in Memory.__members__.values()] == list(range(27))


def test_bounds_have_no_default_and_of_the_facts_a_stop_alone() -> None:
    assert Bounds._field_defaults == {}
    assert Facts._field_defaults == {"stopping": False}
