"""Looking: the head camera's turn over floor and furniture, the wrist camera's views of things, the hand's own."""

from __future__ import annotations

from itertools import product
from math import atan2, cos, pi, sin

import numpy as np
from scenewright.stages.agent.goals import FURNITURE
from scenewright.stages.agent.scene_map import quarter
from scenewright.stages.agent.senses import Base, Detection, Look, Position, Sweep
from scenewright.stages.agent.world.physics import head
from scenewright.stages.agent.world.physics.eyes import FIXTURE, HEAD, NEAR_BY, STAINED, WRIST, Surface, fuse, seen_in
from scenewright.stages.agent.world.physics.fronts import PARTS, Front
from scenewright.stages.agent.world.physics.looking_arm import looking_arm, turned
from scenewright.stages.agent.world.physics.robot_in_room import TOOL_FROM_CAMERA, RobotInRoom
from scenewright.stages.agent.world.physics.seen import FOUND_WITHIN, Seen, too_wide
from scenewright.stages.kit.acting.eyes.masks import Mask, Segmenter
from scenewright.stages.kit.geometry.cameras import back_project
from scenewright.stages.kit.geometry.transforms import apply, inverse, look_at
from scenewright.stages.kit.motion.arm_motion import ArmPlanner, Tally
from scenewright.stages.kit.rendering.object_views import Picture, take

SIDEWAYS = (0.0, -0.5, 0.5)
"""Turns of the first joint for the three wrist poses [rad]."""
STEEP, OVER = (1.5, 1.3, 1.1), (0.45,)
"""How far down the wrist camera looks at a thing from above, the steepest first [rad], and from how far [m]."""
FRONT_PITCHES, FRONT_FROM, FRONT_ASIDE = (0.5, 0.3, 0.8, 0.1), (0.6, 0.5, 0.7), (0.0, 0.25, -0.25)
"""How far down the wrist camera looks at a front [rad], from how far, and beside its middle [m]."""
INTO_PITCHES, INTO_FROM, INTO_ASIDE = (0.35, 0.2, 0.5, 0.05), (0.6, 0.5, 0.7, 0.8, 0.4), (0.0, 0.12, -0.12)
"""Pitches [rad], distances and shifts aside [m] of looks into a shelf, in the order in which they are tried."""
LOW = 1.1
"""Furniture below this height is looked at from above as well, when it is open [m]; by eye."""
PICTURE_SECONDS = 0.5
"""Time that a picture takes [s]. **Assumed.**"""


class Looking:
    """The eyes of a robot. `sought`: classes that they are asked for."""

    def __init__(self, robot: RobotInRoom, seen: Seen, segmenter: Segmenter, sought: tuple[str, ...]) -> None:
        self._robot, self._seen, self._segmenter, self._sought = robot, seen, segmenter, sought
        self._view = looking_arm(robot.beliefs)
        self.looked_near: tuple[Base, Position] | None = None
        """From where it looked last from near by, and at what."""
        self._furniture = frozenset((*FURNITURE, *(piece.label for piece in robot.room.furniture.values())))
        """What its eyes call furniture."""
        self._missed: set[str] = set()
        """What pictures of this look showed that is not among their masks, as far as somebody knows."""
        self.pictures: list[tuple[str, np.ndarray]] = []
        """What the wrist camera took last, for people."""

    def sweep(self) -> Sweep:
        """Turn the head camera around: floor, obstacles, large furniture."""
        true, map_from_true = self._robot.true_base(), self._robot.map_from_true()
        eye = np.array([true[0], true[1], head.HEIGHT])
        renderer = self._robot.room.renderer(eye)
        clouds = []
        for turn in range(head.TURNS):
            yaw = true[2] + 2 * pi * turn / head.TURNS
            away = np.array([cos(yaw) * cos(head.PITCH), sin(yaw) * cos(head.PITCH), -sin(head.PITCH)])
            pose = look_at(eye, eye + away)
            picture = take(renderer, HEAD, pose, self._robot.random)
            points = apply(map_from_true @ pose, back_project(picture.depth, HEAD).reshape(-1, 3).astype(float))
            is_steady = (
                head.steady(picture.depth).reshape(-1) & ~self._robot.in_hand(points) & ~self._seen.of_parts(points)
            )
            clouds.append(points[is_steady])
            masks = self._segmenter.masks(picture, map_from_true @ pose, ("head", turn))
            for entry in [mask for mask in masks if mask.label in self._furniture]:
                of_furniture = is_steady & entry.mask.reshape(-1) & (picture.depth.reshape(-1) < head.SURE)
                if of_furniture.sum() >= head.LEAST:
                    head.enter(self._seen.pieces, entry.label, points[of_furniture])
            self._robot.seconds_aside += PICTURE_SECONDS
        for number in range(len(self._seen.pieces)):
            self._seen.keep_shelf(number)
        free, occupied = head.cells_of(np.concatenate(clouds), apply(map_from_true, eye[None])[0])
        sweep = Sweep(free, occupied, tuple(self._seen.furniture()))
        self._seen.obstacles.add(sweep)
        return sweep

    def look(self, at: Position, *, close: bool) -> Look:
        """Look at a surface from three wrist poses and fuse what they show, or at a thing at twice the resolution from
        in front and from above: of what is seen from one side alone, the middle is not known."""
        sector, piece = quarter(self._robot.base, at), self._seen.piece_at(at)
        toward = atan2(at[1] - self._robot.believed[1], at[0] - self._robot.believed[0]) - self._robot.believed[2]
        toward = (toward + pi) % (2 * pi) - pi
        surfaces: list[Surface] = []
        renderer = None
        arms = [turned(self._robot.beliefs.chain, self._view, toward + t) for t in ((0.0,) if close else SIDEWAYS)]
        if not close:
            self._seen.keep_shelf(piece)
        shelf = self._seen.front_at(at) if close else self._seen.front_of(piece)
        if shelf is not None and not shelf.slides:
            over = arms if not close and shelf.size[2] < LOW else []  # what lies on its top is there still
            arms = over + self._arms_into(shelf, [at] if close else shelf.openings(), close=close)
        elif close and self._robot.hold is None:
            arms += self._arms_at(at, STEEP, OVER, INTO_ASIDE[:1])
        if not arms:
            return Look((), sector, close, in_view=False)
        nearest_surface = self._seen.nearest(at) if close and shelf is not None else None
        aim = (
            at if nearest_surface is None else (at[0], at[1], float(nearest_surface.middle[2]))
        )  # tall, it would be cut
        for arm in arms:
            self._robot.arm_to(arm)
            pose, seen_pose = self._robot.wrist_poses()
            renderer = renderer or self._robot.room.renderer(pose[:3, 3])
            picture = take(renderer, NEAR_BY if close else WRIST, self._aim(pose, aim, close), self._robot.random)
            camera = self._aim(seen_pose, aim, close)
            if not close:  # a thing fills a picture from near by
                self._seen.keep_top(picture, camera, piece)
            front = self._seen.front_of(piece)
            if front is not None:
                self._seen.keep_floor(picture, camera, front)
            masks = self._masks(picture, camera, (sector, close))
            surfaces += seen_in(picture, self._things(masks), camera, camera[:3, 3])
            self.pictures = [*self.pictures[-40:], (f"{'near ' if close else ''}{arm[0]:+.1f}", picture.color)]
            self._robot.seconds_aside += PICTURE_SECONDS
        self._count_missed()
        self.looked_near = (self._robot.base, at) if close else None
        surfaces = [s for s in surfaces if not self._robot.in_hand(s.middle[None])[0]]
        near = [s for s in fuse(surfaces) if not too_wide(s) or s.label == FIXTURE]
        near = [s for s in near if self._seen.belongs(s, at, piece, close)]
        self._seen.keep(near, at, piece, close)
        surfaces_near = [s for s in near if s.label != FIXTURE]
        return Look(tuple(self._detection(s, sector, close, at) for s in surfaces_near), sector, close)

    def _masks(self, picture: Picture, camera: np.ndarray, region: object) -> list[Mask]:
        masks = self._segmenter.masks(picture, camera, region)
        self._missed |= self._segmenter.missed
        return masks

    def _things(self, masks: list[Mask]) -> list[Mask]:
        """Return the masks without those of furniture and of what moves of it."""
        return [entry for entry in masks if entry.label not in (*PARTS, *self._furniture)]

    def _count_missed(self) -> None:
        for name in sorted(self._missed):
            sought_thing = self._robot.room.things.get(name)
            if sought_thing is None or sought_thing.label in self._sought:
                self._robot.log.mistaken("missed", f"look {name}")
        self._missed.clear()

    def look_at_front(self, at: Position, *, close: bool = False) -> list[Surface]:
        """Look at a front from before it, to both sides of a position, or there at twice the resolution: handles, and
        what they are on, as surfaces."""
        sector, surfaces, renderer = quarter(self._robot.base, at), list[Surface](), None
        for arm in self._arms_at(at, FRONT_PITCHES, FRONT_FROM, FRONT_ASIDE):
            self._robot.arm_to(arm)
            pose, camera = self._robot.wrist_poses()
            renderer = renderer or self._robot.room.renderer(pose[:3, 3])
            picture = take(renderer, NEAR_BY if close else WRIST, pose, self._robot.random)
            masks = [mask for mask in self._masks(picture, camera, (sector, close)) if mask.label in PARTS]
            surfaces += seen_in(picture, masks, camera, camera[:3, 3])
            self.pictures = [*self.pictures[-40:], (f"front {arm[0]:+.1f}", picture.color)]
            self._robot.seconds_aside += PICTURE_SECONDS
        self._count_missed()
        return fuse(surfaces)

    def _arms_into(self, shelf: Front, places: list[Position], *, close: bool) -> list[np.ndarray]:
        """Return arms that hold the wrist camera before places in an open shelf; none where the robot does not stand
        there."""
        asides = INTO_ASIDE[:1] if close else INTO_ASIDE
        if self._robot.hold is not None or not shelf.before(self._robot.believed):
            return []
        return [arm for at in places for arm in self._arms_at(at, INTO_PITCHES, INTO_FROM, asides)]

    def _arms_at(
        self, at: Position, pitches: tuple[float, ...], aways: tuple[float, ...], asides: tuple[float, ...]
    ) -> list[np.ndarray]:
        """Return arms that hold the wrist camera away from a position, looking at places `asides` [m] beside it: each
        by the first of the distances `aways` [m] and pitches [rad] at which the arm gets there."""
        self._robot.beliefs.hold(None)
        self._robot.beliefs.show(self._seen.boxes())
        base, tally = self._robot.believed, Tally()
        planner = ArmPlanner(self._robot.beliefs, np.random.default_rng(5), 0)
        heading = atan2(at[1] - base[1], at[0] - base[0])
        arms = []
        for aside in asides:
            target = np.array(at) + aside * np.array([-sin(heading), cos(heading), 0.0])
            for away, pitch in product(aways, pitches):
                ahead = np.array([cos(heading) * cos(pitch), sin(heading) * cos(pitch), -sin(pitch)])
                tool = look_at(np.array(at) - away * ahead, target) @ inverse(TOOL_FROM_CAMERA)
                arm = planner.free_at(base, tool, tally, starts=3)
                if arm is not None:
                    arms.append(arm)
                    break
        return arms

    def _aim(self, pose: np.ndarray, at: Position, close: bool) -> np.ndarray:
        """Return a camera pose, with the crop of a near look turned to the position that it is of."""
        if not close:
            return pose
        shift = self._robot.map_from_true()
        target = np.array(at)
        if np.allclose(pose, self._robot.wrist_poses()[0]):
            target = apply(inverse(shift), target[None])[0]
        return look_at(pose[:3, 3], target)

    def _detection(self, surface: Surface, sector: int, close: bool, at: Position) -> Detection:
        used = surface.stain >= STAINED if close else None
        spot = tuple(np.round(surface.middle[:2], 1))
        if close and self._robot.luck.happens(self._robot.rates.feedback, "used", spot, sector):
            used = not used
        low, high, middle = surface.low, surface.high, surface.middle
        radius = float(max(high[0] - low[0], high[1] - low[1]) / 2)
        position = (float(middle[0]), float(middle[1]), float(low[2]) + 0.02)
        return Detection(surface.label, position, surface.color, used, radius, not surface.cut)

    def look_at_hand(self, view: int) -> Detection | None:
        """See from the head what the hand holds; a view of one state may be misjudged for good."""
        self._robot.seconds_aside += PICTURE_SECONDS
        true = self._robot.true_base()
        eye = np.array([true[0], true[1], head.HEIGHT])
        tool = self._robot.driver.robot.tool_pose()[:3, 3]
        pose = look_at(eye, tool)
        picture = take(self._robot.room.renderer(eye), WRIST, pose, self._robot.random)
        masks = self._things(self._segmenter.masks(picture, pose, ("hand", view)))
        by_distance = [
            (float(np.linalg.norm(s.middle - tool)), k, s) for k, s in enumerate(seen_in(picture, masks, pose, eye))
        ]
        nearest = min(by_distance, default=None)
        thing_in_hand = nearest[2] if nearest is not None and nearest[0] < FOUND_WITHIN else None
        position = (float(tool[0]), float(tool[1]), float(tool[2]))
        if self._robot.luck.happens(self._robot.rates.feedback, "feedback", self._robot.grasps, view):
            self._robot.log.mistaken("feedback", f"hand {self._robot.grasps}")
            label = self._sought[0] if self._sought else "thing"
            return Detection(label, position, "", None, 0.04) if thing_in_hand is None else None
        return (
            None if thing_in_hand is None else Detection(thing_in_hand.label, position, thing_in_hand.color, None, 0.04)
        )
