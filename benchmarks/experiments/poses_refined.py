"""How far poses that drift are put right by `poses --method refine`, and where odometry alone would have ended.

Arms: `given`, the poses of a generated room with a drift that is a random walk; `refined`; `rgbd`, which does not look
at them. Cases: `drift` (a centimetre and 0.3 degrees over a metre of way), `far` (three times that), `sparse` (every
fifth picture), `blind` (depth alone).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from pydantic import Field
from scenewright.schemas.sequence import Sequence as SequenceArtifact
from scenewright.stages.kit.formats.trajectories import read_tum, write_tum
from scenewright.stages.kit.geometry.transforms import inverse
from scenewright.stages.kit.measurement.pose_error import associate, trajectory_error
from scenewright.stages.kit.registration.rigid_motion import between, distance_of
from scenewright.stages.kit.stage import Parameters

from benchmarks.drifting import drifting_poses
from benchmarks.experiment import Bench, Experiment, Trial, mean
from benchmarks.generated_rooms import STEPS, error_seed, make_room
from benchmarks.steps import made, opened, unrecorded

TUNING = ("kitchen-40",)
REPORTING = ("kitchen-1100", "office-1101", "bedroom-1102", "room-1103", "kitchen-1104")
SIZE = (320, 240)
GIVEN, REFINED, RGBD = "given", "refined", "rgbd"

Row = dict[str, float]


@dataclass(frozen=True)
class Case:
    """What is given."""

    drift: float = 1.0
    every: int = 1
    use_color: bool = True


CASES = {"drift": Case(), "far": Case(drift=3.0), "sparse": Case(every=5), "blind": Case(use_color=False)}


class RefinedParameters(Parameters):
    """Options of the experiment."""

    frames: int = Field(200, ge=10, description="Frames of a generated room")


def measure(bench: Bench, trials: Sequence[Trial]) -> Iterator[tuple[Trial, Row]]:
    """Yield the error of one room's paths."""
    room = make_room(bench.out / "rooms", trials[0].seed, bench.parameters.frames, size=SIZE)
    times, true = read_tum(room.sequence / "trajectory.tum")
    for trial in trials:
        case = CASES[trial.case]
        folder = bench.out / "rooms" / f"{room.folder.name}-drift{case.drift:g}"
        folder.mkdir(parents=True, exist_ok=True)
        given = drifting_poses(true, np.random.default_rng(error_seed(trial.seed)), case.drift)
        write_tum(folder / "trajectory.tum", times, given)
        options = ("--log", room.ground_truth / "log.mcap", "--trajectory", folder / "trajectory.tum")
        sequence = made("ingest", folder / f"every{case.every}", *options, "--every", case.every)
        found = read_tum(sequence / "trajectory.tum")
        if trial.arm != GIVEN:
            out = bench.folder(trial)
            out.mkdir(parents=True, exist_ok=True)
            method = {"method": "refine" if trial.arm == REFINED else "rgbd", "use_color": case.use_color}
            unrecorded("poses", out, method, sequence=opened(SequenceArtifact, sequence))
            found = read_tum(out / "trajectory.tum")
        yield trial, row_of(times, true, *found)


def row_of(times: np.ndarray, true: np.ndarray, found_times: np.ndarray, found: np.ndarray) -> Row:
    """Return the error [cm] of poses (M, 4, 4) after rigid alignment with true ones (N, 4, 4), and that of the last as
    seen from the first."""
    error = trajectory_error(times, true, found_times, found)
    rows, own = associate(times, found_times)
    off = inverse(between(true[rows[0]], true[rows[-1]])) @ between(found[own[0]], found[own[-1]])
    assert error is not None
    return {"ate_cm": 100 * error.rmse_aligned, "end_cm": 100 * distance_of(off)}


EXPERIMENT = Experiment(
    name="poses_refined",
    title="Given camera paths that drift, refined",
    simulated="Rooms, walks, pictures, noisy depth; the drift is a random walk, its size that which `refine` states.",
    knows="Colour, depth, camera and the poses that drift; `rgbd` not these.",
    does_not_show="Drift as a phone has it, which keeps the vertical and jumps; rolling shutters; one drift a room.",
    arms={GIVEN: "the given path", REFINED: "refined", RGBD: "odometry and loops"},
    cases=tuple(CASES),
    tuning=TUNING,
    reporting=REPORTING,
    seeds_of=lambda bench, case: TUNING if bench.tuning or bench.quick else REPORTING,
    together=lambda trial: trial.seed,
    measure=measure,
    record=Row,
    measures={"ate_cm": mean("ate_cm", "cm"), "end_cm": mean("end_cm", "cm")},
    parameters=RefinedParameters,
    quick={"frames": 60},
    steps=("poses", *STEPS),
)
