"""What of a scene is free to move: what an arm carries, and furniture that stands by its own weight.

Free is what stands on something (what hangs would fall) and is either of a class that an arm carries, or furniture: a
thing, with doors and drawers or without, not built in, which the contact graph puts on a level plane, laden or not.
What a person marked (`edit mark`) is as they said; what hangs stays.
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass

from scenewright.schemas.contact_graph import SCENE_NODE, ContactGraphFile, GraphNode
from scenewright.stages.kit.formats.scene_supports import support_height

STANDS = ("supports", "contains")
BUILT_IN = frozenset(
    (
        "wall_cabinet",
        "wall_shelf",
        "cabinet",
        "drawer_unit",
        "wardrobe",
        "chest",
        "shelf",
        "fridge",
        "oven",
        "dishwasher",
        "washing_machine",
        "hob",
        "sink",
        "toilet",
        "bed",
        "person",
        "pendant_lamp",
        "board",
        "door",
        "window",
        "curtain",
    )
)
"""Part of the building, fastened to it, or too heavy to be pushed."""
NAMELESS = "object"


@dataclass(frozen=True)
class Mobility:
    """Whether a body is free, and whether as furniture (which no arm carries)."""

    movable: bool
    furniture: bool = False


def mobility(graph: ContactGraphFile, node: GraphNode, carriable: Collection[str], fixed: Collection[str]) -> Mobility:
    """Return what is free to move about a node.

    `carriable`: classes that an arm carries; `fixed`: classes that stay although they would be furniture.
    """
    link = graph.parent_link(node.id)
    stands = link is None or link.relation in STANDS
    if node.node_type == "layout" or not stands:
        return Mobility(False)
    if node.mark is not None:
        return Mobility(node.mark == "movable", node.mark == "movable" and node.class_name not in carriable)
    if node.class_name in carriable:
        return Mobility(True)
    if link is None or link.source == SCENE_NODE:
        return Mobility(False)
    if node.class_name in BUILT_IN or node.class_name in fixed:
        return Mobility(False)
    if support_height(graph, {entry.id: entry for entry in graph.nodes}, node.id) is None:
        return Mobility(False)
    return Mobility(True, furniture=True)
