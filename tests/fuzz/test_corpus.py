"""The committed corpus of every harness, replayed and mutated for about a second each. `make fuzz` looks further."""

from __future__ import annotations

import random
import resource
import time

import pytest

from tests.fuzz.harness import corpus_of, edited, edits_of, script
from tests.fuzz.mutation import mutated
from tests.fuzz.registry import NAMES, load

SECONDS = 0.6
"""Of mutations, for every harness."""
LARGEST_GROWTH = 1024 * 1024
"""Memory that one harness may add to the process [kB]: a compressed image may claim 64 million pixels."""


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.slow
def test_corpus_and_mutations(name: str) -> None:
    target = load(name).target
    inputs = [path.read_bytes() for path in corpus_of(name)]
    assert inputs, f"no corpus: python -m tests.fuzz.make_corpus {name}"
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    for data in (b"", *inputs):
        target(data)
    rng = random.Random(name)
    end = time.monotonic() + SECONDS
    count = 0
    while time.monotonic() < end and count < 2000:
        data = mutated(rng.choice(inputs), rng)
        started = time.monotonic()
        try:
            target(data)
        except Exception as error:
            error.add_note(f"harness {name}, input {data!r}")
            raise
        assert time.monotonic() - started < 10, data
        count += 1
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before < LARGEST_GROWTH


@pytest.mark.parametrize("name", NAMES)
def test_seeds_are_in_the_corpus(name: str) -> None:
    """A harness whose samples changed shape needs its corpus made again."""
    assert len([path for path in corpus_of(name) if path.name.startswith("seed-")]) == len(load(name).seeds())


def test_edit_scripts() -> None:
    edits = [(3, 1, b"abc"), (0, 0, b""), (2**32 - 1, 255, b"x")]
    assert list(edits_of(script(*edits))) == edits
    assert edited(b"0123456789", script((3, 2, b"ab"))) == b"012ab56789"
    assert edited(b"0123456789", script((0, 0, b">"), (11, 5, b"<"))) == b">0123456789<"
    assert edited(b"", b"\xff" * 9) in (b"\xff" * 3, b"")


def test_mutations_repeat() -> None:
    assert [mutated(b"some bytes", random.Random(k)) for k in range(50)] == [
        mutated(b"some bytes", random.Random(k)) for k in range(50)
    ]
