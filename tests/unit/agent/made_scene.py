"""A true scene made by hand: a table with a can, a cabinet of two drawers with a cup in the upper one, or a shelf."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from scenewright.schemas.interactive_scene import InteractiveSceneFile, SceneBody
from scenewright.schemas.scene_parts import Box, Joint

Vector = tuple[float, float, float]
Boxes = tuple[tuple[Vector, Vector], ...]
"""Size and middle of each [m]."""
CABINET_AT, TABLE_AT = (-1.0, 1.6, 0.0), (1.2, 0.0, 0.0)
DEPTH, WIDTH, HEIGHT, WALL = 0.45, 0.6, 0.8, 0.02
DRAWER_LOW = (0.06, 0.43)
"""Height of the two drawers' bottoms [m]; the front looks along -y."""
HANDLE_Y = -DEPTH / 2 - 0.045
BACK, INNER = DEPTH / 2 - WALL / 2, DEPTH - 3 * WALL
CARCASS: Boxes = (
    ((WIDTH, WALL, HEIGHT), (0, BACK, HEIGHT / 2)),
    *(((WALL, DEPTH, HEIGHT), (side * (WIDTH - WALL) / 2, 0, HEIGHT / 2)) for side in (-1, 1)),
    ((WIDTH, DEPTH, WALL), (0, 0, HEIGHT - WALL / 2)),
    ((WIDTH, DEPTH, 0.04), (0, 0, 0.02)),
)
TABLE: Boxes = (((0.8, 1.2, 0.04), (0, 0, 0.72)), ((0.1, 0.1, 0.7), (0, 0, 0.35)))
SHELF_AT, BOARDS = (0.3, -1.8, 0.0), (0.05, 0.41, 0.77, 1.13)
"""Of a shelf that looks along y, and the height of its boards [m]."""
SHELF: Boxes = (
    ((0.8, WALL, 1.5), (0, -0.14, 0.75)),
    *(((WALL, 0.3, 1.5), (side * 0.39, 0, 0.75)) for side in (-1, 1)),
    *(((0.78, 0.3, WALL), (0, 0, height - WALL / 2)) for height in BOARDS),
)


def drawer(low: float) -> Boxes:
    """Return a drawer in the frame of the cabinet: front, floor, back, sides, then the bar of its handle."""
    tall, across = 0.33, WIDTH - 0.1
    return (
        ((WIDTH - 2 * WALL - 0.01, WALL, tall), (0, -DEPTH / 2 + WALL / 2, low + tall / 2)),
        ((across, INNER, 0.01), (0, 0, low + 0.01)),
        ((across, 0.01, 0.12), (0, INNER / 2, low + 0.07)),
        *(((0.01, INNER, 0.12), (side * across / 2, 0, low + 0.07)) for side in (-1, 1)),
        ((0.2, 0.02, 0.02), (0, HANDLE_Y, low + tall / 2)),
    )


def write_room(folder: Path, *, opened: float = 0.0, shelf: bool = False) -> Path:
    """Write the scene folder, the upper drawer `opened` [m], with a `shelf` as well; return it."""
    links, joints, records = [], [], []
    slides = tuple(
        Joint(
            name=f"cabinet_3__drawer_{k}_slide",
            type="prismatic",
            part=f"cabinet_3__drawer_{k}",
            origin=(0, 0, 0),
            axis=(0, -1, 0),
            lower=0.0,
            upper=0.36,
            handle=(0.0, HANDLE_Y, low + 0.165),
            handle_axis=(1, 0, 0),
        )
        for k, low in enumerate(DRAWER_LOW, 1)
    )
    still: dict[str, tuple[Boxes, Vector, Vector]] = {
        "floor_1": ((((5, 5, 0.1), (0, 0, -0.05)),), (0, 0, 0), (5, 5, 0.1)),
        "table_2": (TABLE, TABLE_AT, (0.8, 1.2, 0.74)),
        "cabinet_3": (CARCASS, CABINET_AT, (WIDTH, DEPTH, HEIGHT)),
    }
    if shelf:
        still["shelf_6"] = (SHELF, SHELF_AT, (0.8, 0.3, 1.5))
    for name, (boxes, at, size) in still.items():
        links.append(_link(name, boxes, mass=20.0))
        joints.append(_joint(f"world__{name}", "fixed", "world", name, at))
        values = {slides[1].name: opened, slides[0].name: 0.0} if name == "cabinet_3" else {}
        parent = None if name == "floor_1" else "floor_1"
        records.append(_record(name, at, size, parent, joints=slides if values else (), joint_values=values))
    for slide, low in zip(slides, DRAWER_LOW, strict=True):
        links.append(_link(slide.part, drawer(low), mass=3.0))
        limits = f'<axis xyz="0 -1 0"/><limit lower="0" upper="{slide.upper}" effort="50" velocity="1"/>'
        joints.append(_joint(slide.name, "prismatic", "cabinet_3", slide.part, (0, 0, 0), limits))
    cup_y = CABINET_AT[1] - 0.05 - opened
    things: dict[str, tuple[str, Vector, Vector]] = {
        "can_4": ("table_2", (1.1, 0.1, 0.742), (0.06, 0.06, 0.12)),
        "cup_5": ("cabinet_3", (CABINET_AT[0], cup_y, DRAWER_LOW[1] + 0.017), (0.07, 0.07, 0.09)),
    }
    (folder / "bodies").mkdir(parents=True)
    for name, (on, at, size) in things.items():
        text = _link(name, ((size, (0, 0, size[2] / 2)),), mass=0.2)
        (folder / "bodies" / f"{name}.urdf").write_text(f'<robot name="{name}">{text}</robot>')
        more = {
            "movable": True,
            "file": f"bodies/{name}.urdf",
            "relation": "contains" if name == "cup_5" else "supports",
        }
        records.append(_record(name, at, size, on, **more))
    tree = f'<robot name="scene"><link name="world"/>{"".join(links)}{"".join(joints)}</robot>'
    for name in ("static.urdf", "scene.urdf"):
        (folder / name).write_text(tree)
    InteractiveSceneFile(bodies=tuple(records)).write(folder / "scene.json")
    return folder


def _record(name: str, at: Vector, size: Vector, parent: str | None, **more: object) -> SceneBody:
    pose = np.eye(4)
    pose[:3, 3] = at
    middle = (at[0], at[1], at[2] + (size[2] / 2 if parent else -size[2] / 2))
    values = {"movable": False, "mass": 1.0, "parent": parent, "box": Box(center=middle, size=size), **more}
    rows = tuple(tuple(row) for row in pose.tolist())
    return SceneBody(name=name, class_name=name.rsplit("_", 1)[0], world_from_body=rows, **values)  # type: ignore[arg-type]


def _link(name: str, boxes: Boxes, mass: float) -> str:
    shapes = ""
    for number, (size, at) in enumerate(boxes):
        grey = 0.3 + 0.1 * (number % 5)
        shape = f'<origin xyz="{_text(at)}"/><geometry><box size="{_text(size)}"/></geometry>'
        color = f'<material name="grey_{number % 5}"><color rgba="{grey} {grey} {grey} 1"/></material>'
        shapes += f"<visual>{shape}{color}</visual><collision>{shape}</collision>"
    inertia = f'<inertia ixx="{mass}" ixy="0" ixz="0" iyy="{mass}" iyz="0" izz="{mass}"/>'
    if mass < 1:
        inertia = inertia.replace(f'"{mass}"', '"0.0002"')
    return f'<link name="{name}"><inertial><mass value="{mass}"/>{inertia}</inertial>{shapes}</link>'


def _joint(name: str, kind: str, parent: str, child: str, at: Vector, more: str = "") -> str:
    return (
        f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>'
        f'<origin xyz="{_text(at)}"/>{more}</joint>'
    )


def _text(values: Vector) -> str:
    return " ".join(f"{value:g}" for value in values)
