"""Pictures of a simulated depth camera, and the points of a mask in them: how robots in simulation see things."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scenewright.schemas.scene_parts import Camera
from scenewright.stages.kit.geometry.cameras import back_project
from scenewright.stages.kit.geometry.point_clouds import clusters
from scenewright.stages.kit.geometry.transforms import apply
from scenewright.stages.kit.rendering.depth_noise import disturb_depth
from scenewright.stages.kit.rendering.ray_casting import SceneRenderer
from scipy.ndimage import binary_erosion

LEAST_PIXELS = 25
"""Fewest pixels of a mask (ConceptGraphs)."""
LINK = 0.05
"""Distance of points of one cluster [m] (ConceptGraphs)."""


@dataclass(frozen=True)
class Picture:
    """What a camera took: colour (H, W, 3) uint8, noisy z-depth (H, W) [m], and the true instances (H, W), which a
    segmentation backend other than the oracle does not look at."""

    color: np.ndarray
    depth: np.ndarray
    instance: np.ndarray
    camera: Camera


@dataclass(frozen=True)
class View:
    """A picture, and from where it was taken."""

    picture: Picture
    map_from_camera: np.ndarray
    """(4, 4), as it is believed."""

    @property
    def eye(self) -> np.ndarray:
        """Where the camera stood (3,)."""
        return self.map_from_camera[:3, 3]


def take(
    renderer: SceneRenderer, camera: Camera, world_from_camera: np.ndarray, random: np.random.Generator
) -> Picture:
    """Take a picture with the noise of a depth camera."""
    rendered = renderer.render(camera, world_from_camera)
    reflectance = rendered.albedo.mean(axis=2)
    depth = disturb_depth(rendered.depth, rendered.incidence, reflectance, np.zeros_like(reflectance), camera, random)
    return Picture(rendered.color, depth, rendered.instance, camera)


def cloud(picture: Picture, mask: np.ndarray, map_from_camera: np.ndarray, *, whole: bool = False) -> np.ndarray:
    """Return the points (N, 3) of a mask (H, W) in the map frame: its largest cluster, or the `whole` of what may be
    seen in pieces; none where too few are left."""
    inner = binary_erosion(mask) & (picture.depth > 0)
    if inner.sum() < LEAST_PIXELS:
        return np.zeros((0, 3))
    points = apply(map_from_camera, back_project(picture.depth, picture.camera)[inner].astype(float))
    return points if whole else points[clusters(points, LINK) == 0]
