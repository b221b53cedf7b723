"""The robot in the physics world, as arms get it (`stages/agent/body.py`): what it knows came through its cameras.

Two frames: the true one, in which pybullet lives, and the map's, which is where localisation says that things are.
Between them lies an error that is drawn anew wherever the base comes to a stop. Joints stand a little beside where
their encoders say. Grasps, falls and collisions are pybullet's.
"""

from __future__ import annotations

from math import atan2, cos, hypot, pi, sin

import numpy as np

from schemas.apartment import Apartment, Furniture
from stages.agent.body import Base, Detection, Felt, FeltKind, Look, Position, SeenFurniture, Sweep
from stages.agent.obstacle_map import ObstacleMap
from stages.agent.scene_map import quarter
from stages.agent.world.events import Event, EventLog
from stages.agent.world.failures import Rates
from stages.agent.world.physics import head
from stages.agent.world.physics.eyes import (
    HEAD,
    NEAR_BY,
    STAINED,
    WRIST,
    Picture,
    Segmenter,
    Surface,
    fuse,
    seen_in,
    take,
)
from stages.agent.world.physics.hands import (
    DROP,
    JUST_OVER,
    SOME_WAY_OVER,
    Beliefs,
    Box,
    Hold,
    Motion,
    Target,
    plan_grasp,
    plan_release,
    reachable,
)
from stages.agent.world.physics.oracle import NoisyOracle
from stages.agent.world.physics.room import Body, Room
from stages.kit.geometry.cameras import back_project
from stages.kit.geometry.transforms import apply, inverse, look_at
from stages.kit.motion.failures import MotionFailed
from stages.kit.motion.kinematics import forward
from stages.kit.motion.physical_robot import PhysicalRobot
from stages.kit.motion.segments import Segment, whole_body
from stages.kit.rendering.segmenter_errors import Luck, SegmenterErrors
from stages.kit.simulation.engine import engine
from stages.kit.simulation.robot import Configuration, base_pose
from stages.kit.simulation.robot_description import load_robot

LOCALISATION, TURNED = 0.008, 0.006
"""Standard deviation of where the base thinks that it stands [m], [rad], drawn at every stop."""
JOINTS = 0.001
"""The same of each joint's encoder [rad], drawn once."""
VIEW = np.array([0.0, -0.9, 0.0, -2.2, 0.0, 2.1, 0.785])
"""Arm that holds the wrist camera over a surface in front, looking down by 45 degrees [rad]."""
SIDEWAYS = (0.0, -0.5, 0.5)
"""Turns of the first joint for the three wrist poses [rad]."""
TOOL_FROM_CAMERA = np.array([[0, -1, 0, 0.06], [1, 0, 0, 0], [0, 0, 1, -0.1], [0, 0, 0, 1]], float)
FOUND_WITHIN = 0.12
"""A surface this near to a position is meant by it [m]."""
STEP = 0.05
"""Between poses of the base at which collisions are looked for [m]."""
LOOK_SECONDS, PICTURE_SECONDS = 3.0, 0.5
"""**Assumed**: of a motion of the arm to a view, and of a picture."""
DOORS = ("fridge", "dresser")
AROUND = 1.4
"""What is farther from the base does not matter to the arm [m]."""
CLOSED_ON_NOTHING = 0.004
"""Opening of the fingers below which they hold nothing [m]."""
COMFORT = 4.5
"""Cells of the map within which a turn of the pedestal (0.28 m) with its folded arm (0.39 m) may touch something."""
NEARER = 0.1
"""The arm is shorter than the one of the fast world: it starts so much nearer to a table before it [m]."""


class PhysicsBody:
    """One episode's world in pybullet. `sought`: classes that the eyes are asked for. `close` it."""

    same_thing, stand_off, clearance, short_armed = 0.07, 0.38, 2.9, True

    def __init__(self, apartment: Apartment, sought: tuple[str, ...], rates: Rates, seed: int) -> None:
        self.apartment, self._rates, self._luck = apartment, rates, Luck(seed)
        self._random = np.random.default_rng([seed, 83])
        self.room = Room(apartment)
        self._sought = sought
        self._oracle = NoisyOracle(self.room, SegmenterErrors(rates, self._luck, sought))
        self._segmenter: Segmenter = self._oracle
        description = load_robot("panda")
        self._beliefs = Beliefs(description)
        self._description = description
        self._joint_error = self._random.normal(0, JOINTS, 7)
        self._error = np.zeros(3)
        x, y, yaw = apartment.start
        if any(self._gap(piece, x, y) < 0.5 for piece in apartment.furniture):
            x, y = x + NEARER * cos(yaw), y + NEARER * sin(yaw)
        self._believed = np.array([x, y, yaw])
        self._arm = description.carry
        start = Configuration(self._believed, self._arm + self._joint_error, description.opening)
        self._driver = PhysicalRobot(self.room.world, description, start, record_rate=1.0)
        self._driver.put(start)
        self._hold: Hold | None = None
        self._carried: str | None = None
        self._pieces: list[head.SeenPiece] = []
        self._tops: dict[int, float] = {}
        self._surfaces: list[Surface] = []
        self._obstacles = ObstacleMap(self.base, self.clearance, COMFORT)
        self._log = EventLog()
        self._seconds = self.metres = 0.0
        self._grasps = 0
        self._looked_from: Base | None = None
        self.pictures: list[tuple[str, np.ndarray]] = []
        """What the wrist camera took last, for people."""

    def close(self) -> None:
        """End both pybullet worlds."""
        self._beliefs.close()
        self.room.close()

    # ---- frames ----

    @property
    def base(self) -> Base:
        """Where localisation says that the robot stands."""
        return Base(*(float(v) for v in self._believed))

    @property
    def seconds(self) -> float:
        """Since the beginning."""
        return self._seconds + self.room.world.time

    def _true_base(self) -> np.ndarray:
        return self._driver.robot.configuration().base

    def _map_from_true(self) -> np.ndarray:
        return base_pose(self._believed, self._description) @ inverse(base_pose(self._true_base(), self._description))

    def _gap(self, piece: Furniture, x: float, y: float) -> float:
        off = [max(0.0, abs(p - c) - s / 2) for p, c, s in zip((x, y), piece.centre, piece.size, strict=True)]
        return hypot(*off)

    # ---- head ----

    def sweep(self) -> Sweep:
        """Turn the head camera around: floor, obstacles, large furniture."""
        true, map_from_true = self._true_base(), self._map_from_true()
        eye = np.array([true[0], true[1], head.HEIGHT])
        renderer = self.room.renderer(eye)
        clouds = []
        for turn in range(head.TURNS):
            yaw = true[2] + 2 * pi * turn / head.TURNS
            away = np.array([cos(yaw) * cos(head.PITCH), sin(yaw) * cos(head.PITCH), -sin(head.PITCH)])
            pose = look_at(eye, eye + away)
            picture = take(renderer, HEAD, pose, self._random)
            points = apply(map_from_true @ pose, back_project(picture.depth, HEAD).reshape(-1, 3).astype(float))
            there = head.steady(picture.depth).reshape(-1)
            clouds.append(points[there])
            numbers = picture.instance.reshape(-1)
            for number in np.unique(numbers[there]):
                name = self.room.named.get(int(number), "")
                own = there & (numbers == number) & (picture.depth.reshape(-1) < head.SURE)
                if name in self.room.furniture and own.sum() >= head.LEAST:
                    head.enter(self._pieces, self.room.furniture[name].label, points[own])
            self._seconds += PICTURE_SECONDS
        free, occupied = head.cells_of(np.concatenate(clouds), apply(map_from_true, eye[None])[0])
        sweep = Sweep(free, occupied, tuple(self._seen_pieces()))
        self._obstacles.add(sweep)
        return sweep

    def _seen_pieces(self) -> list[SeenFurniture]:
        made = []
        for piece in self._pieces:
            if len(piece.cubes) < head.LEAST:
                continue
            low, high = piece.box
            centre, size = (low + high) / 2, np.maximum(high - low, 0.1)
            made.append(
                SeenFurniture(
                    piece.label,
                    (float(centre[0]), float(centre[1])),
                    (float(size[0]), float(size[1])),
                    float(high[2]),
                    piece.label in DOORS,
                    False,
                )
            )
        return made

    # ---- base ----

    def drive(self, base: Base, length: float, toward: str) -> Felt:
        """Drive along the robot's own map; with empty hands it is moved and asked for contacts, not simulated."""
        goal = np.array([base.x, base.y, base.yaw])
        way = self._obstacles.path(self.base, (base.x, base.y))
        failed = MotionFailed("no_way", "the obstacle map shows no way there") if way is None else None
        if way is not None:
            if not np.allclose(self._arm, self._description.carry):
                self._arm_to(self._description.carry)
            error = self._random.normal(0, 1, 3) * (LOCALISATION, LOCALISATION, TURNED)
            points = [np.array([*point, 0.0]) - self._error for point in way[1:-1]]
            ease = [self._obstacles.at_ease(*point) for point in way[1:-1]]
            for turns in (ease, [False] * len(ease), [True] * len(ease)):
                start = self._true_base()
                failed = self._roll_along(start, _facing_on(start, points, turns, goal - error))
                if failed is None:
                    break
            self._error = error
            self._believed = goal if failed is None else self._true_base() + error
            self._believed[2] = (self._believed[2] + pi) % (2 * pi) - pi
            self.metres += length
        if toward:
            self._log.done("drive", f"drive to {toward.rsplit('_', 1)[0]}", failed is None, "navigation", "")
        return Felt(True) if failed is None else Felt(False, "no_way", failed.failure)

    def _roll_along(self, start: np.ndarray, rows: list[np.ndarray]) -> MotionFailed | None:
        arm = self._arm + self._joint_error
        if self._hold is not None:
            try:
                self._driver.follow(Segment(whole_body_rows(np.array([start, *rows]), arm), 0.0), None)
            except MotionFailed as failed:
                if failed.failure.kind == "path_blocked":
                    return failed
            return None
        here = start
        opening = self._driver.robot.configuration().opening
        for row in rows:
            count = max(1, int(np.ceil(np.abs(row - here)[:2].max() / STEP)))
            for k in range(1, count + 1):
                at = here + (row - here) * k / count
                self._driver.robot.set_body(np.concatenate([at, arm]))
                struck = self._struck()
                if struck:
                    back = here + (row - here) * (k - 1) / count
                    self._driver.put(Configuration(back, arm, opening))
                    return MotionFailed("path_blocked", f"the base touched {struck}", (struck,))
            self._seconds += float(np.linalg.norm((row - here)[:2])) / self._description.base_speed
            here = row
        self._driver.put(Configuration(here, arm, opening))
        self._seconds += 1.0
        return None

    def _struck(self) -> str:
        engine.performCollisionDetection(physicsClientId=self.room.world.client)
        for contact in self.room.world.contacts(self._driver.robot.body_id):
            name = self.room.world.name_of(contact.other_body)
            if name is not None and name != "floor" and contact.depth > 0.001:
                return self.room.world.bodies[name].record.class_name
        return ""

    # ---- eyes ----

    def look(self, at: Position, *, close: bool) -> Look:
        """Look at a surface from three wrist poses and fuse what they show, or at a thing at twice the resolution."""
        sector, piece = quarter(self.base, at), self._piece_at(at)
        toward = atan2(at[1] - self._believed[1], at[0] - self._believed[0]) - self._believed[2]
        toward = (toward + pi) % (2 * pi) - pi
        found: list[Surface] = []
        renderer = None
        for turn in (0.0,) if close else SIDEWAYS:
            arm = VIEW.copy()
            arm[0] = np.clip(toward + turn, -2.7, 2.7)
            self._arm_to(arm)
            pose, seen_pose = self._wrist_poses()
            renderer = renderer or self.room.renderer(pose[:3, 3])
            picture = take(renderer, NEAR_BY if close else WRIST, self._aimed(pose, at, close), self._random)
            camera = self._aimed(seen_pose, at, close)
            if not close:  # a thing fills a picture from near by
                self._keep_top(picture, camera, piece)
            masks = self._segmenter.masks(picture, (sector, close))
            found += seen_in(picture, masks, camera, camera[:3, 3])
            self.pictures = [*self.pictures[-40:], (f"{'near ' if close else ''}{turn:+.1f}", picture.color)]
            self._seconds += PICTURE_SECONDS
        for name in sorted(self._oracle.missed):
            if self.room.things[name].label in self._sought:
                self._log.mistaken("missed", f"look {name}")
        self._oracle.missed.clear()
        self._looked_from = self.base
        near = [s for s in fuse(found) if self._belongs(s, at, piece, close)]
        old = [s for s in self._surfaces if not self._belongs(s, at, piece, close)]
        self._surfaces = old + near
        return Look(tuple(self._detection(s, sector, close, at) for s in near), sector, close)

    def _aimed(self, pose: np.ndarray, at: Position, close: bool) -> np.ndarray:
        """Return a camera pose, with the crop of a near look turned to the position that it is of."""
        if not close:
            return pose
        shift = self._map_from_true()
        target = np.array(at)
        if np.allclose(pose, self._wrist_poses()[0]):
            target = apply(inverse(shift), target[None])[0]
        return look_at(pose[:3, 3], target)

    def _wrist_poses(self) -> tuple[np.ndarray, np.ndarray]:
        """Return the wrist camera's pose (4, 4) in truth, and in the map by base and encoders."""
        true = self._driver.robot.tool_pose() @ TOOL_FROM_CAMERA
        seen = base_pose(self._believed, self._description) @ forward(self._beliefs.chain, self._arm)
        return true, seen @ TOOL_FROM_CAMERA

    def _keep_top(self, picture: Picture, map_from_camera: np.ndarray, piece: int | None) -> None:
        """Measure the height of the top of furniture that fills the picture: the most frequent height [m]."""
        if piece is None:
            return
        points = apply(map_from_camera, back_project(picture.depth, picture.camera)[::3, ::3].reshape(-1, 3))
        low, high = self._pieces[piece].box
        inside = np.all((points[:, :2] > low[:2]) & (points[:, :2] < high[:2]), axis=1)
        heights = points[inside & (np.abs(points[:, 2] - high[2]) < 0.08), 2]
        if len(heights) > 200:
            counts, edges = np.histogram(heights, bins=np.arange(high[2] - 0.08, high[2] + 0.081, 0.005))
            top = edges[counts.argmax()] + 0.0025
            self._tops[piece] = float(np.median(heights[np.abs(heights - top) < 0.006]))

    def _piece_at(self, at: Position) -> int | None:
        for number, piece in enumerate(self._pieces):
            low, high = piece.box
            if len(piece.cubes) >= head.LEAST and np.all((at[:2] > low[:2] - 0.1) & (at[:2] < high[:2] + 0.1)):
                return number
        return None

    def _belongs(self, surface: Surface, at: Position, piece: int | None, close: bool) -> bool:
        middle = surface.middle
        if close:
            return hypot(middle[0] - at[0], middle[1] - at[1]) <= FOUND_WITHIN
        if piece is None:
            return False
        low, high = self._pieces[piece].box
        return bool(
            np.all((middle[:2] > low[:2] - 0.05) & (middle[:2] < high[:2] + 0.05)) and middle[2] > high[2] - 0.1
        )

    def _detection(self, surface: Surface, sector: int, close: bool, at: Position) -> Detection:
        used = surface.stain >= STAINED if close else None
        spot = tuple(np.round(surface.middle[:2], 1))
        if close and self._luck.happens(self._rates.feedback, "used", spot, sector):
            used = not used
        low, high, middle = surface.low, surface.high, surface.middle
        radius = float(max(high[0] - low[0], high[1] - low[1]) / 2)
        position = (float(middle[0]), float(middle[1]), float(low[2]) + 0.02)
        return Detection(surface.label, position, surface.color, used, radius)

    def look_at_hand(self, view: int) -> Detection | None:
        """See from the head what the hand holds; a view of one state may be misjudged for good."""
        self._seconds += PICTURE_SECONDS
        true = self._true_base()
        eye = np.array([true[0], true[1], head.HEIGHT])
        tool = self._driver.robot.tool_pose()[:3, 3]
        picture = take(self.room.renderer(eye), WRIST, look_at(eye, tool), self._random)
        near = [
            (float(np.linalg.norm(s.middle - tool)), k, s)
            for k, s in enumerate(
                seen_in(picture, self._segmenter.masks(picture, ("hand", view)), look_at(eye, tool), eye)
            )
        ]
        seen = min(near, default=None)
        held = seen[2] if seen is not None and seen[0] < FOUND_WITHIN else None
        position = (float(tool[0]), float(tool[1]), float(tool[2]))
        if self._luck.happens(self._rates.feedback, "feedback", self._grasps, view):
            self._log.mistaken("feedback", f"hand {self._grasps}")
            label = self._sought[0] if self._sought else "thing"
            return Detection(label, position, "", None, 0.04) if held is None else None
        return None if held is None else Detection(held.label, position, held.color, None, 0.04)

    # ---- hand ----

    def _arm_to(self, arm: np.ndarray) -> None:
        """Bring the arm to joint values; with empty hands it is put there."""
        base = self._true_base()
        self._seconds += LOOK_SECONDS
        if self._hold is None:
            opening = self._driver.robot.configuration().opening
            self._driver.put(Configuration(base, arm + self._joint_error, opening))
        else:
            rows = whole_body(base, np.array([self._arm, arm]) + self._joint_error)
            try:
                self._carefully(Segment(rows, 0.0, 0.6))
            except MotionFailed:
                arm = self._measured_arm()  # something is in the way: it looks from where it got to
        self._arm = arm

    def _measured_arm(self) -> np.ndarray:
        return self._driver.robot.configuration().arm - self._joint_error

    def _carefully(self, segment: Segment) -> None:
        """Follow a segment; what slips out of the hand is not noticed. Raises MotionFailed `path_blocked`."""
        try:
            self._driver.follow(segment, None)
        except MotionFailed as failed:
            if failed.failure.kind != "grasp_lost":
                raise

    def _boxes(self, without: Position | None = None) -> dict[str, Box]:
        """Return what is around the base in the map; what covers a position is left out."""
        boxes: dict[str, Box] = {}
        for number, piece in enumerate(self._pieces):
            low, high = piece.box
            off = np.maximum(0.0, np.maximum(low[:2] - self._believed[:2], self._believed[:2] - high[:2]))
            if len(piece.cubes) >= head.LEAST and np.hypot(*off) < AROUND:
                top = min(float(high[2]), self._tops.get(number, float(high[2]))) - 0.004
                inner = 0.02
                boxes[f"furniture_{number}"] = (
                    np.array([*(low[:2] + inner), 0.0]),
                    np.array([*(high[:2] - inner), top]),
                )
        for number, surface in enumerate(self._surfaces):
            low, high = surface.low, surface.high
            covers = without is not None and bool(
                np.all((np.array(without[:2]) > low[:2] - 0.03) & (np.array(without[:2]) < high[:2] + 0.03))
            )
            if not covers and np.hypot(*(surface.middle - [*self._believed[:2], 0])[:2]) < AROUND:
                boxes[f"thing_{number}"] = (low, high)
        return boxes

    def reaches(self, base: Base, at: Position) -> bool:
        """Whether a free arm pose over a position exists in the robot's own map, from a base pose."""
        self._beliefs.hold(None)
        self._beliefs.show(self._boxes(at))
        return reachable(self._beliefs, np.array([base.x, base.y, base.yaw]), at, np.random.default_rng(5))

    def grasp(self, at: Position, label: str, candidate: int) -> Felt:
        """Take the surface that was seen at a position. A slip and a wrong thing are not felt."""
        meant = self._nearest_thing(at)
        step = f"grasp {meant}" if meant and self.room.things[meant].label == label else f"grasp a {label}"
        if self._carried is not None or self._hold is not None:
            self._log.done("grasp", step, False, "api", "")
            return Felt(False, "no_grasp")
        try:
            self._take(at, candidate)
        except MotionFailed as failed:
            self._recover()
            self._log.done("grasp", step, False, "grasp", "")
            return Felt(False, _felt_kind(failed), failed.failure)
        held = self._driver.held
        self._carried = held
        right = held is not None and self.room.things[held].label == label
        cause = "grasp" if held is None else "false_positive"
        self._log.done("grasp", step, right, cause, self.room.things[held].label if held else "")
        return Felt(True)

    def _see_from_here(self, at: Position) -> None:
        """Look once more at what will be grasped: what was measured from another stop is off by both stops' errors."""
        if self._looked_from == self.base:
            return
        before = self._surfaces
        self.look(at, close=True)
        if not any(hypot(s.middle[0] - at[0], s.middle[1] - at[1]) <= FOUND_WITHIN for s in self._surfaces):
            self._surfaces = before

    def _take(self, at: Position, candidate: int) -> None:
        self._see_from_here(at)
        away = [hypot(s.middle[0] - at[0], s.middle[1] - at[1]) for s in self._surfaces]
        number = int(np.argmin(away)) if away else -1
        if number < 0 or away[number] > FOUND_WITHIN:
            raise MotionFailed("no_grasp", "no surface was seen there", (), {"distance": min(away, default=9.0)})
        surface = self._surfaces[number]
        self._surfaces = [s for s in self._surfaces if s is surface or not s.same_as(surface)]
        number = next(k for k, s in enumerate(self._surfaces) if s is surface)
        self._beliefs.hold(None)
        self._beliefs.show(self._boxes())
        piece = self._piece_at(at)
        floor = self._tops.get(piece, float(surface.low[2])) if piece is not None else float(surface.low[2])
        target = Target(surface, f"thing_{number}", candidate, floor)
        motion = plan_grasp(self._beliefs, self._believed, self._arm, target, self._random)
        self._grasps += 1
        self._carry_out(motion.there)
        self._close_hand()
        self._surfaces.pop(number)
        self._hold = motion.hold
        try:
            self._carry_out(motion.away)
        except MotionFailed:
            self._driver.release()  # lifting is blocked: let go
            self._hold = None
            raise
        if self._driver.robot.configuration().opening < CLOSED_ON_NOTHING:
            self._hold = None
            self._driver.held = None

    def _close_hand(self) -> None:
        tool = self._driver.robot.tool_pose()[:3, 3]
        world = self.room.world
        near = [(float(np.linalg.norm(world.center_of_mass(n)[:3, 3] - tool)), n) for n in self._loose()]
        world.wake()
        for _, name in sorted(near)[:2]:
            self.room.moved[name] += 1
        try:
            self._driver.grasp(min(near)[1] if near else "")
        except (MotionFailed, KeyError):
            self._driver.held = None

    def _loose(self) -> list[str]:
        return [name for name in self.room.things if name in self.room.world.bodies]

    def _carry_out(self, segments: tuple[Segment, ...]) -> None:
        base = self._true_base()
        for segment in segments:
            arms = segment.path[:, 3:]
            rows = whole_body(base, arms + self._joint_error)
            self._carefully(Segment(rows, segment.opening, segment.pace))
            self._arm = arms[-1]

    def _recover(self) -> None:
        """Draw the arm in after a motion that could not be planned or was stopped, with what it holds."""
        if self._hold is not None:
            self._arm = self._measured_arm()
            self._arm_to(self._description.carry)
            return
        self._arm = self._description.carry
        start = Configuration(self._true_base(), self._arm + self._joint_error, self._description.opening)
        self._driver.put(start)

    def release(self, at: Position, label: str, *, gently: bool = False) -> Felt:
        """Let go 15 cm over a position, or gently: down to contact."""
        name = self._carried
        step = f"place {name or 'nothing'} on {label}"
        if name is None:
            self._hold = None
            self._log.done("release", step, False, "", "")
            return Felt(True)
        here = (at[0], at[1], self._support(at))
        self._beliefs.show(self._boxes(at))
        try:
            self._let_go(self._way_down(here, (JUST_OVER, SOME_WAY_OVER) if gently else (DROP,)), gently)
        except MotionFailed as failed:
            self._recover()
            self._log.done("release", step, False, "place", "")
            return Felt(False, "no_trajectory", failed.failure)
        body = self.room.body(name, None)
        on = self.room.furniture[body.on].label if body.on in self.room.furniture else ""
        on = self.room.things[body.on].label if body.on in self.room.things else on
        self._log.done("release", step, on == label, "place", "")
        return Felt(True)

    def _way_down(self, here: Position, heights: tuple[float, ...]) -> Motion:
        """Plan to let go at the first of the heights over a position that can be got to. Raises MotionFailed."""
        for number, height in enumerate(heights):
            try:
                return plan_release(self._beliefs, self._believed, self._arm, self._hold, here, height, self._random)
            except MotionFailed:
                if number + 1 == len(heights):
                    raise
        raise AssertionError("unreachable")

    def _let_go(self, motion: Motion, gently: bool) -> None:
        reach, down = motion.there
        self._carry_out((reach,))
        parts = np.array_split(down.path, min(4, len(down.path))) if gently else [down.path]
        for rows in parts:
            self._carry_out((Segment(rows, 0.0, down.pace),))
            if gently and self._touches():
                break
        held = self._carried
        self._driver.release()
        self._carried, self._hold = None, None
        if held is not None:
            self.room.moved[held] += 1
        back = np.concatenate([self._arm[None], motion.away[0].path[:, 3:]])
        rows = whole_body(self._true_base(), back)
        try:
            self._carry_out((Segment(rows, self._description.opening, motion.away[0].pace), *motion.away[1:]))
        except MotionFailed:
            self._recover()  # it let go already: what became of it is for the eyes
        self._driver.wait(0.5)

    def _touches(self) -> bool:
        """Whether the wrist feels that what is held stands on something."""
        if self._carried is None:
            return True
        own = self.room.world.bodies[self._carried].body_id
        contacts = self.room.world.contacts(own)
        return sum(c.force for c in contacts if c.other_body != self._driver.robot.body_id) > 1.0

    def _support(self, at: Position) -> float:
        """Return the height [m] of what was seen at a position: of a thing there, else of the furniture."""
        for surface in self._surfaces:
            near = np.hypot(*(surface.points[:, :2] - at[:2]).T) < 0.035
            if near.sum() > 5:
                return float(np.median(surface.points[near, 2]))
        piece = self._piece_at(at)
        if piece is None:
            return at[2]
        return self._tops.get(piece, float(self._pieces[piece].box[1][2]))

    def pull(self, at: Position, *, opening: bool) -> Felt:
        """Doors of this world do not move."""
        self._log.done("pull", f"{'open' if opening else 'close'} something", False, "grasp", "")
        return Felt(False, "door_stuck")

    # ---- how it truly is ----

    def _nearest_thing(self, at: Position) -> str:
        true = apply(inverse(self._map_from_true()), np.array([at], float))[0]
        near = [
            (hypot(x - true[0], y - true[1]), name)
            for name in self._loose()
            if not self.room.things[name].carries
            for x, y, _ in [self.room.lies(name)]
        ]
        return min(near)[1] if near and min(near)[0] <= FOUND_WITHIN else ""

    @property
    def events(self) -> list[Event]:
        """What was done and what the eyes got wrong, in order."""
        return self._log.events

    @property
    def furniture(self) -> dict[str, Furniture]:
        """By name."""
        return self.room.furniture

    @property
    def opened(self) -> set[str]:
        """Furniture whose door is open: none."""
        return set()

    @property
    def bodies(self) -> dict[str, Body]:
        """Things as they lie now."""
        return {name: self.room.body(name, self._driver.held) for name in self.room.things}

    def root(self, name: str) -> str:
        """Return the furniture (or `floor`, or "" for the hand) on which a thing is, through what carries it."""
        bodies = self.bodies
        on = bodies[name].on
        while on in bodies:
            on = bodies[on].on
        return on


def _felt_kind(failed: MotionFailed) -> FeltKind:
    kinds: dict[str, FeltKind] = {"no_grasp": "no_grasp", "no_inverse_kinematics": "out_of_reach"}
    return kinds.get(failed.failure.kind, "no_trajectory")


def whole_body_rows(bases: np.ndarray, arm: np.ndarray) -> np.ndarray:
    """Return (N, 10) rows of base poses (N, 3) with one arm (7,)."""
    return np.concatenate([bases, np.tile(arm, (len(bases), 1))], axis=1)


def _facing_on(start: np.ndarray, points: list[np.ndarray], turns: list[bool], goal: np.ndarray) -> list[np.ndarray]:
    """Return base poses (3,) through points to a goal pose that turn little from each to the next: along the way at
    points where it `turns`, as before at the others, for the base drives to any side."""
    made: list[np.ndarray] = []
    before = start
    for point, turn in zip([*points, goal], [*turns, True], strict=True):
        turned = point.copy()
        if len(made) < len(points):
            turned[2] = atan2(point[1] - before[1], point[0] - before[0]) if turn else before[2]
        turned[2] = before[2] + (turned[2] - before[2] + pi) % (2 * pi) - pi
        made.append(turned)
        before = turned
    return made
