"""Where a thing is by another one, answered by the contact graph."""

from __future__ import annotations

from scenewright.schemas.contact_graph import ContactGraphFile
from scenewright.schemas.scene_parts import CARRYING


def related(graph: ContactGraphFile, relation: str) -> set[tuple[int, int]]:
    """Return (instance of the thing, instance of the other) of all pairs that stand in a relation.

    `on` and `in` hold through all that carries: a cup on a tray on a table is on the table. `beside` is any proximal
    pair and whatever stands on the same thing.
    """
    instances = {node.id: node.instance for node in graph.nodes}
    parents = {link.target: link for link in graph.links if link.relation in CARRYING}
    pairs: set[tuple[int, int]] = set()
    for node in instances:
        at, inside = node, False
        while at in parents and len(pairs) < 10**6:
            link = parents[at]
            inside = inside or link.relation == "contains"
            if (relation == "in" and inside) or relation in ("on", "under"):
                pairs.add((instances[node], instances[link.source]))
            at = link.source
        if relation == "beside" and node in parents:
            siblings = (link.target for link in parents.values() if link.source == parents[node].source)
            pairs.update((instances[node], instances[sibling]) for sibling in siblings if sibling != node)
    if relation == "beside":
        proximal = [link for link in graph.links if link.relation == "proximal"]
        pairs.update(
            (instances[a], instances[b])
            for link in proximal
            for a, b in ((link.source, link.target), (link.target, link.source))
        )
    if relation == "under":
        pairs = {(b, a) for a, b in pairs}
    return {(a, b) for a, b in pairs if a and b}
