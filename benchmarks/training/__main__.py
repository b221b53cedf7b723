"""`make train-network`: library, frames, training, validation; a part that is there is kept, training goes on.

    python -m benchmarks.training --out FOLDER [--device cuda] [--workers N] [--quick]

Writes FOLDER/run/panoptic.safetensors, metrics.json and table.md. `--quick` proves the recipe in a minute or two: a few
frames, a few steps, and figures that mean nothing.
"""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

from pydantic import Field
from scenewright.schemas.vocabulary import load_vocabulary
from scenewright.stages.engine.chain import run_command
from scenewright.stages.kit.measurement.panoptic_quality import average_quality
from scenewright.stages.segment.backends.network.backend import load_predictor

from benchmarks.options import Recipe, asked
from benchmarks.results import write_measured
from benchmarks.training.real_frames import PLACES
from benchmarks.training.samples import FrameSet
from benchmarks.training.validation import KNOWN, quality_of

LIBRARY_SEED, LIBRARY_SHAPES = 41, 12
"""Seed and shapes of every class of the training's own library; other experiments use seeds 0 and 1."""
QUICK_STEPS, QUICK_SHAPES = 12, 3


class Options(Recipe):
    """Options."""

    data: Path = Field(Path("../shared/data"), description="Folder with the recordings; without them no real frames")
    device: str = Field("cpu", description="Of the training: cpu, or cuda")
    threads: int = Field(1, description="Of the training; 1 gives the same bytes again")
    workers: int = Field(1, description="Processes that make frames")


def main() -> int:
    """Run the recipe."""
    arguments = asked(Options)
    out: Path = arguments.out
    shapes = str(QUICK_SHAPES if arguments.quick else LIBRARY_SHAPES)
    code, _ = run_command(
        ["library", "build", "--out", str(out / "library"), "--seed", str(LIBRARY_SEED)]
        + ["--shapes-per-class", shapes, "--small-shapes-per-class", shapes]
    )
    if code:
        return code
    quick = ["--quick"] if arguments.quick else []
    if not (out / "data" / "done.json").is_file():
        made = ["--out", str(out / "data"), "--library", str(out / "library"), "--workers", str(arguments.workers)]
        _module("benchmarks.training.data", *made, *quick)
    real = []
    if all((arguments.data / place).is_dir() for place in PLACES):
        _module("benchmarks.training.real_frames", "--out", str(out / "real"), "--data", str(arguments.data))
        real = ["--real", str(out / "real")]
    steps = ["--steps", str(QUICK_STEPS), "--batch", "4"] if arguments.quick else []
    train = ["--data", str(out / "data"), "--out", str(out / "run"), "--threads", str(arguments.threads), *real]
    _module("benchmarks.training.train", *train, "--device", arguments.device, *steps)
    weights = out / "run" / "panoptic.safetensors"
    predictor = load_predictor(weights, load_vocabulary())
    frames = FrameSet(out / "data" / "validation")
    metrics: dict[str, float] = {}
    lines = ["| shown | PQ | SQ | RQ | classes |", "|---|---|---|---|---|"]
    for name, known in KNOWN.items():
        sums = quality_of(predictor, frames, range(len(frames)), color=known.color, gravity=known.gravity)
        mean = average_quality(sums.values())
        values = {"pq": mean.pq or 0.0, "sq": mean.sq or 0.0, "rq": mean.rq or 0.0}
        metrics |= {f"{name}/validation/{measure}": value for measure, value in values.items()}
        lines.append(f"| {name} | " + " | ".join(f"{100 * v:.1f}" for v in values.values()) + f" | {mean.classes} |")
    lines += ["", f"{predictor.checkpoint.description}; {len(frames)} validation frames."]
    write_measured(out, metrics, "\n".join(lines) + "\n")
    print(f"to ship it: cp {weights} data/networks/panoptic.safetensors")
    return 0


def _module(name: str, *arguments: str) -> None:
    subprocess.run([sys.executable, "-m", name, *arguments], check=True)


if __name__ == "__main__":
    sys.exit(main())
