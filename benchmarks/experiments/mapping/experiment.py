"""The panoptic map beside the thesis and Voxblox++ on generated rooms: tables 2.1 to 2.4, the same frames and masks."""

from __future__ import annotations

import os
from collections.abc import Sequence

from benchmarks.experiment import Bench, Experiment, Trial
from benchmarks.experiments.mapping.arms import CASES, EVERYWHERE, SHOWN, all_arms, settings
from benchmarks.experiments.mapping.figures_of_merit import MEASURES, more_figures
from benchmarks.experiments.mapping.measuring import MappingParameters, Outcome, measure
from benchmarks.experiments.mapping.printed import printed_by_the_thesis
from benchmarks.generated_rooms import (
    REPORTING,
    ROOMS,
    STEPS,
    TUNING,
    TUNING_UNTRAINED,
    make_library,
    room_of,
    with_draws,
)
from benchmarks.reporting_seeds import Method


def runs(arm: str, case: str) -> bool:
    """Not every arm runs in every case."""
    return case == SHOWN or arm in EVERYWHERE


def seeds_of(bench: Bench, case: str) -> Sequence[str]:
    """The rooms."""
    return (TUNING_UNTRAINED if bench.parameters.untrained else TUNING) if bench.tuning else with_draws(REPORTING)


def prepare(bench: Bench, trials: Sequence[Trial]) -> None:
    """Make the library, which all rooms share, before they are made beside each other."""
    make_library(bench.out / "rooms")


EXPERIMENT = Experiment(
    name="mapping",
    title="Panoptic maps of generated rooms",
    simulated="Rooms, walks, pictures, and depth with the noise of a structured-light camera; the masks are the true "
    "ones with errors put in, which last at the rates of segmenters on real frames (in older cases every frame has its "
    "own), but for the case network; poses are true, but drift in one case and are estimated in another.",
    knows="Colour, depth, poses, camera; the masks of the case, the same for every arm.",
    does_not_show="How it works on a real sensor's depth, with masks of a detector trained on photographs, or on rooms "
    "that people live in.",
    arms={arm.name: arm.title for arm in all_arms(0.02)},
    cases=CASES,
    runs=runs,
    tuning=TUNING,
    reporting=with_draws(REPORTING),
    cluster=room_of,
    seed_group=ROOMS,
    method=Method(("segment", "fuse", "graph"), {arm.name: settings(arm) for arm in all_arms(0.02)}),
    seeds_of=seeds_of,
    together=lambda trial: trial.seed,
    measure=measure,
    record=Outcome,
    measures=MEASURES,
    more_figures=more_figures,
    parameters=MappingParameters,
    places=frozenset({"untrained"}),
    quick_seeds=3,
    quick={"frames": 40},
    jobs=min(2, os.cpu_count() or 1),
    prepare=prepare,
    steps=("segment", "poses", "graph", *STEPS),
    pairs=(
        ("thesis_separate", "voxblox++"),
        ("thesis", "thesis_separate"),
        ("thesis", "voxblox++"),
        ("ours", "thesis"),
        ("ours", "thesis_chosen"),
    ),
    compared=("pq_rooms", "pq_fixed", "pq", "instance_ap", "box_ap", "box_ap_refined"),
    notes=printed_by_the_thesis,
)
