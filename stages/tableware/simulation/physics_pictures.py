"""Key frames of a trial in physics as pictures: arm, table, bin and dishes, seen from across the table."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import ceil
from pathlib import Path

import numpy as np
import trimesh
from PIL import Image
from scenewright.schemas.errors import BadInput
from scenewright.schemas.scene_parts import Camera
from scenewright.stages.kit.formats.link_poses import link_poses
from scenewright.stages.kit.formats.urdf_file import parse_urdf
from scenewright.stages.kit.geometry.transforms import look_at
from scenewright.stages.kit.rendering.ray_casting import SceneRenderer
from scenewright.stages.kit.simulation.robot_description import RobotDescription
from scenewright.stages.kit.simulation.shapes import link_shapes, paint
from scenewright.stages.kit.simulation.urdf_split import read_urdf, with_absolute_meshes
from scenewright.stages.tableware.simulation.arm import BASE
from scenewright.stages.tableware.simulation.tabletop import BIN_CENTER, BIN_SIDE
from scenewright.stages.tableware.table_pictures import captioned
from scenewright.stages.tableware.world.dish_shapes import item_mesh
from scenewright.stages.tableware.world.items import TABLE_SIDES, Item, Measures
from scenewright.stages.tableware.world.shape_files import COLORS

EYE, TARGET = np.array([0.62, 1.02, 0.80]), np.array([0.14, -0.12, 0.0])
"""Place of the eye, and the point that it looks at [m]; by eye."""
FIELD_OF_VIEW = np.deg2rad(58.0)
"""Horizontal field of view [rad]; by eye."""
ASPECT = 0.62
"""Height of a picture over its width."""
TABLE_COLOR, BIN_COLOR, ARM_COLOR, HAND_COLOR = (236, 232, 224), (120, 128, 140), (176, 184, 194), (90, 98, 110)
"""Colours (RGB) of the table, the bin, the arm and the hand."""
BIN_DEPTH, WALL = 0.12, 0.008
"""Depth of the bin, and thickness of its walls, as drawn [m]."""
SHOWN = ("inside", "pulled", "placed", "lifted", "over the bin", "released")
"""Moments that are shown, of all that are recorded."""
MOST_FRAMES = 64
"""Most frames of an animation; by eye."""


class PhysicsPictures:
    """Draws the frames of `Recording.arrays()`."""

    def __init__(self, frames: Mapping[str, np.ndarray], width: int, robot: RobotDescription) -> None:
        self._frames = frames
        height = round(ASPECT * width)
        focal = 0.5 * width / float(np.tan(FIELD_OF_VIEW / 2))
        self._camera = Camera(width=width, height=height, fx=focal, fy=focal, cx=width / 2 - 0.5, cy=height / 2 - 0.5)
        self._view = look_at(EYE, TARGET)
        self._robot = robot
        self._hand = {robot.hand_link, *robot.finger_links}
        self._urdf = parse_urdf(self._robot.urdf)
        self._links = _shown(robot)
        self._items = [
            _paint(item_mesh(Item(str(name), kind, (0.0, 0.0, 0.0), measures=Measures(*measures))), COLORS[kind])
            for name, kind, measures in zip(
                frames["names"], frames["kinds"].tolist(), frames["measures"].tolist(), strict=True
            )
        ]
        self._still = _table_and_bin()

    def draw(self, number: int, caption: str = "") -> Image.Image:
        """Return one frame, with a line of text below it."""
        meshes = [*self._still, *self._arm(self._frames["joints"][number])]
        for mesh, pose in zip(self._items, self._frames["poses"][number], strict=True):
            if np.isfinite(pose).all():
                meshes.append(mesh.copy().apply_transform(pose))
        picture = SceneRenderer(list(enumerate(meshes, start=1))).render(self._camera, self._view)
        image = Image.fromarray(picture.color)
        return captioned(image, caption) if caption else image

    def _arm(self, joints: np.ndarray) -> list[trimesh.Trimesh]:
        values = dict(zip(self._robot.arm_joints, joints[:-1].tolist(), strict=True))
        values |= {name: float(joints[-1]) / 2 for name in self._robot.finger_joints}
        meshes = []
        for link, pose in link_poses(self._urdf, values).items():
            world = pose.copy()
            world[:3, 3] += BASE
            for shape in self._links.get(link, ()):
                mesh = shape.copy().apply_transform(world)
                meshes.append(_paint(mesh, HAND_COLOR if link in self._hand else ARM_COLOR))
        return meshes


def _shown(robot: RobotDescription) -> dict[str, list[trimesh.Trimesh]]:
    """Return the shapes of each link: those to see, or to touch where the former are of a format that is not read."""
    text = with_absolute_meshes(read_urdf(robot.urdf), robot.urdf.parent)
    try:
        return link_shapes(text, "visual")
    except BadInput:
        return link_shapes(text)


def key_frames(labels: Sequence[str], most: int) -> list[int]:
    """Return the rows of at most `most` frames that show something, in order, evenly chosen; the last is always one."""
    rows = [row for row, label in enumerate(labels) if label in SHOWN]
    rows = [*rows, len(labels) - 1] if len(labels) else []
    if len(rows) <= most:
        return rows
    return [rows[round(row_number)] for row_number in np.linspace(0, len(rows) - 1, most)]


def draw_physics_strip(
    frames: Mapping[str, np.ndarray], words: Sequence[str], width: int, robot: RobotDescription, most: int = 12
) -> Image.Image:
    """Return key frames in rows of four; `words` says for each frame what is being done."""
    columns, gap = 4, 8
    each = (width - gap * (columns + 1)) // columns
    pictures = PhysicsPictures(frames, each, robot)
    rows = key_frames([str(label) for label in frames["labels"]], most)
    drawn = [pictures.draw(row, _caption(frames, words, row)) for row in rows]
    tallest = max((picture.height for picture in drawn), default=1)
    sheet = Image.new("RGB", (width, ceil(len(drawn) / columns) * (tallest + gap) + gap), "#ffffff")
    for number, picture in enumerate(drawn):
        row, column = divmod(number, columns)
        sheet.paste(picture, (gap + column * (each + gap), gap + row * (tallest + gap)))
    return sheet


def write_physics_animation(
    path: Path, frames: Mapping[str, np.ndarray], words: Sequence[str], width: int, robot: RobotDescription
) -> None:
    """Write a GIF of the key frames."""
    pictures = PhysicsPictures(frames, width, robot)
    rows = key_frames([str(label) for label in frames["labels"]], MOST_FRAMES)
    drawn = [pictures.draw(row, _caption(frames, words, row)) for row in rows]
    tallest = max(picture.height for picture in drawn)
    even = []
    for picture in drawn:
        sheet = Image.new("RGB", (width, tallest), "#ffffff")
        sheet.paste(picture, (0, 0))
        even.append(sheet.quantize(96))
    times = [300] * (len(even) - 1) + [1500]
    even[0].save(path, save_all=True, append_images=even[1:], duration=times, loop=0, optimize=False)


def _caption(frames: Mapping[str, np.ndarray], words: Sequence[str], row: int) -> str:
    return f"{float(frames['seconds'][row]):.0f} s: {words[row]}, {frames['labels'][row]}"


def _paint(mesh: trimesh.Trimesh, color: tuple[int, int, int]) -> trimesh.Trimesh:
    paint(mesh, np.array([*color, 255], dtype=np.uint8))
    return mesh


def _box(
    size: tuple[float, float, float], center: tuple[float, float, float], color: tuple[int, int, int]
) -> trimesh.Trimesh:
    return _paint(trimesh.creation.box(size, trimesh.transformations.translation_matrix(center)), color)


def _table_and_bin() -> list[trimesh.Trimesh]:
    x, y = BIN_CENTER
    meshes = [_box((*TABLE_SIDES, 0.03), (0.0, 0.0, -0.015), TABLE_COLOR)]
    meshes.append(_box((BIN_SIDE, BIN_SIDE, WALL), (x, y, -BIN_DEPTH), BIN_COLOR))
    for side in (-1.0, 1.0):
        reach = side * (BIN_SIDE + WALL) / 2
        meshes.append(_box((WALL, BIN_SIDE, BIN_DEPTH), (x + reach, y, -BIN_DEPTH / 2), BIN_COLOR))
        meshes.append(_box((BIN_SIDE, WALL, BIN_DEPTH), (x, y + reach, -BIN_DEPTH / 2), BIN_COLOR))
    meshes.append(_box((0.16, 0.16, float(BASE[2])), (float(BASE[0]), float(BASE[1]), float(BASE[2]) / 2), BIN_COLOR))
    return meshes
