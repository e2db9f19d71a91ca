"""PDO mapping words and packing."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.pdo import Entry, layout, saturate

BITS = st.sampled_from([8, 16, 32, 64])
ENTRIES = st.lists(st.builds(Entry, st.integers(0x1000, 0xFFFF), st.integers(0, 255), BITS, st.booleans()), max_size=8)


def fits(entries: list[Entry]) -> bool:
    return sum(entry.bits for entry in entries) <= 64


@given(ENTRIES.filter(fits), st.data())
def test_values_survive_packing(entries: list[Entry], data: st.DataObject) -> None:
    low = [-(1 << (e.bits - 1)) if e.signed else 0 for e in entries]
    high = [(1 << (e.bits - e.signed)) - 1 for e in entries]
    values = tuple(data.draw(st.integers(a, b)) for a, b in zip(low, high, strict=True))
    packer = layout(entries)
    frame = packer.pack(*values)
    assert len(frame) == sum(entry.bits for entry in entries) // 8
    assert packer.unpack(frame) == values


@given(ENTRIES.filter(lambda entries: not fits(entries)))
def test_more_than_eight_bytes_are_refused(entries: list[Entry]) -> None:
    with pytest.raises(ValueError, match="at most 8 bytes"):
        layout(entries)


@given(st.integers(0x1000, 0xFFFF), st.integers(0, 255), BITS)
def test_mapping_word_is_index_subindex_length(index: int, subindex: int, bits: int) -> None:
    assert Entry(index, subindex, bits).word.to_bytes(4, "big") == bytes([index >> 8, index & 255, subindex, bits])


def test_a_length_no_machine_has_is_refused() -> None:
    with pytest.raises(ValueError, match="0x6041:0: must be 8, 16, 32 or 64 bits, got 12"):
        layout([Entry(0x6041, 0, 12)])


@given(st.integers(-(1 << 40), 1 << 40))
def test_a_set_point_too_large_keeps_its_sign(value: int) -> None:
    limited = saturate(value, 16)
    assert -32768 <= limited <= 32767
    assert limited == value or (abs(limited) < abs(value) and (limited > 0) == (value > 0))
