"""The page's section about a session of the agent."""

from __future__ import annotations

from pathlib import Path

from scenewright.schemas.agent_episode import AgentEpisode
from scenewright.stages.agent.parameters import RunParameters
from scenewright.stages.agent.run_stage import run
from scenewright.stages.kit.progress import SilentProgress
from scenewright.stages.kit.stage import Context

from tests.unit.report.test_report import parse, report


def test_the_section_tells_the_session_and_that_no_model_was_asked(tmp_path: Path) -> None:
    (tmp_path / "e").mkdir()
    context = Context(output=tmp_path / "e", seed=7, device="cpu", progress=SilentProgress())
    made = run(None, None, None, None, parameters=RunParameters(task="prepare_cup", image_width=300), context=context)
    result = report(tmp_path / "report", episode=AgentEpisode(made.root))
    page = parse((tmp_path / "report" / "report.html").read_text())
    assert result.summary["pictures"] == 2 and "no language model was asked" in page.text
    assert made.info.words in page.text and all(turn.reason in page.text for turn in made.info.turns)
