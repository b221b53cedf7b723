"""What an RGB-D image of a table shows, and what of it could not be handled: the one entry for all who look.

    see_image(color, depth, camera)          -> detections, for a program that plans
    see(color, depth, camera, sizes=...)     -> the same with the statement, the notes and the table's plane

A camera that is known to stand level above the table is used as it is; any other view is rectified to the table's plane
first, which is found in the depth.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

import cv2
import numpy as np
from scenewright.schemas.errors import BadInput
from scenewright.schemas.scene_parts import Camera
from scenewright.stages.tableware.vision.detection import items_in
from scenewright.stages.tableware.vision.detections import Detection, statement
from scenewright.stages.tableware.vision.height_map import HeightMap, check_color, check_depth, height_map
from scenewright.stages.tableware.vision.rectifying import rectify, table_plane
from scenewright.stages.tableware.vision.size_estimation import estimated_dishes
from scenewright.stages.tableware.world.items import DISHES, STANDARD, TABLE_SIDES, DishSizes
from scenewright.stages.tableware.world.overhead import OverheadCamera

Sizes = Literal["known", "estimated"]
LEAST_SIZE = (240, 180)
"""Least width and height of an image [px]."""
MILLIMETRES = 20.0
"""A median depth beyond this [m] is one in millimetres."""
LEVEL = 0.9995
"""Cosine of the angle to the vertical, from which a camera looks straight down."""
OBLIQUE, OBLIQUE_TRUST = np.deg2rad(15.0), 0.8
"""Tilt of the camera [rad] from which on what was seen is trusted less, and by which factor; by eye."""
OBLIQUE_VIEW = "oblique view"
"""A view this far off the vertical is oblique; what is left of a confidence there."""
OVER_MIDDLE = 0.002
"""A camera this near [m] to the vertical through the workspace's middle is over it."""
USUAL_SCALE = (600.0, 1000.0)
"""Pixels per metre on the table that detection is made for; other images are resampled."""
COARSE = 350.0
"""Fewer pixels per metre do not show utensils."""
GLARE_AREA = 0.0004
"""Saturated colour without depth on more than this [m^2] hides what is there."""
HOLE_AREA = 0.002
"""Area of a hole in the depth [m^2] from which on it is reported; it has to be 14 mm wide at least."""


@dataclass(frozen=True)
class Sight:
    """What was seen. World frame [m, rad]: that of the camera's pose where one was given, else the middle of the
    workspace with x along its longer side."""

    detections: tuple[Detection, ...]
    notes: tuple[str, ...]
    """What was not handled, one line each."""
    camera: Camera
    world_from_camera: np.ndarray
    """(4, 4) of the image as it was given."""
    plane: tuple[tuple[float, float, float], float]
    """Normal (towards the camera) and offset [m] of the table in the camera's frame: n.p + d = 0."""
    sides: tuple[float, float]
    """Of the workspace along x and y [m]."""
    rectified: bool
    heights: HeightMap
    """The view from above in which was looked."""
    sizes: DishSizes = STANDARD
    """Of what was looked for."""
    estimated: bool = False
    """Sizes were estimated: each detection has its own."""

    @property
    def statement(self) -> str:
        """In one line what is there, what is in doubt, and what was not handled."""
        return "; ".join([statement(self.detections), *self.notes])


def see_image(
    color: np.ndarray,
    depth: np.ndarray,
    camera: OverheadCamera | Camera,
    sides: tuple[float, float] = TABLE_SIDES,
    *,
    sizes: Sizes = "known",
    dishes: DishSizes = STANDARD,
) -> tuple[Detection, ...]:
    """Return the items that an RGB-D image shows; what carries another comes before it. Arguments and errors are those
    of `see`, which also says what was not handled."""
    return see(color, depth, camera, sides, sizes=sizes, dishes=dishes).detections


def see(
    color: np.ndarray,
    depth: np.ndarray | None,
    camera: OverheadCamera | Camera,
    sides: tuple[float, float] = TABLE_SIDES,
    *,
    sizes: Sizes = "known",
    dishes: DishSizes = STANDARD,
    seed: int = 0,
) -> Sight:
    """Return what an RGB-D image shows of a table.

    `color` (H, W, 3) uint8, `depth` (H, W) z-depth [m], 0 or NaN where unknown. `camera` with its pose over the middle
    of a workspace of `sides` [m], or intrinsics alone: then the table and the workspace are found, and the world is
    theirs. `sizes`: dishes of known sizes, which `dishes` hold, or of any, estimated. Raises BadInput in one line for
    an image that cannot be used.
    """
    intrinsics = camera if isinstance(camera, Camera) else camera.camera
    _check(color, depth, intrinsics)
    assert depth is not None
    depth, notes = _finite(depth)
    some = depth[::4, ::4]
    middle = float(np.median(some[some > 0.0])) if (some > 0.0).any() else 0.0
    if middle > MILLIMETRES:
        raise BadInput(
            f"the median depth is {middle:.4g}: that is not a table in metres",
            hint="give the file's scale: --depth-scale 0.001 where it is in mm",
        )
    pose = None if isinstance(camera, Camera) else np.asarray(camera.world_from_camera, dtype=float)
    if pose is not None and _is_usual(intrinsics, pose):
        view, world = OverheadCamera(intrinsics, pose), pose
        normal, offset, rectified = pose[2, :3], float(pose[2, 3]), False
    else:
        up = None if pose is None else pose[2, :3]
        normal, offset = table_plane(depth, intrinsics, seed, up)
        if pose is not None:
            _check_pose(pose, normal, offset)
        rectified_view = rectify(color, depth, intrinsics, (normal, offset), pose, None if pose is None else sides)
        color, depth, view, sides = (
            rectified_view.color,
            rectified_view.depth,
            rectified_view.view,
            rectified_view.sides,
        )
        world, rectified = rectified_view.world_from_camera, True
        notes += [
            "the view was rectified to the table's plane: what others hide from the camera is not seen",
            *rectified_view.notes,
        ]
        if min(intrinsics.fx, intrinsics.fy) / max(middle, 0.1) < COARSE:
            notes.append(f"{intrinsics.fx / max(middle, 0.1):.0f} pixels per metre are too few to see utensils")
    heights = height_map(color, depth, view, sides)
    if rectified:
        heights = replace(heights, roughness=heights.measured_roughness())
    if sizes == "known":
        detections = items_in(heights, dishes)
    else:
        detections = estimated_dishes(heights, seed)
        notes.append("sizes are estimated: utensils and what stacks hold were not looked for")
    if rectified and -normal[2] < np.cos(OBLIQUE):
        detections = seen_from_the_side(detections)
    notes += _unseen_notes(heights)
    plane = ((float(normal[0]), float(normal[1]), float(normal[2])), float(offset))
    return Sight(
        detections, tuple(notes), intrinsics, world, plane, sides, rectified, heights, dishes, sizes == "estimated"
    )


def _check(color: np.ndarray, depth: np.ndarray | None, camera: Camera) -> None:
    shape = (camera.height, camera.width)
    if depth is None:
        raise BadInput(
            "there is no depth image", hint="detection needs RGB-D; --photograph finds outlines in colour alone"
        )
    check_color(color, shape)
    if camera.width < LEAST_SIZE[0] or camera.height < LEAST_SIZE[1]:
        raise BadInput(
            f"an image of {camera.width} x {camera.height} pixels is too small to see tableware in",
            hint=f"at least {LEAST_SIZE[0]} x {LEAST_SIZE[1]}",
        )
    check_depth(depth, shape)
    if min(camera.fx, camera.fy) <= 0.0:
        raise BadInput(
            f"the camera's focal lengths are {camera.fx:g}, {camera.fy:g}", hint="they are positive, in pixels"
        )


def _finite(depth: np.ndarray) -> tuple[np.ndarray, list[str]]:
    """Return depth with 0 where it is no positive number, and a note when there was any such."""
    least = float(depth.min())
    if least >= 0.0 and np.isfinite(float(depth.max())):  # NaN is neither
        return np.asarray(depth, dtype=np.float32), []
    good = np.isfinite(depth) & (depth >= 0.0)
    share = 1.0 - float(good.mean())
    if share > 0.999:
        raise BadInput("the depth image holds no numbers", hint="use 0 where there is no depth")
    text = f"{share:.1%} of the depth image are no positive numbers and count as unknown"
    return np.where(good, depth, 0.0).astype(np.float32), [text]


def _is_usual(camera: Camera, pose: np.ndarray) -> bool:
    """Whether a view is level, over the middle, turned as detection expects, and of its scale."""
    turned = np.allclose(pose[:3, :3], np.diag([1.0, -1.0, -1.0]), atol=0.02) and pose[2, 2] < -LEVEL
    return (
        bool(turned)
        and float(np.abs(pose[:2, 3]).max()) < OVER_MIDDLE
        and USUAL_SCALE[0] < camera.fx / max(float(pose[2, 3]), 1e-3) < USUAL_SCALE[1]
    )


def _check_pose(pose: np.ndarray, normal: np.ndarray, offset: float) -> None:
    """Raise BadInput where the plane that is seen is not the table that the pose says."""
    angle = float(np.rad2deg(np.arccos(np.clip(normal @ pose[2, :3], -1.0, 1.0))))
    if angle > 5.0 or abs(offset - float(pose[2, 3])) > 0.05:
        raise BadInput(
            f"the table is seen {offset:.3f} m away where the pose says {float(pose[2, 3]):.3f} m, "
            f"{angle:.1f} degrees off it",
            hint="correct the pose, or leave it out",
        )


def seen_from_the_side(detections: tuple[Detection, ...]) -> tuple[Detection, ...]:
    """Return the detections of an oblique view with less trust, as confidences are calibrated from above.

    What belongs to a stack gets none: lower rims are hidden, so that a tall mug is two cups, a can in a bowl a cup.
    """
    carrying = {detection.on for detection in detections if detection.kind in DISHES}
    trusted = []
    for index, detection in enumerate(detections):
        if detection.kind is None:
            trusted.append(detection)
            continue
        stacked = index in carrying or (detection.kind in DISHES and detection.on is not None)
        reasons = (OBLIQUE_VIEW, "a stack seen from the side") if stacked else (OBLIQUE_VIEW,)
        trust = 0.0 if stacked else OBLIQUE_TRUST
        trusted.append(
            replace(detection, confidence=trust * detection.confidence, unsure=(*detection.unsure, *reasons))
        )
    return tuple(trusted)


def _unseen_notes(heights: HeightMap) -> list[str]:
    """Return what of the workspace could not be looked at."""
    inside = heights.workspace()[::2, ::2]
    area = 4.0 / float(heights.scale(0.0)) ** 2
    notes = []
    blind = inside & ~heights.valid[::2, ::2] & ~heights.tall[::2, ::2]
    white = cv2.inRange(np.ascontiguousarray(heights.color[::2, ::2]), (253, 253, 253), (255, 255, 255))
    glare = cv2.morphologyEx((white & blind).astype(np.uint8), cv2.MORPH_CLOSE, np.ones((5, 5), np.uint8))
    lost = float(np.count_nonzero(cv2.morphologyEx(glare, cv2.MORPH_OPEN, np.ones((3, 3), np.uint8)))) * area
    if lost > GLARE_AREA:
        notes.append(
            f"glare: {1e4 * lost:.0f} cm2 of the workspace are full white without depth, what is there was not seen"
        )
    solid = cv2.morphologyEx(blind.astype(np.uint8), cv2.MORPH_OPEN, np.ones((9, 9), np.uint8))
    hole = float(np.count_nonzero(solid)) * area
    if hole > HOLE_AREA:
        notes.append(f"{1e4 * hole:.0f} cm2 of the workspace have no depth, what is there was not seen")
    return notes
