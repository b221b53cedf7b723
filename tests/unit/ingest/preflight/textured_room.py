"""The tiny room with paint on it, as a source in memory, so that colour and depth show the same thing."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from scenewright.schemas.scene_parts import Camera
from scenewright.stages.ingest.preflight.inspection import Inspection, inspect_source
from scenewright.stages.ingest.preflight.settings import ingest_parameters
from scenewright.stages.ingest.source import Entry, LoadedFrame, LogSource, SourceCamera
from scenewright.stages.kit.geometry.cameras import back_project
from scenewright.stages.kit.geometry.transforms import apply, look_at
from scenewright.stages.kit.progress import SilentProgress

from tests.unit.ingest.tiny_room import TABLE, millimetres, room_depth

CAMERA = Camera(width=160, height=120, fx=130.0, fy=130.0, cx=79.5, cy=59.5)
RATE = 10.0


def walk(count: int) -> np.ndarray:
    """Return world_from_camera (count, 4, 4): a walk that turns, rises and comes nearer."""
    s = np.linspace(0, 1, count)
    eyes = np.stack([-1.6 + 0.7 * s, -1.2 + 1.9 * s + 0.1 * np.sin(9 * s), 1.4 + 0.25 * np.sin(5 * s)], axis=1)
    targets = np.stack([0.8 - 0.3 * s, 0.3 - 0.6 * s, 0.5 + 0.2 * np.cos(4 * s)], axis=1)
    return np.array([look_at(eye, target) for eye, target in zip(eyes, targets, strict=True)])


def painted(depth: np.ndarray, camera: Camera, world_from_camera: np.ndarray, speckled: bool = False) -> np.ndarray:
    """Return (H, W, 3) uint8: walls of large soft patches, a dark table, so that its outline is the strongest edge.

    `speckled` adds a pattern of 9 cm cells with corners that features find.
    """
    points = apply(world_from_camera, back_project(depth, camera).astype(float))
    x, y, z = np.moveaxis(points, -1, 0)
    soft = (
        150 + 25 * np.sin(3.1 * x + 1.3 * y) + 25 * np.sin(2.3 * y + 2.9 * z) + 15 * np.sin(11 * x) * np.sin(9 * y + z)
    )
    near = ((points > TABLE[0] - 1e-3) & (points < TABLE[1] + 1e-3)).all(axis=-1)
    grey = np.where(near, 45 + 10 * np.sin(14 * x) * np.sin(13 * y), soft)
    if speckled:
        cells = np.floor(points / 0.09).astype(np.int64) @ np.array([73856093, 19349663, 83492791])
        grey = grey + (cells * 2654435761 % 1009) / 1009 * 90 - 45
    return np.repeat(np.clip(grey, 0, 255).astype(np.uint8)[..., None], 3, axis=2)


def source(
    count: int,
    *,
    camera: Camera = CAMERA,
    poses: np.ndarray | None = None,
    color: bool = True,
    depth: bool = True,
    posed: bool = True,
    right: float | None = None,
    speckled: bool = False,
    **changes: Any,
) -> LogSource:
    """Return the room as a source of `count` frames; `right` is the baseline of a second eye [m]."""
    poses = walk(count) if poses is None else poses

    def load(index: int) -> LoadedFrame:
        exact = room_depth(camera, poses[index])
        other = None
        if right is not None:
            shifted = poses[index].copy()
            shifted[:3, 3] += right * shifted[:3, 0]
            other = painted(room_depth(camera, shifted), camera, shifted, speckled)
        picture = painted(exact, camera, poses[index], speckled) if color else None
        return LoadedFrame(picture, millimetres(exact) if depth else None, right=other)

    entries = tuple(
        Entry(f"frame {k}", 5.0 + k / RATE, poses[k].copy() if posed else None, lambda k=k: load(k))  # type: ignore[misc]
        for k in range(count)
    )
    made = {"format": "room", "rule": "a room in memory", "cameras": (SourceCamera("camera", camera, right),)}
    return LogSource(**{**made, "entries": entries, **changes})


def inspected(what: LogSource, frames: int = 26, *settings: str, **options: Any) -> Inspection:
    """Inspect a source."""
    return inspect_source(what, Path("room"), ingest_parameters(settings), frames, SilentProgress(), **options)
