"""What is in the artifacts, with or without ground truth: entities, edges, how flat the floor is."""

from __future__ import annotations

import numpy as np
from scenewright.schemas.cad_scene import CadScene
from scenewright.schemas.contact_graph import ContactGraphFile
from scenewright.schemas.interactive_scene import InteractiveScene
from scenewright.schemas.panoptic_map import PanopticMap
from scenewright.schemas.segments import SegmentsFile
from scenewright.schemas.sequence import SequenceFile
from scenewright.stages.evaluate.map_measures import PredictedMap
from scenewright.stages.evaluate.results import Part
from scenewright.stages.evaluate.surfaces import read_surface
from scenewright.stages.kit.geometry.planes import fit_plane
from scenewright.stages.kit.measurement.edge_agreement import BESIDE_THE_TREE, DIRECTED
from scenewright.stages.kit.measurement.tables import Table


def count_frames(part: Part, info: SequenceFile) -> None:
    """Frames kept and dropped."""
    part.set("frames", info.frame_count)
    part.set("frames_dropped", sum(info.drops.values()))


def count_segments(part: Part, info: SegmentsFile) -> None:
    """Frames with segments and the mean number of labelled segments."""
    labelled = [sum(s.class_id > 0 for s in frame.segments) for frame in info.frames]
    part.set("frames_segmented", len(labelled))
    part.set("labelled_segments_per_frame", float(np.mean(labelled)) if labelled else None)


def count_entities(part: Part, predicted: PredictedMap) -> None:
    """Entities by class, surface and how much of it is labelled."""
    entities = predicted.info.entities
    part.set("entities", len(entities))
    by_class: dict[str, int] = {}
    for entity in entities:
        by_class[entity.class_name] = by_class.get(entity.class_name, 0) + 1
    for name, count in sorted(by_class.items()):
        part.set(f"entities_{name.replace(' ', '_')}", count)
    part.set("vertices", len(predicted.surface.vertices))
    part.set("triangles", len(predicted.surface.triangles))
    labelled = predicted.vertex_instances > 0
    part.set("labelled_vertices_share", float(labelled.mean()) if len(labelled) else None)
    part.tables.append(
        Table(
            "entities",
            "Entities in the map",
            ("instance", "class", "vertices", "confidence", "observations", "height [m]"),
            tuple(
                (
                    e.instance,
                    e.class_name,
                    e.vertices,
                    e.confidence,
                    e.observations,
                    e.box_maximum[2] - e.box_minimum[2],
                )
                for e in sorted(entities, key=lambda e: e.instance)
            ),
        )
    )


def measure_floor(part: Part, panoptic_map: PanopticMap, predicted: PredictedMap) -> None:
    """How far the floor entity is from z = 0: mean height, root mean square height, tilt of its plane.

    Undefined where no floor was found. Takes the largest entity of class floor.
    """
    floors = [e for e in predicted.info.entities if e.class_name == "floor"]
    if not floors:
        for measure in ("floor_height_mean_m", "floor_height_rms_m", "floor_roughness_m", "floor_tilt_rad"):
            part.set(measure, None)
        return
    floor = max(floors, key=lambda e: (e.vertices, -e.instance))
    vertices = read_surface(panoptic_map.path(floor.mesh)).vertices
    if len(vertices) < 3:
        return
    part.set("floor_height_mean_m", float(vertices[:, 2].mean()))
    part.set("floor_height_rms_m", float(np.sqrt(np.mean(vertices[:, 2] ** 2))))
    normal, offset = fit_plane(vertices)
    part.set("floor_roughness_m", float(np.sqrt(np.mean((vertices @ normal + offset) ** 2))))
    part.set("floor_tilt_rad", float(np.arccos(min(1.0, abs(float(normal[2]))))))


def count_graph(part: Part, graph: ContactGraphFile) -> None:
    """Nodes by type and edges by relation."""
    for node_type in ("layout", "rigid", "articulated"):
        part.set(f"nodes_{node_type}", sum(n.node_type == node_type for n in graph.nodes))
    for relation in (*DIRECTED, *BESIDE_THE_TREE):
        part.set(f"edges_{relation}", sum(link.relation == relation for link in graph.links))
    things = {n.id for n in graph.nodes if n.node_type in ("rigid", "articulated")}
    part.set("support_edges", sum(link.relation in DIRECTED and link.target in things for link in graph.links))
    part.set("hidden_planes", sum(plane.hidden for n in graph.nodes for plane in n.planes))


def count_cad(part: Part, cad_scene: CadScene) -> None:
    """Decisions and collisions of CAD replacement."""
    scene = cad_scene.info
    for decision in ("cad", "mesh", "layout"):
        part.set(f"replaced_{decision}", sum(r.decision == decision for r in scene.replacements))
    part.set("conflicts_before", scene.conflicts_before)
    part.set("conflicts_after", scene.conflicts_after)


def count_bodies(part: Part, interactive_scene: InteractiveScene) -> None:
    """Bodies and joints of the interactive scene."""
    bodies = interactive_scene.info.bodies
    part.set("bodies", len(bodies))
    part.set("bodies_movable", sum(body.movable for body in bodies))
    part.set("joints", sum(len(body.joints) for body in bodies))
