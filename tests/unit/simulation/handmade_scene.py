"""A small interactive scene made of boxes by hand: floor, table, a fridge with a door and shelves, a bottle, a cup."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from scenewright.schemas.base import as_transform, as_vector
from scenewright.schemas.contact_graph import SCENE_NODE, ContactGraphFile, GraphNode
from scenewright.schemas.interactive_scene import InteractiveSceneFile, SceneBody
from scenewright.schemas.scene_parts import Box, Joint, Relation, SurfacePlane
from scenewright.stages.kit.geometry.transforms import quaternion_of, transform_from_yaw

Boxes = list[tuple[tuple[float, float, float], tuple[float, float, float]]]
"""(centre, size) of boxes in a link frame."""


@dataclass
class HandmadeBody:
    """A body of boxes, with one optional door."""

    name: str
    class_name: str
    world_from_body: np.ndarray
    boxes: Boxes
    parent: str
    relation: str = "supports"
    movable: bool = False
    furniture: bool = False
    mass: float = 10.0
    door: Boxes = field(default_factory=list)
    door_origin: tuple[float, float, float] = (0.0, 0.0, 0.0)
    door_axis: tuple[float, float, float] = (0.0, 0.0, 1.0)
    door_value: float = 0.0
    door_upper: float = 2.2
    door_type: str = "revolute"
    handle: tuple[float, float, float] | None = None
    grasp_width: float | None = None
    supports: list[tuple[float, float, float, float, float]] = field(default_factory=list)
    """Horizontal planes in the body frame: x, y, z of the centre, size x, size y."""


def _link(name: str, boxes: Boxes, mass: float) -> str:
    shapes = "".join(
        f'<{tag}><origin xyz="{c[0]} {c[1]} {c[2]}"/><geometry><box size="{s[0]} {s[1]} {s[2]}"/></geometry></{tag}>'
        for c, s in boxes
        for tag in ("collision", "visual")
    )
    centers = np.array([c for c, _ in boxes])
    low = (centers - np.array([s for _, s in boxes]) / 2).min(axis=0)
    high = (centers + np.array([s for _, s in boxes]) / 2).max(axis=0)
    x, y, z = high - low
    cx, cy, cz = (low + high) / 2
    inertia = [mass / 12 * (y * y + z * z), mass / 12 * (x * x + z * z), mass / 12 * (x * x + y * y)]
    return (
        f'<link name="{name}"><inertial><origin xyz="{cx} {cy} {cz}"/><mass value="{mass}"/>'
        f'<inertia ixx="{inertia[0]}" ixy="0" ixz="0" iyy="{inertia[1]}" iyz="0" izz="{inertia[2]}"/></inertial>'
        f"{shapes}</link>"
    )


def _links(body: HandmadeBody) -> str:
    text = _link(body.name, body.boxes, body.mass)
    if body.door:
        shifted = [(tuple(np.array(c) - body.door_origin), s) for c, s in body.door]
        text += _link(f"{body.name}__door", shifted, 4.0)
        origin, axis = (" ".join(map(str, v)) for v in (body.door_origin, body.door_axis))
        text += (
            f'<joint name="{body.name}__hinge" type="{body.door_type}"><parent link="{body.name}"/>'
            f'<child link="{body.name}__door"/><origin xyz="{origin}"/><axis xyz="{axis}"/>'
            f'<limit lower="0" upper="{body.door_upper}" effort="100" velocity="5"/></joint>'
        )
    return text


def _box(body: HandmadeBody) -> Box:
    centers, sizes = (np.array(values) for values in zip(*body.boxes, strict=True))
    low, high = (centers - sizes / 2).min(axis=0), (centers + sizes / 2).max(axis=0)
    center = body.world_from_body[:3, :3] @ ((low + high) / 2) + body.world_from_body[:3, 3]
    return Box(
        center=as_vector(center),
        orientation=tuple(quaternion_of(body.world_from_body).tolist()),
        size=as_vector(high - low),
    )


def _record(body: HandmadeBody) -> SceneBody:
    joints: tuple[Joint, ...] = ()
    if body.door:
        joints = (
            Joint(
                name=f"{body.name}__hinge",
                type=body.door_type,
                part=f"{body.name}__door",
                origin=body.door_origin,
                axis=body.door_axis,
                lower=0.0,
                upper=body.door_upper,
                handle=body.handle,
                handle_axis=(0.0, 0.0, 1.0),
            ),
        )
    return SceneBody(
        name=body.name,
        class_name=body.class_name,
        movable=body.movable,
        furniture=body.furniture,
        file=f"bodies/{body.name}.urdf" if body.movable else None,
        parent=body.parent,
        relation=body.relation,
        world_from_body=as_transform(body.world_from_body),
        joints=joints,
        joint_values={joint.name: body.door_value for joint in joints},
        box=_box(body),
        mass=body.mass,
        contains=bool(body.door),
        grasp_width=body.grasp_width,
    )


def _planes(body: HandmadeBody) -> tuple[SurfacePlane, ...]:
    planes = []
    for x, y, z, width, depth in body.supports:
        half = np.array([width / 2, depth / 2, 0.0])
        local = [np.array([x, y, z]) + half * np.array([i, j, 0]) for i, j in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
        corners = [body.world_from_body[:3, :3] @ p + body.world_from_body[:3, 3] for p in local]
        center = np.mean(corners, axis=0)
        planes.append(
            SurfacePlane(
                normal=(0.0, 0.0, 1.0),
                offset=-float(center[2]),
                area=width * depth,
                center=as_vector(center),
                corners=tuple(as_vector(corner) for corner in corners),
                horizontal=True,
            )
        )
    return tuple(planes)


def write_scene(root: Path, bodies: list[HandmadeBody]) -> None:
    """Write scene.json, static.urdf, bodies/*.urdf and graph.json."""
    (root / "bodies").mkdir(parents=True, exist_ok=True)
    static = '<link name="world"/>'
    for body in bodies:
        if body.movable:
            text = f'<robot name="{body.name}">{_links(body)}</robot>'
            (root / "bodies" / f"{body.name}.urdf").write_text(text)
            continue
        static += _links(body)
        x, y, z = body.world_from_body[:3, 3]
        yaw = np.arctan2(body.world_from_body[1, 0], body.world_from_body[0, 0])
        static += (
            f'<joint name="{body.name}__mount" type="fixed"><parent link="world"/><child link="{body.name}"/>'
            f'<origin xyz="{x} {y} {z}" rpy="0 0 {yaw}"/></joint>'
        )
    (root / "static.urdf").write_text(f'<robot name="scene">{static}</robot>')
    InteractiveSceneFile(bodies=tuple(_record(body) for body in bodies)).write(root / "scene.json")
    nodes = [GraphNode(id=SCENE_NODE, instance=0, class_name="scene", node_type="scene")]
    links = []
    for number, body in enumerate(bodies, start=1):
        kind = "layout" if body.class_name == "floor" else "articulated" if body.door else "rigid"
        nodes.append(
            GraphNode(
                id=body.name,
                instance=number,
                class_name=body.class_name,
                node_type=kind,
                box=_box(body),
                planes=_planes(body),
            )
        )
        links.append(Relation(source=body.parent, target=body.name, relation=body.relation, confidence=1.0))
    ContactGraphFile(nodes=tuple(nodes), links=tuple(links)).write(root / "graph.json")


def floor() -> HandmadeBody:
    """A floor of 5 m x 5 m."""
    return HandmadeBody("floor_1", "floor", np.eye(4), [((0, 0, -0.05), (5.0, 5.0, 0.1))], SCENE_NODE)


def table(x: float, y: float, name: str = "table_3") -> HandmadeBody:
    """A table 1.2 m x 0.7 m, 0.75 m high."""
    boxes: Boxes = [((0, 0, 0.73), (1.2, 0.7, 0.04))]
    boxes += [((i * 0.55, j * 0.3, 0.355), (0.05, 0.05, 0.71)) for i in (-1, 1) for j in (-1, 1)]
    pose = transform_from_yaw(0.0, np.array([x, y, 0.0]))
    return HandmadeBody(name, "table", pose, boxes, "floor_1", supports=[(0, 0, 0.75, 1.2, 0.7)])


def fridge(x: float, y: float, yaw: float = 0.0, door_value: float = 1.6, name: str = "fridge_2") -> HandmadeBody:
    """A fridge 0.6 m x 0.6 m x 1.4 m with shelves at 0.3, 0.65 and 1.0 m; front along -y, hinge on the left."""
    wall = 0.04
    boxes: Boxes = [
        ((0, 0.28, 0.7), (0.6, wall, 1.4)),
        ((-0.28, 0.0, 0.7), (wall, 0.52, 1.4)),
        ((0.28, 0.0, 0.7), (wall, 0.52, 1.4)),
        ((0, 0, 1.38), (0.52, 0.52, wall)),
    ]
    shelves = (0.1, 0.45, 0.8)
    boxes += [((0, 0.0, height - 0.01), (0.52, 0.52, 0.02)) for height in shelves]
    door: Boxes = [((0.0, -0.285, 0.7), (0.6, 0.05, 1.4)), ((0.25, -0.35, 0.9), (0.02, 0.02, 0.4))]
    door += [((0.25, -0.327, height), (0.02, 0.04, 0.02)) for height in (0.72, 1.08)]
    pose = transform_from_yaw(yaw, np.array([x, y, 0.0]))
    return HandmadeBody(
        name,
        "fridge",
        pose,
        boxes,
        "floor_1",
        mass=50.0,
        door=door,
        door_origin=(-0.3, -0.285, 0.0),
        door_axis=(0, 0, -1),
        door_value=door_value,
        handle=(0.25, -0.35, 0.9),
        supports=[(0, 0, height, 0.5, 0.5) for height in shelves],
    )


def bottle(
    x: float, y: float, z: float, parent: str, relation: str = "contains", name: str = "bottle_7"
) -> HandmadeBody:
    """A square bottle 6 cm wide, 20 cm high; its origin is the centre of its bottom."""
    pose = transform_from_yaw(0.0, np.array([x, y, z]))
    boxes: Boxes = [((0, 0, 0.1), (0.06, 0.06, 0.2))]
    return HandmadeBody(name, "bottle", pose, boxes, parent, relation, movable=True, mass=0.3, grasp_width=0.06)


def kitchen(door_value: float = 1.6) -> list[HandmadeBody]:
    """Floor, table, fridge with a bottle on its middle shelf, a cup on the table."""
    cup = HandmadeBody(
        "cup_5",
        "cup",
        transform_from_yaw(0.0, np.array([-1.3, -0.75, 0.75])),
        [((0, 0, 0.05), (0.07, 0.07, 0.1))],
        "table_3",
        movable=True,
        mass=0.2,
        grasp_width=0.07,
    )
    return [
        floor(),
        fridge(1.0, 1.5, door_value=door_value),
        table(-1.3, -1.0),
        bottle(1.0, 1.42, 0.8, "fridge_2"),
        cup,
    ]
