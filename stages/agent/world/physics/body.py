"""The robot in the physics world, as arms get it (`stages/agent/body.py`): what it knows came through its cameras."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scenewright.schemas.apartment import Furniture
from scenewright.stages.agent.senses import CANDIDATES, Base, Detection, Felt, Look, Position, Sweep, Take
from scenewright.stages.agent.world.events import Event
from scenewright.stages.agent.world.failures import Rates
from scenewright.stages.agent.world.physics.driving import Driving
from scenewright.stages.agent.world.physics.handling import Handling
from scenewright.stages.agent.world.physics.looking import Looking
from scenewright.stages.agent.world.physics.oracle import RoomSegmenter
from scenewright.stages.agent.world.physics.pulling import Pulling
from scenewright.stages.agent.world.physics.robot_in_room import RobotInRoom
from scenewright.stages.agent.world.physics.room import Body, Room
from scenewright.stages.agent.world.physics.seen import Seen
from scenewright.stages.kit.acting.errors import SegmenterErrors
from scenewright.stages.kit.acting.eyes.asked import AskedSegmenter
from scenewright.stages.kit.simulation.robot_option import USUAL_ROBOT

CLEARANCE = 2.9
"""Cells of the obstacle map that the base keeps from what is occupied."""


class PhysicsBody:
    """One episode's world in pybullet: a robot in a room. `sought`: classes that the eyes are asked for. `close` it.

    Where the masks are a `segmenter`'s, no error of the eyes is drawn: they are its own.
    """

    same_thing, stand_off, short_armed = 0.07, 0.38, True

    def __init__(
        self,
        room: Room,
        sought: tuple[str, ...],
        rates: Rates,
        seed: int,
        segmenter: AskedSegmenter | None = None,
        robot: str = USUAL_ROBOT,
    ) -> None:
        rates = rates if segmenter is None else replace(rates, feedback=0.0)
        self.apartment, self._room = room.apartment, room
        self._robot = RobotInRoom(self._room, rates, seed, robot)
        self._asked = segmenter
        eyes = segmenter or RoomSegmenter(self._room, SegmenterErrors(rates.eyes, self._robot.luck, sought))
        seen_by_robot = Seen(self._robot, CLEARANCE)
        self.obstacles = seen_by_robot.obstacles
        self._driving = Driving(self._robot, seen_by_robot)
        self._looking = Looking(self._robot, seen_by_robot, eyes, sought)
        self._handling = Handling(self._robot, seen_by_robot, self._looking)
        self._pulling = Pulling(self._robot, seen_by_robot, self._looking, self._driving)

    def close(self) -> None:
        """End both pybullet worlds, and the connection to a segmenter."""
        if self._asked is not None:
            self._asked.close()
        self._robot.close()
        self._room.close()

    # ---- what the robot may ask ----

    @property
    def base(self) -> Base:
        """Where localisation says that the robot stands."""
        return self._robot.base

    @property
    def seconds(self) -> float:
        """Since the beginning."""
        return self._robot.seconds

    def sweep(self) -> Sweep:
        """Turn the head camera around."""
        return self._looking.sweep()

    def drive(self, base: Base, toward: str) -> Felt:
        """Drive along the robot's own map."""
        return self._driving.drive(base, toward)

    def look(self, at: Position, *, close: bool) -> Look:
        """Look at a surface, or at a thing from near by."""
        return self._looking.look(at, close=close)

    def look_at_hand(self, view: int) -> Detection | None:
        """See what the hand holds."""
        return self._looking.look_at_hand(view)

    def reaches(self, base: Base, at: Position, *, take: Take = "") -> bool:
        """Whether a free arm pose over a position exists in the robot's own map, or a grasp of what was seen there."""
        return self._handling.reaches(base, at, take=take)

    @property
    def held_level(self) -> bool:
        """Whether what it holds was taken by a level hand."""
        return self._handling.held_level

    def grasp(self, at: Position, label: str, candidate: int, *, level: bool = False, most: int = CANDIDATES) -> Felt:
        """Take what was seen at a position."""
        return self._handling.grasp(at, label, candidate, level=level, most=most)

    def release(self, at: Position, label: str, *, gently: bool = False) -> Felt:
        """Let go over a position."""
        return self._handling.release(at, label, gently=gently)

    def pull(self, at: Position, *, opening: bool) -> Felt:
        """Open or close a door."""
        return self._pulling.pull(at, opening=opening)

    # ---- how it truly is ----

    @property
    def metres(self) -> float:
        """Driven so far."""
        return self._robot.metres

    @property
    def pictures(self) -> list[tuple[str, np.ndarray]]:
        """What the wrist camera took last."""
        return self._looking.pictures

    @property
    def events(self) -> list[Event]:
        """What was done and what the eyes got wrong, in order."""
        return self._robot.log.events

    @property
    def furniture(self) -> dict[str, Furniture]:
        """By name."""
        return self._room.furniture

    @property
    def opened(self) -> set[str]:
        """Furniture whose door is not shut."""
        return self._room.opened()

    @property
    def bodies(self) -> dict[str, Body]:
        """Things as they lie now."""
        return {name: self._room.body(name, self._robot.driver.held) for name in self._room.things}

    def root(self, name: str) -> str:
        """Return the furniture (or `floor`, or "" for the hand) on which a thing is, through what carries it."""
        bodies = self.bodies
        on = bodies[name].on
        while on in bodies:
            on = bodies[on].on
        return on
