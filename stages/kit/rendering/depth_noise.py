"""What a structured-light depth camera makes of the true depth.

In the order of the light's way: pixels jump sideways across depth edges (Nguyen, Izadi & Lovell 2012, lateral noise),
mix into flying pixels there, lie in the projector's shadow (Khoshelham & Elberink 2012), scatter along the ray with
the axial noise of Nguyen et al., are quantised in disparity (Khoshelham & Elberink, eq. 3), and are lost where too
little light comes back: out of range, at grazing incidence, on dark and on shiny surfaces (the loss laws are ours;
their shape follows Mallick, Das & Majumdar 2014, section III).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import prange
from scenewright.schemas.scene_parts import Camera
from scenewright.stages.kit.compiled import compiled


class DepthCamera(NamedTuple):
    """Constants of the sensor. Compiled functions take it as it is."""

    minimum_range: float = 0.3
    """[m]"""
    maximum_range: float = 5.0
    """[m]"""
    baseline: float = 0.075
    """Distance from projector to camera [m]; the projector is on the left."""
    disparity_levels: float = 16.0
    """Quantisation steps per pixel of disparity."""
    jump_share: float = 0.6
    """Share of the lateral jumps that lands on the other side's depth; half of the rest flies, half is lost."""
    grazing_start: float = float(np.deg2rad(72.0))
    grazing_end: float = float(np.deg2rad(86.0))
    """Incidence between which the loss grows from none to all [rad]."""
    dark_signal: float = 0.0012
    """Returned signal, reflectance * cosine / z^2 [1/m^2], at which half of the pixels are lost."""
    shine_loss: float = 0.5
    """Share of pixels that a mirror-like surface loses when it is seen at 90 degrees off its normal."""
    block: int = 3
    """Losses come in blocks of this many pixels."""


@compiled
def axial_sigma(z: float, incidence: float) -> float:
    """Return the axial standard deviation [m] at depth z [m] and incidence angle [rad] (Nguyen et al. 2012, eq. 3-4):
    0.0012 + 0.0019 (z - 0.4)^2, and 0.0001 / sqrt(z) * theta^2 / (pi/2 - theta)^2 on top. The angle is cut at 82
    degrees, the end of their measurements."""
    angle = min(incidence, 1.4312)
    slanted = 0.0001 / np.sqrt(z) * angle * angle / (np.pi / 2 - angle) ** 2
    return 0.0012 + 0.0019 * (z - 0.4) ** 2 + slanted


@compiled
def lateral_sigma(incidence: float) -> float:
    """Return the lateral standard deviation [px] at an incidence angle [rad] (Nguyen et al. 2012, eq. 2):
    0.8 + 0.035 theta / (pi/2 - theta)."""
    angle = min(incidence, 1.4312)
    return 0.8 + 0.035 * angle / (np.pi / 2 - angle)


@compiled
def quantise(z: float, focal_length: float, baseline: float, levels: float) -> float:
    """Round z [m] to the nearest disparity level."""
    disparity = np.floor(focal_length * baseline / z * levels + 0.5) / levels
    return focal_length * baseline / disparity if disparity > 0.0 else 0.0


@compiled
def loss_probability(z: float, incidence: float, reflectance: float, gloss: float, sensor: DepthCamera) -> float:
    """Return the probability in 0..1 that a pixel gets no depth. The causes are independent.

    Grazing: smooth step between the two angles. Dark: 1 / (1 + (signal / dark_signal)^4). Shiny: gloss * shine_loss *
    sin^2(incidence).
    """
    step = min(1.0, max(0.0, (incidence - sensor.grazing_start) / (sensor.grazing_end - sensor.grazing_start)))
    grazing = step * step * (3.0 - 2.0 * step)
    signal = reflectance * np.cos(incidence) / (z * z)
    dark = sensor.dark_signal**4 / (sensor.dark_signal**4 + signal**4 + 1e-30)
    shiny = gloss * sensor.shine_loss * np.sin(incidence) ** 2
    return 1.0 - (1.0 - grazing) * (1.0 - dark) * (1.0 - shiny)


@compiled(parallel=True)
def _projector_shadow(depth: np.ndarray, focal_length: float, baseline: float) -> np.ndarray:
    """Mark pixels (H, W) that the projector, left of the camera, cannot see.

    A pixel u at depth z appears in projector column u + f b / z. Walking to the right, a column that was passed already
    belongs to something nearer, which throws its shadow there.
    """
    height, width = depth.shape
    shadow = np.zeros((height, width), dtype=np.bool_)
    for v in prange(height):
        passed = -1e9
        for u in range(width):
            z = depth[v, u]
            if z <= 0.0:
                continue
            column = u + focal_length * baseline / z
            if column < passed - 0.5:
                shadow[v, u] = True
            else:
                passed = max(passed, column)
    return shadow


class _Seen(NamedTuple):
    """What disturb_depth is given, and where the projector does not reach: (H, W) each."""

    depth: np.ndarray
    incidence_cosine: np.ndarray
    reflectance: np.ndarray
    gloss: np.ndarray
    shadow: np.ndarray


class _Draws(NamedTuple):
    """The random values of an image: of each pixel (H, W) a normal one along the ray, two sideways (H, W, 2) and a
    uniform one; a uniform one for each block of lost pixels, and by how many pixels the blocks are moved (2,)."""

    normal: np.ndarray
    jump: np.ndarray
    chance: np.ndarray
    loss: np.ndarray
    shift: np.ndarray


@compiled(parallel=True)
def _disturb(seen: _Seen, draws: _Draws, focal_length: float, sensor: DepthCamera) -> np.ndarray:
    depth, incidence_cosine, reflectance, gloss, shadow = seen
    normal, jump, chance, loss, shift = draws
    minimum, maximum, baseline, levels = (
        sensor.minimum_range,
        sensor.maximum_range,
        sensor.baseline,
        sensor.disparity_levels,
    )
    jump_share, block = sensor.jump_share, sensor.block
    height, width = depth.shape
    result = np.zeros((height, width), dtype=np.float32)
    for v in prange(height):
        for u in range(width):
            z = float(depth[v, u])
            if z <= 0.0 or shadow[v, u]:
                continue
            cosine = min(1.0, max(1e-3, float(incidence_cosine[v, u])))
            incidence = np.arccos(cosine)
            spread = lateral_sigma(incidence)
            du, dv = spread * jump[v, u, 0], spread * jump[v, u, 1]
            uu = min(width - 1, max(0, u + int(np.rint(du))))
            vv = min(height - 1, max(0, v + int(np.rint(dv))))
            there = float(depth[vv, uu])
            slope = z * np.tan(min(incidence, 1.4312)) / focal_length
            reach = max(abs(uu - u), abs(vv - v)) + 0.5
            if there > 0.0 and abs(there - z) > 0.01 * z + 2.0 * reach * slope:
                rest = 0.5 * (1.0 - jump_share)
                if chance[v, u] < jump_share:
                    z = there
                elif chance[v, u] < jump_share + rest:
                    z = z + (there - z) * (chance[v, u] - jump_share) / rest
                else:
                    continue
            if z < minimum or z > maximum:
                continue
            lost = loss_probability(z, incidence, float(reflectance[v, u]), float(gloss[v, u]), sensor)
            if loss[(v + shift[0]) // block, (u + shift[1]) // block] < lost:
                continue
            z += axial_sigma(z, incidence) * normal[v, u]
            if z > 0.0:
                z = quantise(z, focal_length, baseline, levels)
            if minimum <= z <= maximum:
                result[v, u] = z
    return result


def disturb_depth(
    depth: np.ndarray,
    incidence_cosine: np.ndarray,
    reflectance: np.ndarray,
    gloss: np.ndarray,
    camera: Camera,
    random: np.random.Generator,
    sensor: DepthCamera | None = None,
) -> np.ndarray:
    """Return the depth (H, W) float32 [m] that the sensor reports, 0 where it reports none.

    `depth` (H, W) true z-depth [m], 0 = nothing; `incidence_cosine` (H, W) between ray and surface normal;
    `reflectance` (H, W) and `gloss` (H, W) in 0..1. Uses the same number of random values for every image of a size.
    """
    sensor = sensor or DepthCamera()
    height, width = depth.shape
    block = sensor.block
    normal = random.standard_normal((height, width), dtype=np.float32)
    jump = random.standard_normal((height, width, 2), dtype=np.float32)
    chance = random.random((height, width), dtype=np.float32)
    loss = random.random((height // block + 2, width // block + 2), dtype=np.float32)
    shift = random.integers(0, block, 2)
    shadow = _projector_shadow(depth, camera.fx, sensor.baseline)
    seen = _Seen(depth, incidence_cosine, reflectance, gloss, shadow)
    return _disturb(seen, _Draws(normal, jump, chance, loss, shift), camera.fx, sensor)
