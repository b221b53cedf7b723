"""The scene parse tree: an object gets one parent or none, and no parent is its own descendant."""

from __future__ import annotations

from scenewright.stages.graph.nodes import Entity
from scenewright.stages.graph.support import Candidate

UPRIGHT_LAYOUT = ("wall", "door", "window", "curtain", "ceiling")
"""Classes of the room that things are fixed to, and not laid on."""


def objects_of(entities: list[Entity]) -> list[Entity]:
    """Return the nodes that need a parent."""
    return [entity for entity in entities if entity.node_type != "layout"]


def upright_layout(entities: list[Entity]) -> list[Entity]:
    """Return layout that was seen and on which things may hang."""
    return [entity for entity in entities if entity.class_name in UPRIGHT_LAYOUT and len(entity.points)]


def choose_parents(ranked: dict[str, list[Candidate]]) -> dict[str, Candidate]:
    """Return at most one relation per object, such that they form trees; none for what nothing is offered to.

    The most certain objects choose first; a choice that would close a cycle (two flat things that each seem to lie on
    the other) is passed over. The thesis orders parents by the height of their bottoms, which needs no such check and
    fails where two bottoms differ by noise alone.
    """
    chosen: dict[str, Candidate] = {}
    offered = [name for name, candidates in ranked.items() if candidates]
    for name in sorted(offered, key=lambda n: (-ranked[n][0].score, n)):
        free = (candidate for candidate in ranked[name] if not descends_from(candidate.parent, name, chosen))
        best = next(free, None)
        if best is not None:
            chosen[name] = best
    return chosen


def descends_from(node: str, ancestor: str, chosen: dict[str, Candidate]) -> bool:
    """Whether `node` is `ancestor` or hangs below it in the relations chosen so far."""
    while True:
        if node == ancestor:
            return True
        if node not in chosen:
            return False
        node = chosen[node].parent
