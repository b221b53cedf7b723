"""Draw tubes and the wound pad into one eye, with sub-pixels; compiled.

Each tube's cone is drawn into a sub-pixel depth buffer by the closest approach between the sub-pixel's ray and the
cone's axis: exact for thin cones, whatever their width in pixels. Shading follows the hit's normal, the line of sight
and the lights, so that highlights on steel lie at different places of the needle in the two eyes.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scenewright.stages.kit.compiled import compiled
from scenewright.stages.suture.world.pad import FLAT_FROM, Ridge, height, texture
from scenewright.stages.suture.world.tubes import LEFT_DRIVER, NEEDLE, THREAD

SUBPIXELS = 3
"""Sub-pixels a side."""


class Cones(NamedTuple):
    """Starts and ends (N, 3) [m] of cones in the camera's frame, their radii there (N,) [m], the body (N,) of each."""

    starts: np.ndarray
    ends: np.ndarray
    start_radii: np.ndarray
    end_radii: np.ndarray
    bodies: np.ndarray


class View(NamedTuple):
    """A camera: focal length and principal point [px]; `rotation` (3, 3) turns its directions into the world, where it
    stands at `place` (3,) [m] over a pad with this `ridge`."""

    focal: float
    centre_x: float
    centre_y: float
    rotation: np.ndarray
    place: np.ndarray
    ridge: Ridge


class Lighting(NamedTuple):
    """Lamps (L, 4): place [m] and strength; how the room is turned [rad]; the pad's texture and colour (3,); `shadow`
    (S, S) in 0..1 darkens the pad at world (x, y) = origin + index / scale."""

    lamps: np.ndarray
    turn: float
    salt: int
    pad_colour: np.ndarray
    shadow: np.ndarray
    shadow_origin: float
    shadow_scale: float


@compiled(fastmath=True)
def _hit_depth(
    ray_x: float, ray_y: float, start: np.ndarray, axis: np.ndarray, start_radius: float, end_radius: float
) -> tuple[float, float]:
    """Return the depth z of the hit of the ray (ray_x, ray_y, 1) and the place 0..1 on the axis; depth 0 if none."""
    ray_squared = ray_x * ray_x + ray_y * ray_y + 1.0
    axis_squared = axis[0] * axis[0] + axis[1] * axis[1] + axis[2] * axis[2]
    ray_axis = ray_x * axis[0] + ray_y * axis[1] + axis[2]
    ray_start = ray_x * start[0] + ray_y * start[1] + start[2]
    axis_start = axis[0] * start[0] + axis[1] * start[1] + axis[2] * start[2]
    determinant = ray_squared * axis_squared - ray_axis * ray_axis
    along = 0.5
    if determinant > 1e-9 * ray_squared * axis_squared:
        along = (ray_start * ray_axis - axis_start * ray_squared) / determinant
    along = min(max(along, 0.0), 1.0)
    near_x, near_y = start[0] + along * axis[0], start[1] + along * axis[1]
    near_z = start[2] + along * axis[2]
    depth = (near_x * ray_x + near_y * ray_y + near_z) / ray_squared
    gap_x, gap_y, gap_z = near_x - depth * ray_x, near_y - depth * ray_y, near_z - depth
    gap_squared = gap_x * gap_x + gap_y * gap_y + gap_z * gap_z
    radius = start_radius + along * (end_radius - start_radius)
    inside = radius * radius - gap_squared
    if inside <= 0.0 or depth <= 0.0:
        return 0.0, along
    sine = np.sqrt(max(determinant / (ray_squared * axis_squared), 0.09))
    return depth - np.sqrt(inside / ray_squared) / sine, along


@compiled(fastmath=True)
def draw(cones: Cones, view: View, depth: np.ndarray, cone: np.ndarray) -> tuple[int, int, int, int]:
    """Fill the sub-pixel buffers `depth` (0: nothing) and `cone` (index of the tube's cone, -1: nothing).

    Both are (H * SUBPIXELS, W * SUBPIXELS). Returns the box (first row, end row, first column, end column) of pixels
    that were touched.
    """
    starts, ends, start_radii, end_radii = cones.starts, cones.ends, cones.start_radii, cones.end_radii
    focal, centre_x, centre_y = view.focal, view.centre_x, view.centre_y
    rows, columns = depth.shape
    box = [rows, 0, columns, 0]
    half = (SUBPIXELS - 1) / 2.0
    for index in range(len(starts)):
        start, end = starts[index], ends[index]
        if start[2] < 0.02 or end[2] < 0.02:
            continue
        radius = max(start_radii[index], end_radii[index])
        reach = focal * radius / min(start[2], end[2]) * 1.2 + 1.0
        u0, v0 = focal * start[0] / start[2] + centre_x, focal * start[1] / start[2] + centre_y
        u1, v1 = focal * end[0] / end[2] + centre_x, focal * end[1] / end[2] + centre_y
        first_column = max(int((min(u0, u1) - reach) * SUBPIXELS), 0)
        end_column = min(int((max(u0, u1) + reach) * SUBPIXELS) + 2, columns)
        first_row = max(int((min(v0, v1) - reach) * SUBPIXELS), 0)
        end_row = min(int((max(v0, v1) + reach) * SUBPIXELS) + 2, rows)
        if first_row >= end_row or first_column >= end_column:
            continue
        box[0], box[1] = min(box[0], first_row), max(box[1], end_row)
        box[2], box[3] = min(box[2], first_column), max(box[3], end_column)
        axis = end - start
        for row in range(first_row, end_row):
            ray_y = ((row - half) / SUBPIXELS - centre_y) / focal
            for column in range(first_column, end_column):
                ray_x = ((column - half) / SUBPIXELS - centre_x) / focal
                nearest, _ = _hit_depth(ray_x, ray_y, start, axis, start_radii[index], end_radii[index])
                if nearest > 0.0 and (cone[row, column] < 0 or nearest < depth[row, column]):
                    depth[row, column] = nearest
                    cone[row, column] = index
    return box[0] // SUBPIXELS, -(-box[1] // SUBPIXELS), box[2] // SUBPIXELS, -(-box[3] // SUBPIXELS)


@compiled(fastmath=True)
def pad_depth(ray_x: float, ray_y: float, view: View) -> tuple[float, float, float]:
    """Return the depth z at which the ray meets the wound pad, and the world's x and y there."""
    _, _, _, rotation, eye, ridge = view
    direction_x = rotation[0, 0] * ray_x + rotation[0, 1] * ray_y + rotation[0, 2]
    direction_y = rotation[1, 0] * ray_x + rotation[1, 1] * ray_y + rotation[1, 2]
    direction_z = rotation[2, 0] * ray_x + rotation[2, 1] * ray_y + rotation[2, 2]
    if direction_z > -1e-3:
        return 0.0, 0.0, 0.0
    far_depth = -(eye[2] + 0.001) / direction_z
    near_depth = -(eye[2] - 0.0065) / direction_z
    near_y, far_y = eye[1] + near_depth * direction_y, eye[1] + far_depth * direction_y
    if min(near_y, far_y) > FLAT_FROM or max(near_y, far_y) < -FLAT_FROM:
        reach = -eye[2] / direction_z
        for _ in range(2):
            reach = (height(eye[0] + reach * direction_x, eye[1] + reach * direction_y, ridge) - eye[2]) / direction_z
        return reach, eye[0] + reach * direction_x, eye[1] + reach * direction_y
    steps = 10
    last = near_depth
    for step in range(1, steps + 1):
        reach = near_depth + (far_depth - near_depth) * step / steps
        x, y, z = eye[0] + reach * direction_x, eye[1] + reach * direction_y, eye[2] + reach * direction_z
        if z <= height(x, y, ridge):
            low, high = last, reach
            for _ in range(8):
                middle = 0.5 * (low + high)
                x, y, z = eye[0] + middle * direction_x, eye[1] + middle * direction_y, eye[2] + middle * direction_z
                if z <= height(x, y, ridge):
                    high = middle
                else:
                    low = middle
            return high, x, y
        last = reach
    return far_depth, eye[0] + far_depth * direction_x, eye[1] + far_depth * direction_y


@compiled(fastmath=True)
def hide_below_pad(depth: np.ndarray, cone: np.ndarray, box: tuple[int, int, int, int], view: View) -> None:
    """Take out of the buffers whatever lies behind the wound pad's surface: what is in the tissue is not seen."""
    focal, centre_x, centre_y, rotation, eye, ridge = view
    half = (SUBPIXELS - 1) / 2.0
    for row in range(box[0] * SUBPIXELS, min(box[1] * SUBPIXELS, depth.shape[0])):
        ray_y = ((row - half) / SUBPIXELS - centre_y) / focal
        for column in range(box[2] * SUBPIXELS, min(box[3] * SUBPIXELS, depth.shape[1])):
            if cone[row, column] < 0:
                continue
            ray_x = ((column - half) / SUBPIXELS - centre_x) / focal
            reach = depth[row, column]
            x = eye[0] + reach * (rotation[0, 0] * ray_x + rotation[0, 1] * ray_y + rotation[0, 2])
            y = eye[1] + reach * (rotation[1, 0] * ray_x + rotation[1, 1] * ray_y + rotation[1, 2])
            z = eye[2] + reach * (rotation[2, 0] * ray_x + rotation[2, 1] * ray_y + rotation[2, 2])
            if z > 0.0075:
                continue
            hidden = z < height(x, y, ridge)
            if not hidden:
                ground, _, _ = pad_depth(ray_x, ray_y, view)
                hidden = 0.0 < ground < reach
            if hidden:
                cone[row, column] = -1
                depth[row, column] = 0.0


@compiled(fastmath=True)
def _surroundings(x: float, y: float, z: float, turn: float) -> float:
    """Return what steel mirrors from the room in the world's direction (x, y, z): dark bench, bright lamps, stripes."""
    azimuth = np.arctan2(y, x) + turn
    level = 0.10 + 0.35 * max(z, 0.0)
    level += 1.1 * np.exp(-((np.sin(0.5 * (azimuth - 0.8)) / 0.22) ** 2) - ((z - 0.55) / 0.2) ** 2)
    level += 0.8 * np.exp(-((np.sin(0.5 * (azimuth + 2.0)) / 0.30) ** 2) - ((z - 0.35) / 0.15) ** 2)
    return level * (1.0 + 0.35 * np.sin(5.0 * azimuth) * np.sin(7.0 * z))


@compiled(fastmath=True)
def _unit(x: float, y: float, z: float) -> tuple[float, float, float]:
    length = np.sqrt(x * x + y * y + z * z) + 1e-12
    return x / length, y / length, z / length


@compiled(fastmath=True)
def _shade_tube(
    body: int,
    point: np.ndarray,
    normal: np.ndarray,
    eye: np.ndarray,
    lights: np.ndarray,
    turn: float,
    along: float,
    colour: np.ndarray,
) -> None:
    """Write the colour (3,) of a tube's point (world frame) as seen from `eye`; `lights` (L, 4): place, strength."""
    view_x, view_y, view_z = _unit(eye[0] - point[0], eye[1] - point[1], eye[2] - point[2])
    facing = normal[0] * view_x + normal[1] * view_y + normal[2] * view_z
    diffuse, sharp, broad = 0.0, 0.0, 0.0
    for light in lights:
        to_x, to_y, to_z = _unit(light[0] - point[0], light[1] - point[1], light[2] - point[2])
        diffuse += light[3] * max(normal[0] * to_x + normal[1] * to_y + normal[2] * to_z, 0.0)
        half_x, half_y, half_z = _unit(view_x + to_x, view_y + to_y, view_z + to_z)
        shine = max(normal[0] * half_x + normal[1] * half_y + normal[2] * half_z, 0.0)
        sharp += light[3] * shine**400
        broad += light[3] * shine**30
    if body == THREAD:
        twist = 1.0 + 0.15 * np.sin(along * 6283.0 / 0.7)
        grey = (0.12 + 0.55 * diffuse) * twist
        colour[0], colour[1], colour[2] = 0.40 * grey, 0.14 * grey, 0.52 * grey
        for channel in range(3):
            colour[channel] += 0.10 * broad
        return
    mirror_x = 2 * facing * normal[0] - view_x
    mirror_y = 2 * facing * normal[1] - view_y
    mirror_z = 2 * facing * normal[2] - view_z
    room = _surroundings(mirror_x, mirror_y, mirror_z, turn)
    if body == NEEDLE:
        grey = 0.03 + 0.10 * diffuse + 0.55 * room + 3.0 * sharp + 0.35 * broad
        colour[0], colour[1], colour[2] = grey, 1.0 * grey, 1.02 * grey
    else:
        tint = 0.95 if body == LEFT_DRIVER else 1.05
        grey = 0.02 + 0.16 * diffuse + 0.22 * room + 0.5 * broad
        colour[0], colour[1], colour[2] = grey * tint, grey, grey / tint


@compiled(fastmath=True)
def shade(
    depth: np.ndarray,
    cone: np.ndarray,
    cones: Cones,
    view: View,
    lighting: Lighting,
    image: np.ndarray,
    depth_map: np.ndarray,
) -> None:
    """Write the linear colour image (H, W, 3) of the buffers over the wound pad, and the pad's depth where it is
    seen."""
    starts, ends, bodies = cones.starts, cones.ends, cones.bodies
    focal, centre_x, centre_y, rotation, eye, ridge = view
    lights, turn, salt, pad_colour, shadow, shadow_origin, shadow_scale = lighting
    rows, columns = image.shape[0], image.shape[1]
    half = (SUBPIXELS - 1) / 2.0
    colour = np.zeros(3)
    point, normal = np.zeros(3), np.zeros(3)
    share = 1.0 / (SUBPIXELS * SUBPIXELS)
    for row in range(rows):
        for column in range(columns):
            ray_x, ray_y = (column - centre_x) / focal, (row - centre_y) / focal
            empty = 0
            total_0, total_1, total_2 = 0.0, 0.0, 0.0
            for sub_row in range(row * SUBPIXELS, (row + 1) * SUBPIXELS):
                for sub_column in range(column * SUBPIXELS, (column + 1) * SUBPIXELS):
                    index = cone[sub_row, sub_column]
                    if index < 0:
                        empty += 1
                        continue
                    reach = depth[sub_row, sub_column]
                    hit_x = ((sub_column - half) / SUBPIXELS - centre_x) / focal * reach
                    hit_y = ((sub_row - half) / SUBPIXELS - centre_y) / focal * reach
                    axis = ends[index] - starts[index]
                    offset_x, offset_y = hit_x - starts[index, 0], hit_y - starts[index, 1]
                    offset_z = reach - starts[index, 2]
                    length = axis[0] * axis[0] + axis[1] * axis[1] + axis[2] * axis[2] + 1e-18
                    along = (offset_x * axis[0] + offset_y * axis[1] + offset_z * axis[2]) / length
                    normal_x, normal_y, normal_z = _unit(
                        offset_x - along * axis[0], offset_y - along * axis[1], offset_z - along * axis[2]
                    )
                    for k in range(3):
                        point[k] = eye[k] + rotation[k, 0] * hit_x + rotation[k, 1] * hit_y + rotation[k, 2] * reach
                        normal[k] = rotation[k, 0] * normal_x + rotation[k, 1] * normal_y + rotation[k, 2] * normal_z
                    _shade_tube(bodies[index], point, normal, eye, lights, turn, index * 0.001 + along * 0.001, colour)
                    total_0 += min(colour[0], 4.0)
                    total_1 += min(colour[1], 4.0)
                    total_2 += min(colour[2], 4.0)
            if empty > 0:
                ground, x, y = pad_depth(ray_x, ray_y, view)
                if ground > 0.0:
                    if depth_map[row, column] == 0.0:
                        depth_map[row, column] = ground
                    slope = 0.0
                    if abs(y) < FLAT_FROM:
                        slope = (height(x, y + 2e-4, ridge) - height(x, y - 2e-4, ridge)) / 4e-4
                    normal_x, normal_y, normal_z = _unit(0.0, -slope, 1.0)
                    z = height(x, y, ridge)
                    light_sum = 0.0
                    for light in lights:
                        to_x, to_y, to_z = _unit(light[0] - x, light[1] - y, light[2] - z)
                        light_sum += light[3] * max(normal_y * to_y + normal_z * to_z + normal_x * to_x, 0.0)
                    shadow_row = int((y - shadow_origin) * shadow_scale)
                    shadow_column = int((x - shadow_origin) * shadow_scale)
                    shade_here = 0.0
                    if 0 <= shadow_row < shadow.shape[0] and 0 <= shadow_column < shadow.shape[1]:
                        shade_here = shadow[shadow_row, shadow_column]
                    grey = (0.25 + 0.65 * light_sum * (1.0 - shade_here)) * (1.0 + 0.16 * texture(x, y, salt))
                    wound = 1.0
                    if abs(y) < 0.003:
                        wound = 1.0 - 0.5 * np.exp(-((y / 0.0009) ** 2))
                    total_0 += empty * grey * pad_colour[0]
                    total_1 += empty * grey * pad_colour[1] * wound
                    total_2 += empty * grey * pad_colour[2] * wound
            image[row, column, 0] = total_0 * share
            image[row, column, 1] = total_1 * share
            image[row, column, 2] = total_2 * share


@compiled(fastmath=True)
def label(
    depth: np.ndarray,
    cone: np.ndarray,
    bodies: np.ndarray,
    box: tuple[int, int, int, int],
    body_map: np.ndarray,
    depth_map: np.ndarray,
) -> None:
    """Write each pixel's body (uint8, 0: pad), by the majority of its sub-pixels, and that body's mean depth [m]."""
    counts, sums = np.zeros(5), np.zeros(5)
    for row in range(box[0], min(box[1], body_map.shape[0])):
        for column in range(box[2], min(box[3], body_map.shape[1])):
            counts[:], sums[:] = 0.0, 0.0
            for sub_row in range(row * SUBPIXELS, (row + 1) * SUBPIXELS):
                for sub_column in range(column * SUBPIXELS, (column + 1) * SUBPIXELS):
                    index = cone[sub_row, sub_column]
                    body = bodies[index] if index >= 0 else 0
                    counts[body] += 1.0
                    sums[body] += depth[sub_row, sub_column]
            best = np.argmax(counts)
            body_map[row, column] = best
            depth_map[row, column] = sums[best] / counts[best] if best > 0 else 0.0
