"""An MJCF as a scene: MuJoCo reads it, and what it made of the file is told to other engines.

A body with a free joint is free; one without joints whose parents have none stands fast. The state is that of the first
key frame, where the file has one.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
from scenewright.schemas.errors import BadInput, MissingDependency
from scenewright.stages.kit.formats.urdf_file import Link, Shape, Urdf, UrdfJoint
from scenewright.stages.kit.geometry.solids import MassProperties
from scenewright.stages.kit.geometry.transforms import inverse, transform_from, transform_from_quaternion
from scenewright.stages.library.importing.limits import few_findings, plain_text
from scenewright.stages.library.importing.mjcf_document import MOST_INCLUDES
from scenewright.stages.library.importing.scenes.bodies import bodies_of
from scenewright.stages.library.importing.scenes.sdf_scene import check_gravity
from scenewright.stages.library.importing.scenes.shapes import Hulls, ground_shape, solid_shape
from scenewright.stages.library.importing.scenes.writing import OthersScene, PlainNames
from scenewright.stages.library.importing.source_folder import SourceFolder

FOLDERS = {"mesh": "meshdir", "texture": "texturedir", "hfield": "meshdir", "skin": "meshdir"}
"""Elements that name files -> attribute of <compiler> with the folder."""
LEVEL = 0.999
"""A plane is level when the part of its normal along z is larger."""
KINDS = {"hinge": "revolute", "slide": "prismatic"}


def mjcf_scene(path: Path, root: Path) -> OthersScene:
    """Read an MJCF as a scene; where its files lie it says itself. Raises BadInput, MissingDependency."""
    mujoco = _mujoco("an MJCF")
    _check_files(path)
    try:
        model = _model(path, mujoco)
    except ValueError as error:
        reason = plain_text(str(error).strip(), 200)
        raise BadInput(f"{path}: MuJoCo does not read it: {reason}", hint="mend what MuJoCo names") from None
    return _Reader(path, mujoco, model).scene()


def usd_scene(path: Path, root: Path) -> OthersScene:
    """Read a USD as a scene where MuJoCo has the decoder. Raises BadInput where not, and MissingDependency."""
    mujoco = _mujoco("a USD")
    try:
        model = _model(path, mujoco)
    except ValueError:
        raise BadInput(
            f"{path}: MuJoCo {mujoco.__version__} as it is installed does not read USD",
            hint="write the scene as URDF, MJCF or SDF",
        ) from None
    return _Reader(path, mujoco, model).scene()


def _model(path: Path, mujoco: Any) -> Any:
    """Return MuJoCo's model of a file. Raises ValueError."""
    mujoco.set_mju_user_warning(lambda text: None)  # else into a file where it runs
    try:
        return mujoco.MjSpec.from_file(str(path)).compile()
    finally:
        mujoco.set_mju_user_warning(None)


def _mujoco(what: str) -> Any:
    try:
        import mujoco
    except ImportError:
        raise MissingDependency(
            f"{what} is read by MuJoCo, which is not installed", hint="pip install 'scenewright[mujoco]'"
        ) from None
    return mujoco


def _check_files(path: Path) -> None:
    """Raise BadInput for a file that an MJCF or what it includes names, and that is none: MuJoCo would open whatever
    has that name. Names are looked up as MuJoCo does, from the folder of the main file."""
    roots = _with_included(path)
    compiler = {key: value for root in roots for e in root.iter("compiler") for key, value in e.attrib.items()}
    for root in roots:
        for element in root.iter():
            name = element.get("file")
            if element.tag not in FOLDERS or not name:
                continue
            shelf = compiler.get(FOLDERS[element.tag]) or compiler.get("assetdir") or ""
            bare = Path(name).name if compiler.get("strippath") == "true" else name
            if not _is_file(path.parent / shelf / bare):
                raise BadInput(f"{path}: {element.tag} {name!r:.100} is not there", hint="copy it there")


def _with_included(path: Path) -> list[ElementTree.Element]:
    """Return the root elements of an MJCF and of all that it includes, each file once. Raises BadInput."""
    folder, files, roots = SourceFolder(path.parent), [path], []
    for file in files:
        root = folder.read_xml(file)
        roots.append(root)
        for name in [element.get("file", "") for element in root.iter("include")]:
            included = path.parent / name
            if not _is_file(included):
                raise BadInput(f"{file}: includes {name!r:.100}, which is not there", hint="copy it there")
            if included not in files:
                files.append(included)
        if len(files) > MOST_INCLUDES:
            raise BadInput(f"{path}: includes more than {MOST_INCLUDES} files")
    return roots


def _is_file(path: Path) -> bool:
    try:
        return path.is_file()
    except (OSError, ValueError):  # a name that is too long, or with a zero byte
        return False


class _Reader:
    def __init__(self, path: Path, mujoco: Any, model: Any) -> None:
        self.path, self.mujoco, self.model = path, mujoco, model
        self.data = mujoco.MjData(model)
        if model.nkey:
            mujoco.mj_resetDataKeyframe(model, self.data, 0)
        mujoco.mj_forward(model, self.data)
        self.findings: list[str] = []
        self.hulls = Hulls(self.findings)
        self.plain = plain = PlainNames()
        self.names = [plain.of("worldbody")]
        self.names += [plain.of(model.body(k).name or f"body_{k}") for k in range(1, model.nbody)]
        self.joint_names = [plain.of(model.joint(k).name or f"joint_{k}") for k in range(model.njnt)]
        self.joints: list[UrdfJoint] = []
        self.values: dict[str, float] = {}
        self.frames = [np.eye(4) for _ in range(model.nbody)]
        """body_from_link (4, 4): a link's frame lies on its joint's axis."""
        self.grounds: set[str] = set()

    def scene(self) -> OthersScene:
        model = self.model
        check_gravity(np.array(model.opt.gravity), str(self.path), self.findings)
        for number in range(1, model.nbody):
            self._hang(number)
        links = tuple([self._link(number) for number in range(model.nbody)] + self._grounds())
        self._say_what_bullet_lacks()
        bodies = bodies_of(Urdf("", links, tuple(self.joints)), self.values, str(self.path))
        numbers = {body.name: self.names.index(body.name) for body in bodies if body.free}
        return OthersScene(
            self.path,
            "MJCF",
            tuple(bodies),
            self.hulls,
            joint_values=self.values,
            grounds=frozenset(self.grounds & {body.name for body in bodies}),
            numbers=numbers,
            model=model,
            findings=few_findings(self.findings),
        )

    def _hang(self, number: int) -> None:
        """Add the joint between a body and its parent."""
        model, mujoco = self.model, self.mujoco
        name, parent = self.names[number], int(model.body_parentid[number])
        first, count = int(model.body_jntadr[number]), int(model.body_jntnum[number])
        types = [mujoco.mjtJoint(model.jnt_type[k]).name for k in range(first, first + count)]
        kinds = [name.removeprefix("mjJNT_").lower() for name in types]
        if kinds == ["free"]:
            world_from_body = _frame(self.data.xpos[number], self.data.xmat[number])
            self.joints.append(UrdfJoint(f"{name}__in_the_world", "floating", self.names[0], name, world_from_body))
            return
        parent_from_body = _frame(model.body_pos[number], quaternion=model.body_quat[number])
        moving = [k for k, kind in zip(range(first, first + count), kinds, strict=True) if kind in KINDS]
        if len(moving) < count:
            self.findings.append(f"body {name!r:.40}: ball joints are held fast in Bullet")
        if len(moving) > 1:
            self.findings.append(f"body {name!r:.40}: only the first of {len(moving)} joints moves in Bullet")
        if not moving:
            if model.body_mocapid[number] >= 0:
                parent_from_body = _frame(self.data.xpos[number], self.data.xmat[number])
            pose = inverse(self.frames[parent]) @ parent_from_body
            self.joints.append(UrdfJoint(f"{name}__fixed", "fixed", self.names[parent], name, pose))
            return
        joint, kind = moving[0], kinds[moving[0] - first]
        self.frames[number] = transform_from(np.eye(3), np.array(model.jnt_pos[joint]))
        address = int(model.jnt_qposadr[joint])
        reference = float(model.qpos0[address])
        x, y, z = (float(value) for value in model.jnt_axis[joint])
        lower, upper = (float(limit) - reference for limit in model.jnt_range[joint])
        limited = bool(model.jnt_limited[joint])
        if kind == "slide" and not limited:
            self.findings.append(f"slide {self.joint_names[joint]!r:.40} has no range: held fast in Bullet")
        self.joints.append(
            UrdfJoint(
                self.joint_names[joint],
                KINDS[kind] if limited else "continuous" if kind == "hinge" else "fixed",
                self.names[parent],
                name,
                inverse(self.frames[parent]) @ parent_from_body @ self.frames[number],
                (x, y, z),
                lower,
                upper,
                damping=float(np.ravel(model.dof_damping[model.jnt_dofadr[joint]])[0]),
                friction=float(np.ravel(model.dof_frictionloss[model.jnt_dofadr[joint]])[0]),
            )
        )
        self.values[self.joint_names[joint]] = float(self.data.qpos[address]) - reference

    def _link(self, number: int) -> Link:
        model, own_from_body = self.model, inverse(self.frames[number])
        shapes, frictions = [], []
        for geom in range(model.ngeom):
            if self._is_plane(geom):
                continue
            if model.geom_bodyid[geom] == number and (model.geom_contype[geom] or model.geom_conaffinity[geom]):
                shape = self._shape(geom, own_from_body)
                shapes += [] if shape is None else [shape]
                frictions.append(float(model.geom_friction[geom][0]))
        mass = float(model.body_mass[number])
        inertial = None
        if number and mass > 0:
            frame = own_from_body @ _frame(model.body_ipos[number], quaternion=model.body_iquat[number])
            tensor = frame[:3, :3] @ np.diag(model.body_inertia[number]) @ frame[:3, :3].T
            inertial = MassProperties(mass, frame[:3, 3], tensor)
        return Link(self.names[number], inertial, (), tuple(shapes), max(frictions, default=None))

    def _grounds(self) -> list[Link]:
        """Return each plane as a link of its own that is fixed to its body: under a level one nothing may end."""
        model, links = self.model, []
        for geom in range(model.ngeom):
            if not self._is_plane(geom) or not (model.geom_contype[geom] or model.geom_conaffinity[geom]):
                continue
            name, body = self.plain.of(model.geom(geom).name or "ground"), int(model.geom_bodyid[geom])
            pose = _frame(model.geom_pos[geom], quaternion=model.geom_quat[geom])
            friction = float(model.geom_friction[geom][0])
            links.append(Link(name, None, (), (ground_shape(np.eye(4)),), friction))
            pose = inverse(self.frames[body]) @ pose
            self.joints.append(UrdfJoint(f"{name}__fixed", "fixed", self.names[body], name, pose))
            if self.data.geom_xmat[geom][8] > LEVEL:
                self.grounds.add(name)
        return links

    def _is_plane(self, geom: int) -> bool:
        return int(self.model.geom_type[geom]) == int(self.mujoco.mjtGeom.mjGEOM_PLANE)

    def _shape(self, geom: int, own_from_body: np.ndarray) -> Shape | None:
        model, where = self.model, f"{self.path}: geom {self.model.geom(geom).name or geom!r}"
        kind = self.mujoco.mjtGeom(model.geom_type[geom]).name.removeprefix("mjGEOM_").lower()
        pose = own_from_body @ _frame(model.geom_pos[geom], quaternion=model.geom_quat[geom])
        size = np.array(model.geom_size[geom])
        if kind == "box":
            return solid_shape("box", 2 * size, pose, where)
        if kind in ("sphere", "cylinder", "capsule"):
            return solid_shape(kind, size[:1] if kind == "sphere" else size[:2] * (1, 2), pose, where)
        if kind == "mesh":
            mesh = int(model.geom_dataid[geom])
            start, count = int(model.mesh_vertadr[mesh]), int(model.mesh_vertnum[mesh])
            points = np.array(model.mesh_vert[start : start + count], dtype=float)
            return self.hulls.shape(points @ pose[:3, :3].T + pose[:3, 3], model.mesh(mesh).name)
        if kind == "ellipsoid":
            turns = np.random.default_rng(0).normal(size=(400, 3))
            ball = size * turns / np.linalg.norm(turns, axis=1, keepdims=True)
            self.findings.append("ellipsoids are hulls of 400 points in Bullet")
            return self.hulls.shape(ball @ pose[:3, :3].T + pose[:3, 3])
        self.findings.append(f"geoms of type {kind} are left out in Bullet")
        return None

    def _say_what_bullet_lacks(self) -> None:
        """Note what of the file counts in MuJoCo alone."""
        model = self.model
        masks = {
            (int(a), int(b)) for a, b in zip(model.geom_contype, model.geom_conaffinity, strict=True) if a or b
        } - {(1, 1)}
        if (model.body_gravcomp != 0).any():
            self.findings.append(f"{int((model.body_gravcomp != 0).sum())} bodies have gravcomp: taken as 0")
        for count, what in (
            (int(model.neq), "<equality> holds"),
            (int(model.ntendon), "<tendon> pulls"),
            (int(model.nu), "<actuator> pushes"),
            (int(model.nflex), "<flex> is"),
            (len(masks), "contype other than 1 sorts"),
        ):
            if count:
                self.findings.append(f"{what} in MuJoCo alone ({count})")


def _frame(position: np.ndarray, matrix: np.ndarray | None = None, quaternion: np.ndarray | None = None) -> np.ndarray:
    """Return a pose (4, 4) from a place and a rotation matrix (9,) or a quaternion w x y z."""
    if quaternion is not None:
        return transform_from_quaternion(np.roll(np.array(quaternion), -1), np.array(position))
    return transform_from(np.array(matrix).reshape(3, 3), np.array(position))
