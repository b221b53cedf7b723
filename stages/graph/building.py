"""From a panoptic map, finished or partial, to its contact graph (Han 2024, section 2.2)."""

from __future__ import annotations

from dataclasses import dataclass

from scenewright.schemas.contact_graph import SCENE_NODE, ContactGraphFile, GraphNode
from scenewright.schemas.panoptic_map import PanopticMap
from scenewright.schemas.scene_parts import Relation
from scenewright.stages.graph.entities import Kept, load_entities, suppose_floor
from scenewright.stages.graph.evidence import relation_of
from scenewright.stages.graph.method import GraphMethod
from scenewright.stages.graph.nodes import Entity
from scenewright.stages.graph.parameters import GraphParameters
from scenewright.stages.graph.refinement import proximal_relations, register_hidden_planes
from scenewright.stages.graph.support import Candidate
from scenewright.stages.graph.tree import choose_parents
from scenewright.stages.graph.unknown import unknown_support
from scenewright.stages.kit.geometry.boxes import refined_box
from scenewright.stages.kit.stage import Context


@dataclass(frozen=True)
class Built:
    """A contact graph and what it was built from."""

    graph: ContactGraphFile
    entities: list[Entity]
    dropped: dict[str, str]
    """Name -> why it is no node."""
    floor: str


def build_graph(
    panoptic_map: PanopticMap,
    method: GraphMethod,
    parameters: GraphParameters,
    context: Context,
    kept: Kept | None = None,
) -> Built:
    """Build the graph of one map, finished or partial. `kept`: see `load_entities`."""
    with context.progress.step("nodes"):
        entities, dropped = load_entities(panoptic_map, method, parameters, context, kept)
        floor_note = "seen" if any(entity.class_name == "floor" for entity in entities) else "none"
        if floor_note == "none":
            floor = suppose_floor(panoptic_map, entities, parameters, context)
            if floor is not None:
                entities.append(floor)
                floor_note = "supposed at z = 0"
    with context.progress.step("supports"):
        chosen = choose_parents(method.ranked_candidates(entities))
        by_name, chosen = register_hidden_planes({entity.name: entity for entity in entities}, chosen)
        entities = [by_name[entity.name] for entity in entities]
    with context.progress.step("refinement"):
        graph = contact_graph(entities, chosen, method)
    return Built(graph, entities, dropped, floor_note)


def contact_graph(entities: list[Entity], chosen: dict[str, Candidate], method: GraphMethod) -> ContactGraphFile:
    """Put nodes, tree and proximal relations into the file's form; boxes are refined on the way."""
    by_name = {entity.name: entity for entity in entities}
    boxes = {}
    nodes = [GraphNode(id=SCENE_NODE, instance=0, class_name=SCENE_NODE, node_type="scene")]
    links = []
    for entity in entities:
        candidate = chosen.get(entity.name)
        if candidate is None or candidate.patch is None:
            boxes[entity.name] = entity.box
        else:
            boxes[entity.name] = refined_box(entity.box, candidate.height, method.maximum_extension(entity))
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
        elif candidate is not None:
            links.append(relation_of(candidate, by_name))
        else:
            links.append(unknown_support(entity, entities))
    links += method.relations_beside(entities, chosen)
    linked = {(link.source, link.target) for link in links}
    links += proximal_relations(entities, boxes, linked)
    return ContactGraphFile(nodes=tuple(nodes), links=tuple(links), graph={"method": method.name})
