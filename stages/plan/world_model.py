"""What the robot believes: the scene in a pybullet world used only for geometry, and the state of its own body."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import trimesh
from scenewright.schemas.base import as_transform, as_vector
from scenewright.schemas.contact_graph import ContactGraphFile
from scenewright.schemas.errors import BadInput
from scenewright.schemas.interactive_scene import SceneBody
from scenewright.schemas.scene_parts import Joint, SurfacePlane
from scenewright.stages.kit.acting.belief import BelievedRoom
from scenewright.stages.kit.acting.query import NOTHING, CollisionQuery, carrying
from scenewright.stages.kit.geometry.transforms import apply, inverse, quaternion_of, transform_from_quaternion
from scenewright.stages.kit.motion.doors import body_from_moved
from scenewright.stages.kit.simulation.robot_description import RobotDescription
from scenewright.stages.kit.simulation.shapes import body_surface, joined, link_shapes
from scenewright.stages.kit.simulation.world import PhysicsWorld, read_scene_bodies
from scenewright.stages.plan.joined_bodies import joined_text
from scenewright.stages.plan.regions import Region, find_regions, region_at
from scenewright.stages.plan.support_planes import top_planes


@dataclass(frozen=True)
class RobotState:
    """Where the robot stands between two actions, and what it holds."""

    base: np.ndarray
    arm: np.ndarray
    holding: str | None = None
    tool_from_item: np.ndarray | None = None
    body_from_tool: np.ndarray | None = None
    """The grasp with which it holds."""


UPRIGHT = 0.9
"""Least upward share of the upright axis of a body that stands, or (downward) stands upside down."""


@dataclass(frozen=True)
class Snapshot:
    """Poses of movable bodies, joint values and records."""

    poses: dict[str, np.ndarray]
    joints: dict[str, dict[str, float]]
    records: dict[str, SceneBody]
    laden: tuple[str, ...]
    """Carriers that were one body with their load."""


class WorldModel(BelievedRoom):
    """The scene as the robot believes it, with a robot in it. Nothing moves by physics here."""

    def __init__(self, root: Path, graph: ContactGraphFile, description: RobotDescription, clearance: float) -> None:
        bodies = read_scene_bodies(root)
        super().__init__(description, clearance, bodies.values())
        self.records: dict[str, SceneBody] = {}
        self._texts: dict[str, str] = {}
        self.planes: dict[str, tuple[SurfacePlane, ...]] = {}
        nodes = {node.id: node for node in graph.nodes}
        for name, (record, text) in bodies.items():
            self.records[name], self._texts[name] = record, text
            self.planes[name] = nodes[name].planes if name in nodes else ()
            if not any(plane.horizontal and len(plane.corners) == 4 for plane in self.planes[name]):
                self.planes[name] += body_planes(record, text)
        self.room = self._room()
        self._points: dict[str, tuple[np.ndarray, np.ndarray]] = {}
        self._regions: dict[str, tuple[Region, ...]] = {}
        self._aboard: dict[str, tuple[str, np.ndarray]] = {}
        """What is lifted with a carrier: item -> (carrier, carrier_from_item)."""

    def _room(self) -> tuple[np.ndarray, np.ndarray]:
        floors = [name for name, record in self.records.items() if record.class_name == "floor"]
        bounds = [self.world.bounds(name) for name in floors or self.records]
        if not bounds:
            raise BadInput("the scene has no bodies", hint="make it of a map that shows things")
        return np.min([low[:2] for low, _ in bounds], axis=0), np.max([high[:2] for _, high in bounds], axis=0)

    # --- beliefs ----------------------------------------------------------------------------------------------

    def see(self, name: str, record: SceneBody, text: str, planes: tuple[SurfacePlane, ...]) -> None:
        """Replace what is believed of a body: pose, joint values and shape (what a look from near by tells)."""
        if name in self.records:
            self.world.remove_body(name)
        record = record.model_copy(update={"name": name})
        self.records[name], self._texts[name], self.planes[name] = record, text, planes
        self._points.pop(name, None)
        self._regions.pop(name, None)
        self.add(record, text)

    def forget(self, name: str) -> None:
        """Take a body out of what is believed."""
        self.world.remove_body(name)
        del self.records[name], self._texts[name]
        self.planes.pop(name, None)
        self._regions.pop(name, None)

    def pose(self, name: str) -> np.ndarray:
        """Return world_from_body (4, 4)."""
        if name in self._aboard:
            carrier, carrier_from_item = self._aboard[name]
            return self.world.pose(carrier) @ carrier_from_item
        return self.world.pose(name)

    def text(self, name: str) -> str:
        """Return the URDF text of a body."""
        return self._texts[name]

    def joint_value(self, name: str, joint: str) -> float:
        """Return the believed value of a joint."""
        return self.world.joint_value(name, joint)

    def joint(self, name: str, joint: str) -> Joint:
        """Return a joint of a body by its prefixed name. Raises KeyError."""
        return next(entry for entry in self.records[name].joints if entry.name == joint)

    def links(self, name: str) -> tuple[str, ...]:
        """Return the link names of a body, without those of what is aboard."""
        return tuple(link for link in self.world.bodies[name].links if link not in self._aboard)

    def put_on(self, item: str, parent: str) -> None:
        """Note that an item now stands on (or in) another body."""
        self.records[item] = self.records[item].model_copy(update={"parent": parent})

    def move_joint(self, joint_name: str, value: float) -> None:
        """Move a joint; what stands on the moving part (in a drawer, on a shelf in a door) is carried along."""
        owner = self.owner(joint_name)
        joint = self.joint(owner, joint_name)
        before = self.pose(owner) @ body_from_moved(joint, self.joint_value(owner, joint_name))
        after = self.pose(owner) @ body_from_moved(joint, value)
        along = set()
        for item, record in self.records.items():
            if record.movable and record.parent == owner:
                region = self.region_under(item, owner)
                if region is not None and region.joint is not None and region.joint.name == joint_name:
                    along |= {item, *self.load(item)}
        for item in sorted(along):
            self.world.set_pose(item, after @ inverse(before) @ self.pose(item))
        self.world.set_joint(owner, joint_name, value)

    def owner(self, joint_name: str) -> str:
        """Return the body that a joint belongs to. Raises StopIteration."""
        return next(name for name, record in self.records.items() if any(j.name == joint_name for j in record.joints))

    def load(self, item: str) -> tuple[str, ...]:
        """Return the movable bodies that stand on a body, and on those, in turn: what goes along when it is carried."""
        loaded: list[str] = []
        waiting = [item]
        while waiting:
            carrier = waiting.pop()
            above = [name for name, record in self.records.items() if record.movable and record.parent == carrier]
            fresh = [name for name in above if name not in loaded and name != item]
            loaded += fresh
            waiting += fresh
        return tuple(loaded)

    def take_aboard(self, carrier: str) -> None:
        """Make one rigid body of a carrier and what stands on it, so that its load counts in collision checks."""
        load = self.load(carrier)
        if not load:
            return
        pose = self.pose(carrier)
        aboard = {item: (carrier, inverse(pose) @ self.pose(item)) for item in load}
        text = joined_text(self._texts[carrier], {item: (self._texts[item], aboard[item][1]) for item in load})
        for item in (carrier, *load):
            self.world.remove_body(item)
        self._aboard |= aboard
        self.add(moved_record(self.records[carrier], pose, {}), text)

    def laden(self, carrier: str) -> bool:
        """Whether something is lifted with a body."""
        return any(owner == carrier for owner, _ in self._aboard.values())

    def set_down(self) -> None:
        """Make bodies of their own again of what is aboard, where it is now."""
        aboard, poses = dict(self._aboard), {item: self.pose(item) for item in self._aboard}
        for carrier in {carrier for carrier, _ in aboard.values()}:
            poses[carrier] = self.world.pose(carrier)
            self.world.remove_body(carrier)
        self._aboard = {}
        for item, pose in sorted(poses.items()):
            self.add(moved_record(self.records[item], pose, {}), self._texts[item])

    def snapshot(self) -> Snapshot:
        """Return where everything is, for `restore`."""
        poses = {name: self.pose(name) for name, record in self.records.items() if record.movable}
        joints = {
            name: {joint: self.joint_value(name, joint) for joint in body.joints}
            for name, body in self.world.bodies.items()
        }
        laden = tuple(sorted({carrier for carrier, _ in self._aboard.values()}))
        return Snapshot(poses, joints, dict(self.records), laden)

    def restore(self, snapshot: Snapshot) -> None:
        """Put everything where it was, loads aboard of what carried them."""
        self.set_down()
        for name, pose in snapshot.poses.items():
            self.world.set_pose(name, pose)
        for name, values in snapshot.joints.items():
            for joint, value in values.items():
                self.world.set_joint(name, joint, value)
        self.records = dict(snapshot.records)
        for carrier in snapshot.laden:
            self.take_aboard(carrier)

    # --- geometry ---------------------------------------------------------------------------------------------

    def points(self, name: str, count: int = 3000) -> np.ndarray:
        """Return (count, 3) points on the surface of a rigid body, body frame; the same ones every time."""
        return self.surface(name, count)[0]

    def surface(self, name: str, count: int = 3000) -> tuple[np.ndarray, np.ndarray]:
        """Return (count, 3) points on the surface of a rigid body and their outward normals, body frame."""
        if name not in self._points:
            self._points[name] = body_surface(self._texts[name], count)
        return self._points[name]

    def regions(self, name: str) -> tuple[Region, ...]:
        """Return the level places of a body where things can stand, largest first."""
        if name not in self._regions:
            meshes = {link: self.part_mesh(name, link) for link in self.shaped_links(name)}
            self._regions[name] = find_regions(name, self.records[name].joints, meshes)
        return self._regions[name]

    def world_from_region(self, region: Region) -> np.ndarray:
        """Return (4, 4) from the closed frame of a region's body to the world, the region where it is now."""
        pose = self.pose(region.body)
        if region.joint is None:
            return pose
        return pose @ body_from_moved(region.joint, self.joint_value(region.body, region.joint.name))

    def height_of(self, region: Region) -> float:
        """Return the height [m] of the middle of a region."""
        middle = np.array([*(region.low + region.high) / 2, region.level])
        return float(apply(self.world_from_region(region), middle)[2])

    def region_under(self, item: str, body: str) -> Region | None:
        """Return the region of a body on which an item stands, None when it stands on none of them."""
        points = apply(self.pose(item), self.points(item))
        low, high = points.min(axis=0), points.max(axis=0)
        foot = np.array([*(low + high)[:2] / 2, low[2]])
        regions = self.regions(body)
        return region_at(regions, (apply(inverse(self.world_from_region(region)), foot) for region in regions))

    def footprint(self, item: str) -> tuple[float, float]:
        """Return radius of the upright foot about the body's origin and height [m] of a rigid body."""
        points = self.points(item)
        return float(np.linalg.norm(points[:, :2], axis=1).max()), float(np.ptp(points[:, 2]))

    def standing(self, item: str) -> np.ndarray:
        """Return the rotation (4, 4) in which a rigid body is put down, but for its yaw: as it was last seen, upright,
        upside down or on its side."""
        rotation = np.eye(4)
        rotation[:3, :3] = np.array(self.records[item].world_from_body)[:3, :3]
        if rotation[2, 2] > UPRIGHT:
            return np.eye(4)
        return np.diag([1.0, -1.0, -1.0, 1.0]) if rotation[2, 2] < -UPRIGHT else rotation

    def foot(self, item: str) -> float:
        """Return the height [m] of the lowest point of a rigid body over its origin when it stands."""
        return float(apply(self.standing(item), self.points(item))[:, 2].min())

    def shaped_links(self, name: str) -> tuple[str, ...]:
        """Return the links of a body that have a collision shape."""
        return tuple(link_shapes(self._texts[name]))

    def part_mesh(self, name: str, link: str) -> trimesh.Trimesh:
        """Return the collision mesh of a link in the body frame with all joints at 0. Raises KeyError."""
        meshes = link_shapes(self._texts[name])[link]
        with self.world.joints_at(name, {joint: 0.0 for joint in self.world.bodies[name].joints}):
            body_from_link = inverse(self.pose(name)) @ self.world.link_pose(name, link)
        mesh = joined(meshes)
        mesh.apply_transform(body_from_link)
        return mesh


def body_planes(record: SceneBody, text: str) -> tuple[SurfacePlane, ...]:
    """Return the horizontal planes on top of a body's base link at its pose, world frame, from its shapes."""
    meshes = [mesh.copy() for mesh in link_shapes(text).get(record.name, [])]
    for mesh in meshes:
        mesh.apply_transform(np.array(record.world_from_body))
    return top_planes(meshes)


def moved_record(record: SceneBody, world_from_body: np.ndarray, joint_values: dict[str, float]) -> SceneBody:
    """Return the record with another pose and joint values; the box moves along."""
    change = world_from_body @ inverse(np.array(record.world_from_body))
    old = transform_from_quaternion(np.array(record.box.orientation), np.array(record.box.center))
    new = change @ old
    orientation = tuple(float(value) for value in quaternion_of(new))
    box = record.box.model_copy(update={"center": as_vector(new[:3, 3]), "orientation": orientation})
    return record.model_copy(
        update={"world_from_body": as_transform(world_from_body), "joint_values": joint_values, "box": box}
    )


def as_held(model: WorldModel, state: RobotState) -> CollisionQuery:
    """Return the query of a robot with what it holds, or nothing, in its hand."""
    if state.holding is None or state.tool_from_item is None:
        return NOTHING
    return carrying(state.holding, state.tool_from_item, model.links(state.holding))


def true_record(world: PhysicsWorld, name: str, record: SceneBody) -> SceneBody:
    """Return the record of a body with the pose and joint values that it has in a world now."""
    joints = {joint: world.joint_value(name, joint) for joint in world.bodies[name].joints}
    return moved_record(record, world.pose(name), joints)
