"""What an arm knows: furniture on the obstacle map, things on it, and what every region of views said of each."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from math import atan2, hypot, pi

from scenewright.stages.agent.body import Body
from scenewright.stages.agent.goals import BOXES, CARRIERS, SMALL
from scenewright.stages.agent.language.values import ObjectMap, SceneObject
from scenewright.stages.agent.senses import Base, Detection, Position, SeenFurniture, Sweep
from scenewright.stages.kit.acting.errors import quarter_turn

SAME_FURNITURE = 0.3
"""Two sightings of furniture this near are of one piece [m], and those of a class whose boxes overlap."""
IN_FRONT = 0.7
"""Furniture whose edge is this near to the base is in front of it [m]."""
SURE, IN_BOX = 0.8, 0.95
"""A thing is taken to be on a small carrier within this share of its radius: nearer to the rim it may lean on it. A box
has corners: in one it is within that share along both sides, and within the second over the diagonal."""
UNLIKE = 0.8
"""What is narrower than this share of a carrier is a thing on it, not the carrier."""
TWICE = 0.5
"""Share of the distance of one thing within which a second detection of one look is of it as well; by eye."""
CARRIES = 0.09
"""Radius from which on a thing can be a plate or a box, and up to which it can be something that goes onto one [m]."""
TOP = 0.08
"""What lies no farther than this below the top of furniture is on it [m]; by eye."""
FLOOR, PATCH = "floor", 0.1
"""What the floor under a thing is called, and its edge [m]."""
Region = tuple[int | str, bool]
"""Quarter turn (or `hand`, or `map`) from which something was seen, and whether from near by."""
MAPPED: Region = ("map", False)
"""Region of the votes for what was mapped before the robot came."""


@dataclass(frozen=True)
class Mapped:
    """What was mapped of a place before the robot came."""

    floor: Sweep
    things: tuple[tuple[int, Detection], ...]
    """Number of the furniture that each is on or in, and the thing."""


@dataclass
class Item:
    """A thing of the map."""

    key: str
    position: Position
    color: str
    radius: float
    place: str
    votes: dict[Region, str | None] = field(default_factory=dict)
    """Region of views -> the class that was seen from there; None: it should have been seen and was not."""
    used_votes: dict[Region, bool] = field(default_factory=dict)
    """The same of whether it is used."""

    @property
    def label(self) -> str:
        """The class that most regions say; the first said among equals."""
        counts = Counter(vote for vote in self.votes.values() if vote is not None)
        return counts.most_common(1)[0][0] if counts else "thing"

    @property
    def margin(self) -> int:
        """By how many regions its class is ahead of any other, and of the sides from which nothing was seen."""
        counts = Counter(vote for vote in self.votes.values() if vote is not None)
        count_of_label = counts.pop(self.label, 0)
        return count_of_label - max([*counts.values(), len(self.sides(seen=False))])

    @property
    def doubt(self) -> str:
        """The class that it may as well be, as many regions say the one as the other; empty without one."""
        counts = Counter(vote for vote in self.votes.values() if vote is not None)
        count_of_label = counts.pop(self.label, 0)
        second_label, count = counts.most_common(1)[0] if counts else ("", 0)
        return second_label if count == count_of_label else ""

    @property
    def disputed(self) -> str:
        """The class that most regions say of those that say another one; empty where all agree."""
        counts = Counter(vote for vote in self.votes.values() if vote not in (None, self.label))
        return counts.most_common(1)[0][0] or "" if counts else ""

    def sides(self, *, seen: bool) -> set[int | str]:
        """Return the sides from which it was seen from near or far, or from which it should have been and was not:
        what hides a thing hides it from a side."""
        sides_with_item = {side for (side, _), vote in self.votes.items() if vote is not None}
        return sides_with_item if seen else {side for side, _ in self.votes} - sides_with_item

    @property
    def used(self) -> bool | None:
        """What most regions say; None where it could not be told, or as many say the one as the other."""
        return None if self.used_margin == 0 else self.used_margin > 0

    @property
    def used_margin(self) -> int:
        """By how many regions more say that it is used than that it is clean."""
        return sum(1 if used else -1 for used in self.used_votes.values())


ENOUGH = 2
"""Regions of views by which a class has to be ahead before anything is done about it: what is wrong from two is mostly
wrong for good (data/errors/segmenters.toml), and a third region is mostly a drive away."""


class SceneMap:
    """Furniture and things by key, names given in the order in which they were found."""

    def __init__(self, body: Body) -> None:
        self.careful = False
        """Whether doubts are told, and classes that a thing is too wide or too narrow for do not count."""
        self.furniture: dict[str, SeenFurniture] = {}
        self.items: dict[str, Item] = {}
        self.obstacles = body.obstacles
        self._named: Counter[str] = Counter()
        self._same_thing = body.same_thing
        self._body = body

    def know(self, before: Mapped) -> None:
        """Believe in what somebody mapped before, the things as if one view had shown them. That a door is open is
        believed where none has to be looked at to be got past."""
        self.obstacles.add(before.floor)
        looks = self._body.short_armed
        known = (replace(piece, opened=piece.opened and not looks) for piece in before.floor.furniture)
        ajar = {piece.label for piece in before.floor.furniture if piece.opened and looks}
        seen = [piece for piece in self.furniture.values() if piece.label in ajar]
        keys = [self._enter(piece) for piece in known]
        for number, detection in before.things:
            self.add(detection, keys[number], MAPPED)
        for piece in seen:  # a door that stands open is no part of the furniture as it was seen
            self._enter(piece)

    def sweep(self, body: Body) -> None:
        """Turn the head camera around and enter the furniture that it saw."""
        for piece_seen in body.sweep().furniture:
            self._enter(piece_seen)

    def _enter(self, seen: SeenFurniture) -> str:
        same_keys = [key for key, piece in self.furniture.items() if _same_piece(piece, seen)] or [
            self._name(seen.label)
        ]
        key = same_keys[0]
        for duplicate in same_keys[1:]:  # two ends of one piece, which were seen before its middle
            del self.furniture[duplicate]
            for item in self.items.values():
                item.place = key if item.place == duplicate else item.place
        self.furniture[key] = seen
        return key

    def patch(self, at: Position) -> str:
        """Enter the floor under a thing that lies there, as what a base stands before; return its key."""
        key = self._name(FLOOR)
        self.furniture[key] = SeenFurniture(FLOOR, at[:2], (PATCH, PATCH), 0.0, False, False)
        return key

    def in_front(self, base: Base) -> str:
        """Return the key of the furniture before a base pose, rather what it faces; or nothing."""
        within_reach = [
            (edge_distance(f, base.x, base.y), key, f) for key, f in self.furniture.items() if f.label != FLOOR
        ]
        within_reach = [entry for entry in within_reach if entry[0] <= IN_FRONT]
        return min(((not _faces(base, f), gap, key) for gap, key, f in within_reach), default=(False, 0.0, ""))[2]

    def add(self, detection: Detection, place: str, region: Region) -> Item:
        """Enter one detection."""
        return self.enter((detection,), place, lambda _: region)[0]

    def enter(
        self, detections: Sequence[Detection], place: str, region_of: Callable[[Detection], Region]
    ) -> list[Item]:
        """Enter what one look showed: of each a vote of its region for the thing that lies there, or a new thing."""
        items = self.matched(detections, place)
        return [
            self._vote(detection, item or self._new(detection, place), region_of(detection))
            for detection, item in zip(detections, items, strict=True)
        ]

    def _new(self, detection: Detection, place: str) -> Item:
        key = self._name(detection.label)
        item = self.items[key] = Item(key, detection.position, detection.color, detection.radius, place)
        return item

    def _vote(self, detection: Detection, item: Item, region: Region) -> Item:
        if not self.careful or detection.label not in classes_not_of(detection.radius):
            item.votes[region] = detection.label
        if detection.whole:
            item.position = detection.position
        if detection.used is not None:
            item.used_votes[region] = detection.used
        return item

    def matched(self, detections: Sequence[Detection], place: str) -> list[Item | None]:
        """Return the thing of a place that each detection of one look is of, or None.

        Pairs are taken by distance, each thing once: fruit lies closer together on a plate than the eyes measure, and
        two things that were seen side by side are two. Of two that are about as near, the one that looks like it is it.
        A further detection right where a thing was found is of it too.
        """
        pairs = sorted(
            (apart + (0.0 if d.label == i.label else TWICE * self._same_thing), key, number, apart)
            for number, d in enumerate(detections)
            for key, i in self.items.items()
            if i.place == place and not _one_carries_the_other(i, d)
            for apart in [_apart(i.position, d.position)]
            if apart <= self._same_thing
        )
        key_of_detection: dict[int, str] = {}
        for _, key, number, apart in pairs:
            if number not in key_of_detection and (
                key not in key_of_detection.values() or apart <= TWICE * self._same_thing
            ):
                key_of_detection[number] = key
        return [
            self.items[key_of_detection[number]] if number in key_of_detection else None
            for number in range(len(detections))
        ]

    def carrier_of(self, item: Item) -> str:
        """Return the key of the small carrier on which a thing lies, or nothing."""
        return "" if item.label in CARRIERS else self.at_carrier(item.position, item.place)

    def at_carrier(self, position: Position, place: str) -> str:
        """Return the key of the small carrier of a place that is at a position, or nothing."""
        carriers = (item for item in self.items.values() if item.label in CARRIERS and item.place == place)
        return next((c.key for c in carriers if _well_on(c, position)), "")

    def scene_object(self, key: str) -> SceneObject:
        """Return a thing or piece of furniture as programs see it."""
        if key in self.furniture:
            piece = self.furniture[key]
            return SceneObject(key, piece.label, door=piece.door, opened=piece.opened, top=piece.top, more=piece.more)
        item = self.items[key]
        doubt, ahead = (item.doubt, min(item.margin, ENOUGH)) if self.careful else ("", 0)
        on = self.carrier_of(item)
        under = self.furniture.get(item.place)
        above = under is not None and under.top and item.position[2] > under.height - TOP
        return SceneObject(
            key, item.label, item.place, item.color, item.used, top=above, on=on, doubt=doubt, ahead=ahead
        )

    def global_map(self) -> ObjectMap:
        """Return the furniture."""
        return ObjectMap(tuple(self.scene_object(key) for key, f in self.furniture.items() if f.label != FLOOR))

    def local_map(self, place: str) -> ObjectMap:
        """Return the things of a place."""
        return ObjectMap(tuple(self.scene_object(i.key) for i in self.items.values() if i.place == place))

    def set_opened(self, key: str, opened: bool, seen: SeenFurniture | None = None) -> None:
        """Remember that a door was opened or closed, and what its furniture is `seen` to be like now."""
        self.furniture[key] = replace(seen or self.furniture[key], opened=opened)

    def _name(self, label: str) -> str:
        name = f"{label.replace(' ', '_')}_{self._named[label]}"
        self._named[label] += 1
        return name


def classes_not_of(radius: float) -> tuple[str, ...]:
    """Return the classes that a thing of a radius [m] is too narrow or too wide for."""
    return CARRIERS if radius < CARRIES else SMALL


def _faces(base: Base, piece: SeenFurniture) -> bool:
    """Whether the nearest point of a piece of furniture is within 45 degrees of where a base pose looks."""
    x, y = (
        min(max(p, c - s / 2), c + s / 2) for p, c, s in zip((base.x, base.y), piece.centre, piece.size, strict=True)
    )
    return abs((atan2(y - base.y, x - base.x) - base.yaw + pi) % (2 * pi) - pi) <= pi / 4


def _one_carries_the_other(item: Item, seen: Detection) -> bool:
    """Whether one of two is a carrier and the other too narrow to be that, as far as the picture shows all of it."""
    if not seen.whole and seen.label == item.label:
        return False
    narrow, wide = sorted((item.radius, seen.radius))
    wider = item.label if item.radius >= seen.radius else seen.label
    return wider in CARRIERS and narrow < UNLIKE * wide


def _apart(a: tuple[float, ...], b: tuple[float, ...]) -> float:
    return hypot(a[0] - b[0], a[1] - b[1])


def _well_on(carrier: Item, at: Position) -> bool:
    """Whether a position is within a small carrier, away from its rim."""
    x, y = (abs(p - c) for p, c in zip(at[:2], carrier.position[:2], strict=True))
    if carrier.label in BOXES:
        return max(x, y) <= SURE * carrier.radius and hypot(x, y) <= IN_BOX * carrier.radius
    return hypot(x, y) <= SURE * carrier.radius


def _same_piece(a: SeenFurniture, b: SeenFurniture) -> bool:
    if _apart(a.centre, b.centre) < SAME_FURNITURE:
        return True
    sides = zip(a.centre, b.centre, a.size, b.size, strict=True)
    return a.label == b.label and all(abs(p - q) < (s + t) / 2 for p, q, s, t in sides)


def edge_distance(piece: SeenFurniture, x: float, y: float) -> float:
    """Distance [m] of a point from the edge of a piece of furniture, 0 inside."""
    return hypot(*(max(0.0, abs(p - c) - s / 2) for p, c, s in zip((x, y), piece.centre, piece.size, strict=True)))


def quarter(base: Base, at: tuple[float, ...]) -> int:
    """Return the quarter turn, 0 to 3, from which a base pose looks at a position."""
    return quarter_turn((base.x, base.y), at)
