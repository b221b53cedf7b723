"""The contact graph after the actions: new parents, boxes and joint values."""

from __future__ import annotations

import numpy as np
from scenewright.schemas.base import as_transform, as_vector
from scenewright.schemas.contact_graph import ContactGraphFile, GraphNode
from scenewright.schemas.scene_parts import TREE_RELATIONS, Box, Relation, SurfacePlane
from scenewright.stages.kit.geometry.transforms import inverse, quaternion_of, transform_from_quaternion


def update_graph(
    graph: ContactGraphFile,
    moved: dict[str, tuple[np.ndarray, np.ndarray]],
    parents: dict[str, tuple[str, str]],
    joints: dict[str, dict[str, float]],
) -> ContactGraphFile:
    """Return the graph after actions.

    `moved`: node -> (world_from_body before, after), `parents`: node -> (new parent, relation), `joints`: node ->
    values by model joint name (without the node's prefix). Of moved nodes, relations beside the tree are dropped.
    """
    nodes = []
    for node in graph.nodes:
        if node.id in moved:
            before, after = moved[node.id]
            node = _moved_node(node, after @ inverse(before))
        if node.id in joints:
            node = node.model_copy(update={"joints": {**node.joints, **joints[node.id]}})
        nodes.append(node)
    links = []
    for link in graph.links:
        if link.relation not in TREE_RELATIONS:
            if link.source not in moved and link.target not in moved:
                links.append(link)
            continue
        if link.target in parents:
            parent, relation = parents[link.target]
            # What was seen of the old place is no evidence of the new one.
            unseen = dict.fromkeys(("plane", "gap", "overlap", "contact", "inside"))
            changes = {"source": parent, "relation": relation, "because": "", **unseen}
            links.append(Relation(**{**link.model_dump(), **changes, "confidence": 1.0}))
        else:
            links.append(link)
    return graph.model_copy(update={"nodes": tuple(nodes), "links": tuple(links)})


def _moved_node(node: GraphNode, change: np.ndarray) -> GraphNode:
    changes: dict[str, object] = {
        "box": None if node.box is None else _moved_box(node.box, change),
        "planes": tuple(_moved_plane(plane, change) for plane in node.planes),
    }
    if node.world_from_model is not None:
        changes["world_from_model"] = as_transform(change @ np.array(node.world_from_model))
    return node.model_copy(update=changes)


def _moved_box(box: Box, change: np.ndarray) -> Box:
    pose = change @ transform_from_quaternion(np.array(box.orientation), np.array(box.center))
    yaw = np.arctan2(pose[1, 0], pose[0, 0])
    upright = transform_from_quaternion(np.array([0, 0, np.sin(yaw / 2), np.cos(yaw / 2)]), pose[:3, 3])
    orientation = tuple(float(value) for value in quaternion_of(upright))
    return box.model_copy(update={"center": as_vector(pose[:3, 3]), "orientation": orientation})


def _moved_plane(plane: SurfacePlane, change: np.ndarray) -> SurfacePlane:
    normal = change[:3, :3] @ np.array(plane.normal)
    center = change[:3, :3] @ np.array(plane.center) + change[:3, 3]
    corners = tuple(as_vector(change[:3, :3] @ np.array(corner) + change[:3, 3]) for corner in plane.corners)
    return plane.model_copy(
        update={
            "normal": as_vector(normal),
            "offset": float(-normal @ center),
            "center": as_vector(center),
            "corners": corners,
        }
    )
