"""The scene parse tree: every object gets exactly one parent, and no parent is its own descendant."""

from __future__ import annotations

from scenewright.schemas.contact_graph import SCENE_NODE
from scenewright.stages.graph.nodes import Entity
from scenewright.stages.graph.support import Candidate

FLOOR_CONFIDENCE = 0.1
"""Confidence of a relation to the floor that only says: it has to stand on something."""
SCENE_CONFIDENCE = 0.05
"""Confidence of a relation to the scene itself, where there is no floor either; by eye."""
UPRIGHT_LAYOUT = ("wall", "door", "window", "curtain", "ceiling")
"""Classes of the room that things are fixed to, and not laid on."""


def objects_of(entities: list[Entity]) -> list[Entity]:
    """Return the nodes that need a parent."""
    return [entity for entity in entities if entity.node_type != "layout"]


def upright_layout(entities: list[Entity]) -> list[Entity]:
    """Return layout that was seen and on which things may hang."""
    return [entity for entity in entities if entity.class_name in UPRIGHT_LAYOUT and len(entity.points)]


def level_floors(entities: list[Entity]) -> list[Entity]:
    """Return floors with a plane to stand on."""
    return [entity for entity in entities if entity.class_name == "floor" and entity.supporting]


def fallback_candidates(child: Entity, floors: list[Entity]) -> list[Candidate]:
    """Return relations of low confidence for an object that nothing supports: the largest floor, then the scene."""
    result = []
    if floors:
        area = {floor.name: max(floor.patches[k].plane.area for k in floor.supporting) for floor in floors}
        floor = max(floors, key=lambda f: (area[f.name], -f.instance))
        patch = max(floor.supporting, key=lambda k: floor.patches[k].plane.area)
        height = floor.patches[patch].plane.center[2]
        gap = child.bottom - height
        result.append(Candidate(child.name, floor.name, FLOOR_CONFIDENCE, "supports", gap, 0.0, height, patch))
    result.append(Candidate(child.name, SCENE_NODE, SCENE_CONFIDENCE, "supports", 0.0, 0.0, child.bottom, None))
    return result


def choose_parents(ranked: dict[str, list[Candidate]]) -> dict[str, Candidate]:
    """Return one relation per object, such that they form a tree.

    The most certain objects choose first; a choice that would close a cycle (two flat things that each seem to lie on
    the other) is passed over. Every list must end with a parent outside the objects. The thesis orders parents by the
    height of their bottoms, which needs no such check and fails where two bottoms differ by noise alone.
    """
    chosen: dict[str, Candidate] = {}
    for name in sorted(ranked, key=lambda n: (-ranked[n][0].score, n)):
        for candidate in ranked[name]:
            if not descends_from(candidate.parent, name, chosen):
                chosen[name] = candidate
                break
        else:
            raise ValueError(f"no parent outside its own descendants is offered for {name}")
    return chosen


def descends_from(node: str, ancestor: str, chosen: dict[str, Candidate]) -> bool:
    """Whether `node` is `ancestor` or hangs below it in the relations chosen so far."""
    while True:
        if node == ancestor:
            return True
        if node not in chosen:
            return False
        node = chosen[node].parent
