"""Splats of rooms, learned while pictures arrive: `ours` beside the methods of LEGS (`thesis`) and of LERF (`lerf`).

Same frames, same poses, every eighth held out. The clock starts with the first picture: those that follow arrive by
their stamps, training goes on all the while, and a step costs the processor time that it takes (one thread). `lerf`
takes all pictures at once, so that it begins when the last has arrived. Cases `<scene>/<budget>` look at the held-out
pictures when the clock shows the budget. `<scene>/drifting` and `<scene>/mended` have poses that drift as odometry
does, without and with `--adjust-every --refine-poses`, at POSES_BUDGET: where they drift, held-out pictures stand where
the drifting path has them; mended, where depth and colour place them among the learned. Generated logs have a picture a
second; they are played ROOM_RATE times as fast. `cameras/one` and `cameras/three`: the same drive with a camera ahead,
and with two more turned to the sides; held out, and the same for both, are pictures of all three. `paths/<path>`: those
three cameras drive a line, a loop, a figure of eight, and that twice, the second time lower.
"""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import Protocol

import numba
import numpy as np
from pydantic import Field
from scenewright.schemas.scene_parts import Camera
from scenewright.schemas.sequence import Sequence as SequenceArtifact
from scenewright.stages.kit.formats.frame_streams import CAMERA_FRAME
from scenewright.stages.kit.formats.frames import FrameReader
from scenewright.stages.kit.geometry.transforms import inverse
from scenewright.stages.kit.rendering.splatting.rasterizer import View
from scenewright.stages.kit.stage import Parameters
from scenewright.stages.splat import PosedView, Trainer, evenly, held_out, posed_frames, read_view, with_points
from scenewright.stages.splat.build_stage import method_of, rasterizer_of
from scenewright.stages.splat.building import placed_poses
from scenewright.stages.splat.render_stage import figures_of

from benchmarks.drifting import drifting_poses
from benchmarks.experiment import Bench, Experiment, Results, Trial, mean, ratio
from benchmarks.generated_rooms import STEPS, error_seed, make_room
from benchmarks.splats.lerf import Lerf
from benchmarks.steps import made, opened
from benchmarks.tabulation import Figure

REAL = {
    "office": "hololens_office",
    "livingroom": "redwood_livingroom1",
    "redkitchen": "7scenes_redkitchen",
    "fox": "fox",
}
"""The red kitchen was looked at while `ours` was made. The fox is pictures alone."""
WITHOUT_DEPTH = ("fox",)
"""No adjustment there."""
ROOMS = ("kitchen", "office", "bedroom", "room")
REPORTING = tuple(f"{ROOMS[k % 4]}-{1400 + k}" for k in range(20))
"""In the reporting range of the recipes."""
ROOM_RATE = 4.0
TUNING = ("kitchen-40", "office-41", "bedroom-40")
GENERATED, CAMERAS, PATHS = MADE = "rooms", "cameras", "paths"
NUMBERS = ("one", "three")
SEVERAL = 3
"""Cameras of the drives that the cases CAMERAS and PATHS are of."""
DRIVES = {"line": ("line", 1), "loop": ("loop", 1), "eight": ("eight", 1), "heights": ("eight", 2)}
"""Path and rounds of the cases PATHS."""
OTHERS = (*(f"{CAMERAS}/{number}" for number in NUMBERS), *(f"{PATHS}/{drive}" for drive in DRIVES))
BUDGETS = {"10s": 10.0, "30s": 30.0, "1min": 60.0, "5min": 300.0, "20min": 1200.0}
QUICK_BUDGETS, WHOLE_BUDGETS = ("10s", "30s"), ("1min", "5min", "20min")
POSES = ("drifting", "mended")
POSES_BUDGET = {True: "30s", False: "1min"}
"""With `--quick` and without; that of several cameras and of drives too."""
HOLD_OUT_EVERY = 8
GOOD = 20.0
"""PSNR at which a splat counts as made (Srinivas 2024, section 10.1) [dB]."""
LOOK_EVERY = 3.0
"""Between two looks at the held-out pictures until they are good [s] ..."""
LOOK_SHARE = 0.1
"""... and at least this share of the clock."""


class LegsParameters(Parameters):
    """Options of the experiment."""

    data: Path = Field(Path("../shared/data"), description="Folder with the real logs")
    frames: int = Field(120, ge=16, description="Frames of a generated room")
    views: int = Field(200, ge=16, description="Pictures of a log, at most")
    width: int = Field(320, ge=32, description="Width of the pictures [px]")
    rooms: int = Field(3, ge=1, description="Generated rooms")
    adjust_every: int = Field(10, ge=1, description="Pictures between two adjustments of poses, where they are mended")


@dataclass(frozen=True)
class Splatted:
    """What was measured of a splat."""

    psnr: float
    ssim: float | None
    depth_error: float | None
    gaussians: int
    steps: int
    seconds_to_20: float
    """From the first picture on; the budget where it was not reached."""
    reached_20: bool
    path_length: float | None = None
    """Of the camera ahead, held-out pictures included [m]."""


def sequence_of(bench: Bench, seed: str, part: str) -> SequenceArtifact:
    """Ingest a real log, or make a room."""
    if seed in REAL:
        log = bench.parameters.data / REAL[seed]
        return opened(SequenceArtifact, made("ingest", bench.out / "logs" / seed, "--log", log))
    cameras = SEVERAL if part in (*NUMBERS, *DRIVES) else 1
    path, rounds = DRIVES.get(part, ("tour", 1))
    several = "logs" if cameras == 1 else f"logs-of-{cameras}"
    folder, frames = bench.out / (f"{several}-{part}" if part in DRIVES else several), cameras * bench.parameters.frames
    room = make_room(folder, seed, frames, size=(320, 240), cameras=cameras, path=path, rounds=rounds)
    return opened(SequenceArtifact, room.sequence)


def seeds_of(bench: Bench, case: str) -> Sequence[str]:
    """The rooms, or the one log of that name, where it is there."""
    scene = case.split("/")[0]
    if scene in MADE:
        return TUNING if bench.tuning else REPORTING[: 1 if bench.quick else bench.parameters.rooms]
    return [scene] if (bench.parameters.data / REAL[scene]).is_dir() else []


def default_cases(bench: Bench) -> list[str]:
    """Short budgets with `--quick`."""
    budgets = QUICK_BUDGETS if bench.quick else WHOLE_BUDGETS
    return [*cases_of((*budgets, *POSES)), *OTHERS]


def cases_of(parts: Sequence[str]) -> list[str]:
    """Return the cases of these parts of all scenes."""
    return [f"{scene}/{part}" for scene in (*REAL, GENERATED) for part in parts if adjusts(scene, part)]


def adjusts(scene: str, part: str) -> bool:
    """Whether a case is one of budgets, or of poses that depth can mend."""
    return part not in POSES or scene not in WITHOUT_DEPTH


def split_views(bench: Bench, seed: str, part: str) -> tuple[list[PosedView], list[PosedView]]:
    """Return the views to learn from and those held out."""
    sequence = sequence_of(bench, seed, part)
    with FrameReader(sequence.path("frames.mcap")) as reader:
        posed = posed_frames(reader, sequence, None)
        if part in POSES:
            drifted = drifting_poses(np.array([pose for _, pose in posed]), np.random.default_rng(error_seed(seed)))
            posed = [(frame, pose) for (frame, _), pose in zip(posed, drifted, strict=True)]
        poses = dict(posed)
        frames = evenly([frame for frame, _ in posed], bench.parameters.views)
        read = {frame: read_view(reader, frame, poses[frame], bench.parameters.width) for frame in frames}
    kept = {frames[k] for k in held_out(len(frames), HOLD_OUT_EVERY)}
    learned = [view for frame, view in read.items() if view is not None and frame not in kept]
    if part == NUMBERS[0]:
        learned = [view for view in learned if view.camera_name == CAMERA_FRAME]
    if seed in WITHOUT_DEPTH:
        learned = with_points(learned, 0)
    return learned, [view for frame, view in read.items() if view is not None and frame in kept]


def measure(bench: Bench, trials: Sequence[Trial]) -> Iterator[tuple[Trial, Splatted]]:
    """Train once up to the greatest budget asked for and yield what the clock's stops show."""
    numba.set_num_threads(1)
    warm_up()
    part = {trial: trial.case.split("/")[1] for trial in trials}
    rate = ROOM_RATE if trials[0].case.split("/")[0] in MADE else 1.0
    first = part[trials[0]]
    stops = {trial: BUDGETS.get(each, BUDGETS[POSES_BUDGET[bench.quick]]) for trial, each in part.items()}
    learned, kept = split_views(bench, trials[0].seed, first)
    learner: Learner = (
        Volume()
        if trials[0].arm == "lerf"
        else Splats(trials[0].arm, bench.parameters.adjust_every if first == "mended" else 0)
    )
    waiting, start, looked, reached = list(learned), learned[0].time, 0.0, float("inf")
    clock = 0.0 if not learner.at_once else (learned[-1].time - start) / rate
    for trial in sorted(trials, key=lambda each: stops[each]):
        while clock < stops[trial]:
            began = time.process_time()
            while waiting and waiting[0].time - start <= clock * rate:
                learner.add(waiting.pop(0), last=not waiting)
            learner.step()
            clock += time.process_time() - began
            if reached == float("inf") and clock - looked >= max(LOOK_EVERY, LOOK_SHARE * clock):
                looked = clock
                if learner.looks(kept)[0] >= GOOD:
                    reached = clock
        psnr, ssim, depth_error = learner.looks(kept)
        good = reached <= stops[trial]
        seconds = reached if good else stops[trial]
        yield (
            trial,
            Splatted(
                psnr, ssim, depth_error, learner.gaussians, learner.steps, seconds, good, path_length(learned, kept)
            ),
        )


def path_length(*views: Sequence[PosedView]) -> float:
    """Return how far the camera ahead went [m]."""
    ahead = sorted((v for some in views for v in some if v.camera_name == CAMERA_FRAME), key=lambda view: view.time)
    eyes = np.array([inverse(view.camera_from_world)[:3, 3] for view in ahead]).reshape(-1, 3)
    return float(np.linalg.norm(np.diff(eyes, axis=0), axis=1).sum())


class Learner(Protocol):
    """What learns pictures and shows others."""

    at_once: bool
    """Whether it begins when all pictures have arrived."""

    @property
    def steps(self) -> int:
        """Taken so far."""

    @property
    def gaussians(self) -> int:
        """Held now."""

    def add(self, view: PosedView, *, last: bool) -> None:
        """Take a picture in."""

    def step(self) -> None:
        """Learn a little."""

    def looks(self, views: Sequence[PosedView]) -> tuple[float, float | None, float | None]:
        """Return mean PSNR [dB], SSIM and depth error [m] of pictures that were not learned; None: not looked at."""


class Splats:
    """Gaussians, by the method of an arm."""

    at_once = False

    def __init__(self, arm: str, adjust_every: int) -> None:
        self.trainer = Trainer(
            method_of(arm),
            rasterizer_of("cpu"),
            np.random.default_rng(0),
            refine_poses=adjust_every > 0,
            adjust_every=adjust_every,
        )

    @property
    def steps(self) -> int:
        return self.trainer.steps

    @property
    def gaussians(self) -> int:
        return len(self.trainer.gaussians)

    def add(self, view: PosedView, *, last: bool) -> None:
        self.trainer.add_view(view, last=last)

    def step(self) -> None:
        self.trainer.step()

    def looks(self, views: Sequence[PosedView]) -> tuple[float, float | None, float | None]:
        return looks(self.trainer, views)


class Volume:
    """A radiance field. All pixels of all held-out pictures would take minutes: some stand for them, without SSIM."""

    at_once, gaussians = True, 0

    def __init__(self) -> None:
        self.views: list[PosedView] = []
        self.model: Lerf | None = None

    @property
    def steps(self) -> int:
        return 0 if self.model is None else self.model.steps

    def add(self, view: PosedView, *, last: bool) -> None:
        self.views.append(view)
        if last:
            self.model = Lerf(self.views, 0)

    def step(self) -> None:
        assert self.model is not None
        self.model.step()

    def looks(self, views: Sequence[PosedView]) -> tuple[float, float | None, float | None]:
        model = self.model or Lerf(self.views, 0)
        found = [model.looked_at(view) for view in views]
        errors = [error for _, error in found if error is not None]
        return float(np.mean([psnr for psnr, _ in found])), None, float(np.mean(errors)) if errors else None


@cache
def warm_up() -> None:
    """Compile what training calls, which is on nobody's clock."""
    camera = Camera(width=16, height=16, fx=16.0, fy=16.0, cx=7.5, cy=7.5)
    blank = PosedView(
        0, 0.0, "camera", camera, np.ones((16, 16, 3), np.float32), np.ones((16, 16), np.float32), np.eye(4)
    )
    trainer = Trainer(method_of("ours"), rasterizer_of("cpu"), np.random.default_rng(0))
    trainer.add_view(blank)
    trainer.step()


def looks(trainer: Trainer, views: Sequence[PosedView]) -> tuple[float, float, float | None]:
    """Return mean PSNR [dB], SSIM and depth error [m] of pictures that were not learned."""
    poses = dict(placed_poses(trainer, views))
    found = []
    for view in views:
        placed = replace(view, camera_from_world=inverse(poses[view.frame]))
        picture = trainer.rasterizer.draw(trainer.gaussians, View(view.camera, placed.camera_from_world)).picture
        found.append(figures_of(placed, picture, "held_out"))
    errors = [each.depth_error for each in found if each.depth_error is not None]
    means = [float(np.mean([getattr(each, name) for each in found])) for name in ("psnr", "ssim")]
    return means[0], means[1], float(np.mean(errors)) if errors else None


def regained(results: Results) -> dict[str, Figure | None]:
    """How much of the PSNR that drift costs adjustment gives back, the scenes of a case together."""
    figures: dict[str, Figure | None] = {}
    exact = POSES_BUDGET[results.bench.quick]
    for scene in (*REAL, GENERATED):
        for arm in results.arms():
            found = [
                [results.get(arm, f"{scene}/{part}", seed) for part in (exact, *POSES)]
                for seed in results.seeds(f"{scene}/{POSES[-1]}")
            ]
            shown = [[each.psnr for each in records if each is not None] for records in found]
            parts = [(row[2] - row[1], row[0] - row[1]) for row in shown if len(row) == 1 + len(POSES)]
            if sum(lost for _, lost in parts):
                figures[f"{arm}/{scene}/{POSES[-1]}/regained"] = ratio(parts)
    return figures


def together(trial: Trial) -> object:
    """Budgets of one scene with the same poses are one training."""
    part = trial.case.split("/")[1]
    return (trial.arm, trial.seed, "exact" if part in BUDGETS else part)


EXPERIMENT = Experiment(
    name="legs",
    title="Rooms as Gaussians, learned while pictures arrive",
    simulated=(
        "The generated rooms, their pictures and noisy depth; the drift of poses; the clock, which is "
        "processor time of one thread beside the log's stamps."
    ),
    knows="Colour, depth, calibration and poses (exact, given, or drifting) of every picture that has arrived.",
    does_not_show=(
        "Language: nothing is asked. A GPU, on which the thesis's method and LERF make far more steps in the "
        "same time. Other budgets."
    ),
    arms={"ours": "ours", "thesis": "thesis's method", "lerf": "LERF"},
    runs=lambda arm, case: arm != "lerf" or case.split("/")[1] in BUDGETS,
    cases=(*cases_of((*BUDGETS, *POSES)), *OTHERS),
    default_cases=default_cases,
    seeds_of=seeds_of,
    tuning=TUNING,
    reporting=REPORTING,
    together=together,
    measure=measure,
    record=Splatted,
    measures={
        "psnr": mean("psnr", "dB"),
        "ssim": mean("ssim"),
        "depth_error": mean("depth_error", "m"),
        "seconds_to_20": mean("seconds_to_20", "s"),
        "reached_20": mean("reached_20"),
        "gaussians": mean("gaussians", interval=False),
        "steps": mean("steps", interval=False),
        "path_length": mean("path_length", "m", interval=False),
    },
    pairs=(("ours", "thesis"), ("ours", "lerf")),
    compared=("psnr", "ssim", "seconds_to_20"),
    more_figures=regained,
    parameters=LegsParameters,
    places=frozenset({"data"}),
    quick={"frames": 60, "views": 60},
    steps=STEPS,
)
