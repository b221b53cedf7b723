"""Wiring of `graph`: panoptic map in, contact graph out (Han 2024, section 2.2)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace as dataclass_replace

from scenewright.schemas.contact_graph import ContactGraph
from scenewright.schemas.panoptic_map import PanopticMap
from scenewright.stages.graph.building import build_graph
from scenewright.stages.graph.entities import Kept
from scenewright.stages.graph.method import GraphMethod
from scenewright.stages.graph.ours import Ours
from scenewright.stages.graph.parameters import GraphParameters
from scenewright.stages.graph.thesis import Thesis
from scenewright.stages.graph.timeline import Stand, build_timeline
from scenewright.stages.kit.progress import SilentProgress
from scenewright.stages.kit.stage import Context

METHODS: dict[str, Callable[[GraphParameters], GraphMethod]] = {"ours": Ours, "thesis": Thesis}


def run(panoptic_map: PanopticMap, *, parameters: GraphParameters, context: Context) -> ContactGraph:
    """Build the contact graph of a panoptic map: nodes, support tree, hidden planes, refined boxes, proximal pairs.

    Where the map kept snapshots of itself, the graph of each is built as well, and timeline.json says how it grew.
    """
    method = METHODS[parameters.method](parameters)
    unchanged: Kept = {}
    grown = []
    for snapshot in panoptic_map.snapshots():
        with context.progress.step("snapshots"):
            quiet = dataclass_replace(context, progress=SilentProgress())
            built = build_graph(snapshot, method, parameters, quiet, unchanged)
            grown.append(Stand(snapshot.info.frames_integrated, built.graph, built.entities))
    built = build_graph(panoptic_map, method, parameters, context, unchanged if grown else None)
    graph, entities = built.graph, built.entities
    for name, reason in built.dropped.items():
        context.logger.info("%s is left out: %s", name, reason)
    graph.write(context.output / "graph.json")
    if grown:
        with context.progress.step("timeline"):
            grown.append(Stand(panoptic_map.info.frames_integrated, graph, entities))
            timeline = build_timeline(grown)
            timeline.write(context.output / "timeline.json")

    supports = [link for link in graph.links if link.relation in ("supports", "contains")]
    summary = {
        "objects": sum(entity.node_type != "layout" for entity in entities),
        "layout": sum(entity.node_type == "layout" for entity in entities),
        "supports": sum(link.relation == "supports" for link in supports),
        "contains": sum(link.relation == "contains" for link in supports),
        "carried_on_wall": sum(link.relation == "carries_on_wall" for link in graph.links),
        "hang_from_above": sum(link.relation == "hangs_from" for link in graph.links),
        "second_carriers": sum(link.relation == "also_supports" for link in graph.links),
        "leaning": sum(link.relation == "leans_on" for link in graph.links),
        "proximal": sum(link.relation == "proximal" for link in graph.links),
        "unknown": sum(link.relation == "unknown" for link in graph.links),
        "hidden_planes": sum(plane.hidden for node in graph.nodes for plane in node.planes),
        "floor": built.floor,
        "dropped": len(built.dropped),
    }
    if grown:
        summary["snapshots"] = len(grown)
    outcome = "ok" if summary["objects"] or summary["layout"] else "empty"
    return ContactGraph(context.output, outcome=outcome, summary=summary)
