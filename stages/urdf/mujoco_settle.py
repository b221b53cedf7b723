"""The same test in MuJoCo: a second engine, without Bullet's padding, that reads scene.mjcf.xml."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from scenewright.schemas.errors import BadInput, MissingDependency
from scenewright.schemas.interactive_scene import InteractiveSceneFile
from scenewright.stages.urdf.settle_report import MOVED_LIMIT, TURNED_LIMIT, BodyMotion
from scipy.spatial.transform import Rotation

MJCF_FILE, KEY_FRAME = "scene.mjcf.xml", "reconstructed"


def mujoco_motions(
    scene_folder: Path, seconds: float, *, moved_limit: float = MOVED_LIMIT, turned_limit: float = TURNED_LIMIT
) -> tuple[BodyMotion, ...]:
    """Return what becomes of the movable bodies of a scene in MuJoCo, after `seconds` [s] from the key frame, in the
    order of scene.json. Distances and angles are of the centre of mass and the principal axes.

    Raises MissingDependency without MuJoCo, BadInput for a scene that it does not load.
    """
    try:
        import mujoco
    except ImportError:
        raise MissingDependency("MuJoCo is not installed", hint="pip install 'scenewright[mujoco]'") from None
    folder = Path(scene_folder)
    scene = InteractiveSceneFile.read(folder / "scene.json")
    path = folder / MJCF_FILE
    try:
        model = mujoco.MjModel.from_xml_path(str(path))
    except ValueError as error:
        raise BadInput(f"{path}: MuJoCo does not load it: {error}", hint="run `urdf` again") from None
    data = mujoco.MjData(model)
    _check_names(path, model, scene)
    names = [body.name for body in scene.bodies if body.movable]
    numbers = [model.body(name).id for name in names]
    if model.nkey:
        mujoco.mj_resetDataKeyframe(model, data, model.key(KEY_FRAME).id)
    mujoco.mj_forward(model, data)
    before = [_pose(data, number) for number in numbers]
    ground = _ground(model, data, scene)
    mujoco.mj_step(model, data, nstep=round(seconds / model.opt.timestep))
    mujoco.mj_forward(model, data)
    motions = []
    for name, number, (position, rotation) in zip(names, numbers, before, strict=True):
        now, turned = _pose(data, number)
        motions.append(
            BodyMotion(
                name,
                moved=float(np.linalg.norm(now - position)),
                turned=float(Rotation.from_matrix(rotation.T @ turned).magnitude()),
                fell_through=bool(now[2] < ground),
                moved_limit=moved_limit,
                turned_limit=turned_limit,
            )
        )
    return tuple(motions)


def _check_names(path: Path, model: Any, scene: InteractiveSceneFile) -> None:
    """Raise BadInput where a file lacks a body of scene.json that is asked for, or the key frame: of another run."""
    bodies = {model.body(number).name for number in range(model.nbody)}
    lacking = [
        one.name for one in scene.bodies if (one.movable or one.class_name == "floor") and one.name not in bodies
    ]
    if lacking:
        more = f" and {len(lacking) - 3} more" if len(lacking) > 3 else ""
        raise BadInput(
            f"{path}: there is no body {', '.join(lacking[:3])}{more}, which scene.json names", hint="run `urdf` again"
        )
    keys = [model.key(number).name for number in range(model.nkey)]
    if keys and KEY_FRAME not in keys:
        raise BadInput(f"{path}: there is no key frame {KEY_FRAME}, only {', '.join(keys)}", hint="run `urdf` again")


def _pose(data: Any, number: int) -> tuple[np.ndarray, np.ndarray]:
    """Return position (3,) and rotation (3, 3) of a body's inertial frame, world frame."""
    return np.array(data.xipos[number]), np.array(data.ximat[number]).reshape(3, 3)


def _ground(model: Any, data: Any, scene: InteractiveSceneFile) -> float:
    """Return the height under which no centre of mass may end [m]: the lowest top of a floor, minus infinity without
    one. Floors collide as boxes."""
    tops = []
    for body in scene.bodies:
        if body.class_name == "floor":
            entry = model.body(body.name)
            for geom in range(entry.geomadr[0], entry.geomadr[0] + entry.geomnum[0]):
                half = np.abs(np.array(data.geom_xmat[geom]).reshape(3, 3)) @ model.geom_size[geom]
                if model.geom_contype[geom]:
                    tops.append(float(data.geom_xpos[geom][2] + half[2]))
    return min(tops, default=-np.inf)
