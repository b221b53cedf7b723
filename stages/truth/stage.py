"""`scenewright truth scenenn`: an annotated scan becomes ground truth that `evaluate` measures against.

The thesis's protocol (Han 2024, section 2.5.2): ten classes, everything else is void. The scan's mesh was made from the
frames themselves, so all of its surface counts as seen. Truth is written in the world frame of the sequence that it is
for, as a box that stands upright in the log's own world would lean in the one that ingest made upright.
"""

from __future__ import annotations

import tomllib
from pathlib import Path

import numpy as np
from scenewright.schemas.base import as_transform
from scenewright.schemas.contact_graph import SCENE_NODE, ContactGraphFile, GraphNode
from scenewright.schemas.errors import BadInput
from scenewright.schemas.ground_truth import GroundTruth, GroundTruthFile, TrueObject
from scenewright.schemas.places import data_file
from scenewright.schemas.sequence import Sequence
from scenewright.schemas.vocabulary import load_vocabulary
from scenewright.stages.kit.drawing.palette import instance_color
from scenewright.stages.kit.formats.ply_files import ColoredMesh, write_ply
from scenewright.stages.kit.formats.scenenn_annotation import (
    AnnotatedLabel,
    class_by_last_word,
    class_by_substring,
    read_annotation,
)
from scenewright.stages.kit.geometry.boxes import is_round, minimum_box
from scenewright.stages.kit.geometry.transforms import apply
from scenewright.stages.kit.stage import Context
from scenewright.stages.truth.labelled_mesh import LabelledMesh, read_labelled_mesh
from scenewright.stages.truth.parameters import WORDS, SceneNNParameters
from scenewright.stages.truth.surface import surface_points

SPACING = 0.01
"""Grid of the points that are measured on [m], that of every ground truth."""


def run(
    annotation: Path, mesh: Path, sequence: Sequence, *, parameters: SceneNNParameters, context: Context
) -> GroundTruth:
    """Read both halves of the annotation, move them into the sequence's world, and write what evaluate reads.

    Raises BadInput when a file is broken, when the two do not belong together, or when no label is of a known class.
    """
    labels = read_annotation(annotation)
    scan = read_labelled_mesh(mesh)
    unlisted = check_together(annotation, mesh, labels, scan, parameters.maximum_unlisted)
    classes = classes_of(labels, parameters.matching, read_words())
    world_from_log = np.array(sequence.info.gravity.world_from_log)
    vertices = apply(world_from_log, scan.vertices)
    instances = np.where(np.isin(scan.labels, sorted(classes)), scan.labels, 0)
    if not instances.any():
        raise BadInput(
            f"{annotation}: no label with a surface is of a class of data/{WORDS}", hint="is this SceneNN's annotation?"
        )
    with context.progress.step("sample the surface"):
        try:
            points, point_instances = surface_points(vertices, scan.faces, instances, SPACING)
        except ValueError as error:
            raise BadInput(f"{mesh}: {error}", hint="is it in metres?") from None
    with context.progress.step("boxes"):
        objects = true_objects(classes, vertices, instances, point_instances)
    name = parameters.name or annotation.stem
    info = sequence.info
    extent = np.ptp(vertices, axis=0)
    GroundTruthFile(
        source="scan",
        seed=context.seed,
        recipe=f"SceneNN {name}",
        room_size=(float(extent[0]), float(extent[1]), float(extent[2])),
        camera=info.camera,
        frame_count=info.frame_count,
        depth_noise=True,
        objects=objects,
    ).write(context.output / "ground_truth.json")
    unconnected_graph(objects).write(context.output / "graph.json")
    np.savez(context.output / "visible.npz", points=points, instance=point_instances)
    write_ply(context.output / "mesh.ply", colored(vertices, scan.faces, instances))
    if unlisted:
        context.logger.warning("%d vertices carry a label that %s does not list; void", unlisted, annotation.name)
    counts: dict[str, int] = {}
    for entry in objects:
        counts[entry.class_name] = counts.get(entry.class_name, 0) + 1
    return GroundTruth(
        context.output,
        summary={
            "scene": name,
            "labels": len(labels),
            "labels_without_surface": len(labels.keys() - set(np.unique(scan.labels).tolist())),
            "unlisted_vertices": unlisted,
            "points": len(points),
            "labelled_share": round(float((point_instances > 0).mean()), 3),
            **{f"true_{name}": count for name, count in sorted(counts.items())},
        },
    )


def read_words() -> dict[str, str]:
    """Return word -> class name, in the order of data/annotations/scenenn.toml."""
    rows = tomllib.loads(data_file(WORDS).read_text())["word"]
    return {row["word"]: load_vocabulary().by_name(row["class"]).name for row in rows}


MATCHING = {"thesis": class_by_substring, "words": class_by_last_word}


def classes_of(labels: dict[int, AnnotatedLabel], matching: str, words: dict[str, str]) -> dict[int, str]:
    """Return the class of every label that is of one. `matching` as in the parameters."""
    decide = MATCHING[matching]
    decided = {identity: decide(label, words) for identity, label in labels.items() if identity > 0}
    return {identity: name for identity, name in decided.items() if name is not None}


def check_together(
    annotation: Path, mesh: Path, labels: dict[int, AnnotatedLabel], scan: LabelledMesh, maximum_unlisted: float
) -> int:
    """Return how many vertices carry a label (not 0) that the annotation does not list.

    Raises BadInput when they are more than the share `maximum_unlisted` of all, or when no label of the annotation is
    in the mesh: the two are then of different scenes, or of different versions of the annotation.
    """
    present = set(np.unique(scan.labels).tolist()) - {0}
    hint = "take both from the same folder of the same version of SceneNN"
    if not present & labels.keys():
        raise BadInput(f"{mesh}: none of the {len(labels)} labels of {annotation.name} is in it", hint=hint)
    missing = sorted(present - labels.keys())
    count = int(np.isin(scan.labels, missing).sum())
    if count > maximum_unlisted * len(scan.labels):
        share = 100 * count / len(scan.labels)
        raise BadInput(
            f"{mesh}: {share:.0f} % of its vertices carry labels that {annotation.name} does not list, "
            f"the first is {missing[0]}",
            hint=f"{hint}, or allow more: --maximum-unlisted",
        )
    return count


def true_objects(
    classes: dict[int, str], vertices: np.ndarray, instances: np.ndarray, point_instances: np.ndarray
) -> tuple[TrueObject, ...]:
    """Return the objects that have a surface, by instance: each with the upright minimum box of its vertices.

    vertices (V, 3) in the world, instances (V,), point_instances (N,) of the points of visible.npz.
    """
    order = np.argsort(instances, kind="stable")
    numbers, starts = np.unique(instances[order], return_index=True)
    vertices_of = dict(zip(numbers.tolist(), np.split(order, starts[1:]), strict=True))
    counts = dict(zip(*(array.tolist() for array in np.unique(point_instances, return_counts=True)), strict=True))
    return tuple(
        TrueObject(
            instance=instance,
            name=f"{name}_{instance}",
            class_name=name,
            world_from_model=as_transform(np.eye(4)),
            box=minimum_box(vertices[vertices_of[instance]]),
            round=is_round(vertices[vertices_of[instance], :2]),
            visible_pixels=counts.get(instance, 0),
        )
        for instance, name in sorted(classes.items())
        if instance in vertices_of
    )


def unconnected_graph(objects: tuple[TrueObject, ...]) -> ContactGraphFile:
    """Return a graph of the objects without edges: nobody annotated what carries what."""
    vocabulary = load_vocabulary()
    nodes = [GraphNode(id=SCENE_NODE, instance=0, class_name=SCENE_NODE, node_type="scene")]
    nodes += [
        GraphNode(
            id=entry.name,
            instance=entry.instance,
            class_name=entry.class_name,
            node_type=vocabulary.by_name(entry.class_name).node,
            box=entry.box,
        )
        for entry in objects
    ]
    return ContactGraphFile(graph={"annotated": "no"}, nodes=tuple(nodes), links=())


def colored(vertices: np.ndarray, faces: np.ndarray, instances: np.ndarray) -> ColoredMesh:
    """Return the mesh with a colour for each instance, grey where void."""
    numbers, inverse = np.unique(instances, return_inverse=True)
    palette = np.array([instance_color(int(number)) for number in numbers])
    colors = np.rint(255 * palette[inverse]).astype(np.uint8)
    return ColoredMesh(vertices.astype(np.float32), faces.astype(np.int32), colors)
