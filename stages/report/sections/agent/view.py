"""A session for the page: what was asked, thought, done and seen, with the map as it grew."""

from __future__ import annotations

from typing import Any

from scenewright.schemas.agent_episode import AgentEpisode, EpisodeTurn
from scenewright.stages.report.images import animation, from_file
from scenewright.stages.report.page import Page

WIDTH, MOST_ROWS = 1100, 80
"""Width of pictures [px], and most turns that are listed."""


def turn_row(number: int, turn: EpisodeTurn) -> dict[str, Any]:
    """Return the row of a turn: program, thought, and what came back."""
    came = [call.error.message if call.error is not None else call.returned for call in turn.calls]
    if turn.error is not None and turn.error.message not in came:
        came.append(turn.error.message)
    return {
        "number": number,
        "reason": turn.reason[:300],
        "code": turn.code[:600],
        "came": "; ".join(filter(None, came))[:600],
        "seconds": round(turn.seconds),
        "failed": turn.error is not None or any(text.startswith("False") for text in came),
    }


def view(page: Page) -> dict[str, Any] | None:
    """Return the session, or None without one. Raises BadInput for a picture that cannot be read."""
    episode = page.given("episode", AgentEpisode)
    if episode is None:
        return None
    file, picture = episode.info, episode.path("map.png")
    moving, views = episode.path("map.gif"), episode.path("views.png")
    return {
        "file": file,
        "model": file.language is not None,
        "rows": [turn_row(number, turn) for number, turn in enumerate(file.turns[:MOST_ROWS], 1)],
        "hidden": max(0, len(file.turns) - MOST_ROWS),
        "moving": animation(moving, "the map growing, turn by turn") if moving.is_file() else None,
        "views": from_file(views, "the last images of the wrist camera", WIDTH) if views.is_file() else None,
        "picture": from_file(picture, "the map as it grew", WIDTH) if picture.is_file() else None,
    }
