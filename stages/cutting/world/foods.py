"""Foods as closed meshes: rings of points along a spine, with seeded proportions and a smooth rough surface."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scenewright.stages.cutting.world.body import Body

RINGS, POINTS = 22, 28
"""Rings along the spine, points around it: 1,232 triangles."""


@dataclass(frozen=True)
class Family:
    """What foods of a name have in common. Lengths in metres; ranges are uniform."""

    length: tuple[float, float]
    thickness: tuple[float, float]
    """Of the thinner of the two cross axes, at its thickest."""
    flatness: tuple[float, float] = (1.0, 1.0)
    """The wider cross axis over the thinner one."""
    profile: Callable[[np.ndarray], np.ndarray] = lambda t: np.sqrt(np.maximum(1.0 - t**2, 0.0))
    """Half thickness along the spine, t from -1 to 1, as a share."""
    squareness: float = 2.0
    """Exponent of the superellipse across: 2 is round, 8 nearly a box."""
    bend: tuple[float, float] = (0.0, 0.0)
    """Angle that the spine turns through [rad]."""
    roughness: float = 0.02
    """Standard deviation of the surface, as a share of the thickness."""


def _blunt(power: float) -> Callable[[np.ndarray], np.ndarray]:
    return lambda t: np.maximum(1.0 - np.abs(t) ** power, 0.0) ** (1.0 / power)


def _taper(t: np.ndarray) -> np.ndarray:
    return np.asarray(_blunt(6.0)(t) * (0.72 - 0.28 * t))


FAMILIES: dict[str, Family] = {
    "carrot": Family((0.12, 0.19), (0.026, 0.04), profile=_taper),
    "cucumber": Family((0.13, 0.20), (0.032, 0.048), profile=_blunt(5.0), bend=(0.0, 0.25)),
    "sausage": Family((0.10, 0.17), (0.024, 0.036), profile=_blunt(8.0), bend=(0.0, 0.5), roughness=0.008),
    "potato": Family((0.08, 0.12), (0.045, 0.06), flatness=(1.05, 1.3), profile=_blunt(2.4), roughness=0.03),
    "bread": Family((0.14, 0.22), (0.05, 0.075), flatness=(1.1, 1.5), profile=_blunt(7.0), squareness=3.5),
    "cheese": Family((0.08, 0.14), (0.035, 0.055), (1.1, 1.6), _blunt(20.0), squareness=10.0, roughness=0.004),
}
"""Family -> lengths, thicknesses and shapes from which a food is drawn [m]; by eye."""


def make_food(family: str, random: np.random.Generator) -> Body:
    """Return a food of a family, its spine along z, centred."""
    kind = FAMILIES[family]
    length, thickness = random.uniform(*kind.length), random.uniform(*kind.thickness)
    wide, bend = thickness * random.uniform(*kind.flatness), random.uniform(*kind.bend)
    # Rings stand closer where the profile falls off, so that blunt ends are round.
    t = np.sin(0.5 * np.pi * np.linspace(-1.0, 1.0, RINGS + 2)[1:-1])
    share = kind.profile(t)
    angle = 2.0 * np.pi * np.arange(POINTS) / POINTS
    outline = (np.abs(np.cos(angle)) ** kind.squareness + np.abs(np.sin(angle)) ** kind.squareness) ** (
        -1.0 / kind.squareness
    )
    radius = share[:, None] * outline * (1.0 + kind.roughness * _waves(t, angle, random))
    x = 0.5 * thickness * radius * np.cos(angle)
    y = 0.5 * wide * radius * np.sin(angle)
    z = np.repeat(0.5 * length * t[:, None], POINTS, axis=1)
    rings = np.stack([x, y, z], axis=-1)
    poles = np.array([[0.0, 0.0, -0.5 * length], [0.0, 0.0, 0.5 * length]])
    vertices = np.concatenate([rings.reshape(-1, 3), poles])
    body = Body.of_mesh(_bend(vertices, length, bend), _faces())
    return body.shifted(-body.moments[0])


def _waves(t: np.ndarray, angle: np.ndarray, random: np.random.Generator) -> np.ndarray:
    """Return smooth noise (rings, points) of about unit deviation."""
    total = np.zeros((len(t), len(angle)))
    for around in range(4):
        for along in range(1, 4):
            phases = random.uniform(0.0, 2.0 * np.pi, 2)
            weight = random.normal()
            total += weight * np.outer(np.cos(np.pi * along * t + phases[0]), np.cos(around * angle + phases[1]))
    return np.asarray(total / np.sqrt(3.0))


def _bend(vertices: np.ndarray, length: float, angle: float) -> np.ndarray:
    """Return vertices (V, 3) with the z axis bent to an arc in the plane y, z."""
    if angle < 1e-3:
        return vertices
    radius = length / angle
    turned = vertices[:, 2] / radius
    out = radius - vertices[:, 1]
    return np.column_stack([vertices[:, 0], radius - out * np.cos(turned), out * np.sin(turned)])


def _faces() -> np.ndarray:
    around = np.arange(POINTS)
    ahead = (around + 1) % POINTS
    faces = []
    for ring in range(RINGS - 1):
        low, high = ring * POINTS, (ring + 1) * POINTS
        faces += [np.column_stack([low + around, low + ahead, high + ahead])]
        faces += [np.column_stack([low + around, high + ahead, high + around])]
    south, north, last = RINGS * POINTS, RINGS * POINTS + 1, (RINGS - 1) * POINTS
    faces += [np.column_stack([np.full(POINTS, south), ahead, around])]
    faces += [np.column_stack([np.full(POINTS, north), last + around, last + ahead])]
    return np.concatenate(faces)
