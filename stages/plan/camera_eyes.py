"""A look through cameras: rendered depth pictures, masks that may be missed or wrong, and the planned shape fitted to
the points of a mask. What is estimated is where a thing, or furniture with joints, stands and how far a joint is open;
shapes stay as planned."""

from __future__ import annotations

import numpy as np

from schemas.scene_parts import Camera
from stages.kit.geometry.cameras import scaled
from stages.kit.geometry.transforms import apply, inverse, look_at
from stages.kit.rendering.object_views import LEAST_PIXELS, cloud, take
from stages.kit.rendering.segmenter_errors import SegmenterErrors, quarter_turn
from stages.kit.simulation.shapes import link_shapes, surface_points
from stages.plan.affordances import CARRIER_CLASSES
from stages.plan.correspondence import alike
from stages.plan.erring_robot import ErringRobot
from stages.plan.eyes import CELL, NEAR_BY, Room, Seen
from stages.plan.pictures import RoomPictures
from stages.plan.pose_fit import fit_joint, fit_upright
from stages.plan.seen_carrier import SeenCarrier, carrier_text, seen_carrier
from stages.plan.world_model import WorldModel, body_planes, moved_record

CAMERA = Camera(width=240, height=180, fx=260.0, fy=260.0, cx=119.5, cy=89.5)
EYES = ((0.0, 1.35), (0.2, 0.85))
"""How far before the middle of the base and how high the cameras are [m]: the head's, and one that the hand holds up,
which is not there while the hand holds something. **Assumed**: the arm gets there and back."""
BEFORE_IT, OVER_IT = 1.2, (0.1, 0.45)
"""A carrier nearer to the base than this is looked at closely [m], and by the free hand from over it: so far on the
robot's side of it, so high [m]."""
HIDDEN = 0.015
"""A carrier that looks smaller than it did by more is partly hidden [m]."""
SAME = 0.1
"""Clouds of two cameras this near to each other are of one thing [m]."""
LEAST_POINTS = 40
POINTS, FURNITURE_POINTS = 1500, 3000
"""Of a shape that is fitted; of each part of furniture."""
MOST_MOVED = 0.1
"""Furniture stands no farther from where it is believed [m]."""


class CameraEyes:
    """The eyes of a robot that errs. `radius`: how far from where it is believed a thing of its class is it [m]."""

    again = True

    def __init__(
        self,
        model: WorldModel,
        room: Room,
        pictures: RoomPictures,
        robot: ErringRobot,
        errors: SegmenterErrors,
        random: np.random.Generator,
        radius: float,
    ) -> None:
        self._model, self._room, self._pictures, self._robot = model, room, pictures, robot
        self._errors, self._random, self._radius = errors, random, radius
        self._names = dict(enumerate(room.records, start=1))
        """Instance number of a picture -> body of the room."""
        self._carriers: dict[str, SeenCarrier] = {}
        """Planned body -> its shape, as the last look showed it that showed all of it."""

    def seen(self, body: str, here: str) -> Seen | None:
        """Return the planned body where the pictures show it; None where they do not, and for what neither is carried
        nor has joints. `here` is not used: which thing it is, its class and place say."""
        record = self._model.records[body]
        if not record.carriable and not record.joints:
            return None
        carrier = record.class_name in CARRIER_CLASSES and self._distance(body) < BEFORE_IT
        points = self._look_for(body, record.class_name, closely=carrier)
        if len(points) < LEAST_POINTS:
            return None
        text, planes = self._model.text(body), self._model.planes[body]
        shape = self._carrier(body, points) if carrier else None
        if shape is not None:
            record, text = moved_record(record, shape.pose, {}), carrier_text(body, shape, record.mass)
            return record, text, body_planes(record, text)
        pose, joints = self._model.pose(body), {j.name: self._model.joint_value(body, j.name) for j in record.joints}
        if record.carriable:
            seen_before = body in self._carriers
            pose = fit_upright(points, apply(pose, self._model.points(body, POINTS)), as_believed=seen_before) @ pose
        else:
            motion, joints = self._furniture(body, points, joints)
            pose = motion @ pose
        return moved_record(record, pose, joints), text, planes

    def _carrier(self, body: str, points: np.ndarray) -> SeenCarrier | None:
        """Return what points (N, 3) of a carrier show of its shape, None where that is less than was seen before: an
        arm or what stands on it hides the rest."""
        load = [[*self._model.pose(name)[:2, 3], self._model.footprint(name)[0]] for name in self._model.load(body)]
        pose = self._model.pose(body)
        shape = seen_carrier(points, np.array(load).reshape(-1, 3), float(np.arctan2(pose[1, 0], pose[0, 0])))
        before = self._carriers.get(body)
        if shape is None or (before is not None and np.any(shape.size < before.size - HIDDEN)):
            return None
        self._carriers[body] = shape
        return shape

    def _distance(self, body: str) -> float:
        """Return how far from the base a body is believed [m]."""
        base = self._robot.robot.configuration().base
        return float(np.hypot(*(np.mean(self._model.world.bounds(body), axis=0)[:2] - base[:2])))

    def _furniture(
        self, body: str, points: np.ndarray, joints: dict[str, float]
    ) -> tuple[np.ndarray, dict[str, float]]:
        """Return how furniture stands from where it is believed (4, 4), and the joint values at which it fits the
        points (N, 3), joint by joint: joints, place, and joints again, as an open door tells nothing of where a shut
        one stands."""
        model, found = self._model, dict(joints)
        shapes = {
            link: surface_points(meshes, FURNITURE_POINTS, np.random.default_rng(0))[0]
            for link, meshes in link_shapes(model.text(body)).items()
        }

        def points_at(values: dict[str, float]) -> np.ndarray:
            with model.world.joints_at(body, values):
                return np.concatenate([apply(model.world.link_pose(body, k), own) for k, own in shapes.items()])

        motion = np.eye(4)
        for turn in range(2):
            seen = apply(inverse(motion), points)
            for joint in model.records[body].joints:

                def of_joint(value: float, name: str = joint.name) -> np.ndarray:
                    return points_at(found | {name: value})

                found[joint.name] = fit_joint(seen, of_joint, joint.lower, joint.upper, joints[joint.name])
            if turn == 0:
                motion = fit_upright(points, points_at(found), as_believed=True)
                if np.linalg.norm(motion[:3, 3] + (motion[:3, :3] - np.eye(3)) @ points.mean(axis=0)) > MOST_MOVED:
                    return np.eye(4), found  # that is no error of a map: something else was fitted
        return motion, found

    def _look_for(self, body: str, class_name: str, *, closely: bool = False) -> np.ndarray:
        """Return the points (N, 3) of the mask of its class that is nearest to where a body is believed, map frame;
        `closely`: at twice the resolution, and from above as well where the hand is free."""
        map_from_true = self._robot.map_from_true()
        believed = np.mean(self._model.world.bounds(body), axis=0)
        target = apply(inverse(map_from_true), believed[None])[0]
        base = self._robot.robot.configuration().base
        ahead = np.array([np.cos(base[2]), np.sin(base[2])])
        renderer = self._pictures.sight(self._robot.world)
        found = np.zeros((0, 3))
        camera = scaled(CAMERA, 2.0) if closely else CAMERA
        hand = self._robot.held is None
        eyes = [np.array([*(base[:2] + forward * ahead), height]) for forward, height in EYES[: None if hand else 1]]
        if closely and hand:
            back = base[:2] - target[:2]
            back *= OVER_IT[0] / max(float(np.linalg.norm(back)), 1e-9)
            eyes.append(target + np.array([*back, OVER_IT[1]]))
        for eye in eyes:
            pose = look_at(eye, target)
            picture = take(renderer, camera, pose, self._random)
            clouds = [
                points
                for number in np.unique(picture.instance)
                if self._made_out(int(number), picture.instance == number, class_name)
                and len(points := cloud(picture, picture.instance == number, map_from_true @ pose))
            ]
            goal = np.median(found, axis=0) if len(found) else believed
            away = [float(np.linalg.norm(np.median(points, axis=0) - goal)) for points in clouds]
            if clouds and min(away) < (SAME if len(found) else self._radius):
                found = np.concatenate([found, clouds[int(np.argmin(away))]])
        return found

    def _made_out(self, number: int, mask: np.ndarray, class_name: str) -> bool:
        """Whether the segmentation takes an instance of a picture for something of a class."""
        name = self._names.get(number, "")
        if not name or mask.sum() < LEAST_PIXELS:
            return False
        at = self._robot.world.pose(name)[:2, 3]
        base = self._robot.robot.configuration().base
        view = (quarter_turn(base.tolist(), at.tolist()), bool(np.hypot(*(base[:2] - at)) < NEAR_BY))
        if self._errors.misses(name, hash(tuple(np.rint(at / CELL).astype(int).tolist())), *view):
            return False
        return alike(self._errors.class_of(name, self._room.records[name].class_name, *view), class_name)
