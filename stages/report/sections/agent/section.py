"""Declaration of the section `agent`."""

from __future__ import annotations

from scenewright.schemas.agent_episode import AgentEpisode
from scenewright.stages.report.section import Section

SECTION = Section(
    "agent",
    "Robot told in words",
    order=85,
    reads={"episode": AgentEpisode},
    became={"episode": "a session of a robot"},
    alone="A robot told in words",
)
