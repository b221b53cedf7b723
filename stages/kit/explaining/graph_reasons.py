"""Why a node of a contact graph stands where it does, and what the evidence for it is."""

from __future__ import annotations

from collections.abc import Iterator

from scenewright.schemas.contact_graph import SCENE_NODE, ContactGraph, ContactGraphFile, GraphNode
from scenewright.schemas.scene_parts import TREE_RELATIONS, Relation
from scenewright.stages.kit.explaining.reason import Reason, Reasons, edit_reasons, length, listed, merged, percent

STANDS = {
    "supports": "It stands on {}",
    "contains": "It stands inside {}",
    "carries_on_wall": "It hangs on {}",
    "hangs_from": "It hangs from {}",
    "also_supports": "{} carries it too",
    "leans_on": "It leans on {}",
}
"""What a relation means to its target."""


def graph_reasons(graph: ContactGraph) -> Reasons:
    """Return the reasons of every node but the root."""
    return merged([node_reasons(graph.info), edit_reasons(graph.edits)])


def node_reasons(graph: ContactGraphFile) -> Reasons:
    """Return by node what carries it, what it carries and what else it touches, with the evidence."""
    return {node.id: list(_of(graph, node)) for node in graph.nodes if node.id != SCENE_NODE}


def _of(graph: ContactGraphFile, node: GraphNode) -> Iterator[Reason]:
    if node.mark is not None:
        yield Reason(f"A person marked it {node.mark}.", {"mark": node.mark})
    parent = graph.parent_link(node.id)
    if parent is not None and parent.relation == "unknown":
        yield Reason(f"Nothing is known to carry it: {parent.because}.", parent.model_dump(mode="json"))
    elif parent is None or parent.source == SCENE_NODE:
        why = "it bounds the room" if node.node_type == "layout" else "no support was found under or behind it"
        yield Reason(f"Nothing carries it: {why}.", {"parent": None, "node_type": node.node_type})
    else:
        yield Reason(_sentence(parent, parent.source), parent.model_dump(mode="json"))
    for link in graph.links:
        if link.relation not in (*TREE_RELATIONS, "proximal") and node.id == link.target:
            yield Reason(_sentence(link, link.source), link.model_dump(mode="json"))
    near = [link for link in graph.links if link.relation == "proximal" and node.id in (link.source, link.target)]
    shares = {link.source if node.id == link.target else link.target: link.overlap for link in near}
    if shares:
        rows = [name if share is None else f"{name} ({percent(share)})" for name, share in shares.items()]
        says = f"It is close to {listed(rows)}: that share of the smaller box lies in the other."
        yield Reason(says, {"proximal": [link.model_dump(mode="json") for link in near]})
    children = graph.children(node.id)
    if children:
        yield Reason(f"It carries {listed(children)}.", {"children": children})


def _sentence(link: Relation, other: str) -> str:
    stands = STANDS[link.relation].format(other)
    return " ".join([f"{stands}, with confidence {link.confidence:.2f}.", *_evidence(link)])


def _evidence(link: Relation) -> Iterator[str]:
    """Yield what gap, overlap and share inside mean for a relation (schemas/scene_parts.py)."""
    upright = link.relation in ("supports", "contains", "also_supports")
    if link.gap is not None:
        plane = "the plane" if link.plane is None else f"plane {link.plane}"
        side = "above" if link.gap >= 0 else "below"
        yield (
            f"Its lowest point was {length(abs(link.gap))} {side} {plane} of {link.source} before it was moved onto it."
            if upright and link.relation != "also_supports"
            else f"The gap between the two is {length(link.gap)}."
        )
    if link.overlap is not None:
        of = {"carries_on_wall": "of its side faces the plane", "leans_on": "of its height is where they meet"}.get(
            link.relation, "of its footprint lies over the plane" if upright else "of its footprint lies under it"
        )
        yield f"{percent(link.overlap)} {of}."
    if link.inside is not None:
        yield f"{percent(link.inside)} of its box lies inside {link.source}."
