"""The map from two sides."""

from __future__ import annotations

from typing import Any

from scenewright.schemas.panoptic_map import PanopticMap
from scenewright.stages.report.page import Page
from scenewright.stages.report.room import draw
from scenewright.stages.report.views import top_view


def view(page: Page) -> dict[str, Any] | None:
    """Return pictures of the map, none of an empty one, and what is in it."""
    panoptic_map, room = page.given("panoptic_map", PanopticMap), page.room
    if panoptic_map is None:
        return None
    info = panoptic_map.info
    text = (
        f"{len(info.entities)} entities in a map of {100 * info.voxel_size:g} cm voxels from "
        f"{info.frames_integrated} frames, masks: {info.segmentation}. Grey surface has no label. The near walls "
        "and the ceiling are cut away."
    )
    views = None
    if room.coloured is not None and room.oblique is not None:
        from_above = top_view(room.coloured, round(0.75 * room.width))
        views = {
            "oblique": draw(room.coloured, room.oblique, "The map, every instance in its colour", room.font_size(13.5)),
            "top": draw(room.coloured, from_above, "From above, y up", room.font_size(15.5)),
            "color": room.in_image_colours,
        }
    return {"map_text": text, "map_views": views}
