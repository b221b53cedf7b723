"""The step `suture evaluate`: trials in the layout of table 4.1 and figure 4.1; poses and threads against the truth."""

from __future__ import annotations

import numpy as np
from scenewright.schemas.errors import BadInput
from scenewright.schemas.evaluation import MetricsFile
from scenewright.schemas.suture_needle import SutureNeedle, SutureThread
from scenewright.schemas.suture_scene import StereoRigRecord, SutureScene, SutureSceneFile, SutureView
from scenewright.schemas.suture_trial import SutureEvaluation, SutureTrial
from scenewright.stages.kit.formats.numpy_files import read_arrays
from scenewright.stages.kit.stage import Context
from scenewright.stages.suture.evaluation import needle_figures, trial_figures
from scenewright.stages.suture.evaluation.judgement import Estimate, NeedleTruth, judged
from scenewright.stages.suture.evaluation.thread_figures import ThreadError, thread_error, thread_metrics, thread_rows
from scenewright.stages.suture.needle.records import as_estimate
from scenewright.stages.suture.parameters import EvaluateParameters
from scenewright.stages.suture.rig import NeedlePose

ROUNDING = 1e-9
"""Baselines that differ by less than this are the same [m]."""


def run(
    trials: SutureTrial | None,
    scene: SutureScene | None,
    needle: SutureNeedle | None,
    needle_thesis: SutureNeedle | None,
    thread: SutureThread | None,
    *,
    parameters: EvaluateParameters,
    context: Context,
) -> SutureEvaluation:
    """Write metrics.json, table.md and the plots of whatever is given."""
    from scenewright.stages.suture.evaluation import plots

    figures: dict[str, float | None] = {}
    sections: list[str] = []
    notes: list[str] = []
    (context.output / "plots").mkdir()
    if trials is not None:
        file = trials.info
        figures.update(trial_figures.metrics(file.runs))
        sections.append(trial_figures.table(file.runs).rstrip())
        notes += [
            f"{sight.arm} sees by {sight.model}: ASSUMED figures" for sight in file.perception if not sight.measured
        ]
        with context.progress.step("histogram"):
            plots.histogram(context.output / "plots" / "sutures.png", file.runs)
    if scene is not None:
        truth = scene.truth
        poses = [estimated for estimated in (needle_thesis, needle) if estimated is not None]
        groups = _groups([record for estimated in poses for record in judge(estimated, truth)])
        if groups:
            figures.update(needle_figures.metrics(groups))
            sections.append("\n".join(["# The needle's pose", "", *needle_figures.rows("case", groups)]))
            notes += [f"needle: masks are {estimated.info.masks_from}" for estimated in poses[:1]]
            with context.progress.step("errors"):
                plots.pose_errors(context.output / "plots" / "needle.png", groups)
        if thread is not None:
            errors = thread_errors(thread, scene)
            figures.update(thread_metrics(errors))
            sections.append("\n".join(["# The thread", "", *thread_rows(errors)]))
            notes.append(f"thread: masks are {thread.info.masks_from}")
    label = parameters.label or "simulated and rendered; nothing here is about real tissue"
    MetricsFile(label=label, metrics=dict(sorted(figures.items())), notes=tuple(notes)).write(
        context.output / "metrics.json"
    )
    remarks = [f"{label}.", *(f"{note}." for note in notes)]
    context.output.joinpath("table.md").write_text("\n\n".join([*sections, *remarks]) + "\n", encoding="utf-8")
    return SutureEvaluation(root=context.output, summary={"figures": len(figures), "tables": len(sections)})


def same_rig(rig: StereoRigRecord, other: StereoRigRecord) -> bool:
    """Whether two rigs are one but for the rounding of a calibration matrix."""
    return rig.camera == other.camera and abs(rig.baseline - other.baseline) < ROUNDING


def judge(needle: SutureNeedle, truth: SutureSceneFile) -> list[Estimate]:
    """Return every frame's estimate, and the filtered one, beside the truth. Raises BadInput for another scene's."""
    file = needle.info
    if not same_rig(file.rig, truth.rig):
        raise BadInput(f"{needle.root}: its rig is not the scene's", hint="give the scene that the needle was seen in")
    records = []
    for record in file.frames:
        view = _view(truth, record.frame, needle)
        records.append(
            judged(file.estimator, "frames", view.seed, _true(truth, record.frame), as_estimate(record.estimate))
        )
    if file.filtered is not None:
        last = file.frames[-1].frame
        records.append(judged(file.estimator, "filtered", truth.seed, _true(truth, last), as_estimate(file.filtered)))
    return records


def _view(truth: SutureSceneFile, frame: int, needle: SutureNeedle) -> SutureView:
    if frame >= len(truth.views):
        raise BadInput(
            f"{needle.root}: frame {frame} is not among the scene's {len(truth.views)}",
            hint="give the scene that the needle was seen in",
        )
    return truth.views[frame]


def _true(truth: SutureSceneFile, frame: int) -> NeedleTruth:
    view = truth.views[frame]
    return NeedleTruth(NeedlePose(np.array(view.camera_from_needle)), view.holder, view.place, view.seen)


def _groups(records: list[Estimate]) -> dict[str, list[Estimate]]:
    """Return the issue's cases that the records fill."""
    frames = [record for record in records if record.case == "frames"]
    fused = [record for record in records if record.case == "filtered"]
    by_name = {
        "needle_visible": [record for record in frames if record.visible],
        "needle_all": frames,
        "needle_visible_filtered": [record for record in fused if record.visible],
        "needle_all_filtered": fused,
    }
    return {name: of_case for name, of_case in by_name.items() if of_case}


def thread_errors(thread: SutureThread, scene: SutureScene) -> list[ThreadError]:
    """Return every frame's error of the thread. Raises BadInput for another scene's, or arrays that are not there."""
    file = thread.info
    errors = []
    for record in file.frames:
        if record.frame >= len(scene.truth.views):
            raise BadInput(
                f"{thread.root}: frame {record.frame} is not in the scene", hint="give the thread's own scene"
            )
        (true,) = read_arrays(scene.path("threads.npz"), f"thread_{record.frame:06d}", shapes=("N 3",))
        points = np.zeros((0, 3))
        if record.points:
            (points,) = read_arrays(thread.path("threads.npz"), f"points_{record.frame:06d}", shapes=("N 3",))
        errors.append(thread_error(points, record.length, true))
    return errors
