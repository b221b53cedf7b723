"""The commands of suturing in a row, as a user runs them: an example of few views and trials.

Two scenes, one of separate views and one of a needle that moves, go through `disparity`, `suture needle` (the thesis's
estimator and ours) and `suture thread`; trials of every arm through `suture simulate`; each through `suture evaluate`,
and all of it into one report. Steps that are up to date are not run again.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from pathlib import Path

from pydantic import Field
from scenewright.stages.kit.stage import Parameters
from scenewright.stages.suture import ARM_NAMES

from benchmarks.experiment import Bench, Experiment, Results, Trial
from benchmarks.steps import made

CHAIN, SEED = "chain", "2000"
"""Of scenes and trials; no other part uses seeds from here on."""


class ChainParameters(Parameters):
    """Options of the experiment."""

    views: int = Field(12, ge=1, description="Separate views")
    frames: int = Field(10, ge=1, description="Frames of a needle that moves")
    trials: int = Field(25, ge=1, description="Trials an arm")


def measure(bench: Bench, trials: Sequence[Trial]) -> Iterator[tuple[Trial, dict[str, float]]]:
    """Run all commands and yield the figures of their evaluations."""
    out, asked = bench.out, bench.parameters
    see(out / "views", "views", asked.views)
    see(out / "motion", "motion", asked.frames)
    arms = [word for arm in ARM_NAMES for word in ("--arms", arm)]
    made("suture simulate", out / "trials", *arms, "--trials", asked.trials, "--seed", SEED, "--record", "ours")
    made("suture evaluate", out / "evaluation", "--trials", out / "trials")
    made(
        "report",
        out / "report",
        "--sequence",
        out / "motion" / "disparity",
        "--suture-needle",
        out / "motion" / "needle",
        "--suture-thread",
        out / "motion" / "thread",
        "--suture-trial",
        out / "trials",
        "--suture-evaluation",
        out / "evaluation",
    )
    figures: dict[str, float] = {}
    for part, folder in (("views_", out / "views"), ("motion_", out / "motion"), ("", out)):
        told = json.loads((folder / "evaluation" / "metrics.json").read_text(encoding="utf-8"))["metrics"]
        for name, value in told.items():
            arm, case, figure = name.split("/")
            figures[f"{arm}/chain_{part}{case}/{figure}"] = value
    yield trials[0], figures


def see(folder: Path, arrangement: str, frames: int) -> None:
    """Render a scene and run everything that looks at it, below `folder`."""
    scene, seen = folder / "scene", ("--sequence", folder / "scene")
    made("suture scene", scene, "--frames", frames, "--arrangement", arrangement, "--seed", SEED)
    disparity = ("--disparity", made("disparity", folder / "disparity", *seen))
    needle = made("suture needle", folder / "needle", *seen, *disparity)
    words = ("--estimator", "thesis", "--pictures", "0")
    rival = made("suture needle", folder / "needle_thesis", *seen, *disparity, *words)
    thread = made("suture thread", folder / "thread", *seen, "--needle", needle)
    given = ("--scene", scene, "--needle", needle, "--needle-thesis", rival, "--thread", thread)
    made("suture evaluate", folder / "evaluation", *given)


def more_figures(results: Results) -> dict[str, float]:
    """The example's figures; their cases begin with `chain_`."""
    return dict(next(iter(results.records.values())))


EXPERIMENT = Experiment(
    name="stitch_chain",
    title="The commands of suturing in a row",
    simulated="Everything.",
    knows="What each command is given.",
    does_not_show="More than that the commands fit together: few views, few trials.",
    arms={CHAIN: CHAIN},
    cases=(CHAIN,),
    reporting=(SEED,),
    measure=measure,
    record=dict[str, float],
    measures={},
    more_figures=more_figures,
    parameters=ChainParameters,
    quick={"views": 2, "frames": 2, "trials": 3},
    keeps=False,
)
