"""The same scene of boxes as others would write it: in URDF, MJCF and SDF."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

MASS = 0.5


@dataclass(frozen=True)
class Block:
    """A box; with `hinge` a door about z through this place of its own, that opens by two radians."""

    name: str
    size: tuple[float, float, float]
    at: tuple[float, float, float]
    free: bool = False
    hinge: tuple[float, float, float] | None = None


TABLE = Block("table", (1.0, 0.6, 0.8), (0.0, 0.0, 0.4))
CUP_SIZE = (0.1, 0.1, 0.1)


def cup(height: float, name: str = "cup", x: float = 0.0) -> Block:
    """A box that should stand at 0.8 m, with its bottom at `height` [m]."""
    return Block(name, CUP_SIZE, (x, 0.0, height + 0.05), free=True)


DOOR = Block("door", (0.4, 0.02, 0.5), (0.2, 1.0, 0.3), hinge=(-0.2, 0.0, 0.0))
FRAME = Block("frame", (0.1, 0.1, 0.5), (-0.08, 1.0, 0.3))


def wall(angle_side: float) -> Block:
    """A wall beside the door: it meets the door when that stands across, `angle_side` [m] from its hinge."""
    return Block("wall", (0.1, 0.6, 0.5), (angle_side, 1.4, 0.3))


def _row(values: Sequence[float]) -> str:
    return " ".join(f"{value:g}" for value in values)


def _moments(size: tuple[float, float, float]) -> tuple[float, float, float]:
    x, y, z = size
    return MASS / 12 * (y * y + z * z), MASS / 12 * (x * x + z * z), MASS / 12 * (x * x + y * y)


def _centers(block: Block) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """Where the frame of a block is, and its box in it: a door's frame lies on its hinge."""
    hinge = block.hinge or (0.0, 0.0, 0.0)
    return tuple(a + b for a, b in zip(block.at, hinge, strict=True)), tuple(-value for value in hinge)


def _inertia(block: Block) -> str:
    xx, yy, zz = _moments(block.size)
    return f"<ixx>{xx:g}</ixx><iyy>{yy:g}</iyy><izz>{zz:g}</izz>"


def urdf(path: Path, blocks: Sequence[Block], more: str = "") -> Path:
    """Write the scene as URDF, its root is an empty link `world`."""
    text = '<robot name="scene"><link name="world"/>'
    for block in blocks:
        place, box = _centers(block)
        xx, yy, zz = _moments(block.size)
        kind = "floating" if block.free else "revolute" if block.hinge else "fixed"
        text += (
            f'<link name="{block.name}"><inertial><origin xyz="{_row(box)}"/><mass value="{MASS}"/>'
            f'<inertia ixx="{xx}" iyy="{yy}" izz="{zz}" ixy="0" ixz="0" iyz="0"/></inertial>'
            f'<collision><origin xyz="{_row(box)}"/><geometry><box size="{_row(block.size)}"/></geometry></collision>'
            f'</link><joint name="of_{block.name}" type="{kind}"><parent link="{"frame" if block.hinge else "world"}"/>'
            f'<child link="{block.name}"/><origin xyz="{_row(_in_frame(block, place))}"/><axis xyz="0 0 1"/>'
            '<limit lower="0" upper="2" effort="10" velocity="1"/></joint>'
        )
    path.write_text(f"{text}{more}</robot>")
    return path


def _in_frame(block: Block, place: Sequence[float]) -> list[float]:
    return [a - b for a, b in zip(place, FRAME.at if block.hinge else (0.0, 0.0, 0.0), strict=True)]


def mjcf(path: Path, blocks: Sequence[Block], more: str = "") -> Path:
    """Write the scene as MJCF."""
    text = '<mujoco model="scene"><compiler angle="radian"/><worldbody>'
    doors = "".join(_mjcf_body(block) for block in blocks if block.hinge)
    text += "".join(_mjcf_body(block, doors if block.name == "frame" else "") for block in blocks if not block.hinge)
    path.write_text(f"{text}</worldbody>{more}</mujoco>")
    return path


def _mjcf_body(block: Block, inner: str = "") -> str:
    place, box = _centers(block)
    joint = "<freejoint/>" if block.free else ""
    if block.hinge:
        joint = f'<joint name="of_{block.name}" axis="0 0 1" range="0 2"/>'
    half = [value / 2 for value in block.size]
    return (
        f'<body name="{block.name}" pos="{_row(_in_frame(block, place))}">{joint}'
        f'<geom type="box" size="{_row(half)}" pos="{_row(box)}" mass="{MASS}"/>{inner}</body>'
    )


def sdf(path: Path, blocks: Sequence[Block], more: str = "") -> Path:
    """Write the scene as an SDF world. A frame with a door is tied to the world by a joint, other blocks are static."""
    doors = {block.name for block in blocks if block.hinge}
    text = '<sdf version="1.9"><world name="scene"><gravity>0 0 -9.81</gravity>'
    for block in blocks:
        if block.hinge:
            continue
        tied = block.name == "frame" and doors
        text += f'<model name="{block.name}">' + ("" if block.free or tied else "<static>1</static>")
        text += _sdf_link(block)
        if tied:
            text += '<joint name="fast" type="fixed"><parent>world</parent><child>frame</child></joint>'
            text += "".join(_sdf_link(door) + _sdf_hinge(door) for door in blocks if door.hinge)
        text += "</model>"
    path.write_text(f"{text}{more}</world></sdf>")
    return path


def _sdf_link(block: Block) -> str:
    place, box = _centers(block)
    return (
        f'<link name="{block.name}"><pose>{_row(place)} 0 0 0</pose><inertial><pose>{_row(box)} 0 0 0</pose>'
        f"<mass>{MASS}</mass><inertia>{_inertia(block)}</inertia></inertial>"
        f'<collision name="c"><pose>{_row(box)} 0 0 0</pose><geometry><box><size>{_row(block.size)}</size>'
        "</box></geometry></collision></link>"
    )


def _sdf_hinge(block: Block) -> str:
    return (
        f'<joint name="of_{block.name}" type="revolute"><parent>frame</parent><child>{block.name}</child>'
        "<axis><xyz>0 0 1</xyz><limit><lower>0</lower><upper>2</upper></limit></axis></joint>"
    )


WRITERS: dict[str, Callable[..., Path]] = {"scene.urdf": urdf, "scene.xml": mjcf, "scene.sdf": sdf}
"""File name -> how it is written."""
