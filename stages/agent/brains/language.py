"""A language model as the brain, over the kit's backends: an endpoint, a local server, or a transcript."""

from __future__ import annotations

from pydantic import Field
from scenewright.schemas.base import Model
from scenewright.stages.agent.brains.brain import Reply
from scenewright.stages.agent.brains.prompt import feedback_text, system_prompt, task_text
from scenewright.stages.agent.language.interpreter import Ran
from scenewright.stages.kit.language.chat import Chat
from scenewright.stages.kit.language.messages import Message, say
from scenewright.stages.kit.language.reply_schema import schema_of

SHOWN_TURNS = 30
"""Latest programs that are shown with every question, with what came of them; by eye."""


class ProgramReply(Model):
    """The JSON of a reply."""

    reason: str = Field(description="What came back, and what to do next", max_length=8_000)
    code: str = Field(description="The next program", max_length=20_000)


class LanguageBrain:
    """Asks a model for each program, with the thesis's prompt and all that came back so far."""

    def __init__(self, words: str, chat: Chat) -> None:
        self.chat = chat
        self._first = (say("system", system_prompt()), say("user", task_text(words)))
        self._turns: list[Message] = []

    @property
    def label(self) -> str:
        """That of the backend."""
        return self.chat.backend.label

    def reply(self, last: Ran | None) -> Reply:
        """Return the model's next program. Raises LanguageFailed."""
        if last is not None:
            self._turns.append(say("user", feedback_text(last)))
        latest_turns = self._turns[-2 * SHOWN_TURNS :]
        answer = self.chat.ask((*self._first, *latest_turns), schema_of(ProgramReply))
        self._turns.append(say("assistant", answer.model_dump_json()))
        return Reply(answer.reason, answer.code)
