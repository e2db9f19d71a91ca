"""Seeded damage of bytes and texts."""

from __future__ import annotations

import random
import re

# values that a hand or a tool puts into a file
ODD_VALUES = (
    "0", "-1", "1e-9", "4294967296", "1e15", "1e308", "-1e-300", "1e-300", ".nan", ".inf", "null", "true", "''", "[]",
    "{}", "'[/]'", "../../x", "9" * 400, "[[[[1]]]]", "0x7fffffff", "1_000", "!!python/name:os.system",
)  # fmt: skip
_NUMBER = re.compile(r"(?<![\w.])-?\d+(?:\.\d+)?(?:e-?\d+)?(?![\w.])")
_VALUE = re.compile(r"(?<=: )[^\n{\[#]+")
ODD_BYTES = b"\0\xff\x80{}[]:\"'\n\t,#&*!"


def damaged_bytes(rng: random.Random, data: bytes) -> bytes:
    """Flip, overwrite, cut, remove, repeat or insert bytes at one to four places; half of them near the end, where
    formats keep their metadata."""
    out = bytearray(data)
    for _ in range(rng.randint(1, 4)):
        if not out:
            break
        low = max(0, len(out) - 4096) if rng.random() < 0.5 else 0
        at, way = rng.randrange(low, len(out)), rng.randrange(7)
        end = min(len(out), at + rng.randint(1, 64))
        if way <= 1:
            out[at] ^= 1 << rng.randrange(8)
        elif way == 2:
            out[at] = rng.randrange(256)
        elif way == 3:
            del out[at:]
        elif way == 4:
            del out[at:end]
        elif way == 5:
            out[at:at] = out[at:end]
        else:
            out[at:at] = bytes(rng.choice(ODD_BYTES) for _ in range(rng.randint(1, 8)))
    return bytes(out)


def damaged_text(rng: random.Random, text: str) -> bytes:
    """Replace numbers and values by odd ones, remove, repeat or swap lines, or damage bytes."""
    for _ in range(rng.randint(1, 3)):
        way, lines = rng.randrange(6), text.split("\n")
        at = rng.randrange(len(lines))
        if way <= 2:
            found = list((_NUMBER if way < 2 else _VALUE).finditer(text))
            if found:
                place = rng.choice(found)
                text = text[: place.start()] + rng.choice(ODD_VALUES) + text[place.end() :]
        elif way == 3:
            text = "\n".join(lines[:at] + lines[at + 1 :])
        elif way == 4:
            text = "\n".join([*lines[:at], lines[at], *lines[at:]])
        else:
            return damaged_bytes(rng, text.encode())
    return text.encode()
