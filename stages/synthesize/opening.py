"""What somebody opened or shut while the room was recorded: doors and drawers that stand in two states."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scenewright.schemas.cad_library import Affordances
from scenewright.stages.kit.geometry.transforms import transform_from
from scenewright.stages.synthesize.arrangement import TOUCH, Arrangement
from scenewright.stages.synthesize.collision import CollisionWorld
from scenewright.stages.synthesize.furniture import Catalogue, same_plane
from scenewright.stages.synthesize.placement import PlacedObject

OPENED = (0.35, 1.0)
"""Share of its range by which a joint is opened."""
KINDS = ("door", "drawer")
"""Kinds of joints that are opened: on lids things may stand."""
CLEAR = 0.01
"""Distance between what was opened and everything else [m]."""


@dataclass(frozen=True)
class TwoStates:
    """One room before and after somebody went through it, and with everything open that ever was."""

    before: Arrangement
    after: Arrangement
    opened: Arrangement


def open_some(arrangement: Arrangement, catalogue: Catalogue, count: int, random: np.random.Generator) -> TwoStates:
    """Return a room in which up to `count` things that stand shut are open in one of two states, one joint each.

    Half of them stand open first and are shut afterwards. A joint is passed over where its open part would touch
    something.
    """
    affordances = {entry.model: entry for entry in catalogue.library.info.affordances}
    solid = CollisionWorld()
    for thing in arrangement.objects:
        solid.add(thing.name, thing.furnishing.shape.placed(_lifted_pose(thing)))
    shut: dict[str, PlacedObject] = {}
    opened: dict[str, PlacedObject] = {}
    renumbered: dict[str, dict[int, int]] = {}
    for k in random.permutation(len(arrangement.objects)):
        thing = arrangement.objects[int(k)]
        names = _openable_joints(thing, affordances.get(thing.furnishing.model.id))
        if len(opened) == count or not names:
            continue
        model, scale = thing.furnishing.model, thing.furnishing.scale
        name = names[int(random.integers(len(names)))]
        joint = next(entry for entry in model.joints if entry.name == name)
        value = round(joint.lower + float(random.uniform(*OPENED)) * (joint.upper - joint.lower), 4)
        trial = replace(thing, furnishing=catalogue.furnishing(model, {name: value}, scale))
        shape = trial.furnishing.shape.placed(_lifted_pose(thing))
        may_touch = {
            thing.name,
            thing.parent,
            *(other.name for other in arrangement.objects if other.parent == thing.name),
        }
        inside = arrangement.room.holds(shape.minimum, shape.maximum)
        planes = planes_kept(thing, trial)
        carrying = {number for other in arrangement.objects for number in planes_under(other, thing.name)}
        if not inside or not carrying <= set(planes) or solid.conflict(shape, CLEAR, without=may_touch) is not None:
            continue
        renumbered[thing.name] = planes
        solid.add(thing.name, shape)
        opened[thing.name] = trial
        shut[thing.name] = replace(thing, furnishing=catalogue.furnishing(model, {name: 0.0}, scale))
    first = {name: bool(random.random() < 0.5) for name in opened}

    def state(is_open: Sequence[str]) -> Arrangement:
        chosen = {**shut, **{name: opened[name] for name in is_open}}
        objects = [chosen.get(thing.name, thing) for thing in arrangement.objects]
        numbers = {name: renumbered[name] for name in is_open}
        return replace(arrangement, objects=tuple(carried_as_numbered(thing, numbers) for thing in objects))

    return TwoStates(
        before=state([name for name in opened if first[name]]),
        after=state([name for name in opened if not first[name]]),
        opened=state(list(opened)),
    )


def planes_kept(shut: PlacedObject, opened: PlacedObject) -> dict[int, int]:
    """Return index -> index: the surfaces of a thing that stands shut, among those that it has opened."""
    after = opened.furnishing.surfaces
    return {
        k: opened_index
        for k, plane in enumerate(shut.furnishing.surfaces)
        for opened_index, candidate in enumerate(after)
        if same_plane(plane, candidate)
    }


def planes_under(thing: PlacedObject, carrier: str) -> list[int]:
    """Return the indices of the carrier's surfaces that a thing stands on or touches."""
    main_planes = [thing.plane] if thing.parent == carrier else []
    further_planes = [entry.plane for entry in thing.further if entry.source == carrier]
    return [plane for plane in (*main_planes, *further_planes) if plane is not None]


def carried_as_numbered(thing: PlacedObject, numbers: Mapping[str, Mapping[int, int]]) -> PlacedObject:
    """Return a thing whose carriers' surfaces are numbered anew. `numbers`: carrier -> index -> index."""

    def anew(carrier: str, plane: int | None) -> int | None:
        return plane if plane is None or carrier not in numbers else numbers[carrier][plane]

    further = tuple(replace(entry, plane=anew(entry.source, entry.plane)) for entry in thing.further)
    return replace(thing, plane=anew(thing.parent, thing.plane), further=further)


def _openable_joints(thing: PlacedObject, affordances: Affordances | None) -> list[str]:
    """Return the doors and drawers of a thing that stands shut and stays where it is."""
    furnishing = thing.furnishing
    if affordances is None or furnishing.model.movable or any(furnishing.joints.values()):
        return []
    return [use.joint for use in affordances.joints if use.kind in KINDS and not use.behind]


def _lifted_pose(thing: PlacedObject) -> np.ndarray:
    """Return its pose a little over what it stands on, so that standing is no touch."""
    return transform_from(np.eye(3), np.array([0.0, 0.0, 2 * TOUCH])) @ thing.world_from_model
