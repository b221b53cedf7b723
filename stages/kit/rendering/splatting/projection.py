"""Gaussians into the picture and gradients back into space, compiled; `reference.project` says the same in ten lines.

With M = R diag(scales) of a Gaussian, W the rotation of the camera and J the Jacobian of its projection, the half
B = J W M (2, 3) has B B' as covariance in the picture.
"""

from __future__ import annotations

import math

import numba
import numpy as np
from scenewright.stages.kit.compiled import compiled
from scenewright.stages.kit.rendering.splatting import rasterizer

DILATION, NEAR, SMALLEST_ALPHA = rasterizer.DILATION, rasterizer.NEAR, rasterizer.SMALLEST_ALPHA
CHUNK = 256
"""Gaussians that one thread takes at a time."""


@compiled(fastmath=True)
def _turn(quaternion, turn):  # type: ignore[no-untyped-def]
    """Write the rotation matrix (3, 3) of a quaternion (4,) into `turn`; return its length."""
    w, x, y, z = quaternion[0] * 1.0, quaternion[1] * 1.0, quaternion[2] * 1.0, quaternion[3] * 1.0
    length = math.sqrt(w * w + x * x + y * y + z * z)
    w, x, y, z = w / length, x / length, y / length, z / length
    turn[0, 0], turn[0, 1], turn[0, 2] = 1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)
    turn[1, 0], turn[1, 1], turn[1, 2] = 2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)
    turn[2, 0], turn[2, 1], turn[2, 2] = 2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)
    return length


@compiled(fastmath=True)
def _jacobian(point, focal, limits, jacobian):  # type: ignore[no-untyped-def]
    """Write the Jacobian (2, 3) of the projection at a point (3,) of the camera's frame; return x/z and y/z taken."""
    z = point[2]
    across = min(max(point[0] / z, limits[0]), limits[1])
    along = min(max(point[1] / z, limits[2]), limits[3])
    jacobian[0, 0], jacobian[0, 1], jacobian[0, 2] = focal[0] / z, 0.0, -focal[0] * across / z
    jacobian[1, 0], jacobian[1, 1], jacobian[1, 2] = 0.0, focal[1] / z, -focal[1] * along / z
    return across, along


@compiled(fastmath=True)
def _product(a, b, out):  # type: ignore[no-untyped-def]
    """Write the product of small matrices into `out`."""
    for i in range(a.shape[0]):
        for j in range(b.shape[1]):
            total = 0.0
            for k in range(a.shape[1]):
                total += a[i, k] * b[k, j]
            out[i, j] = total


@compiled(parallel=True, fastmath=True)
def project(means, quaternions, log_scales, logit_opacities, pose, focal, center, limits, size):  # type: ignore[no-untyped-def]
    """Return flat (N, 7) float32, depths (N,) float32 [m] and reach (N, 4) int32.

    `flat`: centre u v [px], inverse covariance a b c [1/px^2], opacity, 0; `reach`: first and last column, first and
    last row of the picture in which alpha may count, first > last where none does. `pose` is camera_from_world (4, 4),
    `focal` and `center` (2,) [px], `limits` (4,) of `direction_limits`, `size` (width, height).
    """
    count = len(means)
    flat = np.zeros((count, 7), np.float32)
    depths = np.zeros(count, np.float32)
    reach = np.empty((count, 4), np.int32)
    for chunk in numba.prange((count + CHUNK - 1) // CHUNK):
        turn, jacobian, view = np.empty((3, 3)), np.empty((2, 3)), np.empty((2, 3))
        half, point = np.empty((2, 3)), np.empty(3)
        for n in range(chunk * CHUNK, min(count, (chunk + 1) * CHUNK)):
            reach[n, 0], reach[n, 1], reach[n, 2], reach[n, 3] = 1, 0, 1, 0
            for i in range(3):
                point[i] = pose[i, 3]
                for j in range(3):
                    point[i] += pose[i, j] * means[n, j]
            opacity = 1.0 / (1.0 + math.exp(-logit_opacities[n]))
            if not (point[2] > NEAR and opacity > SMALLEST_ALPHA):
                continue
            _turn(quaternions[n], turn)
            _jacobian(point, focal, limits, jacobian)
            _product(jacobian, pose[:3, :3], view)
            _product(view, turn, half)
            for k in range(3):
                scale = math.exp(log_scales[n, k])
                half[0, k] *= scale
                half[1, k] *= scale
            xx = half[0, 0] ** 2 + half[0, 1] ** 2 + half[0, 2] ** 2 + DILATION
            yy = half[1, 0] ** 2 + half[1, 1] ** 2 + half[1, 2] ** 2 + DILATION
            xy = half[0, 0] * half[1, 0] + half[0, 1] * half[1, 1] + half[0, 2] * half[1, 2]
            determinant = xx * yy - xy * xy
            u, v = focal[0] * point[0] / point[2] + center[0], focal[1] * point[1] / point[2] + center[1]
            power = 2.0 * math.log(opacity / SMALLEST_ALPHA)
            wide, high = math.sqrt(power * xx), math.sqrt(power * yy)
            if not (u + wide >= 0 and u - wide <= size[0] - 1 and v + high >= 0 and v - high <= size[1] - 1):
                continue
            reach[n, 0], reach[n, 1] = max(0.0, math.ceil(u - wide)), min(size[0] - 1.0, math.floor(u + wide))
            reach[n, 2], reach[n, 3] = max(0.0, math.ceil(v - high)), min(size[1] - 1.0, math.floor(v + high))
            flat[n, 0], flat[n, 1] = u, v
            flat[n, 2], flat[n, 3], flat[n, 4] = yy / determinant, -xy / determinant, xx / determinant
            flat[n, 5] = opacity
            depths[n] = point[2]
    return flat, depths, reach


@compiled(parallel=True, fastmath=True)
def project_back(means, quaternions, log_scales, flat, pose, focal, limits, flat_gradients, depth_gradients, visible):  # type: ignore[no-untyped-def]
    """Return gradients by means (N, 3), quaternions (N, 4), log scales (N, 3), logits (N,), and the twist (6,).

    `flat_gradients` (N, 6) are by u v a b c and opacity, `depth_gradients` (N,) by the depth.
    """
    count = len(means)
    chunks = (count + CHUNK - 1) // CHUNK
    by_mean, by_quaternion = np.zeros((count, 3)), np.zeros((count, 4))
    by_scale, by_logit = np.zeros((count, 3)), np.zeros(count)
    twists = np.zeros((chunks, 6))
    for chunk in numba.prange(chunks):
        turn, jacobian, view, half = np.empty((3, 3)), np.empty((2, 3)), np.empty((2, 3)), np.empty((2, 3))
        point, moved, by_half, spread = np.empty(3), np.empty(3), np.empty((2, 3)), np.empty((3, 3))
        by_spread, by_view, by_turn, by_pose = np.empty((3, 3)), np.empty((2, 3)), np.empty((3, 3)), np.empty((3, 3))
        by_jacobian, scales = np.empty((2, 3)), np.empty(3)
        for n in range(chunk * CHUNK, min(count, (chunk + 1) * CHUNK)):
            if not visible[n]:
                continue
            for i in range(3):
                point[i] = pose[i, 3]
                scales[i] = math.exp(log_scales[n, i])
                for j in range(3):
                    point[i] += pose[i, j] * means[n, j]
            length = _turn(quaternions[n], turn)
            across, along = _jacobian(point, focal, limits, jacobian)
            _product(jacobian, pose[:3, :3], view)
            for i in range(3):
                for k in range(3):
                    spread[i, k] = turn[i, k] * scales[k]
            _product(view, spread, half)
            # covariance = half half'; its inverse is Q = (a b; b c): gradient -Q G Q, and by the half 2 (-Q G Q) half
            a, b, c = float(flat[n, 2]), float(flat[n, 3]), float(flat[n, 4])
            ga, gb, gc = flat_gradients[n, 2], 0.5 * flat_gradients[n, 3], flat_gradients[n, 4]
            p, q, r, s = a * ga + b * gb, a * gb + b * gc, b * ga + c * gb, b * gb + c * gc
            xx, xy, yy = -(p * a + q * b), -(p * b + q * c), -(r * b + s * c)
            for k in range(3):
                by_half[0, k] = 2.0 * (xx * half[0, k] + xy * half[1, k])
                by_half[1, k] = 2.0 * (xy * half[0, k] + yy * half[1, k])
            for i in range(3):
                for k in range(3):
                    by_spread[i, k] = view[0, i] * by_half[0, k] + view[1, i] * by_half[1, k]
                    by_turn[i, k] = by_spread[i, k] * scales[k]
            for k in range(3):
                total = 0.0
                for i in range(3):
                    total += by_spread[i, k] * turn[i, k]
                by_scale[n, k] = total * scales[k]
            for i in range(2):
                for j in range(3):
                    by_view[i, j] = (
                        by_half[i, 0] * spread[j, 0] + by_half[i, 1] * spread[j, 1] + by_half[i, 2] * spread[j, 2]
                    )
            for i in range(2):
                for j in range(3):
                    by_jacobian[i, j] = (
                        by_view[i, 0] * pose[j, 0] + by_view[i, 1] * pose[j, 1] + by_view[i, 2] * pose[j, 2]
                    )
            x, y, z = point[0], point[1], point[2]
            gu, gv = flat_gradients[n, 0], flat_gradients[n, 1]
            fx, fy = focal[0], focal[1]
            moved[0], moved[1] = gu * fx / z, gv * fy / z
            moved[2] = depth_gradients[n] - (gu * fx * x + gv * fy * y) / (z * z)
            moved[2] -= (by_jacobian[0, 0] * fx + by_jacobian[1, 1] * fy) / (z * z)
            moved[2] += (by_jacobian[0, 2] * fx * across + by_jacobian[1, 2] * fy * along) / (z * z)
            if limits[0] < x / z < limits[1]:
                moved[0] -= by_jacobian[0, 2] * fx / (z * z)
                moved[2] += by_jacobian[0, 2] * fx * x / (z * z * z)
            if limits[2] < y / z < limits[3]:
                moved[1] -= by_jacobian[1, 2] * fy / (z * z)
                moved[2] += by_jacobian[1, 2] * fy * y / (z * z * z)
            for j in range(3):
                by_mean[n, j] = pose[0, j] * moved[0] + pose[1, j] * moved[1] + pose[2, j] * moved[2]
            _add_quaternion(quaternions[n], length, by_turn, by_quaternion[n])
            opacity = float(flat[n, 5])
            by_logit[n] = flat_gradients[n, 5] * opacity * (1.0 - opacity)
            # the camera's rotation enters the Jacobian's frame: by W is J' (by J W), turned back by W'
            for i in range(3):
                for j in range(3):
                    total = 0.0
                    for k in range(3):
                        total += (jacobian[0, i] * by_view[0, k] + jacobian[1, i] * by_view[1, k]) * pose[j, k]
                    by_pose[i, j] = total
            for i in range(3):
                twists[chunk, i] += moved[i]
            twists[chunk, 3] += y * moved[2] - z * moved[1] + by_pose[2, 1] - by_pose[1, 2]
            twists[chunk, 4] += z * moved[0] - x * moved[2] + by_pose[0, 2] - by_pose[2, 0]
            twists[chunk, 5] += x * moved[1] - y * moved[0] + by_pose[1, 0] - by_pose[0, 1]
    twist = np.zeros(6)
    for chunk in range(chunks):
        for k in range(6):
            twist[k] += twists[chunk, k]
    return by_mean, by_quaternion, by_scale, by_logit, twist


@compiled(fastmath=True)
def _add_quaternion(quaternion, length, g, out):  # type: ignore[no-untyped-def]
    """Write the gradient by an unnormalised quaternion (4,), given that by its matrix (3, 3), into `out`."""
    w, x, y, z = quaternion[0] / length, quaternion[1] / length, quaternion[2] / length, quaternion[3] / length
    gw = 2 * (x * (g[2, 1] - g[1, 2]) + y * (g[0, 2] - g[2, 0]) + z * (g[1, 0] - g[0, 1]))
    gx = 2 * (
        -2 * x * (g[1, 1] + g[2, 2]) + y * (g[0, 1] + g[1, 0]) + z * (g[0, 2] + g[2, 0]) + w * (g[2, 1] - g[1, 2])
    )
    gy = 2 * (x * (g[0, 1] + g[1, 0]) - 2 * y * (g[0, 0] + g[2, 2]) + z * (g[1, 2] + g[2, 1]) + w * (g[0, 2] - g[2, 0]))
    gz = 2 * (x * (g[0, 2] + g[2, 0]) + y * (g[1, 2] + g[2, 1]) - 2 * z * (g[0, 0] + g[1, 1]) + w * (g[1, 0] - g[0, 1]))
    along = gw * w + gx * x + gy * y + gz * z
    out[0], out[1] = (gw - along * w) / length, (gx - along * x) / length
    out[2], out[3] = (gy - along * y) / length, (gz - along * z) / length
