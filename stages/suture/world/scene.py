"""Random scenes of the needle world: where the needle is, who holds it, how the thread lies, what light there is.

World frame [m]: the wound runs along x, away from the cameras; y to the cameras' left; z up; the pad's plane is z = 0.
The cameras look from -x and above, so that a needle which crosses the wound shows them its plane. Everything of a
scene follows from its seed. Seeds below 500 are for tuning, from 1000 for reporting.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scenewright.stages.kit.geometry.transforms import apply, inverse, transform_from
from scenewright.stages.suture.rig import ENDOSCOPE, NEEDLE_RADIUS, TWO_CAMERAS, NeedlePose, StereoRig
from scenewright.stages.suture.world.pad import RIDGE_HEIGHT, ROUNDED, Ridge
from scenewright.stages.suture.world.thread import THREAD_RADIUS, loose_thread
from scenewright.stages.suture.world.tubes import (
    LEFT_DRIVER,
    RIGHT_DRIVER,
    THREAD,
    USUAL_NEEDLE,
    NeedleShape,
    Tubes,
    chain,
    driver_tube,
    joined,
    needle_tube,
)
from scipy.spatial.transform import Rotation

HOLDERS = ("air", "left", "right", "both", "tissue")
PLACES = {
    "wound": ((-0.020, 0.020), (-0.012, 0.020), (0.022, 0.032)),
    "left": ((-0.055, -0.030), (-0.020, 0.025), (0.025, 0.050)),
    "right": ((0.030, 0.055), (-0.020, 0.025), (0.025, 0.050)),
    "high": ((-0.025, 0.025), (-0.020, 0.025), (0.050, 0.080)),
    "corner": ((0.045, 0.065), (0.035, 0.060), (0.020, 0.030)),
}
"""Boxes of the needle's centre: (right, back, up) as the cameras see the workspace [m]. `corner` is the lower, back,
right one to which the thesis takes the needle to measure it, farthest from the cameras."""


@dataclass(frozen=True)
class Light:
    """What makes one picture bright or dull: lamps (L, 4; world place [m], strength), exposure, blur, noise."""

    lamps: np.ndarray
    room_turn: float
    exposure: float
    gain_noise: float
    read_noise: float
    blur: float
    pad_colour: np.ndarray
    salt: int


@dataclass(frozen=True)
class NeedleScene:
    """One scene: `pose` and nothing else is what an estimator must find.

    `thread` (N, 3) [m] is the thread's true centre line from the swage on, and `crossing` a piece of another thread
    or None, both in the world; `grips` maps a driver's body to (grip (3,), approach (3,), across (3,), half opening)
    in the world. `right_eye_turn` (3,) is the rotation vector [rad] by which the right camera differs from what its
    calibration says.
    """

    seed: int
    rig: StereoRig
    camera_from_world: np.ndarray
    pose: NeedlePose
    thread: np.ndarray
    crossing: np.ndarray | None
    grips: dict[int, tuple[np.ndarray, np.ndarray, np.ndarray, float]]
    light: Light
    right_eye_turn: np.ndarray
    holder: str
    place: str
    without_needle: bool = False
    """Everything but the needle; `pose` is where it would be."""
    shape: NeedleShape = USUAL_NEEDLE
    ridge: Ridge = ROUNDED

    def tubes(self) -> Tubes:
        """Return every tube of the scene in the left camera's frame."""
        chains = [chain(self.thread, np.full(len(self.thread), THREAD_RADIUS), THREAD)]
        if self.crossing is not None:
            chains.append(chain(self.crossing, np.full(len(self.crossing), THREAD_RADIUS), THREAD))
        for body, (grip, approach, across, opening) in self.grips.items():
            chains.append(driver_tube(grip, approach, across, opening, body))
        others = joined(chains).moved(self.camera_from_world)
        return others if self.without_needle else joined([needle_tube(self.pose, shape=self.shape), others])


def camera_place(rig: StereoRig, random: np.random.Generator) -> np.ndarray:
    """Return camera_from_world (4, 4) of the left camera: the pair looks at the workspace's middle."""
    distance = random.uniform(0.35, 0.38) if rig.baseline > 0.02 else random.uniform(0.125, 0.14)
    elevation = np.radians(random.uniform(45.0, 60.0))
    heading = np.radians(random.uniform(-8.0, 8.0))
    backward = np.array([-np.cos(elevation) * np.cos(heading), np.cos(elevation) * np.sin(heading), np.sin(elevation)])
    forward = -backward
    right = np.cross(forward, [0.0, 0.0, 1.0])
    right /= np.linalg.norm(right)
    rotation = np.stack([right, np.cross(forward, right), forward], axis=1)
    middle = np.array([0.004, 0.0, 0.025]) * (1.0 if rig.baseline > 0.02 else 0.5)
    return inverse(transform_from(rotation, middle + distance * backward - right * rig.baseline / 2.0))


def _needle_in_world(holder: str, place: str, size: float, random: np.random.Generator) -> np.ndarray:
    """Return world_from_needle (4, 4) for the place's box, scaled by `size`; above the pad, or through the wound."""
    if holder == "tissue":
        normal_turn = Rotation.from_euler("zy", random.uniform([-45.0, -25.0], [45.0, 25.0]), degrees=True)
        facing = random.choice([-1.0, 1.0])
        normal = normal_turn.apply([facing, 0.0, 0.0])
        down = np.array([0.0, 0.0, -1.0]) - normal * -normal[2]
        down /= np.linalg.norm(down)
        sideways = np.cross(normal, down)
        # the middle of the arc points down into the ridge, give or take half a quarter turn of the throw
        middle = np.radians(random.uniform(-40.0, 40.0))
        y_axis = np.cos(middle) * down + np.sin(middle) * sideways
        rotation = np.stack([np.cross(y_axis, normal), y_axis, normal], axis=1)
        along = random.uniform(-0.030, 0.030) * size
        lift = RIDGE_HEIGHT + random.uniform(0.001, 0.006)
        return transform_from(rotation, np.array([along, random.uniform(-0.002, 0.002), lift]))
    low, high = np.array(PLACES[place]).T
    while True:
        right, back, up = (random.uniform(low, high) * size).tolist()
        rotation = Rotation.random(random_state=random).as_matrix()
        pose = NeedlePose(transform_from(rotation, np.array([back, -right, max(up, 0.014)])))
        if np.min(pose.points(np.linspace(0.0, np.pi, 25))[:, 2]) > RIDGE_HEIGHT + 0.002:
            return pose.camera_from_needle


def _grip(
    pose: NeedlePose, angle: float, body: int, size: float, random: np.random.Generator
) -> tuple[np.ndarray, np.ndarray, np.ndarray, float]:
    """Return a driver's grip (grip, approach, across, half opening) on the needle at arc `angle` [rad]."""
    grip = pose.points(np.array([angle]))[0]
    tangent = pose.points(np.array([angle + 0.01]))[0] - grip
    tangent /= np.linalg.norm(tangent)
    best, approach = 2.0, np.array([0.0, 0.0, -1.0])
    for _ in range(12):
        candidate = _approach(grip, body, size, random)
        if abs(candidate @ tangent) < best:
            best, approach = abs(float(candidate @ tangent)), candidate
    return grip, approach, np.cross(approach, tangent), random.uniform(0.02, 0.06)


def _approach(grip: np.ndarray, body: int, size: float, random: np.random.Generator) -> np.ndarray:
    """Return the unit direction from a driver's port (above, to its side) to the grip, with the wrist's freedom."""
    side = 1.0 if body == LEFT_DRIVER else -1.0
    port = np.array([random.uniform(-0.02, 0.12), side * random.uniform(0.07, 0.16), random.uniform(0.09, 0.18)])
    direction = grip - port * (0.6 + 0.4 * size)
    direction /= np.linalg.norm(direction)
    return direction


def _light(rig: StereoRig, camera_from_world: np.ndarray, random: np.random.Generator) -> Light:
    """Return lamps that change from scene to scene; an endoscope carries its own beside the lens."""
    eye = inverse(camera_from_world)[:3, 3]
    lamps = []
    for _ in range(int(random.integers(1, 4))):
        lamp_position = np.array([random.uniform(-0.5, 0.4), random.uniform(-0.5, 0.5), random.uniform(0.35, 0.8)])
        lamps.append([*lamp_position, random.uniform(0.3, 1.0)])
    if rig.baseline < 0.02:
        lamps.append([*(eye + [0.0, 0.004, 0.004]), random.uniform(0.6, 1.2)])
    lamps_array = np.array(lamps)
    lamps_array[:, 3] *= random.uniform(0.6, 1.3) / lamps_array[:, 3].sum()
    pad_colour = np.array([0.62, 0.42, 0.33]) * random.uniform(0.8, 1.15, 3)
    return Light(
        lamps=lamps_array,
        room_turn=random.uniform(0.0, 2 * np.pi),
        exposure=random.uniform(0.75, 1.25),
        gain_noise=random.uniform(0.0002, 0.0008),
        read_noise=random.uniform(0.002, 0.008),
        blur=random.uniform(0.45, 1.1),
        pad_colour=pad_colour,
        salt=int(random.integers(1, 1_000_000)),
    )


def make_scene(
    seed: int,
    rig: StereoRig = TWO_CAMERAS,
    holder: str | None = None,
    place: str | None = None,
    calibration_error: float = 0.0,
    attempt: int = 0,
) -> NeedleScene:
    """Return the scene of `seed`. `holder` (one of HOLDERS) and `place` (of PLACES) are drawn where not given.

    `calibration_error` [px] is the standard deviation of the right image's shift along rows, along columns, and, 300
    px from the image's centre, of its turn. `attempt` draws another scene of the same seed.
    """
    random = np.random.default_rng([8, seed, attempt])
    drawn_holder, drawn_place = str(random.choice(HOLDERS)), str(random.choice(list(PLACES)))
    holder, place = holder or drawn_holder, place or drawn_place
    if holder == "tissue":
        place = "wound"
    size = 1.0 if rig is not ENDOSCOPE else 0.5
    camera_from_world = camera_place(rig, random)
    world_pose = NeedlePose(_needle_in_world(holder, place, size, random))
    grips = _grips(world_pose, holder, size, random)
    crossing = None
    if random.random() < 0.35:
        over = world_pose.points(np.array([random.uniform(0.3, 2.8)]))[0]
        eye = inverse(camera_from_world)[:3, 3]
        towards = (eye - over) / np.linalg.norm(eye - over)
        start = over + towards * random.uniform(0.002, 0.008) + random.normal(0.0, 0.012, 3)
        crossing = loose_thread(start, over + towards * 0.003 - start, 0.06, random, loops=0.3)
    swage = world_pose.swage
    tangent = swage - world_pose.points(np.array([np.pi - 0.02]))[0]
    thread = loose_thread(swage, tangent, random.uniform(0.10, 0.40), random, loops=random.uniform(0.2, 1.0))
    light = _light(rig, camera_from_world, random)
    pixel = calibration_error / rig.focal
    right_eye_turn = random.normal(size=3) * np.array([pixel, pixel, calibration_error / 300.0])
    return NeedleScene(
        seed=seed,
        rig=rig,
        camera_from_world=camera_from_world,
        pose=NeedlePose(camera_from_world @ world_pose.camera_from_needle),
        thread=thread,
        crossing=crossing,
        grips=grips,
        light=light,
        right_eye_turn=right_eye_turn,
        holder=holder,
        place=place,
    )


def _grips(
    pose: NeedlePose, holder: str, size: float, random: np.random.Generator
) -> dict[int, tuple[np.ndarray, np.ndarray, np.ndarray, float]]:
    """Return both drivers: those that hold the needle grip it, the others wait open beside it."""
    right_angle, left_angle = random.uniform(1.8, 2.9), random.uniform(0.25, 1.4)
    holds_right = holder in ("right", "both") or (holder == "tissue" and random.random() < 0.4)
    holds_left = holder in ("left", "both") or (holder == "tissue" and not holds_right and random.random() < 0.4)
    grips = {}
    for body, holds, angle, side in (
        (LEFT_DRIVER, holds_left, left_angle, 1.0),
        (RIGHT_DRIVER, holds_right, right_angle, -1.0),
    ):
        if holds:
            grips[body] = _grip(pose, angle, body, size, random)
            continue
        away = np.array([random.uniform(-0.01, 0.03), side * random.uniform(0.012, 0.045), random.uniform(0.0, 0.025)])
        grip = pose.centre + away
        grip[2] = max(grip[2], 0.012)
        approach = _approach(grip, body, size, random)
        grips[body] = (grip, approach, random.normal(size=3), random.uniform(0.05, 0.45))
    return grips


def moved_scene(scene: NeedleScene, world_motion: np.ndarray, frame: int) -> NeedleScene:
    """Return the scene after the needle, and whoever holds it, moved by `world_motion` (4, 4) in the world.

    The thread's beginning follows the swage and its far part stays; lamps stay and the sensor's noise is new.
    """
    world_from_camera = inverse(scene.camera_from_world)
    old_pose = NeedlePose(world_from_camera @ scene.pose.camera_from_needle)
    new_pose = NeedlePose(world_motion @ old_pose.camera_from_needle)
    along = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(scene.thread, axis=0), axis=1))])
    thread = scene.thread + np.exp(-along / 0.03)[:, None] * (new_pose.swage - old_pose.swage)
    grips = {}
    for body, (grip, approach, across, opening) in scene.grips.items():
        if np.min(np.linalg.norm(old_pose.points(np.linspace(0, np.pi, 90)) - grip, axis=1)) < NEEDLE_RADIUS * 0.05:
            turn = world_motion[:3, :3]
            grips[body] = (apply(world_motion, grip[None])[0], turn @ approach, turn @ across, opening)
        else:
            grips[body] = (grip, approach, across, opening)
    return replace(
        scene,
        seed=scene.seed * 1000 + frame,
        pose=NeedlePose(scene.camera_from_world @ new_pose.camera_from_needle),
        thread=thread,
        grips=grips,
    )


def random_motions(scene: NeedleScene, frames: int) -> list[np.ndarray]:
    """Return world motions (4, 4) from the first frame to each of `frames` frames; the first is the identity.

    A free needle is carried by up to 3 mm and 6 degrees a frame; one in the tissue turns along its own arc.
    """
    random = np.random.default_rng([88, scene.seed])
    pose = inverse(scene.camera_from_world) @ scene.pose.camera_from_needle
    motions, motion = [np.eye(4)], np.eye(4)
    drift, axis = random.normal(0.0, 0.0012, 3), random.normal(size=3)
    axis /= np.linalg.norm(axis)
    for _ in range(frames - 1):
        pose_in_world = motion @ pose
        if scene.holder == "tissue":
            turn = Rotation.from_rotvec(pose_in_world[:3, 2] * np.radians(random.uniform(0.5, 2.0))).as_matrix()
            shift = np.zeros(3)
        else:
            turn = Rotation.from_rotvec(axis * np.radians(random.uniform(1.0, 5.0))).as_matrix()
            shift = drift + random.normal(0.0, 0.0005, 3)
        step = transform_from(turn, pose_in_world[:3, 3] - turn @ pose_in_world[:3, 3] + shift)
        motion = step @ motion
        motions.append(motion)
    return motions
