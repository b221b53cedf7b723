"""Furniture that cannot be free: it lies deep in what stays, so that physics would throw it across the room.

Two things that a map does not tell apart, or a desk that is one with the unnamed heap on it, are no less fixed for
being of a class that could be pushed. The overlap stays and is told; what is in it is not let go.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path

from scenewright.schemas.vocabulary import load_vocabulary
from scenewright.stages.kit.simulation.world import load_scene
from scenewright.stages.urdf.scene_penetration import Overlap, resting_overlaps

DEPTH = 0.005
"""Overlaps up to this are noise, which the bodies leave by themselves [m]."""


def wedged_furniture(root: Path) -> dict[str, str]:
    """Return free furniture of the scene written to `root` that has to stay -> what it lies in. Raises BadInput."""
    vocabulary = load_vocabulary()
    with load_scene(root) as world:
        records = {name: body.record for name, body in world.bodies.items()}
        free = {name: record.mass for name, record in records.items() if record.movable and record.furniture}
        if not free:
            return {}
        floors = {name for name, record in records.items() if vocabulary.by_name(record.class_name).name == "floor"}
        carried = {name for name, record in records.items() if record.movable and not record.furniture}
        overlaps = [pair for pair in resting_overlaps(world, DEPTH) if not {pair.first, pair.second} & floors]
    return held(free, carried, overlaps)


def held(free: Mapping[str, float], carried: Iterable[str], overlaps: Iterable[Overlap]) -> dict[str, str]:
    """Return which of `free` furniture (name -> mass [kg]) has to stay -> what it lies in.

    What lies in a thing that stays, stays; of free furniture in each other the heaviest does, and with it the rest.
    Overlaps with what an arm carries (`carried`) hold nothing.
    """
    loose = set(carried)
    pairs = [(o.first, o.second) for o in overlaps if o.first != o.second and not {o.first, o.second} & loose]
    meets = [pair for a, b in pairs for pair in ((a, b), (b, a)) if pair[0] in free]
    wedged_in: dict[str, str] = {}
    while True:
        open_pairs = [(name, other_name) for name, other_name in meets if name not in wedged_in]
        fast = [
            (name, other_name) for name, other_name in open_pairs if other_name not in free or other_name in wedged_in
        ]
        if not fast and open_pairs:
            fast = [max(open_pairs, key=lambda pair: (free[pair[0]], pair[0]))]
        if not fast:
            return wedged_in
        wedged_in |= {name: other_name for name, other_name in reversed(fast)}
