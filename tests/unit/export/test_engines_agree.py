"""A scene in USD, SDF, MJCF and URDF is one scene: the same masses, limits and places of rest as in pybullet."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pybullet
import pytest
from scenewright.schemas.interactive_scene import InteractiveScene
from scenewright.stages.export.parameters import SceneExportParameters
from scenewright.stages.export.scene_stage import run
from scenewright.stages.kit.formats.scene_bundle import write_scene_bundle
from scenewright.stages.kit.simulation.world import load_scene
from scenewright.stages.urdf.exports import write_exports

from tests.unit.urdf.small_room import context, find, graph_of, placed, room, small_library, surface_height

STANDING = ("cup_5", "bottle_6", "cup_8")
"""On the table, in the fridge, on the desk of drawers. What falls is another matter: no two engines bounce alike."""
SECONDS = 2.0
CLOSE = 0.005
"""[m]"""


@dataclass(frozen=True)
class Told:
    """What an engine makes of a scene."""

    masses: dict[str, float]
    """Link -> [kg], of what can move."""
    limits: dict[str, tuple[float, float]]
    """Joint -> lower and upper, from its closed position."""
    rest: dict[str, np.ndarray]
    """Body -> its centre of mass (3,) after SECONDS."""
    opened: dict[str, float]
    """Joint -> its position after SECONDS."""


@pytest.fixture(scope="module")
def scene(tmp_path_factory: pytest.TempPathFactory) -> InteractiveScene:
    """The small room without what falls, and a unit whose drawer stands open, with a cup on it."""
    library = small_library(tmp_path_factory.mktemp("library"), "table", "fridge", "cup", "bottle", "drawer_unit")
    unit = find(library, "drawer_unit_00")
    drawer, top = unit.joints[0], surface_height(unit)
    bodies = [body for body in room(library) if body.name != "cup_7"]
    bodies += [
        placed(library, "drawer_unit_7", unit.id, (-1.0, -0.8, 0.0), parent="floor_1", joints={drawer.name: 0.1}),
        placed(library, "cup_8", "cup_01", (-1.0, -0.8, top), parent="drawer_unit_7", movable=True),
    ]
    root = tmp_path_factory.mktemp("scene")
    write_exports(root, write_scene_bundle(root, bodies, graph_of(bodies)))
    return InteractiveScene(root)


@pytest.fixture(scope="module")
def bullet(scene: InteractiveScene) -> Told:
    with load_scene(scene.root) as world:
        masses, limits = {}, {}
        for name, body in world.bodies.items():
            if body.record.movable:
                masses[name] = pybullet.getDynamicsInfo(body.body_id, -1, world.client)[0]
            for index in range(pybullet.getNumJoints(body.body_id, world.client)):
                info = pybullet.getJointInfo(body.body_id, index, world.client)
                if info[2] != pybullet.JOINT_FIXED:
                    limits[info[1].decode()] = (info[8], info[9])
                    masses[info[12].decode()] = pybullet.getDynamicsInfo(body.body_id, index, world.client)[0]
        world.settle(SECONDS)
        opened = {joint: world.joint_value(name, joint) for name, body in world.bodies.items() for joint in body.joints}
        rest = {name: world.center_of_mass(name)[:3, 3] for name in STANDING}
        return Told(masses, limits, rest, {joint: opened[joint] for joint in limits})


def by_mujoco(load: Callable[[], Any]) -> Told:
    import mujoco

    warnings: list[str] = []
    mujoco.set_mju_user_warning(warnings.append)
    try:
        model = load()
        data = mujoco.MjData(model)
        if model.nkey:
            mujoco.mj_resetDataKeyframe(model, data, 0)
        mujoco.mj_step(model, data, nstep=round(SECONDS / model.opt.timestep))
        mujoco.mj_forward(model, data)
    finally:
        mujoco.set_mju_user_warning(None)
    assert warnings == [] and not data.warning.number.any()
    bodies = [model.body(number) for number in range(1, model.nbody)]
    joints = [model.joint(number) for number in range(model.njnt)]
    free = mujoco.mjtJoint.mjJNT_FREE
    return Told(
        {body.name: float(body.mass[0]) for body in bodies if body.dofnum[0]},
        {joint.name: tuple(joint.range.tolist()) for joint in joints if joint.type[0] != free},
        {name: data.body(name).xipos.copy() for name in STANDING},
        {joint.name: float(data.joint(joint.name).qpos[0]) for joint in joints if joint.type[0] != free},
    )


def mjcf(scene: InteractiveScene, out: Path) -> Told:
    import mujoco

    return by_mujoco(lambda: mujoco.MjModel.from_xml_path(str(scene.path("scene.mjcf.xml"))))


def usd(scene: InteractiveScene, out: Path) -> Told:
    from pxr import Usd

    from tests.unit.export.usd_in_mujoco import usd_in_mujoco

    done = run(scene, parameters=SceneExportParameters(to="usd"), context=context(out))
    return by_mujoco(lambda: usd_in_mujoco(Usd.Stage.Open(str(done.path("scene.usdc")))))


@contextmanager
def engine() -> Iterator[int]:
    client = pybullet.connect(pybullet.DIRECT)
    try:
        pybullet.setGravity(0, 0, -9.81, physicsClientId=client)
        yield client
    finally:
        pybullet.disconnect(client)


def sdf(scene: InteractiveScene, out: Path) -> Told:
    """Bullet reads no joint to the world: these are taken out, and what they held is held by having no mass."""
    done = run(scene, parameters=SceneExportParameters(to="sdf"), context=context(out))
    tree = ElementTree.parse(done.path("scene.sdf"))
    for model in tree.iter("model"):
        for joint in model.findall("joint"):
            if joint.findtext("parent") == "world":
                model.remove(joint)
    tree.write(done.path("scene.sdf"))
    masses, limits, joints = {}, {}, {}
    with engine() as client:
        bodies = {
            pybullet.getBodyInfo(body, client)[1].decode(): body
            for body in pybullet.loadSDF(str(done.path("scene.sdf")), physicsClientId=client)
        }
        for name, body in bodies.items():
            if name in STANDING:
                masses[name] = pybullet.getDynamicsInfo(body, -1, client)[0]
            for index in range(pybullet.getNumJoints(body, client)):
                info = pybullet.getJointInfo(body, index, client)
                if info[2] != pybullet.JOINT_FIXED:
                    joint = info[1].decode()
                    limits[joint] = tuple(done.info.joint_zero.get(joint, 0.0) + info[side] for side in (8, 9))
                    joints[joint] = (body, index)
                    masses[info[12].decode()] = pybullet.getDynamicsInfo(body, index, client)[0]
            if pybullet.getNumJoints(body, client):
                pybullet.changeDynamics(body, -1, mass=0.0, physicsClientId=client)
        pybullet.setTimeStep(1 / 240, client)
        for _ in range(round(240 * SECONDS)):
            pybullet.stepSimulation(client)
        rest = {name: np.array(pybullet.getBasePositionAndOrientation(bodies[name], client)[0]) for name in STANDING}
        opened = {
            joint: done.info.joint_zero.get(joint, 0.0) + pybullet.getJointState(*place, client)[0]
            for joint, place in joints.items()
        }
    return Told(masses, limits, rest, opened)


@pytest.mark.parametrize("other", [mjcf, usd, sdf])
def test_masses_limits_and_rest_are_those_of_bullet(
    other: Callable[[InteractiveScene, Path], Told], scene: InteractiveScene, bullet: Told, tmp_path: Path
) -> None:
    if other is not sdf:
        pytest.importorskip("mujoco")
    if other is usd:
        pytest.importorskip("pxr")
    told = other(scene, tmp_path)
    assert told.masses.keys() >= bullet.masses.keys() and len(bullet.masses) == len(STANDING) + len(bullet.limits)
    assert {name: told.masses[name] for name in bullet.masses} == pytest.approx(bullet.masses, rel=1e-4)
    assert told.limits.keys() == bullet.limits.keys() and len(bullet.limits) >= 3
    for name, limits in bullet.limits.items():
        assert told.limits[name] == pytest.approx(limits, abs=1e-5), name
    for name, place in bullet.rest.items():
        np.testing.assert_allclose(told.rest[name], place, atol=CLOSE, err_msg=name)
    assert told.opened == pytest.approx(bullet.opened, abs=CLOSE) and max(bullet.opened.values()) > 1.0
