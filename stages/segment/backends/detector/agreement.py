"""Two networks that were taught apart seldom err alike: a semantic segmenter as the witness of a detector."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, replace

import numpy as np
from scenewright.schemas.vocabulary import SemanticClass

CONFIRMING_SHARE = 0.3
"""The second network confirms a detection when it gives this share of its mask a name of the same kind."""
CONTRADICTING_SHARE = 0.5
"""The second network contradicts a detection when it gives this share of its mask a name of another kind."""
SAME_KIND = ({"chair", "sofa", "bench"}, {"table", "desk"}, {"monitor", "laptop"})
"""Classes that the networks take for each other when they see a part of a thing."""
SURE = 0.6
"""A detection of this score needs nobody's agreement."""
LEAST_SHARE = 0.02
"""The segmenter does not see what is smaller than this share of the image: it is no witness there."""
HEARD = 0.5
"""Detections down to this share of the score threshold count where the witness confirms them."""


@dataclass(frozen=True)
class Thing:
    """One detected thing in a frame."""

    semantic: SemanticClass
    score: float
    mask: np.ndarray
    """(H, W) bool."""


def witnessed(
    things: Iterable[Thing],
    classes: np.ndarray,
    known: Mapping[int, SemanticClass],
    *,
    threshold: float,
    anything: SemanticClass,
) -> Iterator[Thing]:
    """Yield the detections that stand, as the class that they may be called.

    `classes` (H, W) uint8: what the segmenter calls every pixel; `known`: the classes of the vocabulary among them, by
    their number. What is confirmed stands from any score on, with the score SURE at least. What is contradicted needs
    SURE, and so does what the segmenter knows and does not confirm: from `threshold` on it is `anything`. What the
    segmenter does not know, or is too small for it, stands from `threshold` on.
    """
    names = {entry.name for entry in known.values()}
    for thing in things:
        kind = next((kind for kind in SAME_KIND if thing.semantic.name in kind), {thing.semantic.name})
        class_pixels = np.bincount(classes[thing.mask], minlength=256)
        pixels = int(class_pixels.sum())
        confirming = sum(int(class_pixels[number]) for number, entry in known.items() if entry.name in kind)
        contradicting = sum(int(class_pixels[number]) for number, entry in known.items() if entry.name not in kind)
        witness = pixels >= LEAST_SHARE * classes.size
        if witness and confirming >= CONFIRMING_SHARE * pixels:
            yield replace(thing, score=max(thing.score, SURE))
            continue
        doubted = witness and (bool(kind & names) or contradicting >= CONTRADICTING_SHARE * pixels)
        if thing.score >= (SURE if doubted else threshold):
            yield thing
        elif thing.score >= threshold:
            yield replace(thing, semantic=anything)
