"""`scenewright truth edited`: what a person put right becomes ground truth, so that a lab measures on its own rooms."""

from __future__ import annotations

import numpy as np
from scenewright.schemas.base import as_transform
from scenewright.schemas.cad_scene import CadScene
from scenewright.schemas.contact_graph import ContactGraph, GraphNode
from scenewright.schemas.errors import BadInput
from scenewright.schemas.ground_truth import GroundTruth, GroundTruthFile, TrueObject
from scenewright.schemas.panoptic_map import PanopticMap
from scenewright.schemas.sequence import Sequence
from scenewright.stages.kit.formats.mesh_files import read_mesh
from scenewright.stages.kit.formats.numpy_files import read_arrays
from scenewright.stages.kit.formats.ply_files import write_ply
from scenewright.stages.kit.geometry.boxes import is_round
from scenewright.stages.kit.stage import Context
from scenewright.stages.truth.parameters import EditedParameters
from scenewright.stages.truth.stage import SPACING, colored
from scenewright.stages.truth.surface import surface_points

HINT = "give the graph that was built from this map, and the scene that was made of that"


def run(
    sequence: Sequence,
    panoptic_map: PanopticMap,
    contact_graph: ContactGraph,
    cad_scene: CadScene | None,
    *,
    parameters: EditedParameters,
    context: Context,
) -> GroundTruth:
    """Take the things of a map for true: their surface, classes and supports, and, of a scene, their models and poses.

    What nobody looked at is as true as the machine made it: that is for whoever edits to see to. Raises BadInput when
    the graph or the scene is of another map.
    """
    if panoptic_map.info.world_from_sequence is not None:
        raise BadInput(
            f"{panoptic_map.root}: an edit of gravity turned it out of the world of the sequence",
            hint="give `ingest` what is up, and make the map again",
        )
    mesh = read_mesh(panoptic_map.path("mesh.ply"), may_be_empty=True, hint=HINT)
    (instances,) = read_arrays(panoptic_map.path("mesh_labels.npz"), "instance", shapes=("V",), hint=HINT)
    graph = contact_graph.info if cad_scene is None else cad_scene.graph
    nodes = [node for node in graph.nodes if node.box is not None]
    class_of_instance = {entity.instance: entity.class_name for entity in panoptic_map.info.entities}
    for node in nodes:
        if class_of_instance.get(node.instance, node.class_name) != node.class_name:
            raise BadInput(
                f"{panoptic_map.root}: {node.id} is {class_of_instance[node.instance]}_{node.instance} there", hint=HINT
            )
    if not {node.instance for node in nodes} & class_of_instance.keys():
        raise BadInput(f"{panoptic_map.root}: holds none of the things of the graph", hint=HINT)
    vertices, faces = np.asarray(mesh.vertices, float), np.asarray(mesh.faces)
    owner = np.where(np.isin(instances, [node.instance for node in nodes]), instances, 0)
    with context.progress.step("sample the surface"):
        try:
            points, labels = surface_points(vertices, faces, owner, SPACING)
        except ValueError as error:
            raise BadInput(f"{panoptic_map.root}: {error}", hint=HINT) from None
    if not labels.any():
        raise BadInput(f"{panoptic_map.root}: nothing in it has a name and a surface", hint=HINT)
    extent = np.ptp(vertices[owner > 0], axis=0)
    objects = tuple(_true(node, points[labels == node.instance]) for node in nodes)
    info = sequence.info
    GroundTruthFile(
        source="scan",
        seed=context.seed,
        recipe=parameters.name or "put right by hand",
        room_size=(float(extent[0]), float(extent[1]), float(extent[2])),
        camera=info.camera,
        frame_count=info.frame_count,
        depth_noise=True,
        objects=objects,
    ).write(context.output / "ground_truth.json")
    sure = tuple(link.model_copy(update={"confidence": 1.0}) for link in graph.links)
    plain = tuple(node.model_copy(update={"mesh": None}) for node in graph.nodes)
    graph.model_copy(update={"graph": {"annotated": "by edits"}, "nodes": plain, "links": sure}).write(
        context.output / "graph.json"
    )
    np.savez(context.output / "visible.npz", points=points, instance=labels)
    write_ply(context.output / "mesh.ply", colored(vertices, faces, owner))
    summary = {
        "scene": parameters.name or "put right by hand",
        "nodes": len(objects),
        "unseen": sum(not entry.visible_pixels for entry in objects),
        "relations": len(graph.links),
        "models": sum(entry.model_id is not None for entry in objects),
        "points": len(points),
    }
    return GroundTruth(context.output, summary=summary)


def _true(node: GraphNode, points: np.ndarray) -> TrueObject:
    """Return a node as a true object; points (N, 3) of its surface in the world."""
    assert node.box is not None  # chosen so
    return TrueObject(
        instance=node.instance,
        name=node.id,
        class_name=node.class_name,
        model_id=node.model_id,
        scale=node.scale or 1.0,
        world_from_model=node.world_from_model or as_transform(np.eye(4)),
        joints=node.joints,
        box=node.box,
        round=len(points) >= 3 and is_round(points[:, :2]),
        visible_pixels=len(points),
    )
