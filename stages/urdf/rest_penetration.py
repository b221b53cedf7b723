"""Which links of a URDF lie in each other while all joints are at rest."""

from __future__ import annotations

import tempfile
from dataclasses import dataclass
from pathlib import Path

from scenewright.schemas.errors import BadInput
from scenewright.stages.kit.simulation.engine import engine, native_output_to_stderr
from scenewright.stages.kit.simulation.urdf_split import read_urdf, with_absolute_meshes, without_visuals
from scenewright.stages.urdf.scene_penetration import link_padding

JOINED = ("fixed", "revolute", "continuous", "prismatic")
"""Joints whose two links may touch by design: a door its frame, a drawer its rails."""


@dataclass(frozen=True)
class Penetration:
    """Two links that share space, `depth` [m] deep."""

    first: str
    second: str
    depth: float


def resting_penetrations(path: Path, limit: float) -> list[Penetration]:
    """Return the pairs of links of a URDF that lie more than `limit` [m] in each other, deepest first.

    Joints stand at 0, or at the limit nearest to it; collision shapes are what the engine makes of them (meshes become
    their convex hulls; what it pads them with is taken off). Links that a joint connects are let through, but for
    floating joints: a cup may stand on a table, not in it. Raises BadInput when the file cannot be read or loaded.
    """
    robot = read_urdf(path)
    pairs = {
        frozenset((ends[0].get("link", ""), ends[1].get("link", "")))
        for joint in robot.findall("joint")
        if joint.get("type") in JOINED
        and (ends := [end for end in (joint.find("parent"), joint.find("child")) if end is not None])
        and len(ends) == 2
    }
    for joint in robot.findall("joint"):
        if joint.get("type") == "floating":  # what the engine makes of it as well, with a warning
            joint.set("type", "fixed")
    text = without_visuals(with_absolute_meshes(robot, path.parent))
    with native_output_to_stderr():
        client = engine.connect(engine.DIRECT)
        try:
            return _measure(_load(text, path, client), pairs, limit, client)
        finally:
            engine.disconnect(client)


def _load(text: str, path: Path, client: int) -> int:
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "model.urdf"
        file.write_text(text)
        try:
            return int(engine.loadURDF(str(file), useFixedBase=True, physicsClientId=client))
        except engine.error as error:
            raise BadInput(
                f"{path}: the physics engine does not load it: {error}", hint="mend the findings first"
            ) from None


def _measure(body: int, joined: set[frozenset[str]], limit: float, client: int) -> list[Penetration]:
    names = {-1: engine.getBodyInfo(body, physicsClientId=client)[0].decode()}
    for index in range(engine.getNumJoints(body, physicsClientId=client)):
        info = engine.getJointInfo(body, index, physicsClientId=client)
        names[index] = info[12].decode()
        lower, upper = info[8], info[9]
        if info[2] in (engine.JOINT_REVOLUTE, engine.JOINT_PRISMATIC) and lower <= upper:
            engine.resetJointState(body, index, min(max(0.0, lower), upper), physicsClientId=client)
    engine.performCollisionDetection(physicsClientId=client)
    bounds = {index: engine.getAABB(body, index, physicsClientId=client) for index in names}
    penetrations = []
    indices = sorted(names)
    for position, first in enumerate(indices):
        for second in indices[position + 1 :]:
            if frozenset((names[first], names[second])) in joined or not _bounds_meet(bounds[first], bounds[second]):
                continue
            points = engine.getClosestPoints(body, body, 0.0, first, second, physicsClientId=client)
            depth = max((-point[8] for point in points), default=0.0)
            depth -= link_padding(client, body, first) + link_padding(client, body, second)
            if depth > limit:
                penetrations.append(Penetration(names[first], names[second], float(depth)))
    return sorted(penetrations, key=lambda p: (-p.depth, p.first, p.second))


def _bounds_meet(
    first: tuple[tuple[float, ...], tuple[float, ...]], second: tuple[tuple[float, ...], tuple[float, ...]]
) -> bool:
    return all(first[0][k] <= second[1][k] and second[0][k] <= first[1][k] for k in range(3))
