"""What nothing seen carries: an edge that says so, and why, in place of a carrier that would be guessed."""

from __future__ import annotations

from collections.abc import Sequence

from scenewright.schemas.contact_graph import SCENE_NODE
from scenewright.schemas.scene_parts import Relation
from scenewright.stages.graph.corrected_support import hull_overlap
from scenewright.stages.graph.nodes import Entity
from scenewright.stages.graph.support import height_gap


def unknown_support(child: Entity, entities: Sequence[Entity]) -> Relation:
    """Return the `unknown` relation of an object for which no carrier was accepted, with the nearest surface below."""
    below = [
        (height_gap(child.box, parent.patches[k]), parent.name)
        for parent in entities
        if parent.name != child.name
        for k in parent.supporting
        if hull_overlap(parent.patches[k].hull, child.box) > 0.0
    ]
    gap, name = min(((gap, name) for gap, name in below if gap >= 0.0), default=(0.0, ""))
    because = f"the nearest level surface below it, of {name}, is {gap:.2f} m lower" if name else NOTHING_BELOW
    return Relation(source=SCENE_NODE, target=child.name, relation="unknown", confidence=0.0, because=because)


NOTHING_BELOW = "no level surface was seen below it"
"""Why, where no plane at all lies under a thing."""
