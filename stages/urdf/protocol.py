"""The protocol: does a scene of whatever origin hold, by rules that others can repeat (docs/FORMATS.md)?

One run of 5 s in each engine; the depth of bodies in each other and the sweep of joints are geometry, by Bullet's
shapes.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from scenewright.schemas.errors import MissingDependency
from scenewright.schemas.interactive_scene import InteractiveSceneFile
from scenewright.stages.kit.library_versions import library_version
from scenewright.stages.kit.simulation.margins import RUNS
from scenewright.stages.urdf import settle_report as settle_test
from scenewright.stages.urdf.joint_sweep import JointRange
from scenewright.stages.urdf.motions import MOVED_LIMIT, TURNED_LIMIT, BodyMotion
from scenewright.stages.urdf.mujoco_settle import MJCF_FILE, MujocoScene, let_go, mujoco_scene, others_in_mujoco
from scenewright.stages.urdf.protocol_yield import Yield, scene_yield
from scenewright.stages.urdf.scene_penetration import Overlap
from scenewright.stages.urdf.settle_margins import body_is_near, body_margin, with_margins
from scenewright.stages.urdf.settle_report import settle_report

VERSION = 1
"""Of the protocol: another number, other numbers."""
SECONDS = 5.0
"""Simulated time [s]."""
TURNED = math.radians(5.0)
"""A stable body turns by no more [rad]; how far it may move is the settle test's (`MOVED_LIMIT`)."""
LIMITS = {"moved_limit": MOVED_LIMIT, "turned_limit": TURNED}
OLD_SECONDS, OLD_TURNED = settle_test.SECONDS, TURNED_LIMIT
"""Limits of `urdf settle` [s], [rad], told beside them."""


@dataclass(frozen=True)
class EngineRun:
    """What became of the free bodies in one engine."""

    version: str
    motions: tuple[BodyMotion, ...]


@dataclass(frozen=True)
class Protocol:
    """What the protocol finds of one scene."""

    runs: Mapping[str, EngineRun]
    """Engine -> its run; those that ran."""
    not_run: Mapping[str, str]
    """Engine -> why it did not."""
    overlaps: tuple[Overlap, ...]
    """Pairs of two bodies deeper than the limit at the start, deepest first."""
    joints: tuple[JointRange, ...]
    counts: Yield
    fixed: tuple[str, ...]
    """Bodies that stand fast."""

    @property
    def free(self) -> tuple[str, ...]:
        """Free bodies, in the order of the scene."""
        return tuple(body.name for body in next(iter(self.runs.values())).motions)

    @property
    def stable(self) -> tuple[str, ...]:
        """Free bodies that are stable in every engine that ran."""
        fates = [{body.name for body in run.motions if body.stays} for run in self.runs.values()]
        return tuple(name for name in self.free if all(name in fate for fate in fates))

    @property
    def colliding(self) -> tuple[Overlap, ...]:
        """Pairs of which at least one body is free."""
        return tuple(pair for pair in self.overlaps if {pair.first, pair.second} & set(self.free))

    @property
    def colliding_bodies(self) -> tuple[str, ...]:
        """Free bodies that lie in another body."""
        met = {name for pair in self.colliding for name in (pair.first, pair.second)}
        return tuple(name for name in self.free if name in met)

    @property
    def blocked(self) -> tuple[JointRange, ...]:
        """Joints that meet something in the first tenth of their range."""
        return tuple(joint for joint in self.joints if not joint.free_at_start)

    @property
    def sound(self) -> bool:
        """Whether something is free or moves on a joint, every free body is stable in every engine, none lies in
        another body, and no joint is blocked where it begins."""
        anything = bool(self.free or self.joints)
        return anything and len(self.stable) == len(self.free) and not self.colliding and not self.blocked


def protocol(
    folder: Path, *, model: Any = None, numbers: Mapping[str, int] | None = None, seen: int | None = None
) -> Protocol:
    """Run the protocol on a scene folder; `model` is what MuJoCo runs in place of its scene.mjcf.xml, and `numbers`
    says which of its bodies are free. Writes nothing.

    Raises BadInput for a scene that cannot be loaded, UsageError for a `seen` that is too small.
    """
    counts = scene_yield(folder, seen)
    report = with_margins(settle_report(folder, SECONDS, **LIMITS), folder)
    runs = {"bullet": EngineRun(library_version("pybullet"), report.bodies)}
    not_run: dict[str, str] = {}
    try:
        if model is None and not (folder / MJCF_FILE).is_file():
            raise MissingDependency(f"{MJCF_FILE} is not there", hint="run `urdf` again")
        scene = mujoco_scene(folder) if model is None else others_in_mujoco(model, numbers or {}, folder)
        runs["mujoco"] = EngineRun(library_version("mujoco"), _in_mujoco(scene))
    except MissingDependency as error:
        not_run["mujoco"] = f"{error.message} ({error.hint})"
    free = {body.name for body in report.bodies}
    return Protocol(
        runs,
        not_run,
        tuple(pair for pair in report.collisions if pair.first != pair.second),
        report.joints,
        counts,
        tuple(name for name in _names(folder) if name not in free),
    )


def _names(folder: Path) -> list[str]:
    return [body.name for body in InteractiveSceneFile.read(folder / "scene.json").bodies]


def _in_mujoco(scene: MujocoScene) -> tuple[BodyMotion, ...]:
    """Return what becomes of the bodies, with the margins of what is near a limit: the whole scene is let go again,
    from poses a tenth of a millimetre off."""
    bodies = let_go(scene, SECONDS, moved_limit=MOVED_LIMIT, turned_limit=TURNED)
    if not any(map(body_is_near, bodies)):
        return bodies
    random = np.random.default_rng(0)
    runs = [
        {
            body.name: body
            for body in let_go(scene, SECONDS, moved_limit=MOVED_LIMIT, turned_limit=TURNED, random=random)
        }
        for _ in range(RUNS)
    ]
    return tuple(
        replace(body, margin=body_margin(body, [(run[body.name].moved, run[body.name].turned) for run in runs]))
        if body_is_near(body)
        else body
        for body in bodies
    )


def stable_by_old_limits(body: BodyMotion) -> bool:
    """Whether a body stays by the limits of `urdf settle`, in the first 3 s of the same run."""
    moved, turned = body.by(OLD_SECONDS)
    return moved <= MOVED_LIMIT and turned <= OLD_TURNED and not body.fell_through
