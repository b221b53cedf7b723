"""The compiled rasteriser of splats beside the reference, a plain torch loop over tiles, in the same run.

Gaussians stand in front of the camera, all within the picture, and cover it as a trained room does: an alpha of about
0.9, a few pixels wide each. Colour has harmonics of degree 3; the derivatives by colour, depth and alpha are random.
Times are medians over draws, by Gaussians at 320x240 and by pixels at 20,000 Gaussians. `training` is the peak memory
of a process that trains so many Gaussians on one picture, over that of one that trains hardly any.
"""

from __future__ import annotations

import resource
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace

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

from benchmarks.experiment import Bench, Experiment, Results, Trial, mean, median
from benchmarks.timing import Clock, alone

SIZES = ((320, 240), (160, 120), (640, 480))
COUNTS = (20_000, 5_000, 80_000)
MIDDLE = "20000 at 320x240"
PICTURES = {
    f"{count} at {size[0]}x{size[1]}": (count, size)
    for size in SIZES
    for count in COUNTS
    if count == COUNTS[0] or size == SIZES[0]
}
"""Case -> Gaussians and pixels; the first is the middle one."""
HARDLY_ANY, TRAINED = 1_000, {"250000": 250_000, "1000000": 1_000_000}
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


def drawings(
    rasterizer: Rasterizer, count: int, size: tuple[int, int], trials: Iterable[Trial]
) -> Iterable[tuple[Trial, dict[str, float]]]:
    """Yield the milliseconds of forward, backward and both of a draw for every trial, and the mean alpha."""
    gaussians, view = gaussians_of(count), View(camera_of(size), np.eye(4))
    random, shape = np.random.default_rng(1), (size[1], size[0])
    by = Picture(
        random.normal(size=(*shape, 3)).astype(np.float32),
        random.normal(size=shape).astype(np.float32),
        random.normal(size=shape).astype(np.float32),
        np.zeros((*shape, 0), np.float32),
    )
    for trial in trials:
        clock = Clock()
        with clock.lap():
            drawn = rasterizer.draw(gaussians, view)
        with clock.lap():
            drawn.backward(by)
        forward, backward = (1000 * seconds for seconds in clock.wall)
        alpha = float(drawn.picture.alpha.mean())
        yield trial, {"forward": forward, "backward": backward, "both": forward + backward, "mean alpha": alpha}


def training_peak(count: int) -> float:
    """Return the peak memory [MB] of this process after training so many Gaussians a little, colours of degree 3."""
    width, height = SIZES[0]
    color, depth = np.full((height, width, 3), 0.5, np.float32), np.full((height, width), 3.0, np.float32)
    flat = replace(gaussians_of(count), harmonics=np.zeros((count, 1, 3), np.float32))
    seeds = Seeds(flat, np.zeros(count, bool))
    method = replace(method_of("ours"), seed=lambda *_: seeds, degree_every=1)
    trainer = Trainer(method, CompiledRasterizer(), np.random.default_rng(0))
    trainer.add_view(PosedView(0, 0.0, "camera", camera_of(SIZES[0]), color, depth, np.eye(4)))
    for _ in range(5):
        trainer.step()
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024 / 1e6


def measure(bench: Bench, trials: Sequence[Trial]) -> Iterable[tuple[Trial, dict[str, float]]]:
    """Yield what each draw, and each training, took."""
    if trials[0].case in TRAINED:
        peaks = [alone(training_peak, count) for count in (HARDLY_ANY, TRAINED[trials[0].case])]
        yield trials[0], {"memory": peaks[1] - peaks[0]}
        return
    rasterizer = CompiledRasterizer() if trials[0].arm == "compiled" else ReferenceRasterizer()
    if trials[0].arm == "compiled":
        list(drawings(rasterizer, 100, (32, 32), trials[:1]))  # compiles, or loads what was compiled
    yield from drawings(rasterizer, *PICTURES[trials[0].case], trials)


def runs(arm: str, case: str) -> bool:
    """Whether an arm runs in a case: the torch loop, which is slow, in the middle one alone."""
    return case in TRAINED if arm == "training" else case == MIDDLE or (arm == "compiled" and case in PICTURES)


def over_compiled(results: Results) -> Mapping[str, float | None]:
    """Return the time of the torch loop over that of the compiled rasteriser."""
    ours, loop = (results.value(arm, MIDDLE, "both") for arm in ("compiled", "torch loop"))
    return {f"torch loop/{MIDDLE}/time over compiled": loop / ours if ours and loop else None}


EXPERIMENT = Experiment(
    name="speed_splatting",
    title="Splats drawn on a processor",
    simulated="Gaussians strewn over the picture, as wide as those of a trained room.",
    knows="Nothing to know.",
    does_not_show="A GPU. Real scenes, where Gaussians lie unevenly. Memory of training: pictures, which come on top.",
    arms={"compiled": "compiled", "torch loop": "torch loop", "training": "training"},
    cases=(*PICTURES, *TRAINED),
    seeds_of=lambda bench, case: ("1",) if case in TRAINED else [str(k) for k in range(1, 16)],
    quick_seeds=3,
    runs=runs,
    together=lambda trial: (trial.arm, trial.case),
    measure=measure,
    record=dict[str, float],
    measures={
        **{name: median(name, "ms", interval=False) for name in ("forward", "backward", "both")},
        "mean alpha": mean("mean alpha", interval=False),
        "memory": mean("memory", "MB", interval=False),
    },
    more_figures=over_compiled,
)
