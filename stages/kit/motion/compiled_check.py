"""Is a configuration free? Compiled; says yes only where the mesh checker does.

Three floors, each a lower bound of the one below: a ball around a link against boxes, the link's balls against boxes,
and the distance of the convex hulls themselves (the mesh checker sees hulls too). What the last floor refuses by less
than UNSURE may be free for the mesh checker.
"""

from __future__ import annotations

import numpy as np
from scenewright.stages.kit.compiled import compiled
from scenewright.stages.kit.motion.compiled_arrays import (
    ARM,
    BASE_X,
    BASE_Y,
    BASE_YAW,
    RADIUS,
    RESTING,
    SKIP,
    RobotArrays,
    SceneArrays,
)
from scenewright.stages.kit.motion.convex_distance import Hull, convex_distance

FREE, UNCERTAIN, HIT = 0, 1, 2
"""Answers of a check: no collision, not certain, a collision."""
UNSURE = 0.004
"""Refusals nearer than this [m] to being free are not certain."""


@compiled(error_model="numpy")
def link_frames(chain: np.ndarray, mount_height: float, body: np.ndarray, frames: np.ndarray) -> None:
    """Write world_from_frame (J + 1, 3, 4) for base x, y, yaw and joint values (3 + J,).

    `chain` (J, 4, 4) and `mount_height` [m] are `fixed` and `mount_height` of RobotArrays.
    """
    cosine, sine = np.cos(body[BASE_YAW]), np.sin(body[BASE_YAW])
    frames[0] = 0.0
    frames[0, 0, 0], frames[0, 0, 1] = cosine, -sine
    frames[0, 1, 0], frames[0, 1, 1] = sine, cosine
    frames[0, 2, 2] = 1.0
    frames[0, 0, 3], frames[0, 1, 3], frames[0, 2, 3] = body[BASE_X], body[BASE_Y], mount_height
    for joint in range(chain.shape[0]):
        parent, fixed, child = frames[joint], chain[joint], frames[joint + 1]
        cosine, sine = np.cos(body[ARM + joint]), np.sin(body[ARM + joint])
        for row in range(3):
            x = parent[row, 0] * fixed[0, 0] + parent[row, 1] * fixed[1, 0] + parent[row, 2] * fixed[2, 0]
            y = parent[row, 0] * fixed[0, 1] + parent[row, 1] * fixed[1, 1] + parent[row, 2] * fixed[2, 1]
            z = parent[row, 0] * fixed[0, 2] + parent[row, 1] * fixed[1, 2] + parent[row, 2] * fixed[2, 2]
            child[row, 0] = x * cosine + y * sine
            child[row, 1] = y * cosine - x * sine
            child[row, 2] = z
            child[row, 3] = (
                parent[row, 0] * fixed[0, 3]
                + parent[row, 1] * fixed[1, 3]
                + parent[row, 2] * fixed[2, 3]
                + parent[row, 3]
            )


@compiled(error_model="numpy", inline="always")
def _place(pose: np.ndarray, ball: np.ndarray, out: np.ndarray) -> None:
    for row in range(3):
        out[row] = pose[row, 0] * ball[0] + pose[row, 1] * ball[1] + pose[row, 2] * ball[2] + pose[row, 3]


@compiled(error_model="numpy", inline="always")
def _square_to_box(point: np.ndarray, box: np.ndarray, half: np.ndarray) -> float:
    """Return the squared distance of a point (3,) from a box given by box_from_world (3, 4) and half sides."""
    total = 0.0
    for axis in range(3):
        value = abs(box[axis, 0] * point[0] + box[axis, 1] * point[1] + box[axis, 2] * point[2] + box[axis, 3])
        value -= half[axis]
        if value > 0.0:
            total += value * value
    return total


@compiled(error_model="numpy", inline="always")
def _hull(robot: RobotArrays, frames: np.ndarray, piece: int) -> Hull:
    return Hull(robot.vertices, robot.vertex_begin[piece], robot.vertex_begin[piece + 1], frames[robot.frame[piece]])


@compiled(error_model="numpy")
def _piece_meets(
    robot: RobotArrays, scene: SceneArrays, frames: np.ndarray, piece: int, obstacle: int, centers: np.ndarray
) -> int:
    """Return FREE, UNCERTAIN or HIT for a piece of the robot and one of the scene."""
    balls_near = False
    for ball in range(robot.sphere_begin[piece], robot.sphere_begin[piece + 1]):
        reach = robot.spheres[ball, RADIUS] + scene.distance
        if _square_to_box(centers[ball], scene.box[obstacle], scene.half[obstacle]) < reach * reach:
            balls_near = True
            break
    if not balls_near:
        return FREE
    standing = Hull(
        scene.vertices, scene.vertex_begin[obstacle], scene.vertex_begin[obstacle + 1], scene.pose[obstacle]
    )
    lower, upper = convex_distance(_hull(robot, frames, piece), standing, scene.distance, scene.distance - UNSURE)
    if lower > scene.distance:
        return FREE
    return UNCERTAIN if upper >= scene.distance - UNSURE else HIT


@compiled(error_model="numpy")
def _pieces_meet(robot: RobotArrays, frames: np.ndarray, pair: int, centers: np.ndarray) -> int:
    """Return FREE, UNCERTAIN or HIT for two pieces of the robot."""
    first, second = robot.pairs[pair, 0], robot.pairs[pair, 1]
    apart = robot.pair_distance[pair]
    balls_near = False
    for i in range(robot.sphere_begin[first], robot.sphere_begin[first + 1]):
        for j in range(robot.sphere_begin[second], robot.sphere_begin[second + 1]):
            reach = robot.spheres[i, RADIUS] + robot.spheres[j, RADIUS] + apart
            x = centers[i, 0] - centers[j, 0]
            y = centers[i, 1] - centers[j, 1]
            z = centers[i, 2] - centers[j, 2]
            balls_near = balls_near or x * x + y * y + z * z < reach * reach
        if balls_near:
            break
    if not balls_near:
        return FREE
    lower, upper = convex_distance(_hull(robot, frames, first), _hull(robot, frames, second), apart, apart - UNSURE)
    if lower > apart:
        return FREE
    return UNCERTAIN if upper >= apart - UNSURE else HIT


@compiled(error_model="numpy")
def find_collision(robot: RobotArrays, scene: SceneArrays, body: np.ndarray, first_frame: int) -> tuple[int, int, int]:
    """Return FREE, UNCERTAIN or HIT of a configuration (3 + J,), the part, and the other: the first that is not free.

    The other is the index of a scene group, or -1 - part of another part of the robot. Pieces on frames before
    `first_frame` are not compared with the scene (they do not move in this query).
    """
    frames = np.empty((robot.fixed.shape[0] + 1, 3, 4))
    link_frames(robot.fixed, robot.mount_height, body, frames)
    count = robot.frame.shape[0]
    middles = np.empty((count, 3))
    centers = np.empty((robot.spheres.shape[0], 3))
    for piece in range(count):
        pose = frames[robot.frame[piece]]
        _place(pose, robot.bound[piece], middles[piece])
        for ball in range(robot.sphere_begin[piece], robot.sphere_begin[piece + 1]):
            _place(pose, robot.spheres[ball], centers[ball])
    uncertain_part, uncertain_other = -1, 0
    for pair in range(robot.pairs.shape[0]):
        first, second = robot.pairs[pair, 0], robot.pairs[pair, 1]
        reach = robot.bound[first, RADIUS] + robot.bound[second, RADIUS] + robot.pair_distance[pair]
        x = middles[first, 0] - middles[second, 0]
        y = middles[first, 1] - middles[second, 1]
        z = middles[first, 2] - middles[second, 2]
        if x * x + y * y + z * z < reach * reach:
            state = _pieces_meet(robot, frames, pair, centers)
            if state == HIT:
                return HIT, robot.part[first], -1 - robot.part[second]
            if state == UNCERTAIN:
                uncertain_part, uncertain_other = robot.part[first], -1 - robot.part[second]
    for piece in range(count - 1, -1, -1):
        if robot.frame[piece] < first_frame:
            continue
        part = robot.part[piece]
        reach = robot.bound[piece, RADIUS] + scene.distance
        middle = middles[piece]
        for group in range(scene.low.shape[0]):
            allowed = scene.allowed[part, group]
            if allowed == SKIP:
                continue
            apart = False
            for axis in range(3):
                if middle[axis] + reach < scene.low[group, axis] or middle[axis] - reach > scene.high[group, axis]:
                    apart = True
                    break
            if apart:
                continue
            for obstacle in range(scene.piece_begin[group], scene.piece_begin[group + 1]):
                if _square_to_box(middle, scene.box[obstacle], scene.half[obstacle]) > reach * reach:
                    continue
                state = _piece_meets(robot, scene, frames, piece, obstacle, centers)
                if state == HIT and allowed != RESTING:
                    return HIT, part, group
                if state != FREE:
                    uncertain_part, uncertain_other = part, group
    if uncertain_part >= 0:
        return UNCERTAIN, uncertain_part, uncertain_other
    return FREE, -1, 0
