"""Fill a room by the rules of a recipe: nothing overlaps, everything rests on something, doors can swing."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import count

import numpy as np
import trimesh
from scenewright.schemas.cad_library import CadModel
from scenewright.schemas.errors import BadInput
from scenewright.stages.kit.geometry.transforms import transform_from_yaw
from scenewright.stages.synthesize.collision import CollisionWorld, PlacedShape, box_shape
from scenewright.stages.synthesize.furniture import Catalogue, Furnishing, main_joint
from scenewright.stages.synthesize.less_common import across_two, beside_its_like, from_ceiling, leaning
from scenewright.stages.synthesize.parameters import OTHER_ROOM
from scenewright.stages.synthesize.placement import Hanging, PlacedObject, Pose
from scenewright.stages.synthesize.recipes import CLUTTER_FACTOR, Place, Recipe
from scenewright.stages.synthesize.shell import Room, build_room
from scenewright.stages.synthesize.support import sample_stand

ATTEMPTS = 160
"""Poses tried for one object."""
RESTARTS = 24
"""Rooms begun before the recipe is given up."""
HEADROOM = 1.9
"""Height of the space that must stay free for people and robots [m]."""
CENTRE_MARGIN, FLOOR_MARGIN, TOUCH = 0.8, 0.04, 4e-4
"""Margins [m], by eye: of what stands free to the walls, between things on the floor, and between a thing and what it
stands on."""


@dataclass(frozen=True)
class Arrangement:
    """A furnished room."""

    room: Room
    objects: tuple[PlacedObject, ...]
    first_object: int
    """Instances below this are layout: 1 the floor, then walls and ceiling."""


def world_meshes(arrangement: Arrangement) -> list[tuple[int, trimesh.Trimesh]]:
    """Return (instance, mesh in the world frame) of layout and objects."""
    layout = [(k, entry.mesh) for k, entry in enumerate(arrangement.room.layouts, start=1)]
    return layout + [(thing.instance, thing.world_mesh()) for thing in arrangement.objects]


class _Impossible(Exception):
    """This start of a room cannot be finished."""


def arrange(
    recipe: Recipe,
    catalogue: Catalogue,
    clutter: str,
    seed: int,
    objection: Callable[[Arrangement], str | None] = lambda arrangement: None,
    *,
    rearranged: int = 0,
) -> Arrangement:
    """Furnish a room. The same recipe, library, clutter and seed give the same room.

    `objection` may refuse a finished room by returning why; another is begun then. `rearranged`: which other draw of
    the things that lie on its furniture, 0 the first. Raises BadInput when a class is missing from the library, or when
    no start satisfies the recipe's least counts and the objection.
    """
    for rule in recipe.place:
        if rule.count[0] > 0 and not catalogue.by_class.get(rule.class_name):
            raise BadInput(
                f"the CAD library has no {rule.class_name!r}, which the recipe needs",
                hint="build the library with all classes",
            )
    reasons: list[str] = []
    for start in range(RESTARTS):
        random = np.random.default_rng([seed, 11, start])
        try:
            arranger = _Arranger(recipe, catalogue, clutter, random)
            arrangement = arranger.run()
            refused = objection(arrangement)
            if refused is None:
                if rearranged:
                    return arranger.rearranged(np.random.default_rng([seed, 12, rearranged]))
                return arrangement
            reasons.append(refused)
        except _Impossible as reason:
            reasons.append(str(reason))
    raise BadInput(f"no room found for seed {seed} in {RESTARTS} starts; last: {reasons[-1]}", hint=OTHER_ROOM)


class _Arranger:
    """One start: places rule after rule."""

    def __init__(self, recipe: Recipe, catalogue: Catalogue, clutter: str, random: np.random.Generator) -> None:
        self.recipe, self.catalogue, self.random = recipe, catalogue, random
        self.clutter = CLUTTER_FACTOR[clutter]
        self.room = build_room(recipe.shell, random)
        self.objects: list[PlacedObject] = []
        self.rules: list[Place] = []
        """By which each was placed."""
        self.first_object = len(self.room.layouts) + 1
        self.numbers: Iterator[int] = count(self.first_object)
        self.solid = CollisionWorld()
        self.kept_free = CollisionWorld()
        """Floor that must stay free, and what doors sweep; named by the owner."""

    def run(self) -> Arrangement:
        """Apply all rules in order. Raises _Impossible."""
        for rule in self.recipe.place:
            least, most = rule.count
            if rule.clutter:
                least, most = int(round(least * self.clutter)), int(round(most * self.clutter))
            target_count = int(self.random.integers(least, most + 1))
            placed = 0
            for _ in range(target_count):
                placed += self._place_one(rule)
            if placed < least:
                raise _Impossible(f"{rule.class_name}: {placed} of at least {least} placed ({rule.where})")
        return Arrangement(self.room, tuple(self.objects), self.first_object)

    def rearranged(self, random: np.random.Generator) -> Arrangement:
        """Return the room with another thing, elsewhere, for each that lies on something and has no joint of its own.
        One for which no place is found is left away, and its instance is nobody's."""
        self.random = random
        carried: dict[int, Place] = {}
        names: set[str] = set()
        for thing, rule in zip(self.objects, self.rules, strict=True):
            below = {thing.parent, *(entry.source for entry in thing.further)}
            if (rule.where == "on" and not thing.furnishing.model.joints) or below & names:
                carried[thing.instance] = rule
                names.add(thing.name)
        self.objects = [thing for thing in self.objects if thing.name not in names]
        for name in names:
            del self.solid.shapes[name]
        for instance, rule in carried.items():
            self.numbers = iter([instance])
            self._place_one(rule)
        return Arrangement(self.room, tuple(sorted(self.objects, key=lambda thing: thing.instance)), self.first_object)

    def _place_one(self, rule: Place) -> bool:
        models = [m for m in self.catalogue.by_class.get(rule.class_name, []) if _suits(m, rule)]
        if rule.where == "beside":
            standing = {thing.furnishing.model.id for thing in self.objects if thing.class_name in rule.of}
            models = [model for model in models if model.id in standing]
        if not models:
            return False
        for k in self.random.permutation(len(models))[:4]:
            furnishing = self._furnish(models[int(k)], rule)
            best: tuple[float, Pose, PlacedShape] | None = None
            accepted = 0
            for pose in self._poses(furnishing, rule):
                shape = self._acceptable_shape(furnishing, pose, rule)
                if shape is None:
                    continue
                accepted += 1
                score = self._distance_to(rule.near, pose) if rule.near else 0.0
                if best is None or score < best[0]:
                    best = (score, pose, shape)
                if not rule.near or accepted >= 8:
                    break
            if best is not None:
                self._commit(furnishing, best[1], best[2], rule)
                return True
        return False

    def _furnish(self, model: CadModel, rule: Place) -> Furnishing:
        joints: dict[str, float] = {}
        if rule.open is not None and model.joints:
            joint = main_joint(model)
            if rule.any_joint:
                joint = model.joints[int(self.random.integers(len(model.joints)))]
            share = self.random.uniform(*rule.open)
            joints[joint.name] = round(joint.lower + share * (joint.upper - joint.lower), 4)
        scale = round(float(self.random.uniform(*rule.scale)), 3) if rule.scale[0] < rule.scale[1] else rule.scale[0]
        return self.catalogue.furnishing(model, joints, scale)

    # Candidate poses, rule by rule.

    def _poses(self, furnishing: Furnishing, rule: Place) -> Iterator[Pose]:
        pose_makers: dict[str, Callable[[Furnishing, Place], Pose | None]] = {
            "wall": self._at_wall,
            "mounted": self._on_wall,
            "centre": self._in_centre,
            "floor": self._on_floor,
            "around": self._around,
            "front": self._around,
            "on": self._on_surface,
            "ceiling": lambda thing, by: from_ceiling(self.room, self.objects, thing, by, self.random),
            "beside": lambda thing, by: beside_its_like(self.objects, thing, by, self.random),
            "across": lambda thing, by: across_two(self.objects, thing, by, self.random),
            "leaning": lambda thing, by: leaning(self.room, self.objects, thing, by, self.random),
        }
        make_pose = pose_makers[rule.where]
        for _ in range(ATTEMPTS):
            pose = make_pose(furnishing, rule)
            if pose is not None:
                yield pose

    def _turn(self, rule: Place) -> float:
        return float(self.random.uniform(-rule.yaw_spread, rule.yaw_spread)) if rule.yaw_spread else 0.0

    def _at_wall(self, furnishing: Furnishing, rule: Place) -> Pose | None:
        size = furnishing.closed_size
        wall = self.room.walls[int(self.random.integers(4))]
        inward = wall.inward[:2]
        along = np.array([-inward[1], inward[0]])
        half_room = self.room.size[:2] / 2
        length = float(abs(along) @ half_room) - size[0] / 2 - 0.01
        if length <= 0:
            return None
        depth = float(abs(inward) @ half_room) - size[1] / 2 - self.random.uniform(*rule.gap)
        middle = along * self.random.uniform(-length, length) - inward * depth
        yaw = _yaw_facing(inward) + self._turn(rule)
        return Pose(transform_from_yaw(yaw, np.array([*middle, 0.0])), "floor_1")

    def _on_wall(self, furnishing: Furnishing, rule: Place) -> Pose | None:
        size = furnishing.closed_size
        k = int(self.random.integers(4))
        inward = self.room.walls[k].inward[:2]
        along = np.array([-inward[1], inward[0]])
        half_room = self.room.size[:2] / 2
        length = float(abs(along) @ half_room) - size[0] / 2 - 0.05
        if length <= 0:
            return None
        depth = float(abs(inward) @ half_room) - size[1] / 2
        middle = along * self.random.uniform(-length, length) - inward * depth
        low, high = rule.height or (1.3, 1.5)
        bottom = float(self.random.uniform(low, high))
        if bottom + size[2] > self.room.size[2] - 0.02:
            return None
        pose = transform_from_yaw(_yaw_facing(inward), np.array([*middle, bottom]))
        return Pose(pose, f"wall_{2 + k}", "carries_on_wall", 0)

    def _in_centre(self, furnishing: Furnishing, rule: Place) -> Pose | None:
        spare = self.room.size[:2] / 2 - CENTRE_MARGIN - furnishing.closed_size[:2].min() / 2
        if np.any(spare <= 0):
            return None
        middle = self.random.uniform(-spare, spare)
        yaw = float(self.random.integers(4)) * np.pi / 2 + self._turn(rule)
        return Pose(transform_from_yaw(yaw, np.array([*middle, 0.0])), "floor_1")

    def _on_floor(self, furnishing: Furnishing, rule: Place) -> Pose | None:
        spare = self.room.size[:2] / 2 - furnishing.closed_size[:2].max() / 2
        middle = self.random.uniform(-spare, spare)
        yaw = float(self.random.uniform(-np.pi, np.pi))
        return Pose(transform_from_yaw(yaw, np.array([*middle, 0.0])), "floor_1")

    def _around(self, furnishing: Furnishing, rule: Place) -> Pose | None:
        targets = [o for o in self.objects if o.class_name in rule.of]
        if not targets:
            return None
        target = targets[int(self.random.integers(len(targets)))]
        size, closed_size = target.furnishing.closed_size, furnishing.closed_size
        side = 0 if rule.where == "front" else int(self.random.integers(4))
        direction = np.array([(0.0, -1.0), (1.0, 0.0), (0.0, 1.0), (-1.0, 0.0)][side])
        across = np.array([-direction[1], direction[0]])
        slack = max(0.0, float(abs(across) @ size[:2]) / 2 - closed_size[0] / 2 - 0.02)
        reach = float(abs(direction) @ size[:2]) / 2 + closed_size[1] / 2 + self.random.uniform(*rule.gap)
        at = direction * reach + across * self.random.uniform(-slack, slack)
        world = target.world_from_model
        middle = world[:2, :2] @ at + world[:2, 3]
        yaw = _yaw_facing(world[:2, :2] @ -direction) + self._turn(rule)
        return Pose(transform_from_yaw(yaw, np.array([*middle, 0.0])), "floor_1", at=target.name)

    def _on_surface(self, furnishing: Furnishing, rule: Place) -> Pose | None:
        targets = [o for o in self.objects if o.class_name in rule.of]
        if not targets:
            return None
        target = targets[int(self.random.integers(len(targets)))]
        stand = sample_stand(target, furnishing, rule, self.random)
        if stand is None:
            return None
        pose, plane, inside = stand
        relation: Hanging = "contains" if inside and target.furnishing.model.contains else "supports"
        return Pose(pose, target.name, relation, plane, at=target.name)

    # Whether a pose is good.

    def _acceptable_shape(self, furnishing: Furnishing, pose: Pose, rule: Place) -> PlacedShape | None:
        """Return the shape at the pose, or None."""
        on_something = rule.where in ("on", "across")
        lift = np.eye(4)
        lift[2, 3] = 2.0 * TOUCH
        trial = furnishing.shape.placed(lift @ pose.world_from_model)
        if not self.room.holds(trial.minimum, trial.maximum):
            return None
        margin = rule.spare if on_something else 0.015
        if rule.where == "floor":
            margin = FLOOR_MARGIN
        touching = {name: TOUCH for name in (pose.parent, *(entry.source for entry in pose.further))}
        if self.solid.conflict(trial, margin, margins=touching) is not None:
            return None
        may_overlap = [name for name in self.kept_free.shapes if pose.at and name.startswith(f"{pose.at}/floor")]
        if rule.surface == "drawer":  # what lies in a drawer moves with it
            may_overlap.append(f"{pose.at}/swing")
        if self.kept_free.conflict(trial, 0.0, without=may_overlap) is not None:
            return None
        swing = furnishing.swing
        if swing is not None:
            swept = swing.placed(lift @ pose.world_from_model)
            if not self.room.holds(swept.minimum, swept.maximum):
                return None
            # It may swing through free floor and through where another door swings, not into things.
            if self.solid.conflict(swept, 0.005) is not None:
                return None
        for space in self._free_spaces(furnishing, pose, rule):
            if not self.room.holds(space.minimum, space.maximum) or self.solid.conflict(space) is not None:
                return None
        if rule.room_beside > 0 and self._free_side(furnishing, pose, rule) is None:
            return None
        if on_something and not self._roomy(furnishing, pose, rule):
            return None
        return furnishing.shape.placed(pose.world_from_model)

    def _free_spaces(self, furnishing: Furnishing, pose: Pose, rule: Place) -> list[PlacedShape]:
        """The free floor that the rule wants in front."""
        if rule.room_in_front <= 0:
            return []
        size = furnishing.closed_size
        low = np.array([-size[0] / 2, -size[1] / 2 - rule.room_in_front, 0.03])
        high = np.array([size[0] / 2, -size[1] / 2 - 0.002, HEADROOM])
        return [box_shape(low, high).placed(pose.world_from_model)]

    def _free_side(self, furnishing: Furnishing, pose: Pose, rule: Place) -> PlacedShape | None:
        """A strip of free floor along one of the four sides, the first that is free, or None."""
        half, deep = furnishing.closed_size / 2, rule.room_beside
        sides = [
            ((-half[0], -half[1] - deep), (half[0], -half[1] - 0.002)),
            ((half[0] + 0.002, -half[1]), (half[0] + deep, half[1])),
            ((-half[0], half[1] + 0.002), (half[0], half[1] + deep)),
            ((-half[0] - deep, -half[1]), (-half[0] - 0.002, half[1])),
        ]
        for low, high in sides:
            strip = box_shape(np.array([*low, 0.03]), np.array([*high, HEADROOM])).placed(pose.world_from_model)
            if self.room.holds(strip.minimum, strip.maximum) and self.solid.conflict(strip) is None:
                return strip
        return None

    def _roomy(self, furnishing: Furnishing, pose: Pose, rule: Place) -> bool:
        """Whether the gripper's space beside and above an item is free (it may reach into other kept-free floor)."""
        if rule.spare_beside <= 0 and rule.spare_above <= 0:
            return True
        half = furnishing.closed_size / 2
        low = np.array([-half[0] - rule.spare_beside, -half[1], 0.02])
        high = np.array([half[0] + rule.spare_beside, half[1], 2 * half[2] + rule.spare_above])
        # Turned with the parent, not with the item: the gripper comes from the parent's front.
        parent = next(o for o in self.objects if o.name == pose.parent)
        frame = parent.world_from_model.copy()
        frame[:3, 3] = pose.world_from_model[:3, 3]
        return self.solid.conflict(box_shape(low, high).placed(frame)) is None

    def _distance_to(self, class_name: str | None, pose: Pose) -> float:
        places = [o.world_from_model[:2, 3] for o in self.objects if o.class_name == class_name]
        return min((float(np.linalg.norm(p - pose.world_from_model[:2, 3])) for p in places), default=0.0)

    def _commit(self, furnishing: Furnishing, pose: Pose, shape: PlacedShape, rule: Place) -> None:
        instance = next(self.numbers)
        self.rules.append(rule)
        name = f"{rule.class_name}_{instance}"
        spaces = self._free_spaces(furnishing, pose, rule)
        if rule.room_beside > 0:
            strip = self._free_side(furnishing, pose, rule)
            if strip is not None:
                spaces.append(strip)
        for k, space in enumerate(spaces):
            self.kept_free.add(f"{name}/floor{k}", space)
        if furnishing.swing is not None:
            self.kept_free.add(f"{name}/swing", furnishing.swing.placed(pose.world_from_model))
        self.solid.add(name, shape)
        self.objects.append(
            PlacedObject(
                name,
                instance,
                rule.class_name,
                furnishing,
                pose.world_from_model,
                pose.parent,
                pose.relation,
                pose.plane,
                pose.further,
            )
        )


def _suits(model: CadModel, rule: Place) -> bool:
    size = np.asarray(model.states[0].box_maximum) - np.asarray(model.states[0].box_minimum)
    if rule.largest_extent is not None and max(size[:2]) > rule.largest_extent:
        return False
    if rule.largest_height is not None and size[2] > rule.largest_height:
        return False
    if rule.smallest_height is not None and size[2] < rule.smallest_height:
        return False
    if rule.style and model.recipe.get("style") not in rule.style:
        return False
    if rule.open is not None and not model.joints:
        return False
    return not (rule.graspable and model.grasp_width is None)


def _yaw_facing(direction: np.ndarray) -> float:
    """Return the yaw [rad] that turns a model's front (-y) to a direction (2,)."""
    return float(np.arctan2(direction[1], direction[0]) + np.pi / 2)
