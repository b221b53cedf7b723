"""What can be done with what, as static atoms: within reach, graspable, carries a load, takes things, has room."""

from __future__ import annotations

import numpy as np
from scenewright.stages.kit.acting.hand.grip import narrowest_width
from scenewright.stages.kit.acting.hand.rim_grasps import rim_grasps
from scenewright.stages.kit.geometry.transforms import apply
from scenewright.stages.kit.motion.kinematics import reach, shoulder_height
from scenewright.stages.kit.simulation.robot_description import RobotDescription
from scenewright.stages.kit.simulation.world import FRICTION, GRAVITY
from scenewright.stages.kit.tasks.strips import Atom
from scenewright.stages.plan.world_model import WorldModel

LAYOUT = ("floor", "wall", "ceiling")
"""Classes of the room itself, which nobody moves."""
CARRIER_CLASSES = ("tray", "plate")
"""Classes of things that others are carried on."""


def affordance_atoms(model: WorldModel, objects: dict[str, str], size_uncertainty: float) -> set[Atom]:
    """Return the static atoms of a scene.

    `reachable`: at a height that the arm reaches from its pedestal; that a base fits before it shows in the geometry.
    `graspable`: not heavier than the fingers hold (`liftable_mass`), and narrower than they open, give or take
    `size_uncertainty` [m], or with a rim for carriers.
    `flat`: has a place to put things that no door hides. `fits(item, x)`: of a support, it has room on such a place;
    of a door, behind it. `entrance(door, container)`: something behind this door takes things.
    """
    atoms: set[Atom] = set()
    items = [name for name, kind in objects.items() if kind == "item"]
    feet = {name: model.footprint(name) for name in items}
    for name, kind in objects.items():
        if kind == "item":
            atoms |= _of_item(model, name, size_uncertainty)
        if kind in ("surface", "container") or ("carrier", name) in atoms:
            atoms |= _of_support(model, name, feet)
    return atoms


def within_height(model: WorldModel, height: float) -> bool:
    """Whether the arm on its pedestal reaches a height [m] at some distance."""
    shoulder = model.description.pedestal_height + shoulder_height(model.chain)
    return abs(height - shoulder) < 0.95 * reach(model.chain)


def liftable_mass(robot: RobotDescription) -> float:
    """Return the largest mass [kg] that the friction of both fingers holds against gravity."""
    return 2 * FRICTION * robot.finger_force / GRAVITY


def _of_item(model: WorldModel, name: str, size_uncertainty: float) -> set[Atom]:
    atoms: set[Atom] = set()
    points = apply(model.pose(name), model.points(name))
    if within_height(model, float(points[:, 2].mean())):
        atoms.add(("reachable", name))
    carrier = model.records[name].class_name in CARRIER_CLASSES
    if carrier:
        atoms.add(("carrier", name))
    if model.records[name].mass > liftable_mass(model.description):
        return atoms
    if narrowest_width(points) < model.description.opening + size_uncertainty or (
        carrier and has_rim(model, name, size_uncertainty)
    ):
        atoms.add(("graspable", name))
    return atoms


def _of_support(model: WorldModel, name: str, feet: dict[str, tuple[float, float]]) -> set[Atom]:
    atoms: set[Atom] = set()
    for region in model.regions(name):
        if not region.carries_things or not within_height(model, model.height_of(region)):
            continue
        fitting = [item for item, (radius, height) in feet.items() if item != name and region.takes(radius, height)]
        if not fitting:
            continue
        atoms.add(("reachable", name))
        if not region.doors:
            atoms |= {("flat", name)} | {("fits", item, name) for item in fitting}
        for door in region.doors:
            atoms |= {("entrance", door, name)} | {("fits", item, door) for item in fitting}
    for joint in model.records[name].joints:
        if joint.handle is not None:
            handle = apply(model.pose(name), np.array(joint.handle))
            if within_height(model, float(handle[2])):
                atoms.add(("reachable", joint.name))
    return atoms


def has_rim(model: WorldModel, item: str, uncertainty: float) -> bool:
    """Whether a thing can be lifted by its rim, which may be up to `uncertainty` [m] higher than it looks."""
    random = np.random.default_rng(0)
    return bool(rim_grasps(model.points(item), model.pose(item), random, uncertainty=uncertainty))
