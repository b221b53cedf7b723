"""Panoptic maps: the mesh as it looks, by instance, by class, by trust; boxes of the entities."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import trimesh
from scenewright.schemas.errors import BadInput
from scenewright.schemas.panoptic_map import EntitiesFile, PanopticMap
from scenewright.schemas.scene_parts import Box
from scenewright.schemas.vocabulary import load_vocabulary
from scenewright.stages.kit.drawing.palette import UNLABELLED, instance_color
from scenewright.stages.kit.formats.numpy_files import read_arrays
from scenewright.stages.kit.geometry.boxes import box_from_bounds
from scenewright.stages.kit.viewing.canvas import Canvas, Color, Parts, bytes_of, trust_color
from scenewright.stages.kit.viewing.meshes import load_mesh

LAYERS = ("color", "instance", "class", "trust")
"""Paths of the mesh of a map, in the four ways that it is drawn."""


@dataclass(frozen=True)
class ShownThing:
    """A thing of a map, as it is drawn."""

    instance: int
    class_name: str
    confidence: float
    box: Box

    @property
    def name(self) -> str:
        """What its node is called."""
        return f"{self.class_name}_{self.instance}"


def draw_panoptic_map(panoptic_map: PanopticMap, canvas: Canvas, *hidden: str) -> None:
    """Draw the whole mesh in four ways (colour, instance, class, trust) and a labelled box for every entity.

    What else is drawn under the `hidden` paths is not shown in its views.
    """
    info = panoptic_map.info
    path = panoptic_map.path("mesh.ply")
    if not path.exists() or not info.entities:
        canvas.document("map", f"{len(info.entities)} entities from {info.frames_integrated} frames")
    things = [
        ShownThing(
            entity.instance,
            entity.class_name,
            entity.confidence,
            box_from_bounds(entity.box_minimum, entity.box_maximum),
        )
        for entity in info.entities
    ]
    if path.exists():
        mesh = load_mesh(path)
        draw_map(mesh, _vertex_instances(panoptic_map, len(mesh.vertices)), things, canvas, *hidden)
        canvas.document("entities", entity_table(info))
    else:
        _draw_boxes(things, canvas)


def draw_map(
    mesh: trimesh.Trimesh, instances: np.ndarray, things: Sequence[ShownThing], canvas: Canvas, *hidden: str
) -> None:
    """Draw a mesh of labelled vertices, `instances` (V,), and the boxes of its things.

    What lies under the `hidden` paths is not shown in its views.
    """
    vocabulary = load_vocabulary()
    of_class = {thing.instance: instance_color(vocabulary.by_name(thing.class_name).id) for thing in things}
    trust = {thing.instance: trust_color(thing.confidence) for thing in things}
    instance_parts = Parts(instances, {thing.instance: thing.name for thing in things})
    layers = {
        "color": None,
        "instance": instance_colors(instances),
        "class": painted(instances, of_class),
        "trust": painted(instances, trust),
    }
    for name, colors in layers.items():
        canvas.mesh(name, mesh, colors, front_only=True, parts=instance_parts)
    for view, layer in (("by instance", "instance"), ("colour", "color"), ("by class", "class"), ("by trust", "trust")):
        without = ("boxes",) if layer in ("color", "trust") else ()
        canvas.view(view, *(name for name in layers if name != layer), *without, *hidden)
    if len(mesh.vertices):
        canvas.enclose(*mesh.bounds)
    _draw_boxes(things, canvas)


def _draw_boxes(things: Sequence[ShownThing], canvas: Canvas) -> None:
    canvas.boxes(
        "boxes",
        [thing.box for thing in things],
        [thing.name for thing in things],
        [instance_color(thing.instance) for thing in things],
        show_labels=len(things) <= 60,
    )


def instance_colors(instances: np.ndarray) -> np.ndarray:
    """Return colours (V, 3) uint8 of instance labels (V,)."""
    values, inverse = np.unique(instances, return_inverse=True)
    return np.array([bytes_of(instance_color(int(value))) for value in values], dtype=np.uint8).reshape(-1, 3)[inverse]


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
