"""episode.mcap: where the robot stood, what it knew, said and saw, turn by turn, in Foxglove's schemas."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import cos, sin
from pathlib import Path

import numpy as np
from foxglove_schemas_protobuf.CompressedImage_pb2 import CompressedImage
from foxglove_schemas_protobuf.FrameTransforms_pb2 import FrameTransforms
from foxglove_schemas_protobuf.Grid_pb2 import Grid
from foxglove_schemas_protobuf.Log_pb2 import Log
from foxglove_schemas_protobuf.PackedElementField_pb2 import PackedElementField
from foxglove_schemas_protobuf.SceneEntityDeletion_pb2 import SceneEntityDeletion
from foxglove_schemas_protobuf.SceneUpdate_pb2 import SceneUpdate
from scenewright.schemas.agent_episode import MapThing
from scenewright.stages.agent.obstacle_map import CELL
from scenewright.stages.agent.senses import Base
from scenewright.stages.kit.formats import foxglove
from scenewright.stages.kit.formats.foxglove_log import foxglove_log

TRANSFORMS, MAP, SCENE, LOG, WRIST = "/tf", "/map", "/scene", "/log", "/camera/wrist"
_TOPICS = {TRANSFORMS: FrameTransforms, MAP: Grid, SCENE: SceneUpdate, LOG: Log, WRIST: CompressedImage}
FURNITURE_COLOR, THING_COLOR = (0.80, 0.69, 0.54, 0.9), (0.78, 0.33, 0.24, 1.0)
"""Colours (RGBA) of furniture and of things."""
THING_HEIGHT = 0.08
"""Height with which a thing of the map is drawn, of which no height is kept [m]."""


@dataclass(frozen=True)
class Moment:
    """The end of a turn."""

    seconds: float
    """Of the robot."""
    base: Base
    said: str
    window: np.ndarray
    """(H, W) states of cells, x along the rows."""
    origin: tuple[float, float]
    """Middle of the first cell [m]."""
    things: tuple[MapThing, ...]
    views: tuple[np.ndarray, ...]
    """Pictures (H, W, 3) uint8 that the wrist camera took in this turn."""


def write_log(path: Path, moments: Sequence[Moment]) -> None:
    """Write an episode. All is in the map frame, which the robot's localisation defines."""
    with foxglove_log(path, _TOPICS) as add:
        for moment in moments:
            stamp = foxglove.nanoseconds(moment.seconds)
            add(TRANSFORMS, stamp, foxglove.transforms_message(stamp, "map", "base", _pose(moment.base)))
            add(MAP, stamp, _grid(stamp, moment))
            add(SCENE, stamp, _scene(stamp, moment.things))
            text = Log(level=Log.Level.INFO, message=moment.said, name="agent")
            text.timestamp.FromNanoseconds(stamp)
            add(LOG, stamp, text)
            for view in moment.views:
                add(WRIST, stamp, foxglove.color_message(stamp, foxglove.encode_jpeg(view), "wrist"))


def _pose(base: Base) -> np.ndarray:
    pose = np.eye(4)
    pose[:2, :2] = [[cos(base.yaw), -sin(base.yaw)], [sin(base.yaw), cos(base.yaw)]]
    pose[:2, 3] = base.x, base.y
    return pose


def _grid(stamp: int, moment: Moment) -> Grid:
    """Return the obstacle map: one byte a cell, 0 unknown, 1 free, 2 occupied; columns along x, rows along y."""
    cells = np.ascontiguousarray(moment.window.T.astype(np.uint8))
    grid = Grid(frame_id="map", column_count=cells.shape[1], row_stride=cells.shape[1], cell_stride=1)
    grid.timestamp.FromNanoseconds(stamp)
    grid.pose.position.x, grid.pose.position.y = (float(value - CELL / 2) for value in moment.origin)
    grid.pose.orientation.w = 1.0
    grid.cell_size.x = grid.cell_size.y = CELL
    grid.fields.add(name="state", offset=0, type=PackedElementField.NumericType.UINT8)
    grid.data = cells.tobytes()
    return grid


def _scene(stamp: int, things: Sequence[MapThing]) -> SceneUpdate:
    """Return furniture and things as boxes with their keys, in place of all before."""
    update = SceneUpdate()
    update.deletions.add(type=SceneEntityDeletion.Type.ALL).timestamp.FromNanoseconds(stamp)
    for thing in things:
        entity = update.entities.add(frame_id="map", id=thing.key)
        entity.timestamp.FromNanoseconds(stamp)
        x, y, z = thing.position
        height = THING_HEIGHT if thing.place else z
        cube, text = entity.cubes.add(), entity.texts.add(text=thing.key, font_size=0.08, billboard=True)
        cube.size.x, cube.size.y, cube.size.z = (*thing.size, height)
        for part, at in ((cube, z if thing.place else height / 2), (text, z + height)):
            part.pose.position.x, part.pose.position.y, part.pose.position.z = x, y, at
            part.pose.orientation.w = 1.0
        color = THING_COLOR if thing.place else FURNITURE_COLOR
        cube.color.r, cube.color.g, cube.color.b, cube.color.a = color
        text.color.a = 1.0
    return update
