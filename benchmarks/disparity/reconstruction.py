"""`make bench-reconstruct-stereo`: rooms reconstructed from two eyes, beside the same rooms seen by a depth camera.

    python -m benchmarks.disparity.reconstruction --out FOLDER [--seeds N ...] [--quick]

Both arms run the pipeline `reconstruct-stereo` to its evaluation: same room, walk, masks and voxels. `depth_camera`
gets the log of a simulated structured-light camera instead of the right eye. Depth is compared with the exact depth of
the same frames. Writes metrics.json (`<arm>/room_<seed>/<measure>`) and table.md; a stopped run goes on.
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path

import numpy as np

from benchmarks.disparity.rendered_pairs import made
from stages.engine.chain import run_pipeline
from stages.engine.pipelines import Pipeline, pipeline_path, read_pipeline
from stages.kit.formats.frames import FrameReader

ARMS = ("two_eyes", "depth_camera")
SEEDS, QUICK_SEEDS = (1100,), (100,)
"""A reporting seed, and a tuning seed that proves that the comparison runs."""
GIVEN = {"frames": "60"}
"""Variables of the pipeline that are not its defaults."""
QUICK = {"frames": "12", "width": "320", "height": "240", "clutter": "low"}
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


def exact_depth(folder: Path, run: Path, seed: int, given: dict[str, str]) -> Path:
    """Return a sequence of the room of a run whose depth is exact."""
    values = {name: variable.default for name, variable in pipeline_of("two_eyes").variables.items()} | given
    options = [f"--{name}={values[name]}" for name in ("recipe", "clutter", "frames", "width", "height")]
    made(["synthesize", "--library", str(run / "cad_library"), *options, "--seed", str(seed), "--no-depth-noise",
          "--out", str(folder / "truth")])  # fmt: skip
    made(["ingest", "--log", str(folder / "truth" / "log.mcap"), "--out", str(folder / "sequence")])
    return folder / "sequence"


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


def measured(folder: Path, seed: int, given: dict[str, str]) -> dict[str, dict[str, float]]:
    """Run both arms on a room and return arm -> measure -> value. Raises RuntimeError when a step fails."""
    found = {}
    for arm in ARMS:
        run = folder / arm
        reports = run_pipeline(pipeline_of(arm), run, given | {"seed": str(seed)}, announce=print)
        if reports[-1].exit_code != 0:
            raise RuntimeError(f"{arm}, seed {seed}: {reports[-1].name} ended with {reports[-1].exit_code}")
        metrics = json.loads((run / "evaluation" / "metrics.json").read_text())["metrics"]
        figures = depth_figures(run / "sequence", exact_depth(folder, run, seed, given))
        for measure in MEASURES:
            if measure in metrics and metrics[measure] is not None:
                figures[measure] = (100 if measure in SHARES else 1) * metrics[measure]
        found[arm] = {measure: round(value, 4) for measure, value in figures.items()}
    return found


def table(metrics: dict[str, float]) -> str:
    """Return the table of all rooms, in Markdown."""
    rooms = sorted({key.split("/")[1] for key in metrics}, key=lambda name: int(name.removeprefix("room_")))
    heads = [f"{room.replace('_', ' ')}, {arm.replace('_', ' ')}" for room in rooms for arm in ARMS]
    lines = ["| | " + " | ".join(heads) + " |", "|---|" + "---|" * len(heads)]
    for measure, words in MEASURES.items():
        values = [metrics.get(f"{arm}/{room}/{measure}") for room in rooms for arm in ARMS]
        lines.append(f"| {words} | " + " | ".join("-" if v is None else f"{v:.3g}" for v in values) + " |")
    return "\n".join(lines) + "\n"


def main() -> None:
    """Run both arms on every room."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--seeds", type=int, nargs="+")
    parser.add_argument("--quick", action="store_true", help="one room, few small frames")
    options = parser.parse_args()
    given = QUICK if options.quick else GIVEN
    kept = options.out / "metrics.json"
    metrics: dict[str, float] = json.loads(kept.read_text()) if kept.exists() else {}
    for seed in options.seeds or (QUICK_SEEDS if options.quick else SEEDS):
        for arm, figures in measured(options.out / f"room_{seed}", seed, given).items():
            metrics |= {f"{arm}/room_{seed}/{measure}": value for measure, value in figures.items()}
        kept.write_text(json.dumps(metrics, indent=1, sort_keys=True) + "\n")
        (options.out / "table.md").write_text(table(metrics))
    print(table(metrics))


if __name__ == "__main__":
    main()
