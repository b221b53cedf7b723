"""Our ways of the same calls: what failed is repaired by the smallest layer that can, and what was done is looked at.

Within a call: another view, another grasp, another base pose. Above it, by the brain: another object, another plan. A
call answers with what was found out, as a kind, a sentence and numbers.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import partial
from itertools import chain
from math import hypot

import numpy as np
from scenewright.schemas.plan import Failure
from scenewright.stages.agent.arms.next_view import ahead_of, best_floor_view, fallen_where, floor_seen, worth
from scenewright.stages.agent.arms.skills import CommonSkills
from scenewright.stages.agent.arms.stations import APART, around, corners, drivable, other_sides, spots
from scenewright.stages.agent.body import Body
from scenewright.stages.agent.exploration import explore
from scenewright.stages.agent.goals import CARRIERS
from scenewright.stages.agent.language.values import ObjectMap, Observation, Outcome, SceneObject
from scenewright.stages.agent.scene_map import ENOUGH, Item, Region, classes_not_of, quarter
from scenewright.stages.agent.senses import Base, Detection, Position, Take

SURE_OF_USE = 2
"""Regions of views by which a thing has to be ahead in being clean or used."""
SEEN_FROM = 2
"""Regions of views from which every corner of furniture is looked at before what is not seen there counts as absent."""
MOST_VIEWS = 6
"""Most regions of views that one look at furniture takes; by eye."""
TRIES = 6
"""Executions within one call."""
BESIDE = 0.4
"""How far around its spot something is looked for that is not on it [m]."""
AWAY = 0.1
"""Farthest that what was placed may lie from its spot [m]; by eye."""
OFF_SPOT = 0.05
"""Spots this near to one that something rolled off are not tried again [m]."""
SAME_POSE = 0.15
"""Base poses this near to one that could not be driven to are left alone [m]."""
SAME_ON_SIDE, SAME_BEFORE_OPEN = 0.3, 0.1
"""Base poses this near to one that was tried are as good as it [m]; into a shelf the arm gets from few."""
SAME_TARGET = 0.1
"""A base pose that failed for one position fails for those this near [m]."""
HAND_VIEWS = 3
"""Looks at the hand from which what it holds is told; by eye."""
FLOOR_VIEWS, FLOOR_AT = 4, 1.2
"""Looks at the floor for what fell, and how far before the base they are at [m]."""
LITTLE = 0.1
"""No look is taken that shows less of where it may lie."""
CLOSER = (0.09, 0.12)
"""Distance of spots from each other, and from the edge, where none of the usual ones can be got to [m]; by eye."""
PULLS = 3
"""Most pulls at one door within one call: where it does not move from there, the rest is not the base pose. By eye."""
TALL = 1.2
"""No arm gets over furniture of this height [m]: it is opened from anywhere before it. By eye."""
DEEPER = (0.0, 0.07, 0.14)
"""Extra distances at which a base with a short arm stands before what is open [m], too, and at more places; by eye."""
NEARER = (0.0, -0.08)
"""The same before all else: the arm is short, and a chair may stand where it would be best. By eye."""
ON_FLOOR = 0.2
"""Height below which things lie on the floor [m]; by eye."""


@dataclass(frozen=True)
class Mechanisms:
    """What ours is made of; an ablation leaves one out."""

    agreement: bool = True
    """A thing is evidence only when the views that should see it do."""
    reachability: bool = True
    """Base poses are chosen by whether the arm would get there."""
    repair: bool = True
    """Another grasp or base pose within the call."""
    recheck: bool = True
    """What was done is looked at from two views."""
    memory: bool = True
    """What failed where is not tried again."""
    other_sides: bool = True
    """What is not found is looked for from other sides, and `every` counts only after that."""


@dataclass(frozen=True)
class Lost:
    """A thing that was let go or slipped at a spot of its place and was not seen there after that."""

    item: Item
    spot: Position
    known: frozenset[str]
    """Keys of what was on the map then."""

    @property
    def classes(self) -> set[str]:
        """What some view took it for."""
        return {vote for vote in self.item.votes.values() if vote}


class OwnSkills(CommonSkills):
    """Arms `ours` and `oracle`."""

    def __init__(self, body: Body, mechanisms: Mechanisms | None = None) -> None:
        super().__init__(body)
        self._use = mechanisms or Mechanisms()
        self.scene.careful = self._use.agreement
        self._bad: dict[str, list[tuple[Base, Position]]] = {}
        """Furniture -> base poses that failed, and what for."""
        self._off: list[Position] = []
        """Spots from which something rolled off."""
        self._stood: dict[str, list[Base]] = {}
        """Furniture -> base poses from which it was looked at, as it is now."""
        self._blocked: list[Base] = []
        """Base poses that could not be driven to."""
        self._missing: list[Lost] = []
        self._patches: dict[str, str] = {}
        """Floor under what fell -> furniture that it fell from."""
        self._explored = False
        self._told: set[str] = set()
        """Things of which the brain was told that they may be something else: it is done if it asks again."""

    # ---- eyes ----

    def explore_local(self, place: str) -> ObjectMap:
        """Look from here; where that was done already, from another side, then at each thing that is not sure yet from
        near by. What was seen before stays."""
        looked = self._sides(place)
        looked_before = self._use.other_sides and quarter(self._body.base, self.scene.furniture[place].centre) in looked
        if looked_before and not self._go_round(place, looked):
            for item in [i for i in self.scene.items.values() if i.place == place]:
                self._look(place, item)
        self._look(place)
        if self._use.other_sides and len(self._sides(place)) > 1:
            self._see_all_of(place)
        if self._use.agreement:
            for item in [i for i in self.scene.items.values() if i.place == place]:
                if looked_before or len(set(item.votes.values())) > 1:
                    self._confirm(item)
        if self._use.repair:
            self._look_on_floor(place)
        return ObjectMap(tuple(self.scene.scene_object(i.key) for i in self._lying_at(place)))

    def picture_of_hand(self) -> Observation:
        """What two of three views agree on."""
        label = self._in_hand()
        return Observation("hand", (label,) if label else ())

    def picture_of(self, target: SceneObject) -> Observation:
        """What is there by all views so far and one from where there was none yet."""
        if target.key in self.scene.furniture:
            object_map = self.explore_local(target.key)
            return Observation(target.key, tuple(o.label for o in object_map))
        item = self.scene.items[target.key]
        for _ in range(MOST_VIEWS):
            if (quarter(self._body.base, item.position), True) in item.votes and self._use.other_sides:
                self._go_round(item.place, {side for side, close in item.votes if close and isinstance(side, int)})
            self._look(item.place, item)
            sure = abs(item.used_margin) >= (SURE_OF_USE if self._use.agreement else 1)
            if sure or item.key not in self.scene.items or not self._use.other_sides:
                break
        gone = item.key not in self.scene.items
        return Observation(target.key, () if gone else (item.label,), item.used)

    def _look(self, place: str, item: Item | None = None) -> None:
        """Look at a place, or at one of its things from near by, and count the votes."""
        piece, base = self.scene.furniture[place], self._body.base
        close = item is not None
        at = item.position if item is not None else (*piece.centre, piece.height)
        look = self._body.look(at, close=close)
        if not close:
            self._stood.setdefault(place, []).append(base)
        keys_seen = {
            entered.key
            for entered in self.scene.enter(look.detections, place, lambda d: (quarter(base, d.position), close))
        }
        should = [item] if item is not None else [i for i in self.scene.items.values() if i.place == place]
        for each in should if look.in_view else ():
            if each.key not in keys_seen:
                each.votes[quarter(base, each.position), close] = None
                if len(each.sides(seen=False)) > len(each.sides(seen=True)):
                    self.scene.items.pop(each.key, None)

    def _see_all_of(self, place: str) -> None:
        """Look from further sides until every corner of furniture was in sight from two regions of views: where an end
        of a long table was looked at from one region alone, nothing there is no evidence."""
        ends = corners(self.scene.furniture[place])
        while any(len({quarter(base, end) for base in self._stood[place]}) < SEEN_FROM for end in ends):
            if not self._go_round(place, self._sides(place)):
                return
            self._look(place)

    def _confirm(self, item: Item) -> None:
        """Take views of a thing until one class is enough ahead. Views of one region say the same, and by the error
        model all others tell equally much, so that the next is the cheapest from where it was not seen yet: from near
        by wherever the arm gets there, else from another side."""
        for _ in range(MOST_VIEWS):
            if item.margin >= ENOUGH or item.key not in self.scene.items:
                return
            viewpoint = self._near_by(item)
            if viewpoint is not None and self._there(viewpoint, item.place):
                self._look(item.place, item)
                continue
            sides_seen = {side for side, _ in item.votes if isinstance(side, int)}
            if not self._use.other_sides or not self._go_round(item.place, sides_seen):
                return
            self._look(item.place)

    def _near_by(self, item: Item) -> Base | None:
        """Return the nearest base pose from which the arm gets to a thing that was not looked at from near there."""
        present_base = self._body.base
        poses = [(0.0, present_base)] if self.scene.in_front(present_base) == item.place else []
        if self._use.other_sides:
            poses += self._before(item.place)
        fresh = (b for _, b in poses if (quarter(b, item.position), True) not in item.votes)
        return next((base for base in fresh if self._body.reaches(base, item.position)), None)

    def _sides(self, place: str) -> set[int]:
        """Return the quarter turns from which furniture was looked at."""
        centre = self.scene.furniture[place].centre
        return {quarter(base, centre) for base in self._stood.get(place, [])}

    def _go_round(self, place: str, seen: set[int]) -> bool:
        """Drive to another side of furniture, the one that tells most; False where none can be got to."""
        return any(self.drive(base, place) for _, base in self._other_sides(place, seen)[:2])

    def _other_sides(self, place: str, seen: set[int]) -> list[tuple[float, Base]]:
        """Return base poses before other sides of furniture with the way [m], first those from where a look tells most
        about its things and about its corners."""
        poses = self._open(other_sides(self.scene, place, self._body.base, seen, self._body.stand_off))
        stood = self._stood.get(place, [])
        questions = [
            (at, sides, len(sides))
            for at in corners(self.scene.furniture[place])
            for sides in [frozenset(quarter(base, at) for base in stood)]
        ]
        for item in self.scene.items.values():
            if item.place == place:
                sides = frozenset(side for side, close in item.votes if isinstance(side, int) and not close)
                questions.append((item.position[:2], sides, max(item.margin, 0)))
        return sorted(poses, key=lambda pose: -worth(pose[1], pose[0], questions))

    def _in_hand(self) -> str:
        """Return the class that two views of the hand agree on, empty for an empty hand."""
        labels: list[str] = []
        for view in range(HAND_VIEWS):
            detection = self._body.look_at_hand(view)
            label = detection.label if detection else ""
            if label in labels:
                return label
            labels.append(label)
        return labels[0]

    # ---- base and arm ----

    def drive(self, base: Base, toward: str) -> bool:
        """Drive to a base pose; where that failed is remembered. Where no way is known now it stays where it is: what
        was touched on a drive may have closed that to poses chosen before."""
        if not np.isfinite(self.scene.obstacles.way(self._body.base, (base.x, base.y))):
            return False
        arrived = super().drive(base, toward)
        if not arrived and self._use.memory:
            self._blocked.append(base)
        return arrived

    def _open(self, poses: list[tuple[float, Base]]) -> list[tuple[float, Base]]:
        """Return the poses that are not where driving failed before."""
        is_blocked = ((hypot(p.x - b.x, p.y - b.y) < SAME_POSE for b in self._blocked) for _, p in poses)
        return [pose for pose, blocked in zip(poses, is_blocked, strict=True) if not any(blocked)]

    def _before(self, place: str) -> list[tuple[float, Base]]:
        """Return the base poses along all sides of furniture that the robot can get to, the nearest first."""
        piece = self.scene.furniture[place]
        opened, short = piece.opened, self._body.short_armed
        offs: tuple[float, ...] = (DEEPER if opened else NEARER) if short else (0.0,)
        apart = APART / len(DEEPER) if short and opened else APART
        poses = [p for off in offs for p in around(piece, self._body.stand_off + off, apart)]
        return self._open(drivable(self.scene, self._body.base, poses))

    def navigate(self, target: SceneObject) -> Outcome:
        """Drive before furniture, to a side from which it was not looked at yet as long as there is one."""
        furniture_key = target.key if target.key in self.scene.furniture else self.scene.items[target.key].place
        sides_seen = self._sides(furniture_key) if self._use.other_sides else set()
        poses = self._other_sides(furniture_key, sides_seen) or self._before(furniture_key)
        for _, base in poses[: TRIES if self._use.repair else 1]:
            if self.drive(base, furniture_key):
                return Outcome(True)
        return Outcome(False, "no_way", f"no way to {furniture_key} was found", {"base_poses": len(poses)})

    def _stations(self, place: str, at: Position, *, take: Take = "") -> Iterator[Base]:
        """Yield base poses that reach a position on furniture, first where the robot stands if that will do; a short
        arm explores until one is known. To `take` what is there a grasp of what was seen so far has to be possible,
        or, where none is from anywhere, a pose that reaches shows more, and the next one other sides of it."""
        take_first, tried = take, list[Base]()
        while len(tried) < TRIES:
            fresh = self._fresh(place, at, tried, take)
            if fresh is None and take:
                take = ""
                continue
            if fresh is None:
                if not self._body.short_armed or self._explored:
                    return
                explore(self._body, self.scene, partial(self._fresh, place, at, tried, take))
                self._explored = self._fresh(place, at, tried, take) is None
                continue
            tried.append(fresh)
            yield fresh
            take = take_first

    def _fresh(self, place: str, at: Position, tried: list[Base], take: Take) -> Base | None:
        """Return the nearest base pose that reaches a position and was not tried, nor failed, for it."""
        poses = [(0.0, self._body.base)] if self.scene.in_front(self._body.base) == place else []
        poses += self._before(place)
        tried_bases = tried + self._failed_bases(place, at)
        same_within = (
            SAME_BEFORE_OPEN if self.scene.furniture[place].opened and self._body.short_armed else SAME_ON_SIDE
        )
        apart = (
            base for _, base in poses if not any(hypot(base.x - b.x, base.y - b.y) < same_within for b in tried_bases)
        )
        return next((b for b in apart if not self._use.reachability or self._body.reaches(b, at, take=take)), None)

    def _there(self, base: Base, place: str) -> bool:
        return base == self._body.base or self.drive(base, place)

    def _remember_failure(self, place: str, base: Base, at: Position) -> None:
        self._bad.setdefault(place, []).append((base, at))

    def _failed_bases(self, place: str, at: Position) -> list[Base]:
        """Return base poses that failed; with a short arm those that failed for a position near by: what it does not
        get to from one pose says little about the rest."""
        if not self._use.memory:
            return []
        any_target = not self._body.short_armed
        return [b for b, p in self._bad.get(place, []) if any_target or hypot(p[0] - at[0], p[1] - at[1]) < SAME_TARGET]

    def _unreachable(self, place: str, tries: int, last: Failure | None = None) -> Outcome:
        """Say that all base poses failed, and what motion planning or control said the last time."""
        piece = self.scene.furniture[place]
        why = f"the arm gets to nothing on {place} ({piece.label}, {piece.height:.1f} m high)"
        numbers = {"height": piece.height, "base_poses": float(tries), **(last.numbers if last else {})}
        message = f"{why}: {tries} base poses failed{f'; {last.message}' if last else ''}"
        return Outcome(False, "unreachable", message, numbers)

    def grasp(self, item: Item) -> Outcome:
        """Make sure of what it is, take it, and make sure that it is held."""
        believed = item.label
        if self._use.agreement:
            self._confirm(item)
            if item.key not in self.scene.items:
                return Outcome(False, "gone", f"{item.key} is not there, seen from {len(item.votes)} views")
            if item.label != believed:
                return Outcome(False, "wrong_object", f"{item.key} is rather a {item.label}", label=item.label)
            if item.doubt and item.key not in self._told:
                self._told.add(item.key)
                message = f"{item.key} may be a {item.label} or a {item.doubt}: {len(item.votes)} views do not agree"
                return Outcome(False, "doubtful", message, label=item.doubt)
            if item.disputed and item.key not in self._told:
                self._told.add(item.key)
                message = f"{item.key} looks like a {item.label}, but not from everywhere: also like a {item.disputed}"
                return Outcome(False, "disputed", message, label=item.disputed)
        furniture_key = item.place
        outcome = self._take(item, "any")
        if self.holding is not None and furniture_key in self._patches:
            self.scene.furniture.pop(furniture_key)
        return outcome

    def _take(self, item: Item, how: Take) -> Outcome:
        """Take a thing, by other grasps and from other base poses where one does not do it, and make sure that it is
        held. Nothing is executed that is known to fail, but for one try where nothing else is left: it says why."""
        furniture_key, candidate, tries, executed = item.place, 0, 0, 0
        last: Failure | None = None
        stations = ((base, False) for base in self._stations(furniture_key, item.position, take=how))
        last_resort = ((base, True) for _, base in self._before(furniture_key)[:1])
        for base, desperate in chain(stations, last_resort):
            if (executed and desperate) or (tries and not self._use.repair):
                break
            tries += 1
            if not self._there(base, furniture_key):
                continue
            asks = self._use.reachability and self._use.repair and not desperate
            if asks and not self._body.reaches(self._body.base, item.position, take=how):
                self._remember_failure(furniture_key, base, item.position)
                continue
            while executed < TRIES:
                executed += 1
                felt = self._body.grasp(item.position, item.label, candidate, level=how == "level")
                if not felt.ok:
                    last = felt.failure
                    self._remember_failure(furniture_key, self._body.base, item.position)
                    break
                label_in_hand = self._in_hand() if self._use.recheck else item.label
                if label_in_hand:
                    return self._holds(item, label_in_hand)
                candidate += 1
                if not self._use.repair:
                    return Outcome(False, "not_held", f"{item.key} slipped out of the hand")
                if not self._find_again(item):
                    self._missing.append(Lost(item, item.position, frozenset(self.scene.items)))
                    return Outcome(False, "lost", f"{item.key} slipped and is not seen any more")
        return self._unreachable(furniture_key, tries, last)

    def _holds(self, item: Item, held: str) -> Outcome:
        """Count what the hand's view says as one more vote: it is of one region, as any other."""
        believed = item.label
        self.took(item)
        if self._use.agreement and held in classes_not_of(item.radius):
            return Outcome(True)  # it tells no more than that the hand holds something
        item.votes["hand", True] = held
        if held == believed:
            return Outcome(True)
        if self._use.agreement and item.label == believed:
            message = f"what the hand holds may be a {believed} or a {held}"
            return Outcome(False, "doubtful_in_hand", message, label=held)
        return Outcome(False, "wrong_in_hand", f"what the hand holds looks like a {held}", label=held)

    def _find_again(self, item: Item) -> bool:
        """Look for a thing that was pushed; move its entry there."""
        self.scene.items.pop(item.key, None)
        for close in (True, False):
            look = self._body.look(item.position, close=close)
            same_label = [d for d in look.detections if d.label == item.label]
            same_label = [
                d
                for d in same_label
                if hypot(d.position[0] - item.position[0], d.position[1] - item.position[1]) < 0.12
            ]
            if same_label:
                item.position = same_label[0].position
                self.scene.items[item.key] = item
                return True
        self._stood[item.place] = [self._body.base]
        return False

    def _look_on_floor(self, place: str) -> None:
        """Look on the floor for what was lost at a place and is nowhere on it, and enter what is found there into the
        map; where nothing is, the robot goes back."""
        missing = [lost for lost in self._missing if lost.item.place == place]
        self._missing = [lost for lost in self._missing if lost.item.place != place]
        before = self._body.base
        for lost in missing:
            item, classes = lost.item, lost.classes
            if any(i.label in classes and i.key not in lost.known for i in self._lying_at(place)):
                continue
            detection = self._find_on_floor(lost)
            if detection is not None:
                patch = self.scene.patch(detection.position)
                self._patches[patch] = place
                entered = self.scene.add(detection, patch, (quarter(self._body.base, detection.position), False))
                entered.votes = {**item.votes, **entered.votes}
            elif self._body.base != before:
                self.drive(before, place)

    def _lying_at(self, place: str) -> list[Item]:
        """Return the things of a place, with those that fell off it."""
        return [i for i in self.scene.items.values() if place in (i.place, self._patches.get(i.place))]

    def _find_on_floor(self, lost: Lost) -> Detection | None:
        """Return what is seen on the floor around its furniture that looks like a thing, from the views that show most
        of where it may lie."""
        piece, spot = self.scene.furniture[lost.item.place], lost.spot
        cells, likely = fallen_where(self.scene.obstacles, piece.centre, piece.size, spot)
        for _ in range(FLOOR_VIEWS):
            view = self._floor_view(cells, likely)
            if view is None:
                break
            base = self._body.base
            if (view.x, view.y) != (base.x, base.y) and not self.drive(view, lost.item.place):
                likely = np.where(floor_seen(self.scene.obstacles, view, cells), 0.0, likely)
                continue
            look = self._body.look((*ahead_of(view, FLOOR_AT), 0.0), close=False)
            on_floor = [d for d in look.detections if d.label in lost.classes and d.position[2] < ON_FLOOR]
            if on_floor:
                return min(on_floor, key=lambda d: hypot(d.position[0] - spot[0], d.position[1] - spot[1]))
            likely = np.where(floor_seen(self.scene.obstacles, view, cells), 0.0, likely)
        return None

    def _floor_view(self, cells: np.ndarray, likely: np.ndarray) -> Base | None:
        """Return the base pose to look at the floor from next; exploring, where none is known that shows much."""

        def best() -> Base | None:
            best_view = best_floor_view(self.scene.obstacles, self._body.base, cells, likely)
            return best_view[0] if best_view is not None and best_view[1] >= LITTLE else None

        view = best()
        if view is None and not self._explored:
            explore(self._body, self.scene, best)
            view = best()
            self._explored = view is None
        return view

    def place(self, target: SceneObject) -> Outcome:
        """Put down what is held, on a carrier or on free spots of furniture, and make sure that it lies there."""
        furniture_key, label, at = self.places_on(target)
        if self._use.other_sides and furniture_key not in self._stood and self.navigate(target).ok:
            self._look(furniture_key)  # what stands there was not seen yet
            furniture_key, label, at = self.places_on(target)
        if self.scene.furniture[furniture_key].levels and not self._body.held_level:
            outcome = self._take_from_the_side()
            if not outcome.ok:
                return outcome
        if self._use.memory:
            at = [p for p in at if not any(hypot(p[0] - q[0], p[1] - q[1]) < OFF_SPOT for q in self._off)] or at
        outcome = self.place_at(furniture_key, label, at[:: max(1, len(at) // TRIES)])
        if outcome.kind != "unreachable" or target.key not in self.scene.furniture:
            return outcome
        at = spots(self.scene, furniture_key, self._body.base, *CLOSER)  # beside what stands there
        return self.place_at(furniture_key, label, at[:: max(1, len(at) // (2 * TRIES))])

    def _take_from_the_side(self) -> Outcome:
        """Put what the hand came down on back to where it was, and take it from the side: so it goes into a shelf."""
        item = self.holding
        assert item is not None
        if item.place not in self.scene.furniture:
            return Outcome(False, "unreachable", f"{item.key} goes into a shelf by a level hand alone")
        back = self.place_at(item.place, self.scene.furniture[item.place].label, [item.position])
        return self._take(item, "level") if back.ok else back

    def place_at(self, place: str, label: str, at: list[Position]) -> Outcome:
        """Try the positions, each from base poses that reach it."""
        tries = 0
        last: Failure | None = None
        if not at:
            return Outcome(False, "unreachable", f"{place} has no free spot that is known")
        for position in at:
            for base in self._stations(place, position):
                if tries >= (TRIES if self._use.repair else 1):
                    return Outcome(False, "no_trajectory", f"no way to put it on {label}", {"tries": tries})
                tries += 1
                if not self._there(base, place):
                    continue
                felt = self._body.release(position, label, gently=True)
                if felt.ok:
                    return self._lies(place, label, position)
                last = felt.failure
                self._remember_failure(place, base, position)
        return self._unreachable(place, tries, last)

    def _lies(self, place: str, label: str, at: Position) -> Outcome:
        """Look at the spot from two regions of views; say where it lies if not there."""
        item = self.holding
        assert item is not None
        voted_labels, believed = {vote for vote in item.votes.values() if vote}, item.label
        self.put(place, at)
        if not self._use.recheck:
            return Outcome(True)
        self.scene.items.pop(item.key)
        over = self.scene.items.get(self.scene.at_carrier(at, place))
        over_seen = over is None
        seen_from: set[Region] = set()  # what was seen of it before it was moved says nothing of where it is now
        for close in (True, False):
            look = self._body.look(at, close=close)
            matched_items = self.scene.matched(look.detections, place)
            for d, matched in zip(look.detections, matched_items, strict=True):
                shoved = over if matched is None and over is not None and d.label == over.label else matched
                if shoved is not None and shoved.label in CARRIERS and d.whole:
                    shoved.position = d.position  # the hand may have pushed it
                over_seen = over_seen or shoved is over
            new_detections = [
                d
                for d, matched in zip(look.detections, matched_items, strict=True)
                if d.label in voted_labels and (matched is None or matched.label != d.label)
            ]
            distances = [(hypot(d.position[0] - at[0], d.position[1] - at[1]), d) for d in new_detections]
            away, nearest = min(distances, default=(BESIDE, None), key=lambda pair: pair[0])
            if nearest is not None and away < BESIDE:
                item.position, item.place = nearest.position, place
                seen_from.add((quarter(self._body.base, nearest.position), close))
                item.votes[quarter(self._body.base, nearest.position), close] = nearest.label
                self.scene.items[item.key] = item
                carries = self.scene.carrier_of(item) == (over.key if over else "")
                if away <= AWAY and carries and (over_seen or not close):
                    message = "" if item.label == believed else f"{item.key} looks like a {item.label} after all"
                    return Outcome(True, message=message, label=item.label)
        self._off.append(at)
        if item.key in self.scene.items:
            item.votes = {region: vote for region, vote in item.votes.items() if region in seen_from}
            return Outcome(False, "not_there", f"{item.key} lies beside {label}, not on it")
        self._stood[place] = [self._body.base]  # what was seen from other sides was before this
        self._missing.append(Lost(item, at, frozenset(self.scene.items)))
        return Outcome(False, "lost", f"{item.key} is not seen on {label}")

    def pull(self, key: str, *, opening: bool) -> Outcome:
        """Pull or push a door from base poses that reach it."""
        piece = self.scene.furniture[key]
        at = (*piece.centre, piece.height)
        tries = 0
        last: Failure | None = None
        over = piece.height < TALL and not piece.top  # else nothing says where the arm has to get to
        bases = self._stations(key, at) if over else (base for _, base in self._before(key))
        for base in bases:
            if tries == (PULLS if self._use.repair else 1):
                break
            tries += 1
            if not self._there(base, key):
                continue
            felt = self._body.pull(at, opening=opening)
            if felt.ok:
                self.scene.set_opened(key, opening, felt.furniture)
                return Outcome(True, numbers={"more": 1.0} if self.scene.furniture[key].more else {})
            last = felt.failure
            self._remember_failure(key, base, at)
        return self._unreachable(key, tries, last)
