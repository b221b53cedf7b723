"""The fast world: an apartment without contact, in which actions fail by the persistent causes of failures.py.

Holds the truth. Arms get it as a `Body` (body.py) and nothing else; the judge reads `truth` and `events`.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import atan2, cos, hypot, pi, sin

import numpy as np
from scenewright.schemas.apartment import Apartment, Furniture, Thing
from scenewright.stages.agent.obstacle_map import ObstacleMap
from scenewright.stages.agent.senses import Base, Detection, Felt, Look, Position, SeenFurniture, Sweep, Take
from scenewright.stages.agent.world.events import Event, EventLog
from scenewright.stages.agent.world.failures import Rates
from scenewright.stages.agent.world.floor import Floor
from scenewright.stages.kit.acting.errors import Luck, SegmenterErrors

REACH, HIGHEST = 1.3, 1.4
"""Reach of the arm from the middle of the base over the ground, and the highest place that it reaches [m]."""
FOUND_WITHIN = 0.12
"""The hand closes on what is nearest to where it goes, up to this far [m]."""
NOISE, FURNITURE_NOISE = 0.006, 0.02
"""Standard deviation of measured positions of things and of furniture [m], persistent within a region of views."""
BASE_CELL = 0.35
"""Base poses within such a square around a piece of furniture are one and the same to the arm [m]."""
ROLLS, BESIDE = 0.22, 0.1
"""How far something rolls on furniture, and how far beside a small carrier it comes to lie [m]."""
CLEARANCE = 3.0
"""Cells of the obstacle map that the base keeps from what is occupied."""
SPEED = 0.4
"""Speed of the base [m/s]."""
SECONDS = {
    "sweep": 8.0,
    "drive": 4.0,
    "look": 12.0,
    "close": 5.0,
    "hand": 2.0,
    "grasp": 20.0,
    "release": 15.0,
    "pull": 20.0,
}
"""**Assumed** durations [s]; the thesis states none."""


@dataclass
class Body:
    """A thing as it truly is."""

    thing: Thing
    on: str
    at: tuple[float, float]
    moved: int = 0
    """How often it came to lie anew: what hangs on its pose is drawn anew then."""


class FastWorld:
    """One episode's world. `sought`: classes that the eyes are prompted with; `floor`: if it is worked out already."""

    same_thing, stand_off, short_armed, held_level = 0.04, 0.45, False, True

    def __init__(
        self, apartment: Apartment, sought: tuple[str, ...], rates: Rates, seed: int, floor: Floor | None = None
    ) -> None:
        self.apartment, self._sought, self._rates, self._luck = apartment, sought, rates, Luck(seed)
        self._errors = SegmenterErrors(rates.eyes, self._luck, sought)
        self.bodies = {thing.name: Body(thing, thing.on, thing.at) for thing in apartment.things}
        self.furniture = {piece.name: piece for piece in apartment.furniture}
        self.opened: set[str] = {piece.name for piece in apartment.furniture if piece.opened}
        self.held: str | None = None
        self.pictures: list[tuple[str, np.ndarray]] = []
        self._log = EventLog()
        self._grasps = 0
        self._base = Base(*apartment.start)
        self._seconds = self.metres = 0.0
        self._floor = floor or Floor(apartment)
        self.obstacles = ObstacleMap(self._base, CLEARANCE)

    def close(self) -> None:
        """Nothing is held open."""

    # ---- what the robot may ask ----

    @property
    def base(self) -> Base:
        """Where the robot stands."""
        return self._base

    @property
    def seconds(self) -> float:
        """Since the beginning."""
        return self._seconds

    def sweep(self) -> Sweep:
        """Cast rays over the floor from the base, to the first occupied cell."""
        self._seconds += SECONDS["sweep"]
        free, struck, furniture_seen = self._floor.swept(self._base)
        sweep = Sweep(free, struck, tuple(self._see_furniture(self.apartment.furniture[k]) for k in furniture_seen))
        self.obstacles.add(sweep)
        return sweep

    def drive(self, base: Base, toward: str) -> Felt:
        """Drive. A pose may be unreachable for good; the robot then stays where it is."""
        self._seconds += SECONDS["drive"]
        piece = self._nearest(base.x, base.y)
        bad = piece is not None and self._luck.happens(
            self._rates.navigation, "navigation", piece.name, self._cell(base, piece)
        )
        ok = not bad and self._floor.stands(base)
        if toward:
            self._log_done("drive", f"drive to {piece.name if piece else toward}", ok, "navigation")
        if not ok:
            return Felt(False, "no_way")
        length = self.obstacles.way(self._base, (base.x, base.y))
        self._base = base
        self.metres += length
        self._seconds += length / SPEED
        return Felt(True)

    def look(self, at: Position, *, close: bool) -> Look:
        """Detect what is on the surface at a position, or within a hand's breadth of it."""
        self._seconds += SECONDS["close" if close else "look"]
        sector = _sector(self._base, at)
        piece = self._under(at)
        detections = []
        for body in self._visible(piece):
            if close and hypot(body.at[0] - at[0], body.at[1] - at[1]) > FOUND_WITHIN:
                continue
            detection = self._detect(body, _sector(self._base, (*body.at, 0.0)), close)
            if detection is not None:
                detections.append(detection)
        return Look(tuple(detections), sector, close)

    def look_at_hand(self, view: int) -> Detection | None:
        """See what the hand holds; a view of one state may be misjudged for good."""
        self._seconds += SECONDS["hand"]
        body_in_hand = self.bodies[self.held] if self.held else None
        if self._luck.happens(self._rates.feedback, "feedback", self._grasps, view):
            self._log.mistaken("feedback", f"hand {self._grasps}")
            return self._detection(self._other(), self._hand_position(), "", 0.04) if body_in_hand is None else None
        if body_in_hand is None:
            return None
        label = self._label(body_in_hand, "hand", False)
        return self._detection(
            label, self._hand_position(), body_in_hand.thing.color, body_in_hand.thing.radius, body_in_hand.thing.used
        )

    def reaches(self, base: Base, at: Position, *, take: Take = "") -> bool:
        """Whether the arm gets there: by distance and height, and as far as a bad base pose can be foreseen; nothing
        here has a shape to `take` it by."""
        if not self._in_reach(base, at):
            return False
        piece = self._under(at)
        if piece is None:
            return True
        key = (piece.name, self._cell(base, piece))
        foreseen = self._luck.happens(self._rates.foreseen, "foreseen", *key)
        return not (foreseen and self._luck.happens(self._rates.base, "base", *key))

    def grasp(self, at: Position, label: str, candidate: int, *, level: bool = False, most: int = 1) -> Felt:
        """Take what is nearest to a position. A slip and a wrong thing are not felt."""
        self._seconds += SECONDS["grasp"]
        body, piece = self._at(at), self._under(at)
        step = f"grasp {body.thing.name}" if body is not None and body.thing.label == label else f"grasp a {label}"
        if self.held is not None:
            self._log_done("grasp", step, False, "api")
            return Felt(False, "no_grasp")
        if not self._in_reach(self._base, at):
            self._log_done("grasp", step, False, "grasp")
            return Felt(False, "out_of_reach")
        if piece is not None and self._luck.happens(
            self._rates.base, "base", piece.name, self._cell(self._base, piece)
        ):
            self._log_done("grasp", step, False, "grasp")
            return Felt(False, "no_grasp")
        self._grasps += 1
        if body is None:
            self._log_done("grasp", step, False, "")  # it closed on air: what came before is to blame
            return Felt(True)
        if self._luck.happens(self._rates.slip, "slip", body.thing.name, body.moved, candidate):
            self._nudge(body)
            self._log_done("grasp", step, False, "grasp")
            return Felt(True)
        self.held, body.on, body.moved = body.thing.name, "", body.moved + 1
        right = body.thing.label == label
        self._log_done("grasp", step, right, "" if right else "false_positive")
        return Felt(True)

    def release(self, at: Position, label: str, *, gently: bool = False) -> Felt:
        """Let go over a position; it may roll off unseen, from however low."""
        self._seconds += SECONDS["release"]
        carrier = self._carrier(at)
        onto = self._label_of(carrier) if carrier else "floor"
        step = f"place {self.held or 'nothing'} on {label}"
        if self.held is None:
            self._log_done("release", step, False, "")
            return Felt(True)
        spot = (round(at[0], 1), round(at[1], 1))
        if not self._in_reach(self._base, at) or self._luck.happens(
            self._rates.shut, "shut", carrier, spot, self._cell(self._base, self._under(at))
        ):
            self._log_done("release", step, False, "place")
            return Felt(False, "no_trajectory" if self._in_reach(self._base, at) else "out_of_reach")
        body = self.bodies[self.held]
        self.held = None
        rolls = self._luck.happens(self._rates.roll, "roll", body.thing.name, carrier, spot)
        body.on, body.at = carrier or "floor", (at[0], at[1])
        body.moved += 1
        if rolls:
            self._roll(body, at)
        lies_on = self._label_of(body.on) if body.on != "floor" else "floor"
        ok = lies_on == label  # what rolls on furniture is on it all the same
        self._log_done("release", step, ok, "" if ok else "false_positive" if onto != label else "place")
        return Felt(True)

    def pull(self, at: Position, *, opening: bool) -> Felt:
        """Open or close a door. A bad base pose is bad for handles too."""
        self._seconds += SECONDS["pull"]
        piece = self._under(at)
        step = f"{'open' if opening else 'close'} {piece.name if piece else 'nothing'}"
        if piece is None or not piece.door or not self._in_reach(self._base, at, edge=True):
            self._log_done("pull", step, False, "grasp")
            return Felt(False, "out_of_reach")
        if self._luck.happens(self._rates.base, "base", piece.name, self._cell(self._base, piece)):
            self._log_done("pull", step, False, "grasp")
            return Felt(False, "door_stuck")
        (self.opened.add if opening else self.opened.discard)(piece.name)
        self._log_done("pull", step, True)
        return Felt(True)

    # ---- how it truly is ----

    @property
    def events(self) -> list[Event]:
        """What was done and what the eyes got wrong, in order."""
        return self._log.events

    def _log_done(self, verb: str, step: str, ok: bool, cause: str = "") -> None:
        self._log.done(verb, step, ok, cause, self.bodies[self.held].thing.label if self.held is not None else "")

    def _see_furniture(self, piece: Furniture) -> SeenFurniture:
        x, y = (c + FURNITURE_NOISE * self._normal("furniture", piece.name, k) for k, c in enumerate(piece.centre))
        return SeenFurniture(piece.label, (x, y), piece.size, piece.height, piece.door, piece.name in self.opened)

    def _visible(self, piece: Furniture | None) -> list[Body]:
        if piece is None or (piece.door and piece.name not in self.opened):
            return []
        return [body for body in self.bodies.values() if body.on and self.root(body.thing.name) == piece.name]

    def root(self, name: str) -> str:
        """Return the furniture (or `floor`, or "" for the hand) on which a thing is, through what carries it."""
        on = self.bodies[name].on
        while on in self.bodies:
            on = self.bodies[on].on
        return on

    def _detect(self, body: Body, sector: int, close: bool) -> Detection | None:
        name = body.thing.name
        region = (sector, close)
        if self._errors.misses(name, (body.moved, region)):
            if body.thing.label in self._sought:
                self._log.mistaken("missed", f"look {name}")
            return None
        used = body.thing.used if close else None
        if close and self._luck.happens(self._rates.feedback, "used", name, *region):
            used = not used
        height = 0.02 + (self.furniture[self.root(name)].height if self.root(name) in self.furniture else 0.0)
        position = (*(c + NOISE * self._normal(name, body.moved, *region, k) for k, c in enumerate(body.at)), height)
        return self._detection(
            self._label(body, *region),
            position,  # type: ignore[arg-type]
            body.thing.color,
            body.thing.radius,
            used,
        )

    def _label(self, body: Body, *region: object) -> str:
        return self._errors.name_of(body.thing.name, body.thing.label, (body.moved, region))

    def _other(self) -> str:
        return self._sought[0] if self._sought else "thing"

    def _detection(self, label: str, at: Position, color: str, radius: float, used: bool | None = None) -> Detection:
        return Detection(label, at, color, used, radius)

    def _hand_position(self) -> Position:
        return (self._base.x + 0.4 * cos(self._base.yaw), self._base.y + 0.4 * sin(self._base.yaw), 0.9)

    def _normal(self, *key: object) -> float:
        """Return a standard normal number of a key."""
        u, v = self._luck.uniform("u", *key), self._luck.uniform("v", *key)
        return float(np.sqrt(-2 * np.log(1 - u)) * np.cos(2 * pi * v))

    def _at(self, at: Position) -> Body | None:
        piece = self._under(at)
        loose = [b for b in self._visible(piece) if not b.thing.carries]
        by_distance = [(hypot(b.at[0] - at[0], b.at[1] - at[1]), b.thing.name) for b in loose]
        by_distance = [(d, name) for d, name in by_distance if d <= FOUND_WITHIN]
        return self.bodies[min(by_distance)[1]] if by_distance else None

    def _under(self, at: Position) -> Furniture | None:
        """Return the furniture at a position, with a hand's breadth around it."""
        for piece in self.furniture.values():
            if all(abs(at[k] - piece.centre[k]) <= piece.size[k] / 2 + 0.1 for k in (0, 1)):
                return piece
        return None

    def _carrier(self, at: Position) -> str | None:
        piece = self._under(at)
        for body in self._visible(piece):
            if body.thing.carries and hypot(body.at[0] - at[0], body.at[1] - at[1]) <= body.thing.radius:
                return body.thing.name
        return piece.name if piece is not None else None

    def _label_of(self, name: str) -> str:
        return self.furniture[name].label if name in self.furniture else self.bodies[name].thing.label

    def _nearest(self, x: float, y: float) -> Furniture | None:
        """Return the furniture that a base pose is before: within 0.7 m of its edge."""
        gaps = [
            (hypot(*(max(0.0, abs(p - c) - s / 2) for p, c, s in zip((x, y), f.centre, f.size, strict=True))), f.name)
            for f in self.furniture.values()
        ]
        return self.furniture[min(gaps)[1]] if gaps and min(gaps)[0] <= 0.7 else None

    def _cell(self, base: Base, piece: Furniture | None) -> tuple[int, int]:
        if piece is None:
            return (0, 0)
        return (round((base.x - piece.centre[0]) / BASE_CELL), round((base.y - piece.centre[1]) / BASE_CELL))

    def _in_reach(self, base: Base, at: Position, *, edge: bool = False) -> bool:
        piece = self._under(at)
        height = piece.height if piece is not None else at[2]
        slack = max(piece.size) / 2 if edge and piece is not None else 0.0
        return hypot(base.x - at[0], base.y - at[1]) <= REACH + slack and height <= HIGHEST

    def _nudge(self, body: Body) -> None:
        """A slip pushes a thing a little, and what hangs on its pose is drawn anew."""
        turn = 2 * pi * self._luck.uniform("nudge", body.thing.name, body.moved)
        body.at = self._clip_to_carrier(body, (body.at[0] + 0.04 * cos(turn), body.at[1] + 0.04 * sin(turn)))
        body.moved += 1

    def _roll(self, body: Body, at: Position) -> None:
        """Something rolls off its place and comes to lie beside it, towards the middle of the furniture."""
        piece = self._under(at)
        over = self.bodies.get(body.on)
        origin, far = (over.at, over.thing.radius + BESIDE) if over is not None else (at[:2], ROLLS)
        centre = piece.centre if piece is not None else at[:2]
        toward = atan2(centre[1] - origin[1], centre[0] - origin[0])
        toward += self._luck.uniform("roll", body.thing.name, body.moved) - 0.5
        body.on = piece.name if piece is not None else "floor"
        body.at = self._clip_to_carrier(body, (origin[0] + far * cos(toward), origin[1] + far * sin(toward)))

    def _clip_to_carrier(self, body: Body, at: tuple[float, float]) -> tuple[float, float]:
        """Return a position within the furniture that a thing is on."""
        piece = self.furniture.get(body.on if body.on in self.furniture else self.root(body.thing.name))
        if piece is None:
            return at
        low, high = (np.array(piece.centre) + sign * (np.array(piece.size) / 2 - 0.06) for sign in (-1, 1))
        x, y = np.clip(at, low, high)
        return float(x), float(y)


def _sector(base: Base, at: Position) -> int:
    """Return the quarter from which a base pose looks at a position."""
    return int(((atan2(base.y - at[1], base.x - at[0]) + pi / 4) % (2 * pi)) // (pi / 2)) % 4
