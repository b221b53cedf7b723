"""Both eyes' pictures of a needle scene, and the truth: masks, disparity, pose, what is hidden."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from scenewright.stages.kit.geometry.transforms import inverse
from scenewright.stages.suture.rig import NeedlePose, StereoRig
from scenewright.stages.suture.world.raster import SUBPIXELS, Cones, Lighting, View, draw, hide_below_pad, label, shade
from scenewright.stages.suture.world.scene import NeedleScene
from scenewright.stages.suture.world.tubes import NEEDLE, Tubes
from scipy.spatial.transform import Rotation

SHADOW_SIZE, SHADOW_SCALE, SHADOW_ORIGIN = 800, 2000.0, -0.20
"""Side of the shadow picture [px], its scale [px/m], and the world's x and y at its corner [m]; by eye."""
NEAR = 70
"""Pixels about the needle that are drawn where no pictures are wanted."""
ARC_ANGLES = np.linspace(0.0, np.pi, 121)
"""Angles [rad] of the needle at which it is said whether an eye sees it."""


@dataclass(frozen=True)
class Eye:
    """What one eye has: the picture (H, W, 3) uint8 RGB or None, each pixel's body (H, W) uint8, the depth (H, W) [m]
    in this eye, and which of ARC_ANGLES of the needle it sees (121,)."""

    image: np.ndarray | None
    bodies: np.ndarray
    depth: np.ndarray
    sees: np.ndarray

    def mask(self, *bodies: int) -> np.ndarray:
        """Return where (H, W) any of `bodies` is seen."""
        chosen = np.zeros(256, dtype=bool)
        chosen[list(bodies)] = True
        return chosen[self.bodies]


@dataclass(frozen=True)
class StereoView:
    """Both eyes of a scene with the truth. `disparity` (H, W) float32 [px] belongs to the left eye, NaN unknown."""

    rig: StereoRig
    left: Eye
    right: Eye
    disparity: np.ndarray
    pose: NeedlePose
    holder: str
    place: str

    @property
    def seen(self) -> float:
        """The smaller of the two eyes' shares of the arc that is seen, 0..1."""
        return float(min(self.left.sees.mean(), self.right.sees.mean()))


def render(scene: NeedleScene, pictures: bool = True) -> StereoView:
    """Return the two eyes' view of `scene`; without `pictures` only geometry (masks, depth,
    disparity of tubes), about the needle, much faster."""
    tubes = scene.tubes()
    random = np.random.default_rng([81, scene.seed])
    shadow = _shadow(tubes, scene) if pictures else np.zeros((1, 1))
    right_from_left = np.eye(4)
    right_from_left[:3, :3] = Rotation.from_rotvec(scene.right_eye_turn).as_matrix()
    right_from_left[:3, 3] = right_from_left[:3, :3] @ np.array([-scene.rig.baseline, 0.0, 0.0])
    left = _eye(scene, tubes, scene.camera_from_world, scene.pose, shadow, pictures, random)
    right_pose = NeedlePose(right_from_left @ scene.pose.camera_from_needle)
    right_camera = right_from_left @ scene.camera_from_world
    right = _eye(scene, tubes.moved(right_from_left), right_camera, right_pose, shadow, pictures, random)
    disparity = _disparity(scene.rig, left.depth, right_from_left)
    return StereoView(scene.rig, left, right, disparity, scene.pose, scene.holder, scene.place)


def _disparity(rig: StereoRig, depth: np.ndarray, right_from_left: np.ndarray) -> np.ndarray:
    """Return the true difference of columns (H, W) between the eyes, calibration error included; NaN without depth."""
    rows, columns = np.nonzero(depth > 0)
    z = depth[rows, columns].astype(float)
    points = np.stack([(columns - rig.centre[0]) / rig.focal * z, (rows - rig.centre[1]) / rig.focal * z, z], axis=1)
    moved = points @ right_from_left[:3, :3].T + right_from_left[:3, 3]
    disparity = np.full(depth.shape, np.nan, dtype=np.float32)
    disparity[rows, columns] = columns - (rig.focal * moved[:, 0] / moved[:, 2] + rig.centre[0])
    return disparity


def _eye(
    scene: NeedleScene,
    tubes: Tubes,
    camera_from_world: np.ndarray,
    pose: NeedlePose,
    shadow: np.ndarray,
    pictures: bool,
    random: np.random.Generator,
) -> Eye:
    light = scene.light
    column, row, rig = (0, 0, scene.rig) if pictures else _around_needle(scene.rig, pose)
    world_from_camera = inverse(camera_from_world)
    rotation, eye_position = (
        np.ascontiguousarray(world_from_camera[:3, :3]),
        np.ascontiguousarray(world_from_camera[:3, 3]),
    )
    depth = np.zeros((rig.height * SUBPIXELS, rig.width * SUBPIXELS), dtype=np.float32)
    cone = np.full(depth.shape, -1, dtype=np.int16)
    starts, ends = np.ascontiguousarray(tubes.starts), np.ascontiguousarray(tubes.ends)
    cones = Cones(starts, ends, tubes.start_radii, tubes.end_radii, tubes.bodies)
    view = View(rig.focal, rig.centre[0], rig.centre[1], rotation, eye_position, scene.ridge)
    box = draw(cones, view, depth, cone)
    hide_below_pad(depth, cone, box, view)
    bodies = np.zeros((rig.height, rig.width), dtype=np.uint8)
    depth_map = np.zeros((rig.height, rig.width), dtype=np.float32)
    label(depth, cone, tubes.bodies, box, bodies, depth_map)
    image = None
    if pictures:
        linear = np.empty((rig.height, rig.width, 3), dtype=np.float32)
        lighting = Lighting(
            light.lamps, light.room_turn, light.salt, light.pad_colour, shadow, SHADOW_ORIGIN, SHADOW_SCALE
        )
        shade(depth, cone, cones, view, lighting, linear, depth_map)
        image = _sensor(linear, scene, random)
    sees = _visible_arc(rig, pose, cone, tubes.bodies)
    if not pictures:
        bodies = _paste(bodies, scene.rig, column, row)
        depth_map = _paste(depth_map, scene.rig, column, row)
    return Eye(image, bodies, depth_map, sees)


def _around_needle(rig: StereoRig, pose: NeedlePose) -> tuple[int, int, StereoRig]:
    """Return first column, first row and camera of the part of this eye's image within NEAR px of the needle."""
    pixels = rig.left(pose.points(ARC_ANGLES))
    low = np.clip(np.floor(pixels.min(axis=0)).astype(int) - NEAR, 0, [rig.width - 2, rig.height - 2])
    high = np.clip(np.ceil(pixels.max(axis=0)).astype(int) + NEAR, low + 2, [rig.width, rig.height])
    centre = (rig.centre[0] - float(low[0]), rig.centre[1] - float(low[1]))
    return (
        int(low[0]),
        int(low[1]),
        StereoRig(int(high[0] - low[0]), int(high[1] - low[1]), rig.focal, centre, rig.baseline),
    )


def _paste(part: np.ndarray, rig: StereoRig, column: int, row: int) -> np.ndarray:
    """Return the whole image (H, W) that holds `part` at (column, row) and zeros elsewhere."""
    full_picture = np.zeros((rig.height, rig.width), dtype=part.dtype)
    full_picture[row : row + part.shape[0], column : column + part.shape[1]] = part
    return full_picture


def _visible_arc(rig: StereoRig, pose: NeedlePose, cone: np.ndarray, bodies: np.ndarray) -> np.ndarray:
    """Return which of ARC_ANGLES (121,) this eye sees: the sub-pixel where the centre line falls shows the needle."""
    pixels = rig.left(pose.points(ARC_ANGLES))
    columns = np.round(pixels[:, 0] * SUBPIXELS + (SUBPIXELS - 1) / 2).astype(int)
    rows = np.round(pixels[:, 1] * SUBPIXELS + (SUBPIXELS - 1) / 2).astype(int)
    inside = (columns >= 0) & (rows >= 0) & (columns < cone.shape[1]) & (rows < cone.shape[0])
    index = cone[np.clip(rows, 0, cone.shape[0] - 1), np.clip(columns, 0, cone.shape[1] - 1)]
    return inside & (index >= 0) & (bodies[index] == NEEDLE)


def _shadow(tubes: Tubes, scene: NeedleScene) -> np.ndarray:
    """Return how much (0..0.6) of the light each place of the pad misses: the tubes' shadows from the first lamp."""
    world = tubes.moved(inverse(scene.camera_from_world))
    points, radii = (world.starts + world.ends) / 2.0, (world.start_radii + world.end_radii) / 2.0
    lamp = scene.light.lamps[0, :3]
    reach = points[:, 2] / np.maximum(lamp[2] - points[:, 2], 1e-3)
    cast = points[:, :2] + (points[:, :2] - lamp[:2]) * reach[:, None]
    pixels = (cast - SHADOW_ORIGIN) * SHADOW_SCALE
    shadow = np.zeros((SHADOW_SIZE, SHADOW_SIZE), dtype=np.float32)
    for (column, row), radius in zip(pixels, radii * SHADOW_SCALE, strict=True):
        if -20 < column < SHADOW_SIZE + 20 and -20 < row < SHADOW_SIZE + 20:
            cv2.circle(shadow, (int(column), int(row)), max(int(np.ceil(radius)), 1), 0.6, -1)
    return cv2.GaussianBlur(shadow, (0, 0), 2.0).astype(np.float64)


def _sensor(linear: np.ndarray, scene: NeedleScene, random: np.random.Generator) -> np.ndarray:
    """Return the 8-bit picture (H, W, 3): lens blur, exposure, shot and read noise, saturation, gamma 2.2."""
    light = scene.light
    blurred = cv2.GaussianBlur(linear, (0, 0), light.blur) * np.float32(light.exposure)
    noise = random.standard_normal(blurred.shape, dtype=np.float32)
    noise *= np.sqrt(np.maximum(blurred, 0) * np.float32(light.gain_noise) + np.float32(light.read_noise**2))
    return (np.clip(blurred + noise, 0.0, 1.0) ** np.float32(1 / 2.2) * 255.0 + 0.5).astype(np.uint8)
