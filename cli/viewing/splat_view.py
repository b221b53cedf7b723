"""Pictures of splats beside the camera's, with their figures."""

from __future__ import annotations

from schemas.outside import LARGEST_SHOWN, file_content
from schemas.splat import SplatViews
from stages.kit.viewing.canvas import Canvas


def draw_splat_views(views: SplatViews, canvas: Canvas) -> None:
    """Show every compared picture, and the figures of all as they stand in views.json."""
    canvas.document("views", f"```\n{views.info.model_dump_json(indent=1)}\n```")
    for picture in sorted(views.path("pictures").glob("*.png")):
        canvas.picture(f"pictures/{picture.stem}", file_content(picture, LARGEST_SHOWN))
