"""Which learner: ours, the thesis's with a language model or a stand-in, or one that explores by chance."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from scenewright.stages.kit.language.opening import open_chat
from scenewright.stages.kit.language.scripted import ScriptedBackend
from scenewright.stages.predicates.learning.memory import Memory
from scenewright.stages.predicates.learning.ours import OursLearner
from scenewright.stages.predicates.learning.random_exploration import RandomLearner
from scenewright.stages.predicates.learning.setting import Setting
from scenewright.stages.predicates.learning.thesis import ThesisLearner, stand_in
from scenewright.stages.predicates.learning.thesis_memory import ThesisMemory
from scenewright.stages.predicates.parameters import TeachParameters
from scenewright.stages.predicates.teacher.simulated import Teacher

STAND_IN = "word-list"


@dataclass(frozen=True)
class Exchange:
    """Where what a language model said before is read, and the folder where what it says is kept."""

    transcript: Path | None
    output: Path


def empty_memory(learner: str, setting: Setting) -> Memory:
    """Return what a learner begins with."""
    return ThesisMemory(setting) if learner == "thesis" else Memory(setting)


def open_learner(
    parameters: TeachParameters, teacher: Teacher, actions: Sequence[str], seed: int, memory: Memory, exchange: Exchange
) -> OursLearner:
    """Return the learner that the options ask for. Raises as `open_chat` does."""
    if parameters.learner == "thesis":
        assert isinstance(memory, ThesisMemory)
        chat = open_chat(
            parameters,
            scripted=ScriptedBackend(STAND_IN, stand_in),
            transcript=exchange.transcript,
            record=exchange.output / "transcript.jsonl",
        )
        return ThesisLearner(teacher, actions, seed, memory, chat=chat)
    kind = RandomLearner if parameters.learner == "random" else OursLearner
    return kind(teacher, actions, seed, memory)
