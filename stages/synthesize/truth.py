"""What is true of a furnished room: boxes, planes, contact graph, bodies of the interactive scene."""

from __future__ import annotations

from typing import Any, Literal

import numpy as np
import trimesh
from scenewright.schemas.base import as_transform
from scenewright.schemas.contact_graph import SCENE_NODE, ContactGraphFile, GraphNode
from scenewright.schemas.ground_truth import TrueObject
from scenewright.schemas.scene_parts import Box, Relation, SurfacePlane
from scenewright.schemas.vocabulary import load_vocabulary
from scenewright.stages.kit.formats.scene_bundle import BundleBody
from scenewright.stages.kit.geometry.boxes import (
    box_at_yaw,
    box_from_bounds,
    boxes_overlap_volume,
    clip_polygon,
    convex_hull,
    footprint,
    is_round,
    minimum_box,
    polygon_area,
)
from scenewright.stages.synthesize.arrangement import Arrangement, world_meshes
from scenewright.stages.synthesize.furniture import plane_in_world
from scenewright.stages.synthesize.placement import Further, Hanging, PlacedObject
from scenewright.stages.synthesize.shell import Layout

LEAST_SHARED_VOLUME = 1e-6
"""Boxes that share less than a cubic centimetre only touch [m^3]."""
AXES_TOLERANCE = 0.1
"""A box along the model's axes may have this much more footprint than the least rectangle."""
UPRIGHT = 0.9999
"""Cosine from which on a model stands upright."""


def layout_name(instance: int, layout: Layout) -> str:
    """Return the node id of a slab, `<class>_<instance>`."""
    return f"{layout.class_name}_{instance}"


def object_boxes(arrangement: Arrangement) -> dict[str, Box]:
    """Return the gravity-aligned box of everything as it stands, by name; layout: the slab."""
    boxes = {
        layout_name(instance, layout): box_from_bounds(layout.minimum, layout.maximum)
        for instance, layout in enumerate(arrangement.room.layouts, start=1)
    }
    for thing in arrangement.objects:
        boxes[thing.name] = object_box(np.asarray(thing.world_mesh().vertices), thing.world_from_model)
    return boxes


def object_box(vertices: np.ndarray, world_from_model: np.ndarray) -> Box:
    """Return the gravity-aligned box of vertices (V, 3) [m] along the axes of the model.

    The least rectangle around a monitor on a round foot stands at an angle to the screen, for a gain of two per cent.
    Where a turned rectangle is smaller by more than AXES_TOLERANCE the model does not lie along its axes, and that
    rectangle it is; so with a model that leans.
    """
    least = minimum_box(vertices)
    if world_from_model[2, 2] < UPRIGHT * np.linalg.norm(world_from_model[:3, 2]):
        return least
    model_aligned = box_at_yaw(vertices, float(np.arctan2(world_from_model[1, 0], world_from_model[0, 0])))
    return (
        model_aligned
        if model_aligned.size[0] * model_aligned.size[1] <= (1.0 + AXES_TOLERANCE) * least.size[0] * least.size[1]
        else least
    )


def true_objects(
    arrangement: Arrangement, boxes: dict[str, Box], visible_pixels: np.ndarray, before: Arrangement
) -> list[TrueObject]:
    """Return the records of layout and objects by instance. `visible_pixels` (I,) counts pixels by instance; `before`:
    the room as it was at the beginning, the same where nothing was moved."""
    joints_before = {
        thing.name: _all_joints(old)
        for thing, old in zip(arrangement.objects, before.objects, strict=True)
        if _all_joints(old) != _all_joints(thing)
    }

    def pixels(instance: int) -> int:
        return int(visible_pixels[instance]) if instance < len(visible_pixels) else 0

    records = [
        TrueObject(
            instance=instance,
            name=layout_name(instance, layout),
            class_name=layout.class_name,
            world_from_model=as_transform(np.eye(4)),
            box=boxes[layout_name(instance, layout)],
            visible_pixels=pixels(instance),
        )
        for instance, layout in enumerate(arrangement.room.layouts, start=1)
    ]
    records += [
        TrueObject(
            instance=thing.instance,
            name=thing.name,
            class_name=thing.class_name,
            model_id=thing.furnishing.model.id,
            scale=thing.furnishing.scale,
            world_from_model=as_transform(thing.world_from_model),
            joints=_all_joints(thing),
            joints_before=joints_before.get(thing.name),
            box=boxes[thing.name],
            round=is_round(np.asarray(thing.world_mesh().vertices)[:, :2]),
            visible_pixels=pixels(thing.instance),
        )
        for thing in arrangement.objects
    ]
    return records


def true_graph(arrangement: Arrangement, boxes: dict[str, Box]) -> ContactGraphFile:
    """Return the true contact graph: the scene carries floor, walls and ceiling, the rest hangs as it was placed."""
    vocabulary = load_vocabulary()
    nodes = [GraphNode(id=SCENE_NODE, instance=0, class_name=SCENE_NODE, node_type="scene")]
    links: list[Relation] = []
    planes: dict[str, tuple[SurfacePlane, ...]] = {}
    for instance, layout in enumerate(arrangement.room.layouts, start=1):
        name = layout_name(instance, layout)
        planes[name] = (layout.plane,)
        nodes.append(
            GraphNode(
                id=name,
                instance=instance,
                class_name=layout.class_name,
                node_type="layout",
                box=boxes[name],
                planes=planes[name],
            )
        )
        links.append(Relation(source=SCENE_NODE, target=name, relation="supports", confidence=1.0))
    for thing in arrangement.objects:
        planes[thing.name] = tuple(plane_in_world(p, thing.world_from_model) for p in thing.furnishing.surfaces)
        kind = vocabulary.by_name(thing.class_name).node
        nodes.append(
            GraphNode(
                id=thing.name,
                instance=thing.instance,
                class_name=thing.class_name,
                node_type="rigid" if kind == "layout" else kind,
                box=boxes[thing.name],
                planes=planes[thing.name],
                model_id=thing.furnishing.model.id,
                world_from_model=as_transform(thing.world_from_model),
                scale=thing.furnishing.scale,
                joints=_all_joints(thing),
            )
        )
    for thing in arrangement.objects:
        links.append(_parent_link(thing, boxes, planes))
        links += [_further_link(thing, entry, boxes, planes) for entry in thing.further]
    links += _proximal(arrangement, boxes, links)
    return ContactGraphFile(nodes=tuple(nodes), links=tuple(links))


def _all_joints(thing: PlacedObject) -> dict[str, float]:
    return {joint.name: float(thing.furnishing.joints.get(joint.name, 0.0)) for joint in thing.furnishing.model.joints}


def _parent_link(thing: PlacedObject, boxes: dict[str, Box], planes: dict[str, tuple[SurfacePlane, ...]]) -> Relation:
    relation = thing.relation
    box, parent_box = boxes[thing.name], boxes[thing.parent]
    top, parent_top = (b.center[2] + b.size[2] / 2 for b in (box, parent_box))
    if relation == "contains" and top > parent_top + 0.01:
        relation = "supports"  # it sticks out, as a bottle in a low crate does
    if relation in ("carries_on_wall", "hangs_from"):
        return Relation(source=thing.parent, target=thing.name, relation=relation, confidence=1.0, plane=0, gap=0.0)
    return _on_plane(thing.parent, thing, relation, 0 if thing.plane is None else thing.plane, boxes, planes)


def _further_link(
    thing: PlacedObject, entry: Further, boxes: dict[str, Box], planes: dict[str, tuple[SurfacePlane, ...]]
) -> Relation:
    if entry.relation == "also_supports" and entry.plane is not None:
        return _on_plane(entry.source, thing, entry.relation, entry.plane, boxes, planes)
    return Relation(
        source=entry.source, target=thing.name, relation=entry.relation, confidence=1.0, plane=entry.plane, gap=0.0
    )


def _on_plane(
    source: str,
    thing: PlacedObject,
    relation: Hanging | Literal["also_supports"],
    index: int,
    boxes: dict[str, Box],
    planes: dict[str, tuple[SurfacePlane, ...]],
) -> Relation:
    """The relation to a plane that carries the object or a part of it, with gap and overlap."""
    box, plane = boxes[thing.name], planes[source][index]
    height = -plane.offset / plane.normal[2]
    gap = box.center[2] - box.size[2] / 2 - height
    outline = convex_hull(np.asarray(plane.corners)[:, :2])
    foot = footprint(box)
    overlap = polygon_area(clip_polygon(foot, outline)) / max(polygon_area(foot), 1e-12)
    return Relation(
        source=source,
        target=thing.name,
        relation=relation,
        confidence=1.0,
        plane=index,
        gap=float(gap),
        overlap=float(min(1.0, overlap)),
    )


def _proximal(arrangement: Arrangement, boxes: dict[str, Box], links: list[Relation]) -> list[Relation]:
    """Pairs whose boxes share volume and of which neither carries the other; not between two layout slabs."""
    linked = {(link.source, link.target) for link in links}
    layout = {layout_name(k, entry) for k, entry in enumerate(arrangement.room.layouts, start=1)}
    names = list(boxes)
    relations = []
    for k, a in enumerate(names):
        for b in names[k + 1 :]:
            if (a in layout and b in layout) or (a, b) in linked or (b, a) in linked:
                continue
            if boxes_overlap_volume(boxes[a], boxes[b]) > LEAST_SHARED_VOLUME:
                relations.append(Relation(source=a, target=b, relation="proximal", confidence=1.0))
    return relations


def scene_bodies(arrangement: Arrangement, boxes: dict[str, Box], graph: ContactGraphFile) -> list[BundleBody]:
    """Return layout and objects as bodies of an interactive scene."""
    bodies = [
        BundleBody(
            name=layout_name(instance, layout),
            class_name=layout.class_name,
            parent=None,
            relation="supports",
            world_from_body=np.eye(4),
            movable=False,
            box=boxes[layout_name(instance, layout)],
            mesh=layout.mesh,
        )
        for instance, layout in enumerate(arrangement.room.layouts, start=1)
    ]
    for thing in arrangement.objects:
        link = graph.parent_link(thing.name)
        bodies.append(
            BundleBody(
                name=thing.name,
                class_name=thing.class_name,
                parent=thing.parent,
                relation=link.relation if link else thing.relation,
                world_from_body=thing.world_from_model,
                movable=thing.furnishing.model.movable,
                box=boxes[thing.name],
                model=thing.furnishing.model,
                model_folder=thing.furnishing.folder,
                scale=thing.furnishing.scale,
                joint_values=_all_joints(thing),
            )
        )
    return bodies


def true_mesh(arrangement: Arrangement) -> trimesh.Trimesh:
    """Return the whole surface in the world frame with vertex colours and the vertex attribute `instance`."""
    meshes, labels = [], []
    for instance, mesh in world_meshes(arrangement):
        visual: Any = mesh.visual
        colors = np.asarray(visual.to_color().vertex_colors if visual.kind == "texture" else visual.vertex_colors)
        meshes.append(trimesh.Trimesh(mesh.vertices, mesh.faces, vertex_colors=colors, process=False))
        labels.append(np.full(len(mesh.vertices), instance, dtype=np.int32))
    room_mesh: Any = trimesh.util.concatenate(meshes)
    room_mesh.vertex_attributes["instance"] = np.concatenate(labels)
    return room_mesh
