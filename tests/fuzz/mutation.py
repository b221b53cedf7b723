"""Mutations for the runs in the suite, where no coverage guides: the same seed gives the same bytes."""

from __future__ import annotations

import random

WORDS = (
    *(b"\xff", b"\0", b"\xff\xff\xff\xff", b"\xff\xff\xff\x7f", b"\xc3\x28", b"nan", b"-1", b"1e400", b"9" * 20),
    *(b"../", b"%s", b"{", b"[", b"<", b"=", b'"', b"\n"),
)


def mutated(data: bytes, rng: random.Random) -> bytes:
    """Return the bytes after one to four random changes."""
    changed = bytearray(data)
    for _ in range(rng.randint(1, 4)):
        place = rng.randrange(len(changed) + 1)
        kind = rng.randrange(6)
        if kind == 0 and changed:
            changed[place % len(changed)] ^= 1 << rng.randrange(8)
        elif kind == 1 and changed:
            changed[place % len(changed)] = rng.randrange(256)
        elif kind == 2:
            changed[place:place] = rng.choice(WORDS)
        elif kind == 3:
            word = rng.choice(WORDS)
            changed[place : place + len(word)] = word
        elif kind == 4:
            del changed[place : place + rng.randint(1, 1 + len(changed) // 4)]
        else:
            start = rng.randrange(len(changed) + 1)
            changed[place:place] = changed[start : start + rng.randint(1, 40)]
    return bytes(changed)
