"""A look through cameras: rendered depth pictures, masks that may be missed or wrong, and the planned shape fitted to
the points of a mask. What is estimated is how a thing lies and, from near by, how large it is, where furniture stands
and how far its joints are open; shapes stay as planned, but for trays."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scenewright.schemas.scene_parts import Camera
from scenewright.stages.kit.acting.erring_robot import ErringRobot
from scenewright.stages.kit.acting.errors import quarter_turn
from scenewright.stages.kit.acting.eyes.masks import Segmenter
from scenewright.stages.kit.geometry.cameras import scaled
from scenewright.stages.kit.geometry.transforms import apply, inverse, look_at
from scenewright.stages.kit.rendering.object_views import View, cloud, take
from scenewright.stages.kit.simulation.shapes import link_shapes, surface_points
from scenewright.stages.plan.affordances import CARRIER_CLASSES
from scenewright.stages.plan.correspondence import alike
from scenewright.stages.plan.eyes import Seen
from scenewright.stages.plan.furniture_fit import FittedFurniture, Range, fit_furniture
from scenewright.stages.plan.pictures import RoomPictures
from scenewright.stages.plan.pose_fit import fit_upright
from scenewright.stages.plan.seen_carrier import SeenCarrier, carrier_text, seen_carrier
from scenewright.stages.plan.seen_things import SeenThings
from scenewright.stages.plan.world_model import WorldModel, body_planes, moved_record

CAMERA = Camera(width=240, height=180, fx=260.0, fy=260.0, cx=119.5, cy=89.5)
"""The camera of a look; **assumed**."""
EYES = ((0.0, 1.35), (0.2, 0.85))
"""How far before the middle of the base and how high the cameras are [m]: the head's, and one that the hand holds up,
which is not there while the hand holds something. **Assumed**: the arm gets there and back."""
BEFORE_IT, OVER_IT = 1.2, (0.1, 0.45)
"""Largest distance from the base at which what can be carried is looked at closely [m], and where the free hand is for
that: so far on the robot's side of it, and how high over it [m]."""
HEADINGS, SWEPT, FALLEN = 8, (0.6, 1.4), 1.5
"""How a thing that is not where it is believed is looked for: in so many directions, on the floor so far from the base
[m], up to so far from where it was [m]."""
HIDDEN = 0.015
"""A carrier that looks smaller or larger than it is by more is partly hidden, or taken with what is beside it [m]."""
MOST_TURNED = 0.2
"""Furniture is turned no farther than this from how the map has it [rad]."""
NEAR_BY = 1.5
"""Largest distance of a look from near by [m]."""
SAME = 0.1
"""Clouds of two cameras this near to each other are of one thing [m]."""
LEAST_POINTS = 40
"""With fewer points a thing was not seen; by eye."""
POINTS, FURNITURE_POINTS = 1500, 3000
"""Points of a shape that is fitted, and of each part of furniture."""


@dataclass(frozen=True)
class Look:
    """What cameras showed of one thing."""

    points: np.ndarray
    """(N, 3), map frame."""
    views: tuple[View, ...]
    """The pictures that showed it."""


NOTHING = Look(np.zeros((0, 3)), ())
"""A look that shows nothing."""


def _over(base: np.ndarray, target: np.ndarray) -> np.ndarray:
    """Return where the hand's camera is (3,) that looks at a target (3,) from over it, on the robot's side of it."""
    back = base[:2] - target[:2]
    back *= OVER_IT[0] / max(float(np.linalg.norm(back)), 1e-9)
    return target + np.array([*back, OVER_IT[1]])


class CameraEyes:
    """The eyes of a robot that errs. `radius`: how far from where it is believed a thing of its class is it [m]."""

    again = True

    def __init__(
        self,
        model: WorldModel,
        pictures: RoomPictures,
        robot: ErringRobot,
        segmenter: Segmenter,
        random: np.random.Generator,
        radius: float,
    ) -> None:
        self._model, self._pictures, self._robot = model, pictures, robot
        self._segmenter, self._random, self._radius = segmenter, random, radius
        self._mapped = {name: model.pose(name) for name, record in model.records.items() if not record.carriable}
        """Furniture -> where the map has it (4, 4)."""
        self._parts: dict[str, dict[str, tuple[np.ndarray, np.ndarray]]] = {}
        self._things = SeenThings()
        self._carriers: dict[str, tuple[int, SeenCarrier]] = {}
        """Planned body -> how many points showed most of it, and its shape then."""

    def seen(self, body: str, here: str) -> Seen | None:
        """Return the planned body where the pictures show it; None where they do not, and for what is far away and
        neither is carried nor has joints. `here` is not used: which thing it is, its class and place say."""
        record = self._model.records[body]
        is_close = self._distance(body) < BEFORE_IT
        if not record.carriable and not record.joints and not is_close:
            return None
        carrier = is_close and record.class_name in CARRIER_CLASSES
        look = self._look_for(body, record.class_name, closely=is_close and record.carriable)
        if len(look.points) < LEAST_POINTS and is_close and record.carriable:
            look = self._search(body, record.class_name)
        points = look.points
        if len(points) < LEAST_POINTS:
            return None
        text, planes = self._model.text(body), self._model.planes[body]
        shape = self._carrier(body, points) if carrier else None
        if shape is not None:
            record, text = moved_record(record, shape.pose, {}), carrier_text(body, shape, record.mass)
            return record, text, body_planes(record, text)
        pose, joints = self._model.pose(body), {j.name: self._model.joint_value(body, j.name) for j in record.joints}
        if is_close and record.carriable and record.class_name not in CARRIER_CLASSES:
            eyes = np.array([view.eye for view in look.views])
            pose, text = self._things.fitted(body, text, pose, points, eyes)
            record = moved_record(record, pose, {})
            return record, text, body_planes(record, text)
        if record.carriable:
            seen_before = body in self._carriers
            pose = fit_upright(points, apply(pose, self._model.points(body, POINTS)), as_believed=seen_before) @ pose
        else:
            fit = self._furniture(body, look, joints)
            pose, joints = fit.motion @ pose, fit.joints
        return moved_record(record, pose, joints), text, planes

    def _carrier(self, body: str, points: np.ndarray) -> SeenCarrier | None:
        """Return how points (N, 3) of a carrier show it, None where an arm or what stands on it hides too much. Its
        shape is that of the look that showed most points of it."""
        load = [[*self._model.pose(name)[:2, 3], self._model.footprint(name)[0]] for name in self._model.load(body)]
        pose = self._model.pose(body)
        shape = seen_carrier(points, np.array(load).reshape(-1, 3), float(np.arctan2(pose[1, 0], pose[0, 0])))
        if shape is None:
            return None
        most, best = self._carriers.get(body, (0, shape))
        if len(points) >= most:
            self._carriers[body] = len(points), shape
            return shape
        return replace(shape, boxes=best.boxes) if np.all(np.abs(shape.size - best.size) < HIDDEN) else None

    def _distance(self, body: str) -> float:
        """Return how far from the base a body is believed [m]."""
        base = self._robot.robot.configuration().base
        return float(np.hypot(*(np.mean(self._model.world.bounds(body), axis=0)[:2] - base[:2])))

    def _furniture(self, body: str, look: Look, joints: dict[str, float]) -> FittedFurniture:
        """Return how furniture stands from where it is believed, and the joint values at which it fits a look."""
        world, surface_of_link = self._model.world, self._parts_of(body)

        def surface_at(values: dict[str, float]) -> tuple[np.ndarray, np.ndarray]:
            with world.joints_at(body, values):
                poses = {link: world.link_pose(body, link) for link in surface_of_link}
            points = [apply(poses[link], surface) for link, (surface, _) in surface_of_link.items()]
            normals = [surface @ poses[link][:3, :3].T for link, (_, surface) in surface_of_link.items()]
            return np.concatenate(points), np.concatenate(normals)

        ranges = [Range(joint.name, joint.lower, joint.upper) for joint in self._model.records[body].joints]
        return fit_furniture(
            look.points, look.views, surface_at, ranges, joints, lambda m: self._near_its_place(body, m)
        )

    def _near_its_place(self, body: str, motion: np.ndarray) -> bool:
        """Whether furniture that is moved by a motion (4, 4) from where it is believed stands about as the map has it;
        elsewhere something else was fitted."""
        middle = np.append(np.mean(self._model.world.bounds(body), axis=0), 1.0)
        from_map = motion @ self._model.pose(body) @ inverse(self._mapped[body])
        off = motion @ middle - self._mapped[body] @ inverse(self._model.pose(body)) @ middle
        turn = abs(float(np.arctan2(from_map[1, 0], from_map[0, 0])))
        return float(np.linalg.norm(off)) < self._radius / 2 and turn < MOST_TURNED

    def _parts_of(self, body: str) -> dict[str, tuple[np.ndarray, np.ndarray]]:
        """Return points (N, 3) on each part of furniture and their outward normals (N, 3), its own frame."""
        if body not in self._parts:
            meshes = link_shapes(self._model.text(body))
            random = np.random.default_rng(0)
            self._parts[body] = {
                k: surface_points(meshes_of_link, FURNITURE_POINTS, random)
                for k, meshes_of_link in meshes.items()
                if meshes_of_link
            }
        return self._parts[body]

    def _look_for(self, body: str, class_name: str, *, closely: bool = False) -> Look:
        """Return what the cameras show of the thing of its class that is nearest to where a body is believed;
        `closely`: at twice the resolution, and from above as well where the hand is free."""
        target = self._believed_middle(body)
        base = self._robot.robot.configuration().base
        ahead = np.array([np.cos(base[2]), np.sin(base[2])])
        hand = self._robot.held is None
        eyes = [np.array([*(base[:2] + forward * ahead), height]) for forward, height in EYES[: None if hand else 1]]
        if closely and hand:
            eyes.append(_over(base, target))
        return self._looks(body, class_name, [(eye, target) for eye in eyes], scaled(CAMERA, 2.0 if closely else 1.0))

    def _search(self, body: str, class_name: str) -> Look:
        """Return what a look all around shows of a thing that is not where it is believed, and a closer one at what was
        found: what fell lies somewhere near."""
        base = self._robot.robot.configuration().base
        head = np.array([*base[:2], EYES[0][1]])
        best_look = NOTHING
        for heading in base[2] + 2 * np.pi * np.arange(HEADINGS) / HEADINGS:
            for away in SWEPT:
                target = np.array([*(base[:2] + away * np.array([np.cos(heading), np.sin(heading)])), 0.0])
                look = self._looks(body, class_name, [(head, target)], CAMERA, FALLEN)
                if len(look.points) > len(best_look.points):
                    best_look = look
        if not len(best_look.points):
            return best_look
        target = apply(inverse(self._robot.map_from_true()), np.median(best_look.points, axis=0)[None])[0]
        views = [(head, target), (_over(base, target), target)][: 2 if self._robot.held is None else 1]
        return self._looks(body, class_name, views, scaled(CAMERA, 2.0), FALLEN)

    def _believed_middle(self, body: str) -> np.ndarray:
        """Return where the middle of a body (3,) would truly be if it is where it is believed."""
        believed = np.mean(self._model.world.bounds(body), axis=0)
        return apply(inverse(self._robot.map_from_true()), believed[None])[0]

    def _looks(
        self,
        body: str,
        class_name: str,
        views: list[tuple[np.ndarray, np.ndarray]],
        camera: Camera,
        radius: float | None = None,
    ) -> Look:
        """Return what cameras show of a thing of a class, at most `radius` [m] from where a body is believed (or the
        eyes' own); `views`: where each stands and what it looks at, both (3,), as they truly are."""
        map_from_true = self._robot.map_from_true()
        low, high = self._model.world.bounds(body)
        carriable = self._model.records[body].carriable
        if carriable:
            low = high = (low + high) / 2  # of furniture any side may be in sight
        renderer = self._pictures.sight(self._robot.world)
        thing_points, pictures = np.zeros((0, 3)), []
        base = self._robot.robot.configuration().base
        at = self._believed_middle(body)
        region = quarter_turn(base.tolist(), at.tolist()), bool(np.hypot(*(base - at)[:2]) < NEAR_BY)
        for eye, target in views:
            pose = look_at(eye, target)
            picture = take(renderer, camera, pose, self._random)
            clouds = [
                points
                for entry in self._segmenter.masks(picture, map_from_true @ pose, region)
                if alike(entry.label, class_name)
                and len(points := cloud(picture, entry.mask, map_from_true @ pose, whole=not carriable))
                and not self._of_another(body, class_name, points)
            ]
            if carriable and len(thing_points):
                low = high = np.median(thing_points, axis=0)
            middles = [np.median(points, axis=0) for points in clouds]
            away = [float(np.linalg.norm(middle - np.clip(middle, low, high))) for middle in middles]
            if clouds and min(away) < (SAME if carriable and len(thing_points) else radius or self._radius):
                thing_points = np.concatenate([thing_points, clouds[int(np.argmin(away))]])
                pictures.append(View(picture, map_from_true @ pose))
        return Look(thing_points, tuple(pictures))

    def _of_another(self, body: str, class_name: str, points: np.ndarray) -> bool:
        """Whether points (N, 3) are rather of another thing of a class that is believed to be nearer to them, and as
        near as one cloud is to another of the same thing."""
        middle = np.median(points, axis=0)

        def away(name: str) -> float:
            return float(np.linalg.norm(np.mean(self._model.world.bounds(name), axis=0) - middle))

        others = [
            name
            for name, record in self._model.records.items()
            if name != body
            and record.carriable
            and alike(record.class_name, class_name)
            and name in self._model.world.bodies
        ]
        nearest = min(map(away, others), default=np.inf)
        return nearest < min(SAME, away(body))
