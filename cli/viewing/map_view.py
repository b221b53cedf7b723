"""Panoptic maps: the mesh as it looks, by instance, by class, by trust; boxes of the entities."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from cli.viewing.canvas import Canvas, Color, bytes_of
from cli.viewing.meshes import load_mesh
from schemas.errors import BadInput
from schemas.panoptic_map import EntitiesFile, PanopticMap
from schemas.vocabulary import load_vocabulary
from stages.kit.drawing.palette import UNLABELLED, instance_color
from stages.kit.formats.numpy_files import read_arrays
from stages.kit.geometry.boxes import box_from_bounds


def draw_panoptic_map(panoptic_map: PanopticMap, canvas: Canvas) -> None:
    """Draw the whole mesh twice (colour, instance) and a labelled box for every entity."""
    info = panoptic_map.info
    path = panoptic_map.path("mesh.ply")
    if not path.exists() or not info.entities:
        canvas.document("map", f"{len(info.entities)} entities from {info.frames_integrated} frames")
    if path.exists():
        mesh = load_mesh(path)
        instances = _vertex_instances(panoptic_map, len(mesh.vertices))
        canvas.mesh("color", mesh, front_only=True)
        canvas.mesh("instance", mesh, instance_colors(instances), front_only=True)
        vocabulary = load_vocabulary()
        class_of = {entity.instance: vocabulary.by_name(entity.class_name).id for entity in info.entities}
        trust = {entity.instance: trust_color(entity.confidence) for entity in info.entities}
        canvas.mesh(
            "class", mesh, painted(instances, {k: instance_color(c) for k, c in class_of.items()}), front_only=True
        )
        canvas.mesh("trust", mesh, painted(instances, trust), front_only=True)
        layers = ("color", "instance", "class", "trust")
        canvas.view("by instance", *(name for name in layers if name != "instance"))
        canvas.view("colour", *(name for name in layers if name != "color"), "boxes")
        canvas.view("by class", *(name for name in layers if name != "class"))
        canvas.view("by trust", *(name for name in layers if name != "trust"), "boxes")
        canvas.document("entities", entity_table(info))
        if len(mesh.vertices):
            canvas.enclose(*mesh.bounds)
    canvas.boxes(
        "boxes",
        [box_from_bounds(entity.box_minimum, entity.box_maximum) for entity in info.entities],
        [f"{entity.class_name} {entity.instance}" for entity in info.entities],
        [instance_color(entity.instance) for entity in info.entities],
        show_labels=len(info.entities) <= 60,
    )


def instance_colors(instances: np.ndarray) -> np.ndarray:
    """Return colours (V, 3) uint8 of instance labels (V,)."""
    values, inverse = np.unique(instances, return_inverse=True)
    return np.array([bytes_of(instance_color(int(value))) for value in values], dtype=np.uint8).reshape(-1, 3)[inverse]


def trust_color(confidence: float) -> Color:
    """Return red where the counts disagree (0), yellow between, green where they agree (1)."""
    share = min(max(confidence, 0.0), 1.0)
    return (0.8 if share < 0.5 else 0.8 * 2 * (1 - share), 0.7 if share > 0.5 else 0.7 * 2 * share, 0.15)


def painted(instances: np.ndarray, colors: Mapping[int, Color]) -> np.ndarray:
    """Return colours (V, 3) uint8 of instance labels (V,); grey for those without one."""
    values, inverse = np.unique(instances, return_inverse=True)
    table = [bytes_of(colors.get(int(value), UNLABELLED)) for value in values]
    return np.array(table, dtype=np.uint8).reshape(-1, 3)[inverse]


def entity_table(info: EntitiesFile) -> str:
    """Return the entities in Markdown, the least certain first."""
    rows = ["| thing | confidence | frames that voted for it | triangles |", "|---|--:|--:|--:|"]
    for entity in sorted(info.entities, key=lambda entry: (entry.confidence, entry.instance)):
        name = f"{entity.class_name}_{entity.instance}"
        rows.append(f"| {name} | {entity.confidence:.2f} | {entity.observations} | {entity.triangles} |")
    return "\n".join(rows)


def _vertex_instances(panoptic_map: PanopticMap, count: int) -> np.ndarray:
    path = panoptic_map.path("mesh_labels.npz")
    (labels,) = read_arrays(path, "instance", hint="make the map again")
    if labels.shape != (count,):
        raise BadInput(f"{path}: {labels.shape} labels for {count} vertices", hint="make the map again")
    return labels
