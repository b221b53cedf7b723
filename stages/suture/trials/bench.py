"""The state of a trial and what moves it: two tools, needle, thread, clock, and what happens when a driver moves."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from scenewright.stages.kit.geometry.transforms import inverse, transform_from
from scenewright.stages.suture.motion.needle import SWAGE, about, point_at, turned, upright
from scenewright.stages.suture.motion.primitives import jaws, straight
from scenewright.stages.suture.robot.arms import ARMS
from scenewright.stages.suture.trials.perception import Looking, Seen
from scenewright.stages.suture.trials.recording import Recorder
from scenewright.stages.suture.trials.rope import PARTICLES, drape, winding
from scenewright.stages.suture.trials.settings import World
from scenewright.stages.suture.trials.thread import Drawn, Thread, draw
from scenewright.stages.suture.trials.wound import RIDGE_HALF_WIDTH, RIDGE_HEIGHT

HOME = {
    "right": transform_from(jaws(np.array([0.5, 0.0, -0.85])), np.array([-0.050, 0.0, 0.055])),
    "left": transform_from(jaws(np.array([-0.5, 0.0, -0.85])), np.array([0.050, 0.0, 0.055])),
}
"""Arm -> pose (4, 4) of its tool at the beginning, world frame; by eye."""
CORNER = transform_from(jaws(np.array([1.0, 0.0, 0.0])), np.array([-0.045, -0.030, 0.032]))
"""The lower, back, right corner: away from the cameras, on the right driver's side."""
SHAFT, SHAFT_RADIUS = 0.06, 0.004
"""Length of a tool's shaft that may touch, and its radius [m]; by eye."""
TURNING_RADIUS = 0.02
"""Way that a turn counts for in a motion's time [m/rad]; by eye."""
SETTLING = 30
"""Steps in which the thread comes to rest at the beginning; by eye."""
CHECKED_EVERY = 5
"""Every so many poses of a path the arm is asked whether it reaches them, and at the last."""


class Failed(Exception):
    """A trial-ending error of a class of section 4.1 (I, E, H, T), with what happened."""

    def __init__(self, kind: str, reason: str) -> None:
        super().__init__(reason)
        self.kind, self.reason = kind, reason


@dataclass
class Hold:
    """Who holds the needle, how (tool_from_needle), and with how much of the full force (0 to 1)."""

    arm: str
    grip: np.ndarray
    quality: float


@dataclass
class Bench:
    """A trial's world. Every length in metres, world frame of stages/suture/robot/arms.py."""

    world: World
    eyes: Looking
    random: np.random.Generator
    hand_eye: np.ndarray
    thread: Thread
    needle: np.ndarray
    hold: Hold | None
    recorder: Recorder | None = None
    tools: dict[str, np.ndarray] = field(default_factory=lambda: {name: pose.copy() for name, pose in HOME.items()})
    suture: int = 0
    anchor: np.ndarray | None = None
    holes: tuple[np.ndarray, ...] = ()
    """Where the needle in tissue really went in and came out, (3,) each."""
    expected: Seen | None = None
    """Where the robot believes the needle to lie that it has just inserted."""
    rope: np.ndarray = field(default_factory=lambda: np.zeros((PARTICLES, 3)))
    seconds: float = 0.0
    busy: dict[str, float] = field(default_factory=dict)
    """Until when [s] a driver that was sent aside is under way."""
    tail_reckoned: float = 0.0
    """What a robot that keeps books believes to lie before the first hole [m]."""
    stopped_short: int = 0

    def move(self, arm: str, path: np.ndarray, bar: bool = False, aside: bool = False) -> None:
        """Lead a driver along poses (K, 4, 4); the needle goes with it when held, the thread with the needle.

        A path that leaves the arm's reach ends where it does (counted in `stopped_short`). `bar`: the jaws are wide
        open across the thread, as in sweeping. `aside`: the clock goes on at once, and the driver's own next motion
        begins when it is there.
        """
        checked = np.arange(len(path) - 1, -1, -CHECKED_EVERY)[::-1]
        reached = ARMS[arm].reaches(path[checked])
        if not reached.all():
            self.stopped_short += 1
            path = path[: checked[max(0, int(np.argmin(reached)) - 1)] + 1]
        holds_needle = self.hold is not None and self.hold.arm == arm
        needles = (
            path @ self.hold.grip if holds_needle and self.hold else np.repeat(self.needle[None], len(path), axis=0)
        )
        swages = needles[:, :3, :3] @ SWAGE + needles[:, :3, 3]
        if holds_needle:
            self._tug(float(np.linalg.norm(swages[-1] - self._anchor_or(swages[-1]))))
            if self.hold is None:
                raise Failed("T", "taut thread pulled the needle out of the jaws")
            needles = path @ self.hold.grip
            swages = needles[:, :3, :3] @ SWAGE + needles[:, :3, 3]
        self._drape(arm, path, swages, bar)
        self.tools[arm], self.needle = path[-1], needles[-1]
        started = max(self.seconds, self.busy.get(arm, 0.0))
        ended = started + travel_time(path, self.world.speed)
        if self.recorder is not None:
            self.recorder.follow(arm, path, needles, started, ended, aside)
        if aside:
            self.busy[arm] = ended
        else:
            self.seconds = ended

    def go(self, arm: str, pose: np.ndarray, bar: bool = False) -> None:
        """Move a driver straight to a pose (4, 4)."""
        self.move(arm, straight(self.tools[arm], pose), bar)

    def look(self, place: str) -> Seen | None:
        """Return one estimate of the needle in the robot's frame as it believes it (with the hand-eye error)."""
        self.seconds += self.eyes.model.seconds_an_estimate
        looked = self.eyes.look(self.needle, place)
        if looked is None:
            return None
        return Seen(looked.normal, looked.tip + self.hand_eye, looked.swage + self.hand_eye, looked.right)

    def jaws(self, arm: str) -> np.ndarray:
        """Return the point (1, 3) [m] between a driver's jaws."""
        return np.asarray(self.tools[arm][None, :3, 3])

    def turn_in_grip(self, degrees_normal: float, degrees_in_plane: float) -> None:
        """Turn the held needle in the jaws by random angles of these spreads, about the held point."""
        if self.hold is None:
            return
        tool = self.tools[self.hold.arm]
        tilt = np.radians(degrees_normal) * self.random.standard_normal(2)
        needle = turned(self.needle, self.needle[:3, 0], float(tilt[0]), tool[:3, 3])
        needle = turned(needle, self.needle[:3, 1], float(tilt[1]), tool[:3, 3])
        angle = np.radians(degrees_in_plane) * self.random.standard_normal()
        self.needle = turned(needle, needle[:3, 2], float(angle), tool[:3, 3])
        self.hold.grip = inverse(tool) @ self.needle

    def tangled(self, arm: str) -> bool:
        """Whether the thread is wound about a driver."""
        tool = self.tools[arm]
        return winding(self.rope, tool[:3, 3], -tool[:3, 2]) > self.world.winds

    def overhead(self) -> None:
        """Count the seconds that a primitive takes besides moving and seeing."""
        self.seconds += self.world.overhead

    def record(self, panel: str) -> None:
        """Keep a key frame when the trial is recorded."""
        if self.recorder is not None:
            self.recorder.keep(panel, self.suture, self.seconds, self.tools, self.needle, self.rope)

    def record_past(
        self, panel: str, seconds: float, arm: str, tool: np.ndarray, needle: np.ndarray, rope: np.ndarray
    ) -> None:
        """Keep a key frame of a moment within the last motion: poses (4, 4) then, and the thread (N, 3) before it,
        whose end is led to the needle."""
        if self.recorder is not None:
            share = np.linspace(0.0, 1.0, len(rope))[:, None]
            led = rope + share * (point_at(needle, np.pi) - rope[-1])
            self.recorder.keep(panel, self.suture, seconds, {**self.tools, arm: tool}, needle, led)

    def lay_thread(self) -> None:
        """Lay the thread anew between its anchor (or its free end on the pad) and the needle, and let it fall."""
        swage = point_at(self.needle, np.pi)
        start = (
            self.anchor if self.anchor is not None else swage + np.array([-0.3, 1.0, 0.0]) * self.thread.working * 0.5
        )
        share = np.linspace(0.0, 1.0, PARTICLES)
        self.rope = start + share[:, None] * (swage - start)
        spare = max(0.0, self.thread.working - float(np.linalg.norm(swage - start)))
        bulge = np.array([0.2 * self.random.standard_normal(), 0.6 + 0.3 * self.random.standard_normal(), 0.15])
        self.rope += np.sin(np.pi * share)[:, None] * bulge * 0.5 * spare
        self.rope[:, 2] = np.maximum(self.rope[:, 2], 0.0005)
        self._drape(
            "right", np.repeat(self.tools["right"][None], SETTLING, axis=0), np.repeat(swage[None], SETTLING, 0), False
        )

    def _anchor_or(self, other: np.ndarray) -> np.ndarray:
        return other if self.anchor is None else self.anchor

    def _tug(self, distance: float) -> None:
        if self.anchor is None or self.hold is None:
            return
        drawn = draw(self.thread, distance, self.world.hold * self.hold.quality * 0.5, self.world)
        self.yield_to(drawn)

    def yield_to(self, drawn: Drawn) -> None:
        """Let a held needle give way to thread that does not: it turns in the jaws, or is lost."""
        if drawn.lost:
            raise Failed("T", "the thread ran out: its end slipped out of the first hole")
        if drawn.short <= 0.0:
            return
        if drawn.short > self.world.tug_loses:
            self.hold = None
            return
        spread = self.world.tug_angle_per_millimetre * drawn.short * 1000.0
        self.turn_in_grip(spread, spread)
        self.thread.working += drawn.short

    def _drape(self, arm: str, path: np.ndarray, swages: np.ndarray, bar: bool) -> None:
        steps = len(path)
        capsules = np.zeros((steps, 3, 7))
        for row, name in enumerate(("right", "left")):
            poses = path if name == arm else np.repeat(self.tools[name][None], steps, axis=0)
            capsules[:, row, :3] = poses[:, :3, 3]
            capsules[:, row, 3:6] = poses[:, :3, 3] - SHAFT * poses[:, :3, 2]
            capsules[:, row, 6] = SHAFT_RADIUS
            if self.hold is not None and self.hold.arm == name:
                capsules[:, row, :3] -= 0.006 * poses[:, :3, 2]
        if bar:
            capsules[:, 2, :3] = path[:, :3, 3] + np.array([-0.004, 0.0, 0.0])
            capsules[:, 2, 3:6] = path[:, :3, 3] + np.array([0.022, 0.0, 0.0])
            capsules[:, 2, 6] = 0.003
        first = swages if self.anchor is None else np.repeat(self.anchor[None], steps, axis=0)
        rest_lengths = np.full(steps, self.thread.working)
        drape(
            self.rope,
            rest_lengths,
            np.ascontiguousarray(first),
            np.ascontiguousarray(swages),
            self.anchor is not None,
            capsules,
            RIDGE_HALF_WIDTH,
            RIDGE_HEIGHT,
        )


def travel_time(path: np.ndarray, speed: float) -> float:
    """Return the seconds of a path (K, 4, 4) at `speed` [m/s]; a turn counts by its arc at 20 mm."""
    steps = np.linalg.norm(np.diff(path[:, :3, 3], axis=0), axis=1)
    turns = np.einsum("kij,kij->k", path[1:, :3, :3], path[:-1, :3, :3])
    angles = np.arccos(np.clip((turns - 1.0) / 2.0, -1.0, 1.0))
    return float((steps + TURNING_RADIUS * angles).sum() / speed)


def loaded(world: World, random: np.random.Generator) -> tuple[np.ndarray, Hold]:
    """Return needle pose and hold of a needle handed to the right driver in the corner, near where it should be."""
    rotation = upright(np.zeros(3), 5 * np.pi / 8)[:3, :3]
    tilt = np.radians(world.loading_normal) * random.standard_normal(2)
    rotation = about(rotation[:, 0], float(tilt[0])) @ about(rotation[:, 1], float(tilt[1])) @ rotation
    rotation = about(rotation[:, 2], np.radians(world.loading_in_plane) * random.standard_normal()) @ rotation
    pose = transform_from(rotation, CORNER[:3, 3] - rotation @ SWAGE)
    return pose, Hold("right", inverse(CORNER) @ pose, 0.9)
