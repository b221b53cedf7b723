"""Ours: the light of a room, taken out of colours by its walls.

A camera shows what a surface reflects times the light on it, so a white cupboard in a dim room is grey. A simulator
that puts its own light on that grey shows it dimmer still. What the walls of rooms reflect is known within a third, so
how bright they are in the map tells the light. Hue is left as it is: walls have one of their own.
"""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

import numpy as np
from scenewright.stages.kit.formats.entity_meshes import load_entity_mesh
from scenewright.stages.kit.formats.ply_files import ColoredMesh, write_ply
from scenewright.stages.kit.rendering.surfaces import linear_to_srgb, srgb_to_linear

REFLECTED = 0.65
"""Share of the light that walls of rooms reflect: the middle of what EN 12464-1 (2021) recommends, 0.5 to 0.8."""
LIT = 75
"""The light is that of this percentile of what is called wall: what is darker is in shadow, or hangs on it."""
FEWEST = 1000
"""Vertices of walls that tell the light."""
LEAST, MOST = 0.5, 2.0
"""Between these a gain is believed."""
WHITE, BRIGHT = 0.9, 95
"""Hardly anything reflects more than this: no gain makes this percentile of all surface brighter."""
LUMINANCE = np.array([0.2126, 0.7152, 0.0722])
"""Of linear red, green and blue (IEC 61966-2-1)."""


def gain_by_walls(walls: np.ndarray, everything: np.ndarray) -> float:
    """Return by how much linear light is to be multiplied so that walls reflect what walls do; 1 where too few were
    seen. `walls` (N, 3), `everything` (M, 3): uint8 sRGB of the vertices of walls, and of all of the map."""
    if len(walls) < FEWEST:
        return 1.0
    gain = float(np.clip(REFLECTED / max(np.percentile(luminance(walls), LIT), 1e-6), LEAST, MOST))
    whitest = WHITE / max(float(np.percentile(luminance(everything), BRIGHT)), 1e-6)
    return round(min(gain, max(whitest, 1.0)), 3)


def luminance(colors: np.ndarray) -> np.ndarray:
    """Return the linear luminance (N,) of colours (N, 3) uint8 sRGB: 0 to 1."""
    return np.asarray(srgb_to_linear(colors / 255.0) @ LUMINANCE)


def relit(colors: np.ndarray, gain: float) -> np.ndarray:
    """Return colours (N, 3) uint8 sRGB under `gain` times the light."""
    return np.round(255 * linear_to_srgb(gain * srgb_to_linear(colors / 255.0))).astype(np.uint8)


def relight(files: Iterable[Path], gain: float) -> None:
    """Write meshes (PLY) again under `gain` times the light. Raises BadInput for what is no mesh."""
    for file in files:
        mesh = load_entity_mesh(file)
        colors = relit(mesh.colors, gain)
        write_ply(file, ColoredMesh(mesh.vertices.astype(np.float32), mesh.faces.astype(np.int32), colors))
