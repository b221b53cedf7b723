"""Who stands on whom: as a kinematic tree has it, and as the contacts of a physics world tell."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping

from scenewright.stages.kit.simulation.world import PhysicsWorld

HAND = "hand"
"""Parent of what is held."""
NOTHING = "nothing"
"""Parent of what touches nothing from above."""
STEEP = 0.5
"""Least upward share of a contact normal of something that carries."""
TOUCHING = 0.002
"""Bodies that are closer than this touch [m]."""


def carried_by(parents: Mapping[str, str], item: str) -> list[str]:
    """Return what stands on an item, and on that, nearest first. `parents`: body -> what carries it."""
    carried: list[str] = []
    waiting = [item]
    while waiting:
        below = waiting.pop()
        fresh = [name for name, parent in parents.items() if parent == below and name not in carried]
        carried += fresh
        waiting += fresh
    return carried


def carrier(world: PhysicsWorld, name: str) -> str | None:
    """Return the body of a world that pushes a thing upwards most, by the contacts of the last step; None: nothing."""
    push: dict[str, float] = defaultdict(float)
    for contact in world.contacts(world.bodies[name].body_id):
        body = world.name_of(contact.other_body)
        if body is None or body == name or contact.normal[2] < STEEP or contact.depth < -TOUCHING:
            continue
        push[body] += float(contact.normal[2]) * (contact.force + 1e-3)  # what sleeps has no forces
    return max(sorted(push), key=lambda body: push[body]) if push else None
