"""Eyes that look: every estimate is made of a rendered view of the trial's state, by ours or by the thesis's estimator.

The needle world (stages/suture/world) is given the trial's needle, thread and drivers, and cameras, lamps and
calibration error of its own, drawn once a trial. The ridge is the simulator's; thread behind the last hole is not
drawn. `geometry`: masks are the rendered truth spoiled as learned ones, seventy times as
fast; `pictures`: both eyes' pictures, masks by the network. Either is given the true disparity with the noise of the
needle benchmark. A state that is looked at again is not rendered again: what is new is the noise.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scenewright.stages.kit.geometry.transforms import apply, inverse, transform_from
from scenewright.stages.suture.evaluation.judgement import Estimate, judged
from scenewright.stages.suture.masks import EyeMasks, learned_masks, open_segmenter, spoiled_masks
from scenewright.stages.suture.needle.estimators import ESTIMATORS
from scenewright.stages.suture.rig import TWO_CAMERAS, NeedlePose
from scenewright.stages.suture.robot.arms import REMOTE_CENTRES
from scenewright.stages.suture.robot.psm import YAW_TO_TIP
from scenewright.stages.suture.trials.bench import Bench
from scenewright.stages.suture.trials.perception import PerceptionModel, Seen, ends_of, has_moved
from scenewright.stages.suture.trials.wound import RIDGE_HALF_WIDTH, RIDGE_HEIGHT
from scenewright.stages.suture.world.corruption import noisy_disparity
from scenewright.stages.suture.world.pad import Ridge
from scenewright.stages.suture.world.render import StereoView, render
from scenewright.stages.suture.world.scene import NeedleScene, make_scene
from scenewright.stages.suture.world.thread import THREAD_RADIUS
from scenewright.stages.suture.world.tubes import LEFT_DRIVER, RIGHT_DRIVER, THREAD, Tubes, chain, joined, needle_tube

PICTURED_FROM_TRIAL = transform_from(np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]), np.zeros(3))
"""The needle world's wound runs away from the cameras, the trial's towards them."""
SIGHTS = {
    "geometry": "estimates of rendered views of the trial, masks spoiled as a learned mask's",
    "pictures": "estimates of rendered images of the trial, masks by the network",
}
LOOKS_OF_A_TRIAL = 100_000
"""Distance between the seeds of two trials: more than a trial has looks."""
CALIBRATION_ERROR, DISPARITY_NOISE = 0.15, 1.0
"""[px], those of the needle benchmark."""
BODIES = {"right": RIGHT_DRIVER, "left": LEFT_DRIVER}
HELD_OPEN, OPEN = 0.05, 0.35
"""Half the angle between jaws that hold the needle, and between open ones [rad]; by eye."""


@dataclass(frozen=True)
class TrialScene(NeedleScene):
    """A scene whose drivers have wrists: `drivers` are their parts in the needle world."""

    drivers: Tubes | None = None

    def tubes(self) -> Tubes:
        """Return every tube of the scene in the left camera's frame."""
        chains = [chain(self.thread, np.full(len(self.thread), THREAD_RADIUS), THREAD)]
        if self.drivers is not None:
            chains.append(self.drivers)
        return joined([needle_tube(self.pose), joined(chains).moved(self.camera_from_world)])


@dataclass(frozen=True)
class Looked:
    """A look: the place, what became of it (`right`, `swapped`: right but for the names of the ends, `abstained`,
    `wrong`), whether the needle is where it was at the look before, and how far off it was."""

    place: str
    fate: str
    again: bool
    estimate: Estimate


class LookingEyes:
    """Sees what is rendered of the trial that it watches; counts as `Eyes` does."""

    def __init__(self, model: PerceptionModel, seed: int, pictures: bool) -> None:
        """`model` says whose estimator is meant, how long an estimate takes and how well thread is seen."""
        self.model = model
        self.seed, self.pictures = seed, pictures
        self.looks = self.right = self.abstained = 0
        self.looked: list[Looked] = []
        self._estimate = ESTIMATORS[model.name].of_view
        self._world = make_scene(seed, TWO_CAMERAS, calibration_error=CALIBRATION_ERROR)
        self._segmenter: Any = open_segmenter(None, "--sight geometry needs none") if pictures else None
        self._bench: Bench | None = None
        self._state = b""
        self._view: StereoView | None = None
        self._masks: EyeMasks | None = None
        self._ends: np.ndarray | None = None

    @property
    def places(self) -> dict[str, Counter[str]]:
        """Of each place, how many looks came to which fate."""
        counted: dict[str, Counter[str]] = {}
        for look in self.looked:
            counted.setdefault(look.place, Counter())[look.fate] += 1
        return counted

    def watch(self, bench: Bench) -> None:
        """Look at this trial from now on."""
        self._bench = bench

    def look(self, needle: np.ndarray, place: str) -> Seen | None:
        """Return one estimate of a needle at its true pose (4, 4), in the world; None when it is abstained from."""
        view = self._render_view(needle)
        self.looks += 1
        seed = LOOKS_OF_A_TRIAL * (self.seed + 1) + self.looks
        spoiled, random = spoiled_masks(view.left, view.right, seed)
        masks = spoiled if self._masks is None else self._masks
        pictures = None
        if self._masks is not None and view.left.image is not None and view.right.image is not None:
            pictures = view.left.image, view.right.image
        disparity = noisy_disparity(view, DISPARITY_NOISE, random)
        answer = self._estimate(masks.observation(view.rig, disparity, pictures), 0, None)
        record = judged(self.model.name, "trial", seed, view, answer)
        fate = "abstained" if not record.answered else "wrong"
        if record.within:
            fate = "swapped" if record.swapped else "right"
        ends = ends_of(needle)
        self.looked.append(Looked(place, fate, not has_moved(self._ends, ends), record))
        self._ends = ends
        self.abstained += fate == "abstained"
        self.right += fate == "right"
        if answer.pose is None or answer.abstained:
            return None
        world_from_camera = inverse(PICTURED_FROM_TRIAL) @ inverse(self._world.camera_from_world)
        pose = NeedlePose(world_from_camera @ answer.pose.camera_from_needle)
        return Seen(pose.normal, pose.tip, pose.swage, fate == "right")

    def _render_view(self, needle: np.ndarray) -> StereoView:
        assert self._bench is not None
        state = b"".join(part.tobytes() for part in (needle, *self._bench.tools.values(), self._bench.rope))
        if self._view is None or state != self._state:
            scene = pictured(self._world, self._bench, needle, self.looks)
            self._view, self._state = render(scene, pictures=self.pictures), state
            if self._segmenter is not None:
                left, right = self._view.left.image, self._view.right.image
                self._masks = learned_masks(self._segmenter.masks(left), self._segmenter.masks(right))
        return self._view


def pictured(world: NeedleScene, bench: Bench, needle: np.ndarray, frame: int) -> TrialScene:
    """Return the scene that the cameras and lamps of `world` see of a trial whose needle is at a pose (4, 4)."""
    pose = NeedlePose(world.camera_from_world @ PICTURED_FROM_TRIAL @ needle)
    holding_arm = bench.hold.arm if bench.hold is not None else None
    driver_tubes = [
        driver(
            PICTURED_FROM_TRIAL @ tool,
            apply(PICTURED_FROM_TRIAL, REMOTE_CENTRES[name]),
            HELD_OPEN if name == holding_arm else OPEN,
            BODIES[name],
        )
        for name, tool in bench.tools.items()
    ]
    fields = {name: getattr(world, name) for name in NeedleScene.__dataclass_fields__}
    scene = TrialScene(**fields, drivers=joined(driver_tubes))
    return replace(
        scene,
        seed=1000 * world.seed + frame,
        pose=pose,
        thread=apply(PICTURED_FROM_TRIAL, bench.rope[::-1]),
        crossing=None,
        grips={},
        holder=holding_arm or "air",
        place="trial",
        ridge=Ridge(RIDGE_HEIGHT, RIDGE_HALF_WIDTH, elliptic=True),
    )


def driver(tool: np.ndarray, remote_centre: np.ndarray, opening: float, body: int) -> Tubes:
    """Return a driver at `tool` (4, 4) whose shaft runs from its wrist through its remote centre (3,): as thick as the
    needle world's, jaws half `opening` [rad] apart."""
    along, across = tool[:3, 2], tool[:3, 1]
    hinge = tool[:3, 3] - YAW_TO_TIP * along
    tubes = []
    for side in (-1.0, 1.0):
        direction = np.cos(opening) * along + side * np.sin(opening) * across
        start = hinge + side * 0.0011 * across
        tubes.append(
            chain(start + direction * np.linspace(0.0, 0.0122, 8)[:, None], np.linspace(0.0017, 0.0009, 8), body)
        )
    back = (remote_centre - hinge) / np.linalg.norm(remote_centre - hinge)
    tubes.append(chain(hinge + back * np.linspace(-0.001, 0.010, 5)[:, None], np.linspace(0.0022, 0.0034, 5), body))
    tubes.append(chain(hinge + back * np.linspace(0.010, 0.30, 60)[:, None], np.full(60, 0.0040), body))
    return joined(tubes)
