"""Rooms reconstructed from two eyes, beside the same rooms seen by a depth camera.

Both arms run the pipeline `reconstruct-stereo` to its evaluation: same room, walk, masks and voxels. `depth_camera`
gets the log of a simulated structured-light camera instead of the right eye. Depth is compared with the exact depth of
the same frames.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np
from pydantic import Field
from scenewright.stages.engine.chain import run_pipeline
from scenewright.stages.engine.pipelines import Pipeline, pipeline_path, read_pipeline
from scenewright.stages.kit.formats.frames import FrameReader
from scenewright.stages.kit.stage import Parameters

from benchmarks.experiment import Bench, Experiment, Trial, only
from benchmarks.steps import StepFailed, made

TUNING, REPORTING = ("100",), ("1100",)
"""A tuning seed that proves that the comparison runs, and a reporting seed."""
CASE = "room_"


class StereoRoomsParameters(Parameters):
    """Options of the experiment: variables of the pipeline."""

    frames: int = Field(60, ge=2, description="Frames of a room")
    width: int = Field(0, ge=0, description="Image width [px]; 0: that of the pipeline")
    height: int = Field(0, ge=0, description="Image height [px]; 0: that of the pipeline")
    clutter: str = Field("", description="How much lies about; empty: as in the pipeline")


FARTHEST = 4.0
"""Depth is compared up to here [m], where the pipeline ends; its error grows with its square."""
MEASURES = {
    "depth_share": "pixels with depth [%]",
    "depth_median_mm": "median error of depth [mm]",
    "depth_p95_mm": "95th percentile [mm]",
    "map/pq": "panoptic quality of the map",
    "map/accuracy_mean_mm": "mean distance of the surface from the true one [mm]",
    "map/completeness_mean_mm": "mean distance of the true surface from it [mm]",
    "map/mesh_recall": "true surface found [%]",
    "graph/edit_distance": "edit distance of the contact graph",
    "graph/support_f1": "F1 of support edges",
    "replacement/scan2cad_success": "CAD models right and in place [%]",
    "replacement/functional": "objects functionally right [%]",
    "counts/bodies": "bodies of the scene",
    "replacement/collisions": "pairs of bodies that share space",
}
SHARES = ("map/mesh_recall", "replacement/scan2cad_success", "replacement/functional")


def pipeline_of(arm: str) -> Pipeline:
    """Return the pipeline of an arm: `reconstruct-stereo` without its report; the depth camera's log is ingested as the
    sequence."""
    pipeline = read_pipeline(pipeline_path("reconstruct-stereo"))
    steps = []
    for step in pipeline.step:
        if step.name == "report" or (arm == "depth_camera" and step.name == "stereo_pairs"):
            continue
        if arm == "depth_camera" and step.name == "ground_truth":
            kept = {name: value for name, value in step.parameters.items() if name not in ("stereo_baseline", "depth")}
            step = step.model_copy(update={"parameters": kept})
        if arm == "depth_camera" and step.name == "sequence":
            step = step.model_copy(
                update={"stage": "ingest", "inputs": {"log": "ground_truth/log.mcap"}, "parameters": {}}
            )
        steps.append(step)
    return pipeline.model_copy(update={"step": tuple(steps)})


def exact_depth(folder: Path, library: Path, seed: str, given: dict[str, str]) -> Path:
    """Return a sequence of a room whose depth is exact."""
    values = {name: variable.default for name, variable in pipeline_of("two_eyes").variables.items()} | given
    options = [f"--{name}={values[name]}" for name in ("recipe", "clutter", "frames", "width", "height")]
    truth = made("synthesize", folder / "truth", "--library", library, *options, "--seed", seed, "--no-depth-noise")
    return made("ingest", folder / "sequence", "--log", truth / "log.mcap")


def depth_figures(sequence: Path, exact: Path, every: int = 5) -> dict[str, float]:
    """Return share of pixels with depth [%] and the error of depth [mm], over every n-th frame, where the true depth is
    at most FARTHEST."""
    errors, seen, known = [], 0, 0
    with FrameReader(sequence / "frames.mcap") as reader, FrameReader(exact / "frames.mcap") as truth:
        true_frames = {round(frame.time, 6): frame for frame in truth.frames(("depth",), every=every)}
        for frame in reader.frames(("depth",)):
            true = true_frames.get(round(frame.time, 6))
            if true is None or true.depth is None or frame.depth is None:
                continue
            near = (true.depth > 0) & (true.depth <= FARTHEST)
            both = near & (frame.depth > 0)
            seen, known = seen + int(near.sum()), known + int(both.sum())
            errors.append(np.abs(frame.depth - true.depth)[both])
    error = 1000 * np.concatenate(errors)
    return {
        "depth_share": 100 * known / seen,
        "depth_median_mm": float(np.median(error)),
        "depth_p95_mm": float(np.percentile(error, 95)),
    }


def measure(bench: Bench, trials: Sequence[Trial]) -> Iterator[tuple[Trial, dict[str, float]]]:
    """Run the arms on a room and yield their figures. Raises StepFailed."""
    given = {name: str(value) for name, value in bench.parameters.model_dump().items() if value}
    for trial in trials:
        run = bench.out / trial.case / trial.arm
        reports = run_pipeline(pipeline_of(trial.arm), run, given | {"seed": trial.seed}, announce=_say)
        if reports[-1].exit_code != 0:
            raise StepFailed(f"{trial}: {reports[-1].name}", reports[-1].exit_code)
        metrics = json.loads((run / "evaluation" / "metrics.json").read_text())["metrics"]
        exact = exact_depth(bench.out / trial.case, run / "cad_library", trial.seed, given)
        figures = depth_figures(run / "sequence", exact)
        for name in MEASURES:
            if metrics.get(name) is not None:
                figures[name] = (100 if name in SHARES else 1) * metrics[name]
        yield trial, {name: round(value, 4) for name, value in figures.items()}


def _say(text: str) -> None:
    print(text, file=sys.stderr, flush=True)


EXPERIMENT = Experiment(
    name="stereo_rooms",
    title="Rooms from two eyes and from a depth camera",
    simulated="Rooms, walks, pictures, the depth camera's noise; masks are those of the pipeline.",
    knows="Two rectified pictures, or colour and depth; true poses.",
    does_not_show="Calibration errors of a real rig; one room has no interval.",
    arms={"two_eyes": "two eyes", "depth_camera": "depth camera"},
    cases=tuple(f"{CASE}{seed}" for seed in (*TUNING, *REPORTING)),
    default_cases=lambda bench: [f"{CASE}{seed}" for seed in (TUNING if bench.tuning or bench.quick else REPORTING)],
    tuning=TUNING,
    reporting=REPORTING,
    seeds_of=lambda bench, case: [case.removeprefix(CASE)],
    together=lambda trial: trial.case,
    measure=measure,
    record=dict[str, float],
    measures={name: only(name) for name in MEASURES},
    parameters=StereoRoomsParameters,
    quick={"frames": 12, "width": 320, "height": 240, "clutter": "low"},
    keeps=False,
)
