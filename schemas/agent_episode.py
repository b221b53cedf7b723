"""Kinds `agent_episode`, one session of a robot that was told something, and `agent_evaluation`, many of them."""

from __future__ import annotations

from typing import ClassVar, Literal

from pydantic import Field
from scenewright.schemas.apartment import Apartment
from scenewright.schemas.artifact import Artifact, Document
from scenewright.schemas.base import Model, Seed
from scenewright.schemas.language import LanguageRecord
from scenewright.schemas.plan import Failure


class EpisodeCall(Model):
    """A call of the plan language, and what it returned in words."""

    name: str
    arguments: tuple[str, ...]
    returned: str
    error: Failure | None = None


class EpisodeTurn(Model):
    """A program of the brain and what came of it."""

    reason: str
    code: str
    calls: tuple[EpisodeCall, ...]
    printed: tuple[str, ...] = ()
    error: Failure | None = None
    seconds: float
    """Of the robot, when it was over."""
    base: tuple[float, float, float]
    """x, y [m], yaw [rad] where the robot stood then."""
    holding: str
    """Key of what it believed to hold."""


class EpisodeScore(Model):
    """What it truly came to, by the truth of the world."""

    success: bool
    claimed: bool
    executions: int
    executed: int
    """Executions that did what they were to do."""
    replanned: int
    """Executions of a step that had failed before."""
    recovered: int
    calls: int
    seconds: float
    metres: float
    failures: dict[str, tuple[int, int]]
    """Cause -> failures that nothing made good in a session that failed, and the others."""


class EpisodeFile(Model):
    """episode.json."""

    words: str
    task: str
    """Name of a built-in task; empty for words of the user's own."""
    arm: str
    brain: str
    """`rules`, `open loop rules`: no language model; or the label of the language backend."""
    seed: Seed
    simulation: Literal["fast", "physics"] = Field("fast", exclude_if=lambda world: world == "fast")
    """The world it happened in. Absent: the fast one."""
    failures: float
    """Factor of the rates at which executions fail, and of those of the eyes."""
    perception: float
    segmenter: str = Field("", exclude_if=lambda identity: not identity)
    """What the segmentation service says it is whose masks the robot saw by. Absent: an oracle with errors."""
    segmenter_errors: Literal["thesis", "detector", "network"] = Field(
        "thesis", exclude_if=lambda name: name == "thesis"
    )
    """Whose errors a simulated segmenter made. Absent: those that the thesis prints."""
    robot: str = Field("panda", exclude_if=lambda name: name == "panda")
    """Name of the robot, as its description has it. Absent: the Panda, or the fast world, where there is none."""
    room: str = Field("", exclude_if=lambda digest: not digest)
    """Content digest of the ground truth whose room the robot lived in, in physics. Absent: apartment.json is all."""
    most_turns: int = Field(ge=1)
    end: str
    """`done`, `give_up`, `ask`; `turns`, `time`, `repeats`: a limit; `brain`: no usable answer."""
    said: str
    """What the robot told the user at the end."""
    stopped: Failure | None = None
    understood: bool
    """Whether a judge of ours knows what the words ask for; otherwise `score.success` says nothing."""
    turns: tuple[EpisodeTurn, ...]
    score: EpisodeScore
    language: LanguageRecord | None = None


class MapThing(Model):
    """A thing or piece of furniture of the robot's map."""

    key: str
    label: str
    place: str
    """Furniture that it is on or in; empty for furniture."""
    on: str
    """Small carrier on which it lies."""
    position: tuple[float, float, float]
    size: tuple[float, float]
    """Over the ground, x and y [m]."""
    views: int
    """Regions of views that said something of it."""


class MapSnapshot(Model):
    """The two-level contact graph that the robot believed after a turn: what is on what."""

    turn: int
    known_area: float
    """Floor seen so far [m²]."""
    things: tuple[MapThing, ...]


class EpisodeMaps(Model):
    """maps.json: one for every turn that changed something."""

    snapshots: tuple[MapSnapshot, ...]


class AgentEpisode(Artifact):
    """`episode.json`, `episode.txt`, `apartment.json` (the true one), `known.json` (what was mapped
    of it before, where that was given), `maps.json`, `map.png` and `map.gif` (what
    the robot knew, as it grew), `episode.mcap` (the same by time, with base, words and views), in physics `views.png`
    (what the wrist camera saw last); `transcript.jsonl` when a language model was asked."""

    kind: ClassVar[str] = "agent_episode"
    description: ClassVar[str] = "a robot told in words: programs, calls, maps, and what came of it"
    info = Document(EpisodeFile, "episode.json")
    apartment = Document(Apartment, "apartment.json")
    maps = Document(EpisodeMaps, "maps.json")


class EvaluatedArm(Model):
    """Pooled over the trials of one arm in one task; percentages, None where there is nothing to count."""

    task: str
    arm: str
    trials: int
    success: float
    step_success: float | None
    recovery: float | None
    false_success: float
    calls: float
    seconds: float
    metres: float


class AgentEvaluationFile(Model):
    """results.json."""

    first_seed: Seed
    failures: float
    perception: float
    rows: tuple[EvaluatedArm, ...]


class AgentEvaluation(Artifact):
    """`results.json` and `table.md`."""

    kind: ClassVar[str] = "agent_evaluation"
    description: ClassVar[str] = "arms of the agent compared over tasks and seeds"
    info = Document(AgentEvaluationFile, "results.json")
