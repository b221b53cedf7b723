"""Evaluations, reports and exports: figures as a table, plots as pictures, notes as text."""

from __future__ import annotations

from scenewright.schemas.evaluation import Evaluation, Report
from scenewright.schemas.exported_scene import ExportedScene
from scenewright.schemas.exported_sequence import ExportedSequence
from scenewright.schemas.exported_trajectory import ExportedTrajectory
from scenewright.schemas.outside import LARGEST_SHOWN, file_content, file_text
from scenewright.stages.kit.viewing.canvas import Canvas


def draw_evaluation(evaluation: Evaluation, canvas: Canvas) -> None:
    """Show all figures and plots."""
    metrics = evaluation.info
    rows = [f"**{metrics.label}**", "", "| measure | value |", "|---|---|"]
    for name, value in sorted(metrics.metrics.items()):
        rows.append(f"| {name} | {'-' if value is None else f'{value:.4g}'} |")
    rows += ["", *(f"- {note}" for note in metrics.notes)]
    canvas.document("figures", "\n".join(rows))
    for table in sorted(evaluation.path("tables").glob("*.md")):
        canvas.document(f"tables/{table.stem}", file_text(table, LARGEST_SHOWN))
    for plot in sorted(evaluation.path("plots").glob("*.png")):
        canvas.picture(f"plots/{plot.stem}", file_content(plot, LARGEST_SHOWN))


def draw_report(report: Report, canvas: Canvas) -> None:
    """Say where the page is: it is made for a browser."""
    canvas.document("report", f"Open `{report.path('report.html')}` in a browser.")


def draw_exported_sequence(export: ExportedSequence, canvas: Canvas) -> None:
    """Say what was written: it is made for other tools."""
    info = export.info
    rows = [f"{info.frame_count} frames as {info.layout}: open `{export.path(info.log)}`", ""]
    canvas.document("export", "\n".join([*rows, *(f"- {note}" for note in info.notes)]))


def draw_exported_scene(export: ExportedScene, canvas: Canvas) -> None:
    """Say what was written: it is made for other tools."""
    info = export.info
    rows = [f"{info.bodies} bodies, {info.joints} joints as {info.target}: open `{export.path(info.file)}`", ""]
    canvas.document("export", "\n".join([*rows, *(f"- {note}" for note in info.notes)]))


def draw_exported_trajectory(export: ExportedTrajectory, canvas: Canvas) -> None:
    """Say what was written: it is made for controllers."""
    info = export.info
    rows = [
        f"{len(info.motions)} motions of {info.robot}, {info.statement}: open `{export.path('trajectory.csv')}`",
        "",
    ]
    rows += [f"- {motion.start:.1f} s: {motion.name}, {motion.seconds:.1f} s" for motion in info.motions]
    canvas.document("export", "\n".join(rows))
