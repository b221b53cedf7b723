"""What a brain is: it reads what came of its last program and writes the next."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

from scenewright.stages.agent.language.interpreter import Ran


@dataclass(frozen=True)
class Reply:
    """A thought and a program: the JSON of the thesis's prompt has these two fields."""

    reason: str
    code: str


class Brain(Protocol):
    """Writes programs."""

    @property
    def label(self) -> str:
        """`rules`, `open loop rules`, or that of the language backend: for records and tables."""
        ...

    def reply(self, last: Ran | None) -> Reply:
        """Return the next program; `last` is what came of the one before, None at the beginning. Raises
        LanguageFailed where a language model gives no usable answer."""
        ...
