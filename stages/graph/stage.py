"""Wiring of `graph`: panoptic map in, contact graph out (Han 2024, section 2.2)."""

from __future__ import annotations

from dataclasses import dataclass
from dataclasses import replace as dataclass_replace

from schemas.contact_graph import SCENE_NODE, ContactGraph, ContactGraphFile, GraphNode
from schemas.panoptic_map import PanopticMap
from schemas.scene_parts import TREE_RELATIONS, Relation
from stages.graph.beside import relations_beside
from stages.graph.entities import Kept, load_entities, suppose_floor
from stages.graph.evidence import relation_of
from stages.graph.nodes import Entity
from stages.graph.parameters import GraphParameters
from stages.graph.refinement import proximal_relations, refined_box, register_hidden_planes
from stages.graph.support import Candidate
from stages.graph.timeline import Stand, build_timeline
from stages.graph.tree import choose_parents, ranked_candidates
from stages.kit.progress import SilentProgress
from stages.kit.stage import Context


@dataclass(frozen=True)
class Built:
    """A contact graph and what it was built from."""

    graph: ContactGraphFile
    entities: list[Entity]
    dropped: dict[str, str]
    """Name -> why it is no node."""
    floor: str


def run(panoptic_map: PanopticMap, *, parameters: GraphParameters, context: Context) -> ContactGraph:
    """Build the contact graph of a panoptic map: nodes, support tree, hidden planes, refined boxes, proximal pairs.

    Where the map kept snapshots of itself, the graph of each is built as well, and timeline.json says how it grew.
    """
    kept: Kept = {}
    grown = []
    for snapshot in panoptic_map.snapshots():
        with context.progress.step("snapshots"):
            quiet = dataclass_replace(context, progress=SilentProgress())
            built = build_graph(snapshot, parameters, quiet, kept)
            grown.append(Stand(snapshot.info.frames_integrated, built.graph, built.entities))
    built = build_graph(panoptic_map, parameters, context, kept if grown else None)
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
        "uncertain": sum(
            link.confidence < parameters.minimum_score for link in graph.links if link.relation in TREE_RELATIONS
        ),
        "hidden_planes": sum(plane.hidden for node in graph.nodes for plane in node.planes),
        "floor": built.floor,
        "dropped": len(built.dropped),
    }
    if grown:
        summary["snapshots"] = len(grown)
    outcome = "ok" if summary["objects"] or summary["layout"] else "empty"
    return ContactGraph(context.output, outcome=outcome, summary=summary)


def build_graph(
    panoptic_map: PanopticMap, parameters: GraphParameters, context: Context, kept: Kept | None = None
) -> Built:
    """Build the graph of one map, finished or partial. `kept`: see `load_entities`."""
    with context.progress.step("nodes"):
        entities, dropped = load_entities(panoptic_map, parameters, context, kept)
        floor_note = "seen" if any(entity.class_name == "floor" for entity in entities) else "none"
        if floor_note == "none":
            floor = suppose_floor(panoptic_map, entities, parameters, context)
            if floor is not None:
                entities.append(floor)
                floor_note = "supposed at z = 0"
    with context.progress.step("supports"):
        chosen = choose_parents(ranked_candidates(entities, parameters))
        by_name, chosen = register_hidden_planes({entity.name: entity for entity in entities}, chosen)
        entities = [by_name[entity.name] for entity in entities]
    with context.progress.step("refinement"):
        graph = contact_graph(entities, chosen, parameters)
    return Built(graph, entities, dropped, floor_note)


def contact_graph(
    entities: list[Entity], chosen: dict[str, Candidate], parameters: GraphParameters
) -> ContactGraphFile:
    """Put nodes, tree and proximal relations into the file's form; boxes are refined on the way."""
    by_name = {entity.name: entity for entity in entities}
    boxes = {}
    for entity in entities:
        candidate = chosen.get(entity.name)
        if candidate is None or candidate.patch is None:
            boxes[entity.name] = entity.box
        else:
            most = parameters.maximum_extension
            if parameters.method == "ours" and entity.movable:
                most = min(most, parameters.movable_gap)
            boxes[entity.name] = refined_box(entity.box, candidate.height, most)

    nodes = [GraphNode(id=SCENE_NODE, instance=0, class_name=SCENE_NODE, node_type="scene")]
    links = []
    for entity in entities:
        nodes.append(
            GraphNode(
                id=entity.name,
                instance=entity.instance,
                class_name=entity.class_name,
                node_type=entity.node_type,
                mesh=entity.mesh,
                box=boxes[entity.name],
                box_observed=entity.box,
                planes=tuple(patch.plane for patch in entity.patches),
                confidence=entity.confidence,
            )
        )
        if entity.node_type == "layout":
            links.append(Relation(source=SCENE_NODE, target=entity.name, relation="supports", confidence=1.0))
        else:
            links.append(relation_of(chosen[entity.name], by_name))
    if parameters.method == "ours":
        links += relations_beside(entities, chosen, parameters)
    linked = {(link.source, link.target) for link in links}
    links += proximal_relations(entities, boxes, linked)
    return ContactGraphFile(nodes=tuple(nodes), links=tuple(links), graph={"method": parameters.method})
