"""Suturing, for the page: the needle in both eyes, the thread, the strip of a trial, what ended trials, figure 4.1."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from scenewright.schemas.artifact import Artifact
from scenewright.schemas.outside import LARGEST_SHOWN, file_text
from scenewright.schemas.suture_needle import NeedleFrame, SutureNeedle, SutureThread
from scenewright.schemas.suture_trial import SutureEvaluation, SutureRun, SutureTrial
from scenewright.stages.report.images import Picture, from_file
from scenewright.stages.report.page import Page

WIDTH = 1100
"""Largest width of pictures [px]."""
MOST_PICTURES = 6
"""Most pictures that are shown of an artifact."""
MOST_RUNS = 60
"""Most runs that are listed."""
CLASSES = {"I": "insertion", "E": "extraction", "H": "handover", "T": "thread"}
THROWS = 6
"""Sutures that close the wound of the simulator."""
CAPTIONS = {
    "sutures": "Figure 4.1: share of trials by sutures to failure",
    "needle": "Errors of the poses; the box is the grasp tolerance (1 mm, 10 degrees)",
}


@dataclass(frozen=True)
class NeedleRow:
    """A frame's needle."""

    frame: str
    known: bool
    text: str


@dataclass(frozen=True)
class RunRow:
    """A trial."""

    arm: str
    seed: int
    sutures: int
    seconds: str
    errors: str
    ended: str
    closed: bool


@dataclass(frozen=True)
class SutureView:
    """Everything the page says about suturing."""

    needle: str
    needle_from: str
    needle_rows: tuple[NeedleRow, ...]
    needle_pictures: tuple[tuple[Picture, str], ...]
    thread: str
    thread_pictures: tuple[tuple[Picture, str], ...]
    trial: str
    strip: Picture | None
    strip_text: str
    runs: tuple[RunRow, ...]
    runs_left_out: int
    assumed: tuple[str, ...]
    plots: tuple[tuple[Picture, str], ...]
    tables: tuple[tuple[str, tuple[tuple[str, ...], ...]], ...]
    """Title and rows; the first row is the head."""
    notes: tuple[str, ...]


def suture_view(
    needle: SutureNeedle | None,
    thread: SutureThread | None,
    trial: SutureTrial | None,
    evaluation: SutureEvaluation | None,
    width: int,
) -> SutureView:
    """Read what there is; pictures are at most `width` wide [px]. Raises BadInput for a picture that cannot be read."""
    poses = needle.info if needle is not None else None
    curves = thread.info if thread is not None else None
    file = trial.info if trial is not None else None
    metrics = evaluation.info if evaluation is not None else None
    rows = () if poses is None else tuple(_needle_row(frame) for frame in poses.frames)
    if poses is not None and poses.filtered is not None:
        text = poses.filtered.abstained or "one pose from all frames"
        rows = (*rows, NeedleRow("filtered", not poses.filtered.abstained, text))
    strip = None
    if trial is not None and trial.path("strip.png").is_file():
        strip = from_file(trial.path("strip.png"), "the motions of a trial", 2 * width)
    return SutureView(
        needle="" if poses is None else poses.statement,
        needle_from="" if poses is None else f"masks: {poses.masks_from}; estimator: {poses.estimator}",
        needle_rows=rows,
        needle_pictures=_pictures(needle, "needle", width),
        thread="" if curves is None else f"{curves.statement}; masks: {curves.masks_from}",
        thread_pictures=_pictures(thread, "thread", width),
        trial="" if file is None else file.statement,
        strip=strip,
        strip_text=""
        if file is None
        else f"{file.recorded_arm}, seed {file.recorded_seed}: a suture's motions, a "
        "to k of the thesis's figure 3.2, from the cameras and from above",
        runs=() if file is None else tuple(_run_row(run) for run in file.runs[:MOST_RUNS]),
        runs_left_out=0 if file is None else max(0, len(file.runs) - MOST_RUNS),
        assumed=() if file is None else tuple(source.arm for source in file.perception if not source.measured),
        plots=_plots(evaluation, width),
        tables=() if evaluation is None else tables_of(file_text(evaluation.path("table.md"), LARGEST_SHOWN)),
        notes=() if metrics is None else (metrics.label, *metrics.notes),
    )


def _needle_row(frame: NeedleFrame) -> NeedleRow:
    estimate = frame.estimate
    if estimate.abstained:
        return NeedleRow(str(frame.frame), False, estimate.abstained)
    text = f"tip and swage {100 * estimate.tip_probability:.0f} % sure"
    if estimate.covariance is not None:
        covariance = np.array(estimate.covariance)
        shift, turn = (
            float(np.sqrt(np.linalg.eigvalsh(part)[-1])) for part in (covariance[:3, :3], covariance[3:, 3:])
        )
        text = f"known to {1000 * shift:.2f} mm and {np.degrees(turn):.1f} degrees (1 sigma), {text}"
    return NeedleRow(str(frame.frame), True, text)


def _run_row(run: SutureRun) -> RunRow:
    closed = run.sutures >= THROWS
    ended = "the wound is closed" if closed else ""
    if run.errors and not closed:
        ended = f"{CLASSES[run.errors[-1]]}: {run.reasons[-1]}"
    return RunRow(run.arm, run.seed, run.sutures, f"{run.seconds:.0f}", run.errors or "none", ended, closed)


def _pictures(artifact: Artifact | None, subject: str, width: int) -> tuple[tuple[Picture, str], ...]:
    if artifact is None:
        return ()
    paths = sorted(artifact.path("pictures").glob("*.png"))[:MOST_PICTURES]
    return tuple(
        (from_file(path, f"{subject}, frame {int(path.stem)}", width), f"frame {int(path.stem)}") for path in paths
    )


def _plots(evaluation: SutureEvaluation | None, width: int) -> tuple[tuple[Picture, str], ...]:
    if evaluation is None:
        return ()
    paths: list[Path] = [path for name in CAPTIONS if (path := evaluation.path(f"plots/{name}.png")).is_file()]
    return tuple((from_file(path, CAPTIONS[path.stem], width), CAPTIONS[path.stem]) for path in paths)


def tables_of(markdown: str) -> tuple[tuple[str, tuple[tuple[str, ...], ...]], ...]:
    """Return the tables of a Markdown text with the heading above each; emphasis marks are taken off."""
    title, rows, tables = "", [], []
    for line in [*markdown.splitlines(), ""]:
        if line.startswith("|"):
            cells = tuple(cell.strip().strip("*") for cell in line.strip().strip("|").split("|"))
            if not all(set(cell) <= set("-: ") for cell in cells):
                rows.append(cells)
            continue
        if rows:
            tables.append((title, tuple(rows)))
            rows = []
        if line.startswith("#"):
            title = line.lstrip("# ").strip()
    return tuple(tables)


def view(page: Page) -> dict[str, Any]:
    """Return what there is of suturing: needle, thread, trial, figures."""
    values = suture_view(
        page.given("suture_needle", SutureNeedle),
        page.given("suture_thread", SutureThread),
        page.given("suture_trial", SutureTrial),
        page.given("suture_evaluation", SutureEvaluation),
        WIDTH,
    )
    return {"suture": values}
