"""Panoptic maps: the mesh as it looks, the mesh by instance, boxes of the entities."""

from __future__ import annotations

import numpy as np

from cli.viewing.canvas import Canvas, bytes_of
from cli.viewing.meshes import load_mesh
from schemas.errors import BadInput
from schemas.panoptic_map import PanopticMap
from stages.kit.drawing.palette import instance_color
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
        canvas.view("by instance", "color")
        canvas.view("colour", "instance", "boxes")
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


def _vertex_instances(panoptic_map: PanopticMap, count: int) -> np.ndarray:
    path = panoptic_map.path("mesh_labels.npz")
    (labels,) = read_arrays(path, "instance", hint="make the map again")
    if labels.shape != (count,):
        raise BadInput(f"{path}: {labels.shape} labels for {count} vertices", hint="make the map again")
    return labels
