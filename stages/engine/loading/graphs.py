"""Contact graphs as networkx graphs."""

from __future__ import annotations

from typing import Any

from schemas.contact_graph import ContactGraphFile


def as_networkx(graph: ContactGraphFile) -> Any:
    """Return a networkx.MultiDiGraph: node id -> the fields of GraphNode, edges keyed and attributed by relation.

    `supports`, `contains`, `carries_on_wall` and `hangs_from` go from the carrier to what it carries, and so do
    `also_supports` and `leans_on`, which stand beside the tree; `proximal` holds both ways and is there once. `box` and
    `planes` are the models of schemas/scene_parts.py.
    """
    import networkx

    result = networkx.MultiDiGraph()
    for node in graph.nodes:
        result.add_node(node.id, **{name: getattr(node, name) for name in type(node).model_fields if name != "id"})
    for link in graph.links:
        fields = {name: getattr(link, name) for name in type(link).model_fields if name not in ("source", "target")}
        result.add_edge(link.source, link.target, key=link.relation, **fields)
    return result
