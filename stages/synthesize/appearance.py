"""How the room looks: surface patterns by class, gloss, lamps. Gloss also decides where the depth camera goes blind."""

from __future__ import annotations

import numpy as np
from scenewright.stages.kit.rendering.light_map import AreaLight
from scenewright.stages.kit.rendering.patterns import Material
from scenewright.stages.synthesize.arrangement import Arrangement
from scenewright.stages.synthesize.placement import PlacedObject
from scenewright.stages.synthesize.recipes import Shell
from scenewright.stages.synthesize.shell import Room

GLOSS = {
    "fridge": 0.30,
    "microwave": 0.45,
    "monitor": 0.80,
    "bottle": 0.75,
    "cup": 0.40,
    "bowl": 0.40,
    "bin": 0.30,
    "lamp": 0.30,
    "cabinet": 0.12,
    "wall_cabinet": 0.12,
    "keyboard": 0.15,
    "desk": 0.10,
    "table": 0.10,
}
"""How much the surface of a class shines (0..1); by eye."""
WOODEN = ("table", "desk", "shelf", "chair", "cabinet", "wall_cabinet")
"""Classes with a grain of wood."""
FABRIC = ("sofa", "bed")
"""Classes with a weave."""
AMBIENT = (0.10, 0.10, 0.11)
"""Light that comes from everywhere (R, G, B of 0..1); by eye."""
SKY = (1.6, 1.7, 1.9)
"""Comes in from above in rooms without a ceiling."""


def layout_materials(room: Room, shell: Shell) -> dict[int, Material]:
    """Return the materials of floor, walls and ceiling by instance (1, 2, ...)."""
    materials = {}
    for instance, layout in enumerate(room.layouts, start=1):
        if layout.class_name == "floor":
            along = np.eye(4)
            if room.size[1] > room.size[0]:  # boards run along the longer side
                along[:2, :2] = [[0.0, 1.0], [-1.0, 0.0]]
            materials[instance] = Material(
                shell.floor_pattern, period=shell.floor_period, gloss=0.06, sharpness=30.0, pattern_from_world=along
            )
        elif layout.class_name == "wall":
            materials[instance] = Material("plaster", seed=instance, skirting=0.08)
        else:
            materials[instance] = Material("plaster", strength=0.35, seed=instance)
    return materials


def object_material(thing: PlacedObject) -> Material:
    """Return the material of an object: grain on brown furniture, weave on upholstery, speckle on cardboard, gloss."""
    gloss = GLOSS.get(thing.class_name, 0.0)
    frame = np.linalg.inv(thing.world_from_model)
    seed = 17 * thing.instance
    if thing.class_name in WOODEN:
        return Material("wood", 0.8, 0.05, gloss, 25.0, seed, frame, only_wood=True)
    if thing.class_name in FABRIC:
        return Material("fabric", 1.0, 0.008, 0.0, 10.0, seed, frame)
    if thing.class_name in ("box", "book"):
        return Material("speckle", 0.8, 0.004, 0.05, 20.0, seed, frame)
    return Material("plain", 1.0, 0.2, gloss, 60.0, seed, frame)


def lamps(room: Room, shell: Shell) -> tuple[AreaLight, ...]:
    """Return two flat lamps just under the ceiling, along the longer side."""
    width, depth, height = room.size
    axis = np.array([1.0, 0.0, 0.0]) if width >= depth else np.array([0.0, 1.0, 0.0])
    red, green, blue = (9.0 * c for c in shell.lamp_color)
    lights = []
    for side in (-1.0, 1.0):
        x, y, z = axis * side * 0.24 * max(width, depth) + np.array([0.0, 0.0, height - 0.03])
        lights.append(AreaLight((float(x), float(y), float(z)), (0.9, 0, 0), (0, -0.9, 0), (red, green, blue)))
    return tuple(lights)


def gloss_table(arrangement: Arrangement) -> np.ndarray:
    """Return gloss (0..1) by instance id, as an array that an instance image indexes."""
    last = max([thing.instance for thing in arrangement.objects], default=arrangement.first_object)
    table = np.zeros(last + 1, dtype=np.float32)
    for thing in arrangement.objects:
        table[thing.instance] = GLOSS.get(thing.class_name, 0.0)
    return table
