"""A splat for the page: the whole as it turns, and pictures beside the camera's."""

from __future__ import annotations

from typing import Any

from scenewright.schemas.splat import SplatViews
from scenewright.stages.report.images import animation, from_file
from scenewright.stages.report.page import Page

WIDTH, MOST_PICTURES = 1100, 4
"""Width of pictures [px], and most of them that are shown."""


def view(page: Page) -> dict[str, Any] | None:
    """Return the figures and pictures, or None without them. Raises BadInput for a picture that cannot be read."""
    views = page.given("splat_views", SplatViews)
    if views is None:
        return None
    drawn_views = [
        (each, path) for each in views.info.views if (path := views.path(f"pictures/{each.frame:06d}.png")).is_file()
    ]
    count = min(MOST_PICTURES, len(drawn_views))
    moving = views.path("turntable.gif")
    words = "what the camera saw, what the splat shows, how the depths differ"
    return {
        "file": views.info,
        "pictures": [
            {"frame": each.frame, "use": each.use, "psnr": each.psnr, "image": from_file(path, words, WIDTH)}
            for each, path in (drawn_views[len(drawn_views) * k // count] for k in range(count))
        ],
        "moving": animation(moving, "the splat as it turns") if moving.is_file() else None,
    }
