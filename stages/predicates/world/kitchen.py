"""The kitchen's bodies in pymunk (Chipmunk 2-D): table, sink, objects, gripper and drops of water, stepped at 100 Hz.

Sizes, densities and frictions: docs/INTERPRET.md. What the gripper holds moves with it and pushes what it touches (a
kinematic body), so that a grasp never slips; everything else is free. No wall clock and no global random state: the
same calls give the same numbers.
"""

from __future__ import annotations

import math
from collections.abc import Iterable

import numpy as np
import pymunk
from scenewright.stages.predicates.state import LARGEST_OPENING, TABLE_LEFT, TABLE_RIGHT, Seen, State
from scenewright.stages.predicates.world.catalogue import Kind

STEP = 0.01
"""Time step of the physics [s]."""
GRAVITY = -10.0
"""Acceleration of gravity [units/s^2]; by eye."""
SPEED, PUSH_SPEED = 5.0, 0.6
"""Speed of the gripper, and of one that pushes [units/s]; by eye."""
FINGER = 0.6
"""Width of a finger [units]; by eye."""
FINGER_HEIGHT = 2.0
"""Height of a finger [units]; by eye."""
HOME_X, HOME_Y = 0.0, 25.0
"""Place of the gripper at the beginning [units]; by eye."""
SINK_X, SINK_WIDTH, SINK_DEPTH = 31.0, 12.0, 10.0
"""Middle of the sink, its width and its depth [units]; by eye."""
FAUCET_HEIGHT = 15.0
"""Height of the faucet [units]; by eye."""
DROP_RADIUS = 0.12
"""Radius of a drop [units]; by eye."""
DROP_DENSITY = 0.5
"""Density of a drop; by eye."""
DENSITY = {"block": 0.05, "container": 0.5, "plate": 0.2, "mat": 0.5}
"""Shape -> density; by eye."""
FRICTION = {"block": 1.0, "container": 1.0, "plate": 0.1, "mat": 0.1}
"""Shape -> friction; by eye."""
RAMP = 100
"""Steps in which the gripper takes up speed while there is water, so that none slops over."""
FRAME_EVERY = 40
"""Steps between pictures of a motion."""
MARGIN = 0.05
"""Gap between fingers and what they are about to close on [units]; by eye."""


def _paces(steps: int, ramp: int) -> np.ndarray:
    """Return shares of the speed in each step, rising and falling over `ramp` steps, with the sum `steps`."""
    if ramp == 0:
        return np.ones(steps)
    rise = np.arange(1, ramp) / ramp
    return np.concatenate([rise, np.ones(max(1, steps - ramp)), rise[::-1]])


class Thing:
    """An object: its body, and the shapes that make it up."""

    def __init__(self, name: str, kind: Kind, space: pymunk.Space, x: float, y: float) -> None:
        self.name, self.kind = name, kind
        static = kind.shape == "mat"
        self.body = pymunk.Body(body_type=pymunk.Body.STATIC if static else pymunk.Body.DYNAMIC)
        self.shapes = [pymunk.Poly(self.body, corners) for corners in outline(kind)]
        for shape in self.shapes:
            if not static:
                shape.density = DENSITY[kind.shape]
            shape.friction = FRICTION[kind.shape]
        self.body.position = (x, y + kind.height / 2)
        space.add(self.body, *self.shapes)
        self.mass = 0.0 if static else self.body.mass

    def box(self) -> tuple[float, float, float, float]:
        """Left, bottom, right, top."""
        boxes = [shape.cache_bb() for shape in self.shapes]
        return (
            min(box.left for box in boxes),
            min(box.bottom for box in boxes),
            max(box.right for box in boxes),
            max(box.top for box in boxes),
        )

    def seen(self, water: int) -> Seen:
        """What perception says of it."""
        left, bottom, right, top = self.box()
        return Seen((left + right) / 2, bottom, right - left, top - bottom, self.kind.category, water / 10)


def outline(kind: Kind) -> list[list[tuple[float, float]]]:
    """Return the convex polygons of a kind around the middle of its box."""
    w, h, t = kind.width / 2, kind.height / 2, kind.wall
    if kind.shape == "block":
        return [[(-w, -h), (w, -h), (w, h), (-w, h)]]
    if kind.shape == "plate":  # narrow below, so that it climbs
        return [[(-w + 0.9, -h), (w - 0.9, -h), (w, h), (-w, h)]]
    if kind.shape == "mat":  # a ramp on either side
        return [[(-w, -h), (w, -h), (w - 0.6, h), (-w + 0.6, h)]]
    return [
        [(-w, -h), (w, -h), (w, -h + t), (-w, -h + t)],
        [(-w, -h), (-w + t, -h), (-w + t, h), (-w, h)],
        [(w - t, -h), (w, -h), (w, h), (w - t, h)],
    ]


class Kitchen:
    """A kitchen with things at (middle x, bottom y); `seed` decides where the drops fall."""

    def __init__(self, things: Iterable[tuple[str, Kind, float, float]], seed: int) -> None:
        self.space = pymunk.Space()
        self.space.gravity = (0, GRAVITY)
        self.space.sleep_time_threshold = 0.5
        self.random = np.random.default_rng(seed)
        ground = self.space.static_body
        middle, half = (TABLE_LEFT + TABLE_RIGHT) / 2, (TABLE_RIGHT - TABLE_LEFT) / 2
        for x, y, w, h in (
            (middle, -SINK_DEPTH / 2 - 1, half, SINK_DEPTH / 2 + 1),
            (SINK_X, -SINK_DEPTH - 1, SINK_WIDTH / 2, 1.0),
            (SINK_X + SINK_WIDTH / 2 + 0.5, -SINK_DEPTH / 2, 0.5, SINK_DEPTH / 2),
        ):
            shape = pymunk.Poly(ground, [(x - w, y - h), (x + w, y - h), (x + w, y + h), (x - w, y + h)])
            shape.friction = 1.0
            self.space.add(shape)
        self.things = {name: Thing(name, kind, self.space, x, y) for name, kind, x, y in things}
        self.drops: list[tuple[pymunk.Body, pymunk.Circle]] = []
        self.x, self.y, self.opening, self.angle = HOME_X, HOME_Y, LARGEST_OPENING, 0.0
        self.held: Thing | None = None
        self.fingers = [self._finger(), self._finger()]
        self._put_fingers()
        self.frames: list[list[tuple[str, list[tuple[float, float]]]]] | None = None
        """Pictures of the motion, where they are wanted."""
        self._steps = 0
        self.wait(0.5)

    def _finger(self) -> pymunk.Body:
        body = pymunk.Body(body_type=pymunk.Body.KINEMATIC)
        w, h = FINGER / 2, FINGER_HEIGHT / 2
        shape = pymunk.Poly(body, [(-w, -h), (w, -h), (w, h), (-w, h)])
        shape.friction = 0.3
        self.space.add(body, shape)
        return body

    def _finger_place(self, side: int) -> tuple[float, float]:
        return self.x + side * (self.opening + FINGER) / 2, self.y + FINGER_HEIGHT / 2

    def _put_fingers(self) -> None:
        for body, side in zip(self.fingers, (-1, 1), strict=True):
            body.position = self._finger_place(side)
            body.velocity = (0, 0)

    # ---- motion ------------------------------------------------------------------------------------------------

    def wait(self, seconds: float) -> None:
        """Let time pass."""
        for _ in range(round(seconds / STEP)):
            self._step()

    def _step(self) -> None:
        self.space.step(STEP)
        if self.frames is not None:
            self._steps += 1
            if self._steps % FRAME_EVERY == 0:
                self.frames.append(self.polygons())

    def move(self, x: float, y: float, speed: float = SPEED) -> None:
        """Move fingers, and what they hold, to (x, y) in a straight line."""
        distance = math.hypot(x - self.x, y - self.y)
        step_count = max(1, math.ceil(distance / (speed * STEP)))
        paces = _paces(step_count, RAMP if self.held and self.drops else 0)
        velocity = ((x - self.x) / paces.sum() / STEP, (y - self.y) / paces.sum() / STEP)
        moving = [*self.fingers, *([self.held.body] if self.held else [])]
        self._wake()
        for pace in paces.tolist():
            for body in moving:
                body.velocity = (velocity[0] * pace, velocity[1] * pace)
            self._step()
        for body in moving:
            body.velocity = (0, 0)
        self.x, self.y = x, y
        self._put_fingers()

    def travel(self, x: float, y: float) -> None:
        """Move up, across and down, above everything that stands there."""
        below = self.held.box()[1] - self.y if self.held else 0.0
        tops = [thing.box()[3] for thing in self.things.values() if thing is not self.held]
        height = max(HOME_Y, max(tops, default=0.0) + 2.0 - below, y)
        self.move(self.x, height)
        self.move(x, height)
        self.move(x, y)

    def home(self) -> None:
        """Move the fingers up to where they wait, above where they are."""
        self.move(self.x, max(HOME_Y, self.y))

    def open_to(self, opening: float) -> None:
        """Move the fingers apart, or together, where nothing is between them."""
        self.opening = opening
        self._put_fingers()

    def _wake(self) -> None:
        for body in self.space.bodies:
            if body.body_type == pymunk.Body.DYNAMIC and body.is_sleeping:
                body.activate()

    # ---- holding -----------------------------------------------------------------------------------------------

    def hold(self, thing: Thing) -> None:
        """Take hold: from now on it moves with the fingers."""
        left, _, right, _ = thing.box()
        self.open_to(right - left)
        self._wake()
        thing.body.body_type = pymunk.Body.KINEMATIC
        thing.body.velocity, thing.body.angular_velocity = (0, 0), 0.0
        self.held = thing

    def release(self) -> None:
        """Let go, and wait until it lies."""
        assert self.held is not None
        body = self.held.body
        body.body_type = pymunk.Body.DYNAMIC
        body.velocity, body.angular_velocity = (0, 0), 0.0
        self.held = None
        self.open_to(min(self.opening + 2 * MARGIN, LARGEST_OPENING))
        self.wait(0.3)
        self.home()
        self.wait(0.7)

    # ---- perception --------------------------------------------------------------------------------------------

    def drops_in(self, thing: Thing) -> int:
        """Return how many drops are inside the box of a container."""
        if thing.kind.shape != "container":
            return 0
        left, bottom, right, top = thing.box()
        places = (body.position for body, _ in self.drops)
        return sum(left < drop.x < right and bottom < drop.y < top for drop in places)

    def state(self) -> State:
        """Return what the perception calls say now."""
        objects = {name: thing.seen(self.drops_in(thing)) for name, thing in self.things.items()}
        mass = self.held.mass if self.held else 0.0
        return State(objects, self.x, self.y, self.opening, mass)

    def polygons(self) -> list[tuple[str, list[tuple[float, float]]]]:
        """Return what there is to draw: names and corners; drops are points named `water`."""
        drawn = []
        for name, thing in self.things.items():
            for shape in thing.shapes:
                corners = [thing.body.local_to_world(corner) for corner in shape.get_vertices()]
                drawn.append((name, [(corner.x, corner.y) for corner in corners]))
        for body in self.fingers:
            w, h = FINGER / 2, FINGER_HEIGHT / 2
            corners = [body.local_to_world(corner) for corner in ((-w, -h), (w, -h), (w, h), (-w, h))]
            drawn.append(("gripper", [(corner.x, corner.y) for corner in corners]))
        drawn += [("water", [(body.position.x, body.position.y)]) for body, _ in self.drops]
        return drawn

    # ---- water -------------------------------------------------------------------------------------------------

    def run_faucet(self, seconds: float, rate: float) -> None:
        """Let drops fall out of the faucet, `rate` a step on average."""
        for _ in range(round(seconds / STEP)):
            if self.random.random() < rate:
                body = pymunk.Body()
                shape = pymunk.Circle(body, DROP_RADIUS)
                shape.density, shape.friction = DROP_DENSITY, 0.0
                body.position = (SINK_X + float(self.random.uniform(-0.4, 0.4)), FAUCET_HEIGHT)
                self.space.add(body, shape)
                self.drops.append((body, shape))
            self._step()

    def drain(self) -> None:
        """Take away drops that fell beside."""
        boxes = [thing.box() for thing in self.things.values() if thing.kind.shape == "container"]
        remaining = []
        for body, shape in self.drops:
            x, y = body.position
            if any(box[0] <= x <= box[2] and box[1] <= y <= box[3] for box in boxes):
                remaining.append((body, shape))
            else:
                self.space.remove(body, shape)
        self.drops = remaining

    def pour_over(self, x: float, y: float, side: int) -> None:
        """Turn what is held about the upper corner on `side` (1: right), kept above (x, y), and back again."""
        assert self.held is not None
        poured = self.held
        w, h = poured.kind.width / 2, poured.kind.height / 2
        body = poured.body
        self._wake()
        self._solid_fingers(False)
        for angles in (np.linspace(0.0, 2.3, 700), np.linspace(2.3, 0.0, 300)):
            for angle in angles.tolist():
                turned = -side * angle
                corner = pymunk.Vec2d(side * w, h).rotated(turned)
                dip = max(0.0, 2 * h * math.cos(angle))
                target = pymunk.Vec2d(x, y + dip) - corner
                body.velocity = ((target.x - body.position.x) / STEP, (target.y - body.position.y) / STEP)
                body.angular_velocity = (turned - body.angle) / STEP
                self._step()
        body.velocity, body.angular_velocity, body.angle = (0, 0), 0.0, 0.0
        self.x, self.y = body.position.x, body.position.y + h - self.grip_depth(poured)
        self._put_fingers()
        self._solid_fingers(True)

    @staticmethod
    def grip_depth(thing: Thing) -> float:
        """How far below the top of a thing the fingers' tips are when they hold it."""
        return min(FINGER_HEIGHT, thing.kind.height - MARGIN)

    def _solid_fingers(self, solid: bool) -> None:
        for body in self.fingers:
            for shape in body.shapes:
                shape.sensor = not solid
