"""Pieces seen from above, from the front and from the end, and the plane of two clicks on one of these pictures."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import trimesh
from scenewright.schemas.scene_parts import Camera
from scenewright.stages.cutting.pictures import bounds_of, colored
from scenewright.stages.cutting.world.body import Body, Plane
from scenewright.stages.kit.geometry.transforms import look_at
from scenewright.stages.kit.rendering.ray_casting import SceneRenderer

WIDTH, HEIGHT = 480, 360
"""Size of one picture [px]."""
EYES = ((0.0, 0.0, 1.0), (0.0, -1.0, 0.0), (1.0, 0.0, 0.0))
"""Directions from which it is looked: above, front and end."""
UPS = ((0.0, 1.0, 0.0), (0.0, 0.0, 1.0), (0.0, 0.0, 1.0))
"""Direction that is up in each picture."""
FAR = 8.0
"""Distance from which it is looked [m]: so far that planes through the eye are almost parallel to each other."""
SHORTEST = 8.0
"""Distance between two clicks that is a line [px]."""


class NoCut(Exception):
    """Two clicks that say no plane through a piece; the message says why."""


@dataclass(frozen=True)
class Panels:
    """Three pictures side by side: `color` (HEIGHT, 3 * WIDTH, 3) uint8, `piece` (HEIGHT, 3 * WIDTH), -1 for none."""

    color: np.ndarray
    piece: np.ndarray
    camera: Camera
    poses: tuple[np.ndarray, ...]

    def plane(self, points: np.ndarray) -> tuple[int, Plane]:
        """Return the piece below the line between two clicks (2, 2) [px], most of it, and the plane of that line and
        the eye. Raises NoCut."""
        which = (points[:, 0] // WIDTH).astype(int)
        if (points < 0).any() or (points[:, 1] >= HEIGHT).any() or which.max() >= len(self.poses):
            raise NoCut("a click is outside the image")
        if which[0] != which[1]:
            raise NoCut("the clicks are on two images: click twice on the same one")
        if np.linalg.norm(points[1] - points[0]) < SHORTEST:
            raise NoCut("the clicks are too close to each other to say a line")
        along = points[0] + np.linspace(0.0, 1.0, 4 * WIDTH)[:, None] * (points[1] - points[0])
        u, v = along.astype(int).T
        met = self.piece[v, u]
        if (met < 0).all():
            raise NoCut("the line misses every piece")
        pose = self.poses[which[0]]
        local = points - [which[0] * WIDTH, 0.0]
        focal = (self.camera.fx, self.camera.fy)
        rays = np.column_stack([(local - [self.camera.cx, self.camera.cy]) / focal, np.ones(2)]) @ pose[:3, :3].T
        return int(np.bincount(met[met >= 0]).argmax()), Plane.through(pose[:3, 3], np.cross(*rays))


def panels(pieces: Mapping[int, Body]) -> Panels:
    """Return pieces by number, as they lie, each in a colour of its own."""
    low, high = bounds_of(list(pieces.values()))
    middle, longest = 0.5 * (low + high), float((high - low).max())
    focal = 0.85 * WIDTH * FAR / longest
    camera = Camera(width=WIDTH, height=HEIGHT, fx=focal, fy=focal, cx=0.5 * WIDTH - 0.5, cy=0.5 * HEIGHT - 0.5)
    meshes: list[tuple[int, trimesh.Trimesh]] = [(number + 1, colored(body, number)) for number, body in pieces.items()]
    renderer = SceneRenderer(meshes)
    poses = tuple(look_at(middle + FAR * np.array(eye), middle, up) for eye, up in zip(EYES, UPS, strict=True))
    rendered = [renderer.render(camera, pose) for pose in poses]
    return Panels(
        np.concatenate([each.color for each in rendered], axis=1),
        np.concatenate([each.instance for each in rendered], axis=1) - 1,
        camera,
        poses,
    )
