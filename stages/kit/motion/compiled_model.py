"""Keep the arrays of the compiled collision check in step with a physics world, its robot and what is carried."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from scenewright.stages.kit.acting.query import CollisionQuery
from scenewright.stages.kit.geometry.transforms import apply, inverse, transform_from
from scenewright.stages.kit.motion.compiled_arrays import CHECK, RESTING, SKIP, RobotArrays, SceneArrays
from scenewright.stages.kit.motion.compiled_check import link_frames
from scenewright.stages.kit.motion.convex_pieces import ConvexPiece, link_pieces
from scenewright.stages.kit.motion.kinematics import arm_chain
from scenewright.stages.kit.simulation.robot import Robot
from scenewright.stages.kit.simulation.robot_description import PEDESTAL_LINK, mobile_robot_urdf
from scenewright.stages.kit.simulation.world import LoadedBody, PhysicsWorld

HULL_MARGIN = 0.001
"""Distance by which Bullet widens every convex hull [m]."""
SAFETY = 0.0005
"""Distance that is kept beyond what the mesh checker asks, for its numerical error [m]."""
APART = 2 * HULL_MARGIN + SAFETY
"""Distance beyond the clearance within which hulls are looked at: both margins and the safety [m]."""
CARRIED = "carried"


class CompiledModel:
    """Robot and scene as arrays. `update` before every query; it does little when nothing changed."""

    def __init__(self, world: PhysicsWorld, robot: Robot, clearance: float) -> None:
        self.world, self.robot, self.clearance = world, robot, clearance
        description = robot.description
        self._chain = arm_chain(description)
        self._pieces = link_pieces(mobile_robot_urdf(description))
        joints = len(self._chain.fixed)
        # Pedestal and arm base stand on frame 0, hand and fingers on the last.
        frame_of = {name: max(0, index - 1) for index, name in enumerate(robot.chain)}
        links = [name for name in robot.links if self._pieces.get(name)]
        self._frame_of = {name: frame_of.get(name, joints) for name in links}
        self.parts = [*links, CARRIED]
        self.groups: list[str] = []
        """Names of the scene's links, by index of the group."""
        self._group_body: list[str] = []
        self._group_range: dict[str, range] = {}
        self._bodies: list[LoadedBody] | None = None
        self._revision_and_carried: tuple[int, str | None] = (-1, None)
        self._seen_body: dict[str, int] = {}
        self._rules: tuple[object, ...] | None = None
        self._robot_state: tuple[object, ...] | None = None
        self.arm: RobotArrays
        self.scene: SceneArrays

    def keep(self, clearance: float) -> None:
        """Keep another clearance [m] from now on."""
        self.clearance = clearance
        self._robot_state = None
        if self._bodies is not None:
            self.scene = self.scene._replace(distance=clearance + APART)

    def update(self, query: CollisionQuery) -> None:
        """Take over what changed in the world and in the query."""
        carried, tool_from_carried = query.carried, query.tool_from_carried
        rebuilt = False
        bodies = list(self.world.bodies.values())
        # By the bodies themselves: pybullet gives the id of one that was taken out to the next.
        if self._bodies is None or [*map(id, bodies)] != [*map(id, self._bodies)]:
            self._bodies = bodies
            self._build_scene()
            rebuilt = True
        elif (self.world.revision, carried) != self._revision_and_carried:
            for name, body_range in self._group_range.items():
                changed = max(self.world.revisions.get(name, 0), self.world.stepped)
                # What is carried is looked at again once it is put down.
                if changed > self._seen_body[name] and name != carried:
                    self._place(name, body_range)
                    self._seen_body[name] = changed
        self._revision_and_carried = (self.world.revision, carried)
        rules = (carried, query.may_touch, tuple(query.rests_on))
        if rebuilt or rules != self._rules:
            self._allow(carried, query.may_touch, query.rests_on)
            self._rules = rules
        configuration = self.robot.configuration()
        state = (round(configuration.opening, 6), carried, tool_from_carried.tobytes() if carried else b"")
        if state != self._robot_state:
            self._build_robot(configuration.body, carried, tool_from_carried)
            self._robot_state = state

    def part_name(self, index: int, carried: str | None) -> str:
        """Return the link of the robot, or the carried body, behind an index of a part."""
        name = self.parts[index]
        return carried or name if name == CARRIED else name

    def other_name(self, index: int, carried: str | None) -> str:
        """Return the scene link (index >= 0) or the part (-1 - index) behind what a collision is with."""
        return self.groups[index] if index >= 0 else self.part_name(-1 - index, carried)

    # --- the scene --------------------------------------------------------------------------------------------

    def _build_scene(self) -> None:
        self.groups, self._group_body, self._group_range = [], [], {}
        pieces: list[ConvexPiece] = []
        begin = [0]
        for name, body in self.world.bodies.items():
            shapes = link_pieces(body.text)
            first = len(self.groups)
            for link in body.links:
                if shapes.get(link):
                    self.groups.append(link)
                    self._group_body.append(name)
                    pieces += shapes[link]
                    begin.append(len(pieces))
            self._group_range[name] = range(first, len(self.groups))
        self._box_from_link = np.array([inverse(piece.box[0]) for piece in pieces]).reshape(-1, 4, 4)
        count = len(self.groups)
        self.scene = SceneArrays(
            low=np.zeros((count, 3)),
            high=np.zeros((count, 3)),
            piece_begin=np.array(begin, dtype=np.int64),
            allowed=np.zeros((len(self.parts), count), dtype=np.int64),
            pose=np.zeros((len(pieces), 3, 4)),
            box=np.zeros((len(pieces), 3, 4)),
            half=np.array([piece.box[1] for piece in pieces]).reshape(-1, 3),
            vertex_begin=_begins([piece.vertices for piece in pieces]),
            vertices=_stacked([piece.vertices for piece in pieces], 3),
            distance=self.clearance + APART,
        )
        for name, body_range in self._group_range.items():
            self._place(name, body_range)
            self._seen_body[name] = self.world.revision

    def _place(self, name: str, groups: range) -> None:
        """Put the groups of a body where its links are now; links that did not move are left alone."""
        scene = self.scene
        for group in groups:
            begin, end = int(scene.piece_begin[group]), int(scene.piece_begin[group + 1])
            world_from_link = self.world.link_pose(name, self.groups[group])
            if np.array_equal(scene.pose[begin], world_from_link[:3]):
                continue
            scene.pose[begin:end] = world_from_link[:3]
            scene.box[begin:end] = (self._box_from_link[begin:end] @ inverse(world_from_link))[:, :3]
            vertices = scene.vertices[scene.vertex_begin[begin] : scene.vertex_begin[end]]
            points = apply(world_from_link, vertices)
            scene.low[group], scene.high[group] = points.min(axis=0), points.max(axis=0)

    def _allow(self, carried: str | None, touchable: frozenset[str], rest_on: Mapping[str, float]) -> None:
        allowed = self.scene.allowed
        allowed[:] = CHECK
        fingers = {self.robot.hand, *self.robot.fingers}
        touching = [i for i, name in enumerate(self.parts[:-1]) if self.robot.links[name] in fingers]
        for group, (link, body) in enumerate(zip(self.groups, self._group_body, strict=True)):
            if body == carried:
                allowed[:, group] = SKIP
                continue
            if link in touchable:
                allowed[touching, group] = SKIP
            if link in rest_on:
                allowed[-1, group] = RESTING
            if self.world.bodies[body].record.class_name == "floor":
                allowed[self.parts.index(PEDESTAL_LINK), group] = SKIP

    # --- the robot --------------------------------------------------------------------------------------------

    def _build_robot(self, body: np.ndarray, carried: str | None, tool_from_carried: np.ndarray) -> None:
        """Fix all pieces to their frames with the fingers where they are, and what is carried to the last frame."""
        count = len(self._chain.fixed)
        description = self.robot.description
        frames = np.zeros((count + 1, 3, 4))
        link_frames(self._chain.fixed, description.pedestal_height, body, frames)
        entries: list[tuple[int, int, ConvexPiece, np.ndarray]] = []
        for part, link in enumerate(self.parts[:-1]):
            frame = self._frame_of[link]
            world_from_frame = transform_from(frames[frame, :, :3], frames[frame, :, 3])
            frame_from_link = inverse(world_from_frame) @ self.robot.link_pose(self.robot.links[link])
            entries += [(frame, part, piece, frame_from_link) for piece in self._pieces[link]]
        if carried is not None:
            last_from_body = self._chain.tool @ tool_from_carried
            shapes = link_pieces(self.world.bodies[carried].text)
            for link, pieces in shapes.items():
                if pieces:
                    body_from_link = inverse(self.world.pose(carried)) @ self.world.link_pose(carried, link)
                    entries += [
                        (count, len(self.parts) - 1, piece, last_from_body @ body_from_link) for piece in pieces
                    ]
        pairs, apart = self._pairs([part for _, part, _, _ in entries])
        spheres = [_moved(pose, piece.spheres) for _, _, piece, pose in entries]
        vertices = [apply(pose, piece.vertices) for _, _, piece, pose in entries]
        self.arm = RobotArrays(
            fixed=self._chain.fixed,
            mount_height=description.pedestal_height,
            frame=np.array([entry[0] for entry in entries], dtype=np.int64),
            part=np.array([entry[1] for entry in entries], dtype=np.int64),
            bound=np.array([_moved(pose, piece.bound[None])[0] for _, _, piece, pose in entries]),
            sphere_begin=_begins(spheres),
            spheres=_stacked(spheres, 4),
            vertex_begin=_begins(vertices),
            vertices=_stacked(vertices, 3),
            pairs=pairs,
            pair_distance=apart,
        )

    def _pairs(self, part_indices: list[int]) -> tuple[np.ndarray, np.ndarray]:
        """Return the pairs of pieces that must not meet (K, 2), and their distances: the mesh checker's rules."""
        hand = {self.robot.hand, *self.robot.fingers}
        pairs, apart = [], []
        for i in range(len(part_indices)):
            for j in range(i + 1, len(part_indices)):
                first, second = self.parts[part_indices[i]], self.parts[part_indices[j]]
                if first == second:
                    continue
                if second == CARRIED:
                    if self.robot.links[first] not in hand:
                        pairs.append((i, j))
                        apart.append(self.clearance + APART)
                elif not self.robot.always_near(first, second):
                    pairs.append((i, j))
                    apart.append(APART)
        return np.array(pairs, dtype=np.int64).reshape(-1, 2), np.array(apart)


def _moved(pose: np.ndarray, balls: np.ndarray) -> np.ndarray:
    return np.column_stack([apply(pose, balls[:, :3]), balls[:, 3]])


def _begins(rows: list[np.ndarray]) -> np.ndarray:
    return np.concatenate([[0], np.cumsum([len(entry) for entry in rows])]).astype(np.int64)


def _stacked(rows: list[np.ndarray], width: int) -> np.ndarray:
    return np.concatenate([*rows, np.zeros((0, width))]) if rows else np.zeros((0, width))
