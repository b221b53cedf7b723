"""The compiled rasteriser of splats beside the reference, a plain torch loop over tiles, in the same run.

    python -m benchmarks.speed.splatting [--out FOLDER] [--quick]

Gaussians stand in front of the camera, all within the picture, and cover it as a trained room does: an alpha of about
0.9, a few pixels wide each. Colour has harmonics of degree 3; the derivatives by colour, depth and alpha are random.
Times are medians; `growth` is by Gaussians at 320x240 and by pixels at 20,000 Gaussians. `training` is the peak memory
of a process that trains so many Gaussians on one picture, over that of one that trains hardly any.
"""

from __future__ import annotations

import multiprocessing
import os
import resource
import time
from dataclasses import replace

import numba
import numpy as np
from scenewright.schemas.scene_parts import Camera
from scenewright.stages.kit.rendering.splatting.compiled import CompiledRasterizer
from scenewright.stages.kit.rendering.splatting.gaussians import Gaussians
from scenewright.stages.kit.rendering.splatting.rasterizer import Picture, Rasterizer, View
from scenewright.stages.kit.rendering.splatting.reference import ReferenceRasterizer
from scenewright.stages.splat.build_stage import method_of
from scenewright.stages.splat.seeding import Seeds
from scenewright.stages.splat.trainer import Trainer
from scenewright.stages.splat.views import PosedView

from benchmarks.options import Measurement, asked
from benchmarks.results import write_measured

SIZES = ((160, 120), (320, 240), (640, 480))
COUNTS = (5_000, 20_000, 80_000)
TRAINED = (1_000, 250_000, 1_000_000)
MIDDLE = ((320, 240), 20_000)
AIM_SECONDS = 0.2
WIDTH_OF_ALL = 1.3
"""Standard deviation of a Gaussian in a picture that 20,000 cover, in pixels of one 320 wide."""


def gaussians_of(count: int) -> Gaussians:
    """Return Gaussians within the picture of `camera_of`, float32."""
    random = np.random.default_rng(0)
    depth = random.uniform(1.5, 4.0, count)
    across, along = random.uniform(-0.57, 0.57, count), random.uniform(-0.43, 0.43, count)
    width = WIDTH_OF_ALL * np.sqrt(20_000 / count) * depth / 280.0
    arrays = (
        np.stack([across * depth, along * depth, depth], axis=1),
        random.normal(size=(count, 4)),
        np.log(width)[:, None] + random.normal(0, 0.3, (count, 3)),
        random.normal(0.5, 1.0, count),
        random.normal(0, 0.2, (count, 16, 3)),
        np.zeros((count, 0)),
    )
    return Gaussians(*(array.astype(np.float32) for array in arrays))


def camera_of(size: tuple[int, int]) -> Camera:
    """Return a camera of this size with the same field of view."""
    focal = 280.0 * size[0] / 320
    return Camera(width=size[0], height=size[1], fx=focal, fy=focal, cx=(size[0] - 1) / 2, cy=(size[1] - 1) / 2)


def timed(rasterizer: Rasterizer, count: int, size: tuple[int, int], repeats: int) -> dict[str, float]:
    """Return the median seconds of forward, backward and both, and the mean alpha."""
    gaussians, view = gaussians_of(count), View(camera_of(size), np.eye(4))
    random, shape = np.random.default_rng(1), (size[1], size[0])
    by = Picture(
        random.normal(size=(*shape, 3)).astype(np.float32),
        random.normal(size=shape).astype(np.float32),
        random.normal(size=shape).astype(np.float32),
        np.zeros((*shape, 0), np.float32),
    )
    forward, backward, alpha = [], [], 0.0
    for _ in range(repeats):
        started = time.perf_counter()
        drawn = rasterizer.draw(gaussians, view)
        between = time.perf_counter()
        drawn.backward(by)
        forward.append(between - started)
        backward.append(time.perf_counter() - between)
        alpha = float(drawn.picture.alpha.mean())
    both = np.array(forward) + np.array(backward)
    return {
        "forward": float(np.median(forward)),
        "backward": float(np.median(backward)),
        "both": float(np.median(both)),
        "alpha": alpha,
    }


def training_peak(count: int) -> float:
    """Return the peak memory [MB] of this process after training so many Gaussians a little, colours of degree 3."""
    width, height = MIDDLE[0]
    color, depth = np.full((height, width, 3), 0.5, np.float32), np.full((height, width), 3.0, np.float32)
    flat = replace(gaussians_of(count), harmonics=np.zeros((count, 1, 3), np.float32))
    seeds = Seeds(flat, np.zeros(count, bool))
    method = replace(method_of("ours"), seed=lambda *_: seeds, degree_every=1)
    trainer = Trainer(method, CompiledRasterizer(), np.random.default_rng(0))
    trainer.add_view(PosedView(0, 0.0, "camera", camera_of(MIDDLE[0]), color, depth, np.eye(4)))
    for _ in range(5):
        trainer.step()
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024 / 1e6


def memory() -> dict[str, float]:
    """Return `training/<Gaussians>/memory` [MB] over a process with hardly any, each in a process of its own."""
    peaks = []
    for count in TRAINED:
        with multiprocessing.get_context("spawn").Pool(1) as pool:
            peaks.append(pool.apply(training_peak, (count,)))
    return {f"training/{count}/memory": peak - peaks[0] for count, peak in zip(TRAINED[1:], peaks[1:], strict=True)}


def measure(repeats: int) -> dict[str, float]:
    """Return `<arm>/<Gaussians>x<width>/<measure>`."""
    compiled, metrics = CompiledRasterizer(), {}
    timed(compiled, 100, (32, 32), 1)  # compiles, or loads what was compiled
    cases = [(MIDDLE[0], count) for count in COUNTS] + [(size, MIDDLE[1]) for size in SIZES if size != MIDDLE[0]]
    for size, count in cases:
        for name, value in timed(compiled, count, size, repeats).items():
            metrics[f"compiled/{count} at {size[0]}x{size[1]}/{name}"] = value
    middle = f"{MIDDLE[1]} at {MIDDLE[0][0]}x{MIDDLE[0][1]}"
    for name, value in timed(ReferenceRasterizer(), MIDDLE[1], MIDDLE[0], 1).items():
        metrics[f"torch loop/{middle}/{name}"] = value
    metrics[f"torch loop/{middle}/over compiled"] = (
        metrics[f"torch loop/{middle}/both"] / metrics[f"compiled/{middle}/both"]
    )
    return metrics


def table(metrics: dict[str, float]) -> str:
    """Return the figures as Markdown."""
    lines = ["| arm | case | forward [ms] | backward [ms] | both [ms] |", "|---|---|---|---|---|"]
    for arm, case in dict.fromkeys(tuple(name.split("/")[:2]) for name in metrics):
        times = [f"{1000 * metrics[f'{arm}/{case}/{name}']:.1f}" for name in ("forward", "backward", "both")]
        lines.append(f"| {arm} | {case} | {' | '.join(times)} |")
    return "\n".join(lines) + (
        f"\n\nAim: {1000 * AIM_SECONDS:.0f} ms on two cores for both, 20,000 Gaussians at 320x240. "
        f"{numba.get_num_threads()} threads; load average {os.getloadavg()[0]:.1f} at the end.\n"
    )


def main() -> None:
    """Measure, print the table, write metrics.json and table.md."""
    numba.config.THREADING_LAYER = "omp"  # type: ignore[attr-defined] # the default probes TBB first and warns
    arguments = asked(Measurement)
    metrics, trained = measure(3 if arguments.quick else 15), memory()
    lines = [f"- {name.split('/')[1]} Gaussians in training: {value:.0f} MB" for name, value in trained.items()]
    write_measured(arguments.out, metrics | trained, table(metrics) + "\n" + "\n".join(lines) + "\n")


if __name__ == "__main__":
    main()
