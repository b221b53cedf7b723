"""A USD scene in MuJoCo, by what its UsdPhysics schemas alone say: bodies, masses, colliders, friction, joints.

No package of pip simulates USD. What Isaac reads of a scene is read here with the same library, and simulated.
"""

from __future__ import annotations

import mujoco
import numpy as np
from pxr import Usd, UsdGeom, UsdPhysics, UsdShade
from scenewright.stages.kit.geometry.transforms import inverse, quaternion_of, transform_from
from scipy.spatial.transform import Rotation


def world_from_prim(prim: Usd.Prim) -> np.ndarray:
    """Return the pose of a prim (4, 4); its scale is left in it. USD has row vectors."""
    return np.array(UsdGeom.Xformable(prim).ComputeLocalToWorldTransform(Usd.TimeCode.Default())).T


def joint_side(place: Usd.Attribute, turn: Usd.Attribute) -> np.ndarray:
    """Return body_from_joint (4, 4) of one side of a joint."""
    rotation = Rotation.from_quat([*turn.Get().GetImaginary(), turn.Get().GetReal()])
    return transform_from(rotation.as_matrix(), np.array(place.Get()))


def usd_in_mujoco(stage: Usd.Stage) -> mujoco.MjModel:
    """Return the model; rigid bodies and joints are called as their prims."""
    spec = mujoco.MjSpec()
    scene = next(UsdPhysics.Scene(prim) for prim in stage.Traverse() if prim.IsA(UsdPhysics.Scene))
    spec.option.gravity = np.array(scene.GetGravityDirectionAttr().Get()) * scene.GetGravityMagnitudeAttr().Get()
    spec.option.timestep = 0.002
    made = {None: (spec.worldbody, np.eye(4))}
    joints = {
        joint.GetBody1Rel().GetTargets()[0]: joint
        for joint in map(UsdPhysics.Joint, (prim for prim in stage.Traverse() if prim.IsA(UsdPhysics.Joint)))
    }
    for prim in stage.Traverse():  # a link's parents stand before it
        if prim.HasAPI(UsdPhysics.RigidBodyAPI):
            _add_body(spec, prim, joints.get(prim.GetPath()), made)
    for prim in stage.Traverse():
        if prim.HasAPI(UsdPhysics.CollisionAPI):
            _add_collider(spec, prim, made)
    return spec.compile()


def _add_body(spec: mujoco.MjSpec, prim: Usd.Prim, joint: UsdPhysics.Joint | None, made: dict) -> None:
    above = list(joint.GetBody0Rel().GetTargets()) if joint else []
    parent, world_from_parent = made[above[0] if above else None]
    pose = world_from_prim(prim)
    local = inverse(world_from_parent) @ pose
    body = parent.add_body(name=prim.GetName(), pos=local[:3, 3], quat=_wxyz(local))
    mass = UsdPhysics.MassAPI(prim)
    axes = mass.GetPrincipalAxesAttr().Get()
    body.explicitinertial = True
    body.mass, body.ipos = mass.GetMassAttr().Get(), np.array(mass.GetCenterOfMassAttr().Get(), float)
    body.inertia = np.array(mass.GetDiagonalInertiaAttr().Get(), float)
    body.iquat = np.array([axes.GetReal(), *axes.GetImaginary()])
    if joint is None:
        body.add_freejoint()
    elif above:
        _add_joint(body, joint)
        spec.add_exclude(bodyname1=parent.name, bodyname2=body.name)  # USD: what a joint joins does not collide
    made[prim.GetPath()] = body, pose


def _add_joint(body: object, joint: UsdPhysics.Joint) -> None:
    sides = [
        joint_side(joint.GetLocalPos0Attr(), joint.GetLocalRot0Attr()),
        joint_side(joint.GetLocalPos1Attr(), joint.GetLocalRot1Attr()),
    ]
    prim = joint.GetPrim()
    slides = prim.IsA(UsdPhysics.PrismaticJoint)
    entry = UsdPhysics.PrismaticJoint(prim) if slides else UsdPhysics.RevoluteJoint(prim)
    assert entry.GetAxisAttr().Get() == "X"
    limits = [entry.GetLowerLimitAttr().Get(), entry.GetUpperLimitAttr().Get()]
    between = inverse(sides[0]) @ inverse(world_from_prim(_target(joint, 0))) @ world_from_prim(_target(joint, 1))
    between = between @ sides[1]
    value = between[0, 3] if slides else Rotation.from_matrix(between[:3, :3]).as_rotvec()[0]
    kind = mujoco.mjtJoint.mjJNT_SLIDE if slides else mujoco.mjtJoint.mjJNT_HINGE
    body.add_joint(  # type: ignore[attr-defined]
        name=prim.GetName(),
        type=kind,
        pos=sides[1][:3, 3],
        axis=sides[1][:3, 0],
        ref=value if slides else np.degrees(value),
        limited=mujoco.mjtLimited.mjLIMITED_TRUE,
        range=limits,
    )


def _target(joint: UsdPhysics.Joint, side: int) -> Usd.Prim:
    relation = (joint.GetBody0Rel(), joint.GetBody1Rel())[side]
    return joint.GetPrim().GetStage().GetPrimAtPath(relation.GetTargets()[0])


def _add_collider(spec: mujoco.MjSpec, prim: Usd.Prim, made: dict) -> None:
    body, world_from_body = made[None]
    above = prim.GetParent()
    while above and above.GetPath() not in made:
        above = above.GetParent()
    if above:
        body, world_from_body = made[above.GetPath()]
    pose = inverse(world_from_body) @ world_from_prim(prim)
    scale = np.linalg.norm(pose[:3, :3], axis=0)
    pose[:3, :3] /= scale
    material, _ = UsdShade.MaterialBindingAPI(prim).ComputeBoundMaterial("physics")
    friction = UsdPhysics.MaterialAPI(material.GetPrim()).GetStaticFrictionAttr().Get() if material else 0.6
    told = {"pos": pose[:3, 3], "quat": _wxyz(pose), "friction": [friction, 0.005, 0.0001], "condim": 4}
    if prim.IsA(UsdGeom.Cube):
        half = scale * UsdGeom.Cube(prim).GetSizeAttr().Get() / 2
        body.add_geom(type=mujoco.mjtGeom.mjGEOM_BOX, size=half, **told)
        return
    assert UsdPhysics.MeshCollisionAPI(prim).GetApproximationAttr().Get() == "convexHull"
    mesh = spec.add_mesh(name=str(prim.GetPath()))
    points = np.array(UsdGeom.Mesh(prim).GetPointsAttr().Get(), float) * scale
    mesh.uservert = points.ravel()
    body.add_geom(type=mujoco.mjtGeom.mjGEOM_MESH, meshname=mesh.name, **told)


def _wxyz(pose: np.ndarray) -> np.ndarray:
    return np.roll(quaternion_of(pose), 1)
