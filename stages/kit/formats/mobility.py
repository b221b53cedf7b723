"""What of a scene is free to move: what an arm carries, and furniture that stands by its own weight.

Free is what stands on something (what hangs would fall) and is either of a class that an arm carries, or furniture: a
thing, with doors and drawers or without, not built in, which the contact graph puts on a level plane, laden or not.
What a person marked (`edit mark`) is as they said; what hangs stays, and what nothing is known to carry.
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass, field

from scenewright.schemas.contact_graph import SCENE_NODE, ContactGraphFile, GraphNode
from scenewright.stages.kit.formats.scene_supports import support_height
from scenewright.stages.kit.geometry.boxes import box_volume
from scenewright.stages.kit.geometry.substances import substance_of

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
HEAVIEST = 400.0
"""What has no name and weighs more by its box is not pushed [kg]: a kitchenette in one piece; by eye."""


@dataclass(frozen=True)
class Mobility:
    """Whether a body is free, and whether as furniture (which no arm carries)."""

    movable: bool
    furniture: bool = False
    why: str = field(default="", compare=False)
    """In words, as a clause."""


def mobility(graph: ContactGraphFile, node: GraphNode, carriable: Collection[str], fixed: Collection[str]) -> Mobility:
    """Return what is free to move about a node.

    `carriable`: classes that an arm carries; `fixed`: classes that stay although they would be furniture.
    """
    link = graph.parent_link(node.id)
    if node.node_type == "layout":
        return Mobility(False, why="it bounds the room")
    if link is not None and link.relation == "unknown":
        return Mobility(False, why=f"nothing is known to carry it: {link.because}")
    if link is not None and link.relation not in STANDS:
        return Mobility(False, why="it hangs, and would fall")
    is_carriable = node.class_name in carriable
    if node.mark is not None:
        is_free = node.mark == "movable"
        return Mobility(is_free, is_free and not is_carriable, f"a person marked it {node.mark}")
    if is_carriable:
        return Mobility(True, why=f"an arm carries things of class {node.class_name}")
    if link is None or link.source == SCENE_NODE:
        return Mobility(False, why="nothing was found that carries it")
    if node.class_name in fixed:
        return Mobility(False, why=f"class {node.class_name} is among the classes to keep fixed")
    if node.class_name in BUILT_IN:
        return Mobility(False, why=f"class {node.class_name} is part of the building, or too heavy to push")
    if node.class_name == NAMELESS and (mass := _mass_of_box(node)) > HEAVIEST:
        return Mobility(
            False, why=f"it would weigh {mass:.0f} kg by its size: part of the building, or too heavy to push"
        )
    if support_height(graph, {entry.id: entry for entry in graph.nodes}, node.id) is None:
        return Mobility(False, why="the graph puts it on no level plane")
    return Mobility(True, furniture=True, why="it is furniture and stands by its own weight")


def _mass_of_box(node: GraphNode) -> float:
    return 0.0 if node.box is None else substance_of(node.class_name).hull_density * box_volume(node.box)
