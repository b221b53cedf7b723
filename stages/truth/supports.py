"""`scenewright truth supports`: a support annotation becomes ground truth with a filled contact graph.

Somebody looked at a real recording and wrote down what stands on what. `evaluate` then measures a contact graph of that
recording as it does one of a generated room: edit distance with wrong supports, missing and wrong detections apart,
and precision and recall of the edges by relation.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from scenewright.schemas.base import as_transform
from scenewright.schemas.contact_graph import SCENE_NODE, ContactGraphFile, GraphNode
from scenewright.schemas.errors import BadInput
from scenewright.schemas.ground_truth import GroundTruth, GroundTruthFile, TrueObject
from scenewright.schemas.panoptic_map import PanopticMap
from scenewright.schemas.scene_parts import Box, Relation
from scenewright.schemas.sequence import Sequence
from scenewright.schemas.vocabulary import load_vocabulary
from scenewright.stages.kit.drawing.palette import instance_color
from scenewright.stages.kit.formats.ply_files import ColoredMesh, write_ply
from scenewright.stages.kit.geometry.boxes import is_round, minimum_box, upright_box
from scenewright.stages.kit.stage import Context
from scenewright.stages.truth.annotated_points import SPACING, instances_of, seen_points
from scenewright.stages.truth.outlines import read_outlines
from scenewright.stages.truth.painted_points import painted_owners
from scenewright.stages.truth.parameters import SupportsParameters
from scenewright.stages.truth.support_annotation import SupportAnnotation, read_support_annotation

NOT_SEEN = Box(center=(0.0, 0.0, 0.0), size=(SPACING, SPACING, SPACING))
"""Stands in for the box of a node of which no point was seen; such nodes are optional."""


def run(
    annotation: Path,
    sequence: Sequence,
    panoptic_map: PanopticMap | None = None,
    outlines: Path | None = None,
    *,
    parameters: SupportsParameters,
    context: Context,
) -> GroundTruth:
    """Read the annotation, find its nodes in the frames (or the map), and write what evaluate reads. With `outlines`
    a node is what was painted as it, wherever the annotation finds it.

    Raises BadInput when the annotation or the outlines are broken, when they take label images, a map or frames that
    are not there, or when nothing of the nodes was seen.
    """
    annotation_file = read_support_annotation(annotation)
    names = {node.name: k for k, node in enumerate(annotation_file.nodes, 1)}
    painted = None if outlines is None else read_outlines(outlines, names)
    by_labels = painted is None and any(node.find.labels for node in annotation_file.nodes)
    with context.progress.step("surface of the frames"):
        points, labels = seen_points(
            sequence, every=parameters.every, maximum_depth=parameters.maximum_depth, with_labels=by_labels
        )
    with context.progress.step("find the nodes"):
        try:
            if painted is None:
                points, owner = instances_of(annotation_file, points, labels, panoptic_map, parameters.point_reach)
            else:
                owner, absent = painted_owners(sequence, painted, names, points, parameters.outline_reach)
        except BadInput as error:
            raise BadInput(f"{outlines or annotation}: {error.message}", hint=error.hint) from None
    if painted is not None and absent:
        context.logger.warning(
            "%s: %d of %d painted frames are not in %s; the first is at %g s",
            outlines,
            len(absent),
            len(painted.frames),
            sequence.root,
            absent[0],
        )
    if not owner.any():
        raise BadInput(f"{annotation}: nothing of its nodes is seen in {sequence.root}", hint="is it this recording?")
    objects = annotated_objects(annotation_file, points, owner)
    optional = sum(node.optional for node in annotation_file.nodes)
    info = sequence.info
    low, high = points[owner > 0].min(axis=0), points[owner > 0].max(axis=0)
    GroundTruthFile(
        source="scan",
        seed=context.seed,
        recipe=annotation_file.scene,
        camera=info.camera,
        frame_count=info.frame_count,
        room_size=(float(high[0] - low[0]), float(high[1] - low[1]), float(high[2] - low[2])),
        depth_noise=True,
        objects=objects,
    ).write(context.output / "ground_truth.json")
    graph = annotated_graph(annotation_file, objects)
    graph.write(context.output / "graph.json")
    np.savez(context.output / "visible.npz", points=points.astype(np.float32), instance=owner.astype(np.int32))
    write_ply(context.output / "mesh.ply", flakes(points, owner))
    counts = np.bincount(owner, minlength=len(annotation_file.nodes) + 1)
    unseen = [node.name for k, node in enumerate(annotation_file.nodes, 1) if not counts[k] and not node.optional]
    for name in unseen:
        context.logger.warning("no point of %s is seen; it counts neither way", name)
    return GroundTruth(
        context.output,
        summary={
            "scene": annotation_file.scene,
            "nodes": len(annotation_file.nodes),
            "unseen": len(unseen),
            "optional": optional,
            "relations": len(graph.links),
            "second_carriers": sum(link.relation == "also_supports" for link in graph.links),
            "leaning": sum(link.relation == "leans_on" for link in graph.links),
            "points": len(points),
        },
    )


def annotated_objects(annotation: SupportAnnotation, points: np.ndarray, owner: np.ndarray) -> tuple[TrueObject, ...]:
    """Return the nodes as true objects, numbered 1, 2, ...: each with its annotated box, or that of its points.

    points (N, 3) [m] in the sequence's world, owner (N,) node of each or 0.
    """
    result = []
    for k, node in enumerate(annotation.nodes, 1):
        node_points = points[owner == k]
        where = node.find.box
        box = upright_box(where) if where is not None else (minimum_box(node_points) if len(node_points) else NOT_SEEN)
        result.append(
            TrueObject(
                instance=k,
                name=node.name,
                class_name=node.class_name,
                world_from_model=as_transform(np.eye(4)),
                box=box,
                round=len(node_points) >= 3 and is_round(node_points[:, :2]),
                visible_pixels=0 if node.optional else len(node_points),
            )
        )
    return tuple(result)


def annotated_graph(annotation: SupportAnnotation, objects: tuple[TrueObject, ...]) -> ContactGraphFile:
    """Return the contact graph of the annotation. Layout that no relation carries hangs on the scene."""
    vocabulary = load_vocabulary()
    nodes = [GraphNode(id=SCENE_NODE, instance=0, class_name=SCENE_NODE, node_type="scene")]
    links: list[Relation] = []
    for entry in objects:
        kind = vocabulary.by_name(entry.class_name).node
        nodes.append(
            GraphNode(
                id=entry.name, instance=entry.instance, class_name=entry.class_name, node_type=kind, box=entry.box
            )
        )
        relation = annotation.relation_of(entry.name)
        if relation is None:
            links.append(Relation(source=SCENE_NODE, target=entry.name, relation="supports", confidence=1.0))
            continue
        links.append(Relation(source=relation.parent, target=entry.name, relation=relation.relation, confidence=1.0))
        links += [
            Relation(source=n, target=entry.name, relation="also_supports", confidence=1.0) for n in relation.also
        ]
        links += [Relation(source=n, target=entry.name, relation="leans_on", confidence=1.0) for n in relation.leans_on]
    return ContactGraphFile(graph={"annotated": "by hand"}, nodes=tuple(nodes), links=tuple(links))


def flakes(points: np.ndarray, owner: np.ndarray) -> ColoredMesh:
    """Return a mesh with one small level triangle at each point (N, 3), in the colour of its node, grey where none."""
    angles = np.radians([90.0, 210.0, 330.0])
    corners = 0.5 * SPACING * np.column_stack([np.cos(angles), np.sin(angles), np.zeros(3)])
    vertices = (points[:, None, :] + corners).reshape(-1, 3)
    numbers, inverse = np.unique(owner, return_inverse=True)
    palette = np.array([instance_color(int(number)) for number in numbers])
    colors = np.repeat(np.rint(255 * palette[inverse]).astype(np.uint8), 3, axis=0)
    return ColoredMesh(vertices.astype(np.float32), np.arange(len(vertices), dtype=np.int32).reshape(-1, 3), colors)
