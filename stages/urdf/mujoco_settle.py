"""The same test in MuJoCo: a second engine, without Bullet's padding, that reads scene.mjcf.xml, or another's MJCF."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from scenewright.schemas.errors import BadInput, MissingDependency
from scenewright.schemas.interactive_scene import InteractiveSceneFile
from scenewright.stages.kit.geometry.boxes import bottom, top
from scenewright.stages.kit.geometry.transforms import quaternion_of, transform_from, transform_from_quaternion
from scenewright.stages.kit.simulation.margins import perturbed
from scenewright.stages.kit.simulation.world import GRAVITY
from scenewright.stages.urdf.motions import MOVED_LIMIT, TURNED_LIMIT, BodyMotion, motion_of, watched

MJCF_FILE, KEY_FRAME = "scene.mjcf.xml", "reconstructed"


@dataclass(frozen=True)
class MujocoScene:
    """A model, the state that it begins in, and what of it is watched."""

    model: Any
    key: int | None
    """Number of the key frame with the state; None: the model's own."""
    numbers: Mapping[str, int]
    """Free body -> its number in the model."""
    ground: float
    """Height under which no centre of mass may end [m]."""


def mujoco_motions(
    scene_folder: Path, seconds: float, *, moved_limit: float = MOVED_LIMIT, turned_limit: float = TURNED_LIMIT
) -> tuple[BodyMotion, ...]:
    """Return what becomes of the movable bodies of a scene in MuJoCo, after `seconds` [s] from the key frame, in the
    order of scene.json. Distances and angles are of the centre of mass and the principal axes.

    Raises MissingDependency without MuJoCo, BadInput for a scene that it does not load.
    """
    return let_go(mujoco_scene(scene_folder), seconds, moved_limit=moved_limit, turned_limit=turned_limit)


def mujoco_scene(scene_folder: Path) -> MujocoScene:
    """Load scene.mjcf.xml of a scene folder. Raises MissingDependency without MuJoCo, BadInput for one of another run,
    or that MuJoCo does not load."""
    folder = Path(scene_folder)
    scene = InteractiveSceneFile.read(folder / "scene.json")
    path = folder / MJCF_FILE
    model = _model(path)
    _check_names(path, model, scene)
    numbers = {body.name: model.body(body.name).id for body in scene.bodies if body.movable}
    key = model.key(KEY_FRAME).id if model.nkey else None
    return MujocoScene(model, key, numbers, _ground(_start(model, key), model, scene))


def others_in_mujoco(model: Any, numbers: Mapping[str, int], scene_folder: Path) -> MujocoScene:
    """Return what MuJoCo read of an MJCF that another wrote, in the state of its first key frame, with gravity of 9.81
    along -z whatever the file says; `scene_folder` is the same scene for Bullet."""
    _prepare(model)
    key = 0 if model.nkey else None
    scene = InteractiveSceneFile.read(scene_folder / "scene.json")
    tops = [top(body.box) for body in scene.bodies if body.class_name == "floor"]
    return MujocoScene(model, key, numbers, min(tops, default=_lowest(scene)))


def let_go(
    scene: MujocoScene,
    seconds: float,
    *,
    moved_limit: float = MOVED_LIMIT,
    turned_limit: float = TURNED_LIMIT,
    random: np.random.Generator | None = None,
) -> tuple[BodyMotion, ...]:
    """Return what becomes of the free bodies after `seconds` [s]; with `random` from poses that are a little off.

    Where MuJoCo finds numbers that it cannot go on with, every body counts as gone.
    """
    import mujoco

    model = scene.model
    with _no_log():
        data = _start(model, scene.key)
        if random is not None:
            for number in scene.numbers.values():
                _shift(model, data, number, random)
            mujoco.mj_forward(model, data)

        def step(count: int) -> None:
            if not _broken(data):
                mujoco.mj_step(model, data, nstep=count)

        def look() -> dict[str, np.ndarray]:
            mujoco.mj_kinematics(model, data)  # of what the next step begins with nothing is changed
            lost = np.full((4, 4), np.nan)
            return {name: lost if _broken(data) else _center(data, number) for name, number in scene.numbers.items()}

        times, looks = watched(step, look, seconds, float(model.opt.timestep))
    return tuple(
        motion_of(
            name,
            times,
            [seen[name] for seen in looks],
            fell_through=bool(looks[-1][name][2, 3] < scene.ground),
            moved_limit=moved_limit,
            turned_limit=turned_limit,
        )
        for name in scene.numbers
    )


def _model(path: Path) -> Any:
    try:
        import mujoco
    except ImportError:
        raise MissingDependency("MuJoCo is not installed", hint="pip install 'scenewright[mujoco]'") from None
    try:
        with _no_log():
            model = mujoco.MjModel.from_xml_path(str(path))
    except ValueError as error:
        raise BadInput(f"{path}: MuJoCo does not load it: {error}", hint="run `urdf` again") from None
    _prepare(model)
    return model


def _prepare(model: Any) -> None:
    """Let gravity pull at everything, nothing sleep, and nothing begin anew."""
    import mujoco

    model.opt.gravity[:] = (0.0, 0.0, -GRAVITY)
    model.body_gravcomp[:] = 0.0
    model.opt.disableflags &= ~int(mujoco.mjtDisableBit.mjDSBL_GRAVITY)
    model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_AUTORESET)  # what breaks off would seem to have stayed
    model.opt.enableflags &= ~int(getattr(mujoco.mjtEnableBit, "mjENBL_SLEEP", 0))


def _start(model: Any, key: int | None) -> Any:
    import mujoco

    data = mujoco.MjData(model)
    if key is not None:
        mujoco.mj_resetDataKeyframe(model, data, key)
    mujoco.mj_forward(model, data)
    return data


@contextmanager
def _no_log() -> Iterator[None]:
    """Keep MuJoCo from writing its warnings into a file where it runs."""
    import mujoco

    mujoco.set_mju_user_warning(lambda text: None)
    try:
        yield
    finally:
        mujoco.set_mju_user_warning(None)


def _broken(data: Any) -> bool:
    """Whether positions, speeds or accelerations became numbers that MuJoCo cannot go on with."""
    import mujoco

    kinds = (mujoco.mjtWarning.mjWARN_BADQPOS, mujoco.mjtWarning.mjWARN_BADQVEL, mujoco.mjtWarning.mjWARN_BADQACC)
    return any(data.warning[int(kind)].number for kind in kinds)


def _shift(model: Any, data: Any, number: int, random: np.random.Generator) -> None:
    """Put a free body a little off its pose."""
    start = int(model.jnt_qposadr[model.body_jntadr[number]])
    place = data.qpos[start : start + 7]
    pose = perturbed(transform_from_quaternion(np.roll(place[3:], -1), np.array(place[:3])), random)
    place[:3], place[3:] = pose[:3, 3], np.roll(quaternion_of(pose), 1)


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


def _center(data: Any, number: int) -> np.ndarray:
    """Return the pose (4, 4) of a body's inertial frame, world frame."""
    return transform_from(np.array(data.ximat[number]).reshape(3, 3), np.array(data.xipos[number]))


def _ground(data: Any, model: Any, scene: InteractiveSceneFile) -> float:
    """Return the lowest top of a floor [m], as Bullet's test does: without a floor the bottom of all that is fixed.
    Floors collide as boxes."""
    tops = []
    for body in scene.bodies:
        if body.class_name == "floor":
            entry = model.body(body.name)
            for geom in range(entry.geomadr[0], entry.geomadr[0] + entry.geomnum[0]):
                half = np.abs(np.array(data.geom_xmat[geom]).reshape(3, 3)) @ model.geom_size[geom]
                if model.geom_contype[geom]:
                    tops.append(float(data.geom_xpos[geom][2] + half[2]))
    return min(tops, default=_lowest(scene))


def _lowest(scene: InteractiveSceneFile) -> float:
    """Return the bottom of all that is fixed [m]."""
    return min((bottom(body.box) for body in scene.bodies if not body.movable), default=-np.inf)
