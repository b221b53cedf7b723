"""The agent: an episode as its transcript and the map that grew, an evaluation as its table."""

from __future__ import annotations

from scenewright.schemas.agent_episode import AgentEpisode, AgentEvaluation
from scenewright.schemas.outside import LARGEST_SHOWN, file_content, file_text
from scenewright.stages.kit.viewing.canvas import Canvas


def draw_agent_episode(episode: AgentEpisode, canvas: Canvas) -> None:
    """Show what was thought, done and seen, and the last map."""
    canvas.document("episode", file_text(episode.path("episode.txt"), LARGEST_SHOWN))
    canvas.picture("map", file_content(episode.path("map.png"), LARGEST_SHOWN))


def draw_agent_evaluation(evaluation: AgentEvaluation, canvas: Canvas) -> None:
    """Show the table."""
    canvas.document("table", file_text(evaluation.path("table.md"), LARGEST_SHOWN))
