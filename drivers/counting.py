"""Counts to positions: wrap-around, direction, resolution. Pure; shared by all encoders."""


class Unwrapper:
    """Running total of a counter that wraps at `modulus` counts (2^n for n bits, or any range).

    Valid as long as the encoder moves by less than half the modulus between two readings.
    """

    __slots__ = ("_half", "_last", "_modulus", "total")

    def __init__(self, modulus: int, start: int = 0) -> None:
        if modulus < 2:
            raise ValueError(f"modulus must be at least 2 counts, got {modulus}")
        self._modulus, self._half = modulus, modulus // 2
        self._last = start
        self.total = start

    def restart(self, raw: int) -> None:
        """The next count continues from here."""
        self._last = self.total = raw

    def update(self, raw: int) -> int:
        """Total after reading `raw` (signed or unsigned, any representative of its class)."""
        self.total += (raw - self._last + self._half) % self._modulus - self._half
        self._last = raw
        return self.total
