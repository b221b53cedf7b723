"""Procedural surface patterns (planks, tiles, plaster, wood, fabric), evaluated where a ray hits, and gloss.

Value noise on a hashed lattice (Perlin 1985's idea with values instead of gradients). Every pattern is a function of
a point in the material's own frame, so nothing has to be unwrapped; it fades out where a pixel covers more than its
finest detail, which is what a texture's mip levels do.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from scenewright.stages.kit.compiled import compiled

PatternName = Literal["plain", "planks", "tiles", "carpet", "plaster", "wood", "fabric", "speckle"]
PATTERNS: tuple[PatternName, ...] = ("plain", "planks", "tiles", "carpet", "plaster", "wood", "fabric", "speckle")
_PLAIN, _PLANKS, _TILES, _CARPET, _PLASTER, _WOOD, _FABRIC, _SPECKLE = range(len(PATTERNS))
PATTERN, STRENGTH, PERIOD, GLOSS, SHARPNESS, SEED, TRANSFORM = range(7)
"""Columns of the material table (M, ROW), as in Material; the 12 of pattern_from_world begin at TRANSFORM."""
SKIRTING = TRANSFORM + 12
"""Column of the skirting, behind the 12 of the transform."""
ROW = SKIRTING + 2
"""Columns of the material table; one is spare."""


@dataclass(frozen=True)
class Material:
    """How the surface of an instance looks beyond its colours."""

    pattern: PatternName = "plain"
    strength: float = 1.0
    """0 leaves the colour as it is, 1 is the pattern's natural contrast."""
    period: float = 0.2
    """Size of a plank's width, a tile's edge or a blotch [m]."""
    gloss: float = 0.0
    """Height of the highlight, 0 matt to 1 mirror-like paint."""
    sharpness: float = 40.0
    """Exponent of the highlight (Blinn 1977)."""
    seed: int = 0
    pattern_from_world: np.ndarray = field(default_factory=lambda: np.eye(4))
    skirting: float = 0.0
    """Height of a painted skirting board over z = 0 [m]; 0 for none."""
    only_wood: bool = False
    """The pattern is on wood-coloured triangles alone (see is_wood); the gloss is everywhere."""

    def row(self) -> np.ndarray:
        """Return the material as one (ROW,) float32 row of the material table."""
        head = [PATTERNS.index(self.pattern), self.strength, self.period, self.gloss, self.sharpness, self.seed % 4096]
        return np.asarray([*head, *self.pattern_from_world[:3].reshape(-1), self.skirting, 0.0], dtype=np.float32)


def is_wood(srgb: np.ndarray) -> np.ndarray:
    """Return (...,) bool: whether sRGB colours (..., 3) in 0..1 are browns and beiges as wood has them, no reds."""
    red, green, blue = srgb[..., 0], srgb[..., 1], srgb[..., 2]
    return (green > 0.6 * red) & (green < 0.88 * red) & (blue < 0.86 * green)


@compiled
def _hash(x: int, y: int, z: int, seed: int) -> float:
    """Return a number in 0..1 for a lattice point (32-bit mixing in 64-bit registers: numba widens products)."""
    mask = np.uint64(0xFFFFFFFF)
    h = np.uint64(x & 0xFFFFFFFF) * np.uint64(0x8DA6B343)
    h ^= np.uint64(y & 0xFFFFFFFF) * np.uint64(0xD8163841)
    h ^= np.uint64(z & 0xFFFFFFFF) * np.uint64(0xCB1AB31F)
    h ^= np.uint64(seed & 0xFFFFFFFF) * np.uint64(0x9E3779B1)
    h &= mask
    h ^= h >> np.uint64(15)
    h = (h * np.uint64(0x2C1B3C6D)) & mask
    h ^= h >> np.uint64(12)
    h = (h * np.uint64(0x297A2D39)) & mask
    h ^= h >> np.uint64(15)
    return float(h & np.uint64(0xFFFFFF)) / 16777216.0


@compiled
def value_noise(x: float, y: float, z: float, seed: int) -> float:
    """Return smooth noise in -1..1 at a point, of unit lattice spacing."""
    xf, yf, zf = np.floor(x), np.floor(y), np.floor(z)
    xi, yi, zi = int(xf), int(yf), int(zf)
    fx, fy, fz = x - xf, y - yf, z - zf
    fx = fx * fx * (3.0 - 2.0 * fx)
    fy = fy * fy * (3.0 - 2.0 * fy)
    fz = fz * fz * (3.0 - 2.0 * fz)
    total = 0.0
    for dx in range(2):
        wx = fx if dx else 1.0 - fx
        for dy in range(2):
            wy = fy if dy else 1.0 - fy
            for dz in range(2):
                wz = fz if dz else 1.0 - fz
                total += wx * wy * wz * _hash(xi + dx, yi + dy, zi + dz, seed)
    return 2.0 * total - 1.0


@compiled(inline="always")
def _visible_detail(detail: float, footprint: float) -> float:
    """Return how much of a detail of this size [m] survives in a pixel that covers `footprint` [m], 0..1."""
    return min(1.0, max(0.0, detail / max(footprint, 1e-6) - 0.5))


@compiled
def pattern_line(distance: float, width: float, footprint: float) -> float:
    """Return how dark a joint of this width is in a pixel, box-filtered over its footprint, 0..1."""
    spread = max(width, footprint)
    return max(0.0, 1.0 - distance / spread) * min(1.0, width / spread)


@compiled
def pattern_factor(row: np.ndarray, x: float, y: float, z: float, footprint: float) -> tuple[float, float]:
    """Return (brightness factor, warmth) of a material row at world point x, y, z [m].

    `footprint` is the width that a pixel covers there [m]. The colour is multiplied by the factor; warmth in -1..1
    shifts it from blue towards red.
    """
    kind, strength, period, seed = int(row[PATTERN]), row[STRENGTH], row[PERIOD], int(row[SEED])
    px = row[TRANSFORM] * x + row[TRANSFORM + 1] * y + row[TRANSFORM + 2] * z + row[TRANSFORM + 3]
    py = row[TRANSFORM + 4] * x + row[TRANSFORM + 5] * y + row[TRANSFORM + 6] * z + row[TRANSFORM + 7]
    pz = row[TRANSFORM + 8] * x + row[TRANSFORM + 9] * y + row[TRANSFORM + 10] * z + row[TRANSFORM + 11]
    factor, warmth = 0.0, 0.0
    if kind == _PLANKS:  # along x, `period` wide, staggered joints, each with its own tone
        lane = int(np.floor(py / period))
        length = 6.0 * period
        shifted = px + length * _hash(lane, 7, 3, seed)
        board = int(np.floor(shifted / length))
        across = py / period - lane
        along = shifted / length - board
        tone = _hash(lane, board, 1, seed) - 0.5
        grain = value_noise(px * 3.0 + 31.0 * tone, py * 60.0, 11.0 * tone, seed) * _visible_detail(0.016, footprint)
        broad = value_noise(px * 1.5, py * 14.0, 5.0 * tone, seed + 1) * _visible_detail(0.06, footprint)
        factor = 0.26 * tone + 0.07 * grain + 0.08 * broad
        warmth = 0.25 * tone
        gap = min(across, 1.0 - across) * period
        seam = min(along, 1.0 - along) * length
        factor -= 0.5 * pattern_line(min(gap, seam), 0.004, footprint)
    elif kind == _TILES:  # square, with grout
        across, along = px / period, py / period
        i, j = int(np.floor(across)), int(np.floor(along))
        tone = _hash(i, j, 2, seed) - 0.5
        blotch = value_noise(px * 9.0, py * 9.0, pz * 9.0, seed) * _visible_detail(0.1, footprint)
        factor = 0.10 * tone + 0.05 * blotch
        fx, fy = across - i, along - j
        factor -= 0.35 * pattern_line(min(min(fx, 1.0 - fx), min(fy, 1.0 - fy)) * period, 0.006, footprint)
    elif kind == _CARPET:
        fine = value_noise(px * 220.0, py * 220.0, pz * 220.0, seed) * _visible_detail(0.005, footprint)
        broad = value_noise(px * 6.0, py * 6.0, pz * 6.0, seed + 1)
        middle = value_noise(px * 45.0, py * 45.0, pz * 45.0, seed + 2) * _visible_detail(0.022, footprint)
        factor = 0.20 * fine + 0.05 * broad + 0.09 * middle
    elif kind == _PLASTER:  # painted: faint unevenness, roller marks
        broad = value_noise(px * 1.1, py * 1.1, pz * 1.1, seed)
        marks = value_noise(px * 28.0, py * 28.0, pz * 9.0, seed + 1) * _visible_detail(0.036, footprint)
        fine = value_noise(px * 150.0, py * 150.0, pz * 150.0, seed + 2) * _visible_detail(0.007, footprint)
        factor = 0.035 * broad + 0.02 * marks + 0.03 * fine
    elif kind == _WOOD:  # rings seen along x
        bend = value_noise(px * 1.3, py * 4.0, pz * 4.0, seed)
        ring = np.sin(6.2831853 * ((py + 0.6 * pz) / period + 2.6 * bend))
        grain = value_noise(px * 5.0, py * 130.0, pz * 130.0, seed + 1) * _visible_detail(0.008, footprint)
        factor = 0.07 * ring * _visible_detail(0.5 * period, footprint) + 0.10 * grain + 0.06 * bend
        warmth = 0.06 * ring
    elif kind == _FABRIC:  # woven
        weave = np.sin(6.2831853 * px / period) * np.sin(6.2831853 * (py + pz) / period)
        broad = value_noise(px * 8.0, py * 8.0, pz * 8.0, seed)
        factor = 0.16 * weave * _visible_detail(0.3 * period, footprint) + 0.06 * broad
    elif kind == _SPECKLE:  # cardboard, stone
        fine = value_noise(px / period, py / period, pz / period, seed) * _visible_detail(period, footprint)
        broad = value_noise(px * 7.0, py * 7.0, pz * 7.0, seed + 1)
        factor = 0.10 * fine + 0.06 * broad
    return max(0.05, 1.0 + strength * factor), strength * warmth
