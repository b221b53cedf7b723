"""A scene as one USD layer: /World/<body>/<link>, colliders, rigid bodies, articulations, joints.

Still bodies are colliders alone. A body with doors is an articulation whose first link is fixed to the world; a movable
one is a rigid body. Rigid bodies are never nested: every link has its pose in the world. UsdPhysics has degrees.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from pxr import Gf, Sdf, Tf, Usd, UsdGeom, UsdLux, UsdPhysics, UsdShade, Vt
from scenewright.stages.export.scene_bodies import BodyToExport, SceneToExport
from scenewright.stages.export.scene_registry import Written
from scenewright.stages.kit.formats.link_meshes import Surface
from scenewright.stages.kit.formats.mesh_files import read_mesh
from scenewright.stages.kit.formats.urdf_file import Link, Shape, UrdfJoint
from scenewright.stages.kit.geometry.solids import MassProperties
from scenewright.stages.kit.geometry.transforms import quaternion_of, transform_from
from scenewright.stages.kit.rendering.surfaces import srgb_to_linear
from scipy.spatial.transform import Rotation

GRAVITY = 9.81
LAMP_RADIUS = 0.1
"""Of the ball that shines [m]; by eye."""
LAMP_INTENSITY, THROWN_BACK = 30000.0, 200.0
"""Of the lamp, and of the light from all around; by eye."""
"""Acceleration of free fall that the scene states [m/s^2]."""
WORLD = "/World"


def write(folder: Path, scene: SceneToExport) -> Written:
    """Write scene.usdc into `folder`. The same scene gives the same bytes. Raises BadInput for broken meshes."""
    layer = Sdf.Layer.CreateNew(str(folder / "scene.usdc"))
    stage = Usd.Stage.Open(layer)
    UsdGeom.SetStageUpAxis(stage, UsdGeom.Tokens.z)
    UsdGeom.SetStageMetersPerUnit(stage, 1.0)
    UsdPhysics.SetStageKilogramsPerUnit(stage, 1.0)
    stage.SetDefaultPrim(UsdGeom.Xform.Define(stage, WORLD).GetPrim())
    physics = UsdPhysics.Scene.Define(stage, f"{WORLD}/PhysicsScene")
    physics.CreateGravityDirectionAttr(Gf.Vec3f(0, 0, -1))
    physics.CreateGravityMagnitudeAttr(GRAVITY)
    writer = _Writer(stage, scene)
    for body in scene.bodies:
        writer.add_body(body)
    writer.add_lamp()
    layer.Save()
    return Written(names=writer.renamed)


class _Writer:
    """Adds bodies to a stage and remembers which prim a link became."""

    def __init__(self, stage: Usd.Stage, scene: SceneToExport) -> None:
        self.stage = stage
        self.scene = scene
        self.renamed: dict[str, str] = {}
        self._paths: dict[str, str] = {}
        self._used_names: set[str] = set()
        self._surface_materials: dict[float, UsdShade.Material] = {}

    def add_lamp(self) -> None:
        """Add one lamp, and as much light from all around as walls throw back."""
        light = self.scene.written.info.light
        if light is None:
            return
        lamp = UsdLux.SphereLight.Define(self.stage, self._path(WORLD, "lamp"))
        lamp.CreateRadiusAttr(LAMP_RADIUS)
        lamp.CreateIntensityAttr(LAMP_INTENSITY)
        lamp.AddTranslateOp().Set(Gf.Vec3d(*light.position))
        around = UsdLux.DomeLight.Define(self.stage, self._path(WORLD, "thrown_back"))
        around.CreateIntensityAttr(THROWN_BACK)

    def add_body(self, body: BodyToExport) -> None:
        """Add /World/<body> with its links and joints."""
        group = self._path(WORLD, body.name)
        prim = UsdGeom.Xform.Define(self.stage, group).GetPrim()
        prim.SetCustomDataByKey("class", body.record.class_name)
        if body.articulated:
            UsdPhysics.ArticulationRootAPI.Apply(prim)
        for link in body.links:
            path = self._path(group, link.name)
            self._paths[link.name] = path
            self._add_link(path, link, body)
        if body.dynamic and not body.record.movable:
            first = body.links[0]
            self._fix(f"{group}/to_the_world", None, first.name, self.scene.pose(first))
        for joint in body.joints if body.dynamic else ():
            self._add_joint(group, joint)

    def _path(self, parent: str, name: str) -> str:
        plain = Tf.MakeValidIdentifier(name)
        number, candidate = 1, plain
        while f"{parent}/{candidate}" in self._used_names:
            number += 1
            candidate = f"{plain}_{number}"
        self._used_names.add(f"{parent}/{candidate}")
        if candidate != name:
            self.renamed[candidate] = name
        return f"{parent}/{candidate}"

    def _add_link(self, path: str, link: Link, body: BodyToExport) -> None:
        frame = UsdGeom.Xform.Define(self.stage, path)
        _place(frame, self.scene.pose(link))
        if body.dynamic:
            UsdPhysics.RigidBodyAPI.Apply(frame.GetPrim())
            if link.inertial is not None:
                _add_mass(frame.GetPrim(), link.inertial)
        one_sided = body.name in self.scene.written.layout
        for number, surface in enumerate(self.scene.written.surfaces[link.name]):
            _add_surface(self.stage, f"{path}/visual_{number}", surface, double_sided=not one_sided)
        for number, shape in enumerate(link.collisions):
            prim = self._add_collider(f"{path}/collision_{number}", shape)
            if link.friction is not None:
                UsdShade.MaterialBindingAPI.Apply(prim).Bind(
                    self._surface_material(link.friction), UsdShade.Tokens.weakerThanDescendants, "physics"
                )

    def _add_collider(self, path: str, shape: Shape) -> Usd.Prim:
        if shape.box_size is not None:
            cube = UsdGeom.Cube.Define(self.stage, path)
            cube.CreateSizeAttr(1.0)
            cube.CreateExtentAttr([Gf.Vec3f(-0.5), Gf.Vec3f(0.5)])
            _place(cube, shape.link_from_shape, scale=shape.box_size)
            geometry = cube
        else:
            assert shape.mesh is not None
            solid = read_mesh(self.scene.written.root / shape.mesh, hint="make the scene again")
            mesh = UsdGeom.Mesh.Define(self.stage, path)
            _fill(mesh, shape.scale * np.asarray(solid.vertices), np.asarray(solid.faces))
            _place(mesh, shape.link_from_shape)
            UsdPhysics.MeshCollisionAPI.Apply(mesh.GetPrim()).CreateApproximationAttr(UsdPhysics.Tokens.convexHull)
            geometry = mesh
        geometry.CreatePurposeAttr(UsdGeom.Tokens.guide)
        UsdPhysics.CollisionAPI.Apply(geometry.GetPrim())
        return geometry.GetPrim()

    def _surface_material(self, friction: float) -> UsdShade.Material:
        if friction not in self._surface_materials:
            path = f"{WORLD}/Materials/friction_{round(1000 * friction):04d}"
            material = UsdShade.Material.Define(self.stage, path)
            properties = UsdPhysics.MaterialAPI.Apply(material.GetPrim())
            properties.CreateStaticFrictionAttr(friction)
            properties.CreateDynamicFrictionAttr(friction)
            properties.CreateRestitutionAttr(0.0)
            self._surface_materials[friction] = material
        return self._surface_materials[friction]

    def _fix(self, path: str, parent: str | None, child: str, parent_from_child: np.ndarray) -> None:
        joint = UsdPhysics.FixedJoint.Define(self.stage, path)
        _connect(joint, None if parent is None else self._paths[parent], self._paths[child], parent_from_child)

    def _add_joint(self, group: str, joint: UrdfJoint) -> None:
        path = self._path(group, joint.name)
        if joint.type == "fixed":
            self._fix(path, joint.parent, joint.child, joint.parent_from_child)
            return
        prismatic = joint.type == "prismatic"
        kind = UsdPhysics.PrismaticJoint if prismatic else UsdPhysics.RevoluteJoint
        entry = kind.Define(self.stage, path)
        entry.CreateAxisAttr(UsdPhysics.Tokens.x)
        turn = transform_from(_x_onto(np.array(joint.axis)), np.zeros(3))
        _connect(entry, self._paths[joint.parent], self._paths[joint.child], joint.parent_from_child @ turn, turn)
        in_units = 1.0 if prismatic else 180 / np.pi
        if joint.type != "continuous":
            entry.CreateLowerLimitAttr(joint.lower * in_units)
            entry.CreateUpperLimitAttr(joint.upper * in_units)
        if joint.damping:
            drive = UsdPhysics.DriveAPI.Apply(entry.GetPrim(), "linear" if prismatic else "angular")
            drive.CreateStiffnessAttr(0.0)
            drive.CreateDampingAttr(joint.damping / in_units)


def _connect(
    joint: UsdPhysics.Joint,
    parent: str | None,
    child: str,
    parent_from_joint: np.ndarray,
    child_from_joint: np.ndarray | None = None,
) -> None:
    """Tell a joint its two bodies and where it sits in each; without a parent it is held by the world."""
    if parent is not None:
        joint.CreateBody0Rel().SetTargets([parent])
    joint.CreateBody1Rel().SetTargets([child])
    joint_pose = np.eye(4) if child_from_joint is None else child_from_joint
    joint.CreateLocalPos0Attr(Gf.Vec3f(*parent_from_joint[:3, 3].tolist()))
    joint.CreateLocalRot0Attr(_quaternion(parent_from_joint))
    joint.CreateLocalPos1Attr(Gf.Vec3f(*joint_pose[:3, 3].tolist()))
    joint.CreateLocalRot1Attr(_quaternion(joint_pose))


def _quaternion(pose: np.ndarray) -> Gf.Quatf:
    x, y, z, w = quaternion_of(pose).tolist()
    return Gf.Quatf(w, x, y, z)


def _x_onto(axis: np.ndarray) -> np.ndarray:
    """Return a rotation (3, 3) that turns the x axis onto `axis` (3,)."""
    direction = axis / np.linalg.norm(axis)
    across = np.cross(direction, np.eye(3)[np.argmin(np.abs(direction))])
    across /= np.linalg.norm(across)
    return np.column_stack([direction, across, np.cross(direction, across)])


def _place(prim: UsdGeom.Xformable, pose: np.ndarray, scale: tuple[float, float, float] | None = None) -> None:
    prim.AddTranslateOp().Set(Gf.Vec3d(*pose[:3, 3].tolist()))
    x, y, z, w = quaternion_of(pose).tolist()
    prim.AddOrientOp(UsdGeom.XformOp.PrecisionDouble).Set(Gf.Quatd(w, x, y, z))
    if scale is not None:
        prim.AddScaleOp().Set(Gf.Vec3f(*scale))


def _add_mass(prim: Usd.Prim, inertial: MassProperties) -> None:
    """Mass [kg], centre [m], principal moments [kg m^2] and axes."""
    mass = UsdPhysics.MassAPI.Apply(prim)
    mass.CreateMassAttr(float(inertial.mass))
    mass.CreateCenterOfMassAttr(Gf.Vec3f(*np.asarray(inertial.center, dtype=float).tolist()))
    moments, axes = np.linalg.eigh(inertial.inertia)
    if np.linalg.det(axes) < 0:
        axes[:, 0] *= -1
    mass.CreateDiagonalInertiaAttr(Gf.Vec3f(*moments.tolist()))
    x, y, z, w = Rotation.from_matrix(axes).as_quat().tolist()
    mass.CreatePrincipalAxesAttr(Gf.Quatf(w, x, y, z))


def _add_surface(stage: Usd.Stage, path: str, surface: Surface, *, double_sided: bool) -> None:
    mesh = UsdGeom.Mesh.Define(stage, path)
    _fill(mesh, surface.vertices, surface.faces)
    mesh.CreateDoubleSidedAttr(double_sided)
    if surface.vertex_colors is None:
        colors, kind = srgb_to_linear(np.array([surface.color[:3]])), UsdGeom.Tokens.constant
    else:
        colors, kind = srgb_to_linear(surface.vertex_colors / 255.0), UsdGeom.Tokens.vertex
    mesh.CreateDisplayColorPrimvar(kind).Set(Vt.Vec3fArray.FromNumpy(np.ascontiguousarray(colors, dtype=np.float32)))
    if surface.color[3] < 1.0:
        mesh.CreateDisplayOpacityPrimvar(UsdGeom.Tokens.constant).Set([surface.color[3]])


def _fill(mesh: UsdGeom.Mesh, vertices: np.ndarray, faces: np.ndarray) -> None:
    points = np.ascontiguousarray(vertices, dtype=np.float32)
    mesh.CreatePointsAttr(Vt.Vec3fArray.FromNumpy(points))
    mesh.CreateFaceVertexCountsAttr(Vt.IntArray.FromNumpy(np.full(len(faces), 3, np.int32)))
    mesh.CreateFaceVertexIndicesAttr(Vt.IntArray.FromNumpy(np.ascontiguousarray(faces, dtype=np.int32).ravel()))
    mesh.CreateSubdivisionSchemeAttr(UsdGeom.Tokens.none)
    if len(points):
        mesh.CreateExtentAttr([Gf.Vec3f(*points.min(axis=0).tolist()), Gf.Vec3f(*points.max(axis=0).tolist())])
