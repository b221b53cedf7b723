"""An interactive scene in pybullet: static bodies fixed, movable bodies free, joints at their values.

pybullet turns floating joints into fixed ones, so that scene.urdf would hang every cup in the air. Every body is
therefore loaded on its own: those of static.urdf with a fixed base, the movable ones from their own files.
"""

from __future__ import annotations

import os
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scenewright.schemas.errors import BadInput
from scenewright.schemas.interactive_scene import InteractiveSceneFile, SceneBody
from scenewright.stages.kit.formats.urdf_check import require_sound
from scenewright.stages.kit.geometry.substances import ROLLING_FRICTION, SPINNING_FRICTION
from scenewright.stages.kit.geometry.transforms import inverse, quaternion_of, transform_from_quaternion
from scenewright.stages.kit.simulation.engine import engine, native_output_to_stderr
from scenewright.stages.kit.simulation.urdf_split import (
    links_with_friction,
    read_urdf,
    split_body,
    with_absolute_meshes,
    without_visuals,
)

TIME_STEP = 1.0 / 240.0
"""Time between two states [s]: Bullet's default."""
GRAVITY = 9.81
"""Acceleration of what falls [m/s²]."""
FRICTION = 0.6
"""Friction coefficient of links whose file has none; Bullet multiplies the values of the two links of a contact."""
MOVABLE_FILTER = (1, -1)
"""Bullet's collision group of what moves, and the groups that it meets."""
JOINT_FRICTION = 0.4
"""Torque [N m] or force [N] that holds an unpowered door or drawer where it was left."""


@dataclass(frozen=True)
class LoadedBody:
    """A scene body in a physics world."""

    record: SceneBody
    body_id: int
    links: dict[str, int]
    """Link name -> pybullet link index; -1 is the base link."""
    joints: dict[str, int]
    """Names of moving joints -> pybullet joint index."""
    text: str
    """The URDF it was loaded from, without visual shapes."""

    @property
    def name(self) -> str:
        """Node id in the contact graph."""
        return self.record.name


@dataclass(frozen=True)
class Contact:
    """A contact between two links. `depth` [m] is positive for penetration; `normal` (3,) points from other to own."""

    own_link: int
    other_body: int
    other_link: int
    depth: float
    point: np.ndarray
    normal: np.ndarray
    force: float


class PhysicsWorld:
    """A pybullet client without graphics. Close it, or use it in a `with` statement."""

    def __init__(self, time_step: float = TIME_STEP) -> None:
        self.client = engine.connect(engine.DIRECT)
        self.time_step = time_step
        self.bodies: dict[str, LoadedBody] = {}
        self.revision = 0
        """Grows whenever a body is put somewhere, comes or goes, and with every time step."""
        self.revisions: dict[str, int] = {}
        """Body -> `revision` of its last change by hand; time steps move everything."""
        self.stepped = 0
        """`revision` of the last time step."""
        self._base_from_inertial: dict[int, np.ndarray] = {}
        self.anchored = False
        """Whether friction is anchored, of all but what was loosened."""
        self.time = 0.0
        engine.setGravity(0, 0, -GRAVITY, physicsClientId=self.client)
        engine.setPhysicsEngineParameter(
            fixedTimeStep=time_step,
            numSolverIterations=100,
            deterministicOverlappingPairs=1,
            physicsClientId=self.client,
        )

    def __enter__(self) -> PhysicsWorld:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Disconnect; the world cannot be used afterwards."""
        if self.client >= 0:
            engine.disconnect(physicsClientId=self.client)
            self.client = -1

    def load_urdf_text(self, text: str, *, fixed: bool, flags: int = 0) -> int:
        """Load URDF text (absolute mesh paths) at the origin and return the body id. Raises BadInput."""
        with tempfile.TemporaryDirectory() as folder:
            path = os.path.join(folder, "body.urdf")
            Path(path).write_text(text, encoding="utf-8")
            try:
                with native_output_to_stderr():
                    return engine.loadURDF(
                        path,
                        useFixedBase=fixed,
                        flags=flags | engine.URDF_USE_INERTIA_FROM_FILE,
                        physicsClientId=self.client,
                    )
            except engine.error as error:
                raise BadInput(f"pybullet cannot load a URDF: {error}", hint="run `scenewright verify`") from None

    def add_body(self, record: SceneBody, text: str) -> LoadedBody:
        """Load one scene body from URDF text at its pose and joint values."""
        # Things that lie still fall asleep: three times as fast in a room with thirty bodies. See `wake`.
        flags = engine.URDF_ENABLE_SLEEPING if record.movable else 0
        shapes = without_visuals(text)
        body_id = self.load_urdf_text(shapes, fixed=not record.movable, flags=flags)
        info = engine.getDynamicsInfo(body_id, -1, physicsClientId=self.client)
        self._base_from_inertial[body_id] = transform_from_quaternion(np.array(info[4]), np.array(info[3]))
        links, joints = self._names(body_id)
        body = LoadedBody(record, body_id, links, joints, shapes)
        self.bodies[record.name] = body
        self.set_pose(record.name, np.array(record.world_from_body))
        for joint, index in joints.items():
            self.set_joint(record.name, joint, record.joint_values.get(joint, 0.0))
            engine.setJointMotorControl2(
                body_id,
                index,
                engine.VELOCITY_CONTROL,
                targetVelocity=0.0,
                force=JOINT_FRICTION,
                physicsClientId=self.client,
            )
        with_friction = links_with_friction(text)
        for link, index in links.items():
            if link not in with_friction:
                engine.changeDynamics(
                    body_id,
                    index,
                    lateralFriction=FRICTION,
                    spinningFriction=SPINNING_FRICTION,
                    rollingFriction=ROLLING_FRICTION,
                    physicsClientId=self.client,
                )
        return body

    def remove_body(self, name: str) -> None:
        """Take a scene body out of the world."""
        self.revision += 1
        self.revisions.pop(name, None)
        engine.removeBody(self.bodies.pop(name).body_id, physicsClientId=self.client)

    def _names(self, body_id: int) -> tuple[dict[str, int], dict[str, int]]:
        links = {engine.getBodyInfo(body_id, physicsClientId=self.client)[0].decode(): -1}
        joints = {}
        for index in range(engine.getNumJoints(body_id, physicsClientId=self.client)):
            info = engine.getJointInfo(body_id, index, physicsClientId=self.client)
            links[info[12].decode()] = index
            if info[2] in (engine.JOINT_REVOLUTE, engine.JOINT_PRISMATIC):
                joints[info[1].decode()] = index
        return links, joints

    # --- state ------------------------------------------------------------------------------------------------

    def set_pose(self, name: str, world_from_body: np.ndarray) -> None:
        """Put a body at a pose (4, 4) of its base link frame, at rest."""
        self._changed(name)
        body_id = self.bodies[name].body_id
        # pybullet's base pose is that of the centre of mass, not of the link frame.
        pose = world_from_body @ self._base_from_inertial[body_id]
        engine.resetBasePositionAndOrientation(
            body_id, pose[:3, 3].tolist(), quaternion_of(pose).tolist(), physicsClientId=self.client
        )

    @contextmanager
    def posed(self, name: str, world_from_body: np.ndarray) -> Iterator[None]:
        """Put a body at a pose (4, 4) for a while, and back to the very numbers of before."""
        body_id = self.bodies[name].body_id
        before = engine.getBasePositionAndOrientation(body_id, physicsClientId=self.client)
        self.set_pose(name, world_from_body)
        try:
            yield
        finally:
            self._changed(name)
            engine.resetBasePositionAndOrientation(body_id, *before, physicsClientId=self.client)

    def _changed(self, name: str) -> None:
        self.revision += 1
        self.revisions[name] = self.revision

    def pose(self, name: str) -> np.ndarray:
        """Return world_from_body (4, 4) of the base link frame."""
        return self.center_of_mass(name) @ inverse(self._base_from_inertial[self.bodies[name].body_id])

    def center_of_mass(self, name: str) -> np.ndarray:
        """Return world_from_inertial (4, 4) of the base link: its centre of mass and principal axes."""
        position, quaternion = engine.getBasePositionAndOrientation(
            self.bodies[name].body_id, physicsClientId=self.client
        )
        return transform_from_quaternion(np.array(quaternion), np.array(position))

    def link_pose(self, name: str, link: str) -> np.ndarray:
        """Return world_from_link (4, 4) of a link of a body."""
        index = self.bodies[name].links[link]
        if index < 0:
            return self.pose(name)
        state = engine.getLinkState(
            self.bodies[name].body_id, index, computeForwardKinematics=1, physicsClientId=self.client
        )
        return transform_from_quaternion(np.array(state[5]), np.array(state[4]))

    def velocity(self, name: str) -> tuple[float, float]:
        """Return linear [m/s] and angular [rad/s] speed of a body."""
        linear, angular = engine.getBaseVelocity(self.bodies[name].body_id, physicsClientId=self.client)
        return float(np.linalg.norm(linear)), float(np.linalg.norm(angular))

    def set_joint(self, name: str, joint: str, value: float) -> None:
        """Put a joint at a value [rad] or [m], at rest."""
        self._changed(name)
        body = self.bodies[name]
        engine.resetJointState(body.body_id, body.joints[joint], value, physicsClientId=self.client)

    def joint_value(self, name: str, joint: str) -> float:
        """Return the value of a joint [rad] or [m]."""
        body = self.bodies[name]
        return float(engine.getJointState(body.body_id, body.joints[joint], physicsClientId=self.client)[0])

    @contextmanager
    def joints_at(self, name: str, values: dict[str, float]) -> Iterator[None]:
        """Put joints of a body at values [rad] or [m] for a while. Raises KeyError for an unknown body or joint."""
        before = {joint: self.joint_value(name, joint) for joint in values}
        try:
            for joint, value in values.items():
                self.set_joint(name, joint, value)
            yield
        finally:
            for joint, value in before.items():
                self.set_joint(name, joint, value)

    def bounds(self, name: str) -> tuple[np.ndarray, np.ndarray]:
        """Return the axis-aligned bounds (3,), (3,) of all links of a body, world frame."""
        body = self.bodies[name]
        boxes = np.array(
            [engine.getAABB(body.body_id, index, physicsClientId=self.client) for index in body.links.values()]
        )
        return boxes[:, 0].min(axis=0), boxes[:, 1].max(axis=0)

    # --- time -------------------------------------------------------------------------------------------------

    def step(self, count: int = 1) -> None:
        """Advance the physics by `count` time steps."""
        for _ in range(count):
            engine.stepSimulation(physicsClientId=self.client)
        self.time += count * self.time_step
        self.revision += 1
        self.stepped = self.revision

    def wake(self) -> None:
        """Wake every movable body: what sleeps does not notice that its support was taken away."""
        for body in self.bodies.values():
            if body.record.movable:
                engine.changeDynamics(
                    body.body_id, -1, activationState=engine.ACTIVATION_STATE_WAKE_UP, physicsClientId=self.client
                )

    def anchor_friction(self) -> None:
        """Let what sticks by friction stay where it sticks. Friction solved for speeds alone lets things creep on a
        carrier that moves for long, or turn in a hand: centimetres in 20 s on a tray. What pulls harder than friction
        holds still slides.
        """
        self.anchored = True
        for body in self.bodies.values():
            if body.record.movable:
                self._anchor(body, True)

    def loosen(self, name: str) -> None:
        """Take the anchors off a body that is let go, until friction is anchored again. A finger that opens would take
        along what is anchored to it; the engine anchors contacts, and forgets those of a body that comes anew."""
        if not self.anchored:
            return
        body = self.bodies[name]
        self._anchor(body, False)
        for link in body.links.values():
            engine.setCollisionFilterGroupMask(body.body_id, link, *MOVABLE_FILTER, physicsClientId=self.client)

    def _anchor(self, body: LoadedBody, anchored: bool) -> None:
        for link in (-1, *body.links.values()):
            engine.changeDynamics(body.body_id, link, frictionAnchor=int(anchored), physicsClientId=self.client)

    def settle(self, seconds: float = 1.0) -> dict[str, float]:
        """Let the world fall for some simulated seconds; return how far each movable body moved [m]."""
        movable = [name for name, body in self.bodies.items() if body.record.movable]
        before = {name: self.pose(name)[:3, 3] for name in movable}
        self.wake()
        self.step(round(seconds / self.time_step))
        return {name: float(np.linalg.norm(self.pose(name)[:3, 3] - before[name])) for name in movable}

    # --- contact ----------------------------------------------------------------------------------------------

    def contacts(self, body_id: int, other_id: int | None = None) -> list[Contact]:
        """Return the contacts of a body found by the last step or collision detection."""
        arguments = {"bodyA": body_id} if other_id is None else {"bodyA": body_id, "bodyB": other_id}
        entries = engine.getContactPoints(physicsClientId=self.client, **arguments) or ()
        return [
            Contact(entry[3], entry[2], entry[4], -entry[8], np.array(entry[6]), np.array(entry[7]), entry[9])
            for entry in entries
        ]

    def name_of(self, body_id: int) -> str | None:
        """Return the scene body with this pybullet id, None for others (a robot)."""
        for name, body in self.bodies.items():
            if body.body_id == body_id:
                return name
        return None

    def link_name(self, body_id: int, index: int) -> str:
        """Return the name of a link of any body."""
        if index < 0:
            return engine.getBodyInfo(body_id, physicsClientId=self.client)[0].decode()
        return engine.getJointInfo(body_id, index, physicsClientId=self.client)[12].decode()


def read_scene_bodies(root: Path) -> dict[str, tuple[SceneBody, str]]:
    """Return the bodies of an interactive scene folder: name -> (record, URDF text with absolute mesh paths).

    Raises BadInput when a file is missing or not sound, or a body has no links.
    """
    scene = InteractiveSceneFile.read(root / "scene.json")
    for name in (scene.static_file, *(body.file for body in scene.bodies if body.file is not None)):
        require_sound(root / name, root)
    static = read_urdf(root / scene.static_file)
    names = {body.name for body in scene.bodies}
    bodies = {}
    for record in scene.bodies:
        if record.file is not None:
            path = root / record.file
            text = with_absolute_meshes(read_urdf(path), path.parent)
        else:
            text = split_body(static, record.name, names, (root / scene.static_file).parent)
        bodies[record.name] = (record, text)
    return bodies


def load_scene(root: Path, *, time_step: float = TIME_STEP) -> PhysicsWorld:
    """Load an interactive scene folder (or `room/` of a ground truth) into a new physics world.

    Static bodies are fixed, movable ones free; joints stand at the values of scene.json. Raises BadInput.
    """
    world = PhysicsWorld(time_step)
    try:
        for record, text in read_scene_bodies(root).values():
            world.add_body(record, text)
    except BaseException:
        world.close()
        raise
    return world
