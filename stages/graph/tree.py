"""The scene parse tree: every object gets exactly one parent, and no parent is its own descendant."""

from __future__ import annotations

from scipy.spatial import cKDTree

from schemas.contact_graph import SCENE_NODE
from stages.graph.hanging import hanging_candidate
from stages.graph.nodes import Entity
from stages.graph.parameters import GraphParameters
from stages.graph.shared_support import shared_candidates
from stages.graph.support import HIDDEN_TOP_DISTANCE, Candidate, candidates_for
from stages.graph.walls import wall_candidate

FLOOR_CONFIDENCE = 0.1
"""Of a relation to the floor that only says: it has to stand on something."""
SCENE_CONFIDENCE = 0.05
MOVABLE_REACH = 1 / 3
"""Movable things have to be this much nearer to a wall to hang on it."""
UPRIGHT_LAYOUT = ("wall", "door", "window", "curtain", "ceiling")


def ranked_candidates(entities: list[Entity], parameters: GraphParameters) -> dict[str, list[Candidate]]:
    """Return for every object its acceptable relations, best first: support, then wall or ceiling, then floor or scene.

    The last entry always hangs on the scene, so a tree exists whatever the map shows.
    """
    objects = [entity for entity in entities if entity.node_type != "layout"]
    ours = parameters.method == "ours"
    ceilings = [entity for entity in entities if entity.class_name == "ceiling"] if ours else []
    upright = [e for e in entities if e.class_name in UPRIGHT_LAYOUT and len(e.points)]
    walls = [entity for entity in upright if entity not in ceilings]
    floors = [entity for entity in entities if entity.class_name == "floor" and entity.supporting]
    trees = {wall.name: cKDTree(wall.points) for wall in walls}
    ranked: dict[str, list[Candidate]] = {}
    for child in objects:
        choices = candidates_for(child, entities, parameters)
        close = [c for c in choices if abs(c.gap) <= HIDDEN_TOP_DISTANCE and c.overlap >= parameters.area_threshold]
        if ours and not close:
            # Two in contact come before one that is deeper, and before one of them alone.
            choices = [*shared_candidates(child, entities, parameters), *choices]
        reach = parameters.wall_distance
        if ours and child.movable:
            # A cup does not hang on the wall that the desk, which the map lacks, stands at.
            reach *= MOVABLE_REACH
        wall = wall_candidate(child, walls, reach, trees)
        hanging = hanging_candidate(child, ceilings, reach)
        held = [candidate for candidate in (wall, hanging) if candidate is not None]
        choices += sorted(held, key=lambda candidate: -candidate.score)
        choices += fallback_candidates(child, floors)
        ranked[child.name] = choices
    return ranked


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
