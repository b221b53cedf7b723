"""Disparity: the sequence with its depth, and beside every picture what was matched and how sure of it."""

from __future__ import annotations

from scenewright.cli.viewing.sequence_view import MAXIMUM_FRAMES, draw_sequence
from scenewright.schemas.disparity import Disparity, DisparityFile
from scenewright.stages.kit.formats.disparity_file import DisparityReader
from scenewright.stages.kit.formats.foxglove import encode_jpeg
from scenewright.stages.kit.formats.frames import FrameReader
from scenewright.stages.kit.stereo.pictures import confidence_colors, disparity_colors
from scenewright.stages.kit.viewing.canvas import Canvas


def draw_disparity(disparity: Disparity, canvas: Canvas) -> None:
    """Draw the sequence, disparity and confidence over time, and what the check of the rows said."""
    draw_sequence(disparity, canvas)
    with (
        FrameReader(disparity.path("frames.mcap")) as reader,
        DisparityReader(disparity.path("disparity.mcap")) as maps,
    ):
        every = max(1, -(-len(reader) // MAXIMUM_FRAMES))
        stamps = reader.stamps
        for frame in reader.frames((), every=every):
            disparity_map = maps.read(int(stamps[frame.index]))
            canvas.time(frame.time)
            canvas.picture(f"{frame.camera_name}/disparity", encode_jpeg(disparity_colors(disparity_map.disparity)))
            canvas.picture(f"{frame.camera_name}/confidence", encode_jpeg(confidence_colors(disparity_map.confidence)))
    canvas.always()
    canvas.document("rows", rows_text(disparity.matching))


def rows_text(file: DisparityFile) -> str:
    """Return how the pairs were matched and whether they were rectified, in Markdown."""
    lines = [file.detail, ""]
    for row in file.rows:
        row_text = f"**{row.camera}**: {row.verdict.replace('_', ' ')}, {row.matches} matched features"
        if row.row_error is not None:
            row_text += f", rows {row.row_error:.2f} px apart (90 %: {row.row_error_90:.2f} px)"
        if row.verdict in ("corrected", "not_rectified"):
            row_text += f"; with a small turn of the right eye {row.corrected_row_error:.2f} px"
        lines.append(f"- {row_text}")
    if file.left_out:
        lines.append(f"- left out: {', '.join(f'{count} {reason}' for reason, count in sorted(file.left_out.items()))}")
    return "\n".join(lines)
