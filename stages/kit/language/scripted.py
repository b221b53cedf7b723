"""The scripted stand-in for a language model: a function of ours that reads the request and writes a reply.

It is no language model and is called `scripted` wherever its results are shown.
"""

from __future__ import annotations

from collections.abc import Callable

from scenewright.stages.kit.language.backend import RawReply, Request, estimated_usage


class ScriptedBackend:
    """Answers by `reply(request) -> text`, which has to be a function of the request and a seed alone."""

    def __init__(self, name: str, reply: Callable[[Request], str]) -> None:
        self.name, self._reply = name, reply

    @property
    def label(self) -> str:
        """`scripted:<name>`."""
        return f"scripted:{self.name}"

    def ask(self, request: Request) -> RawReply:
        """Return what the script says."""
        text = self._reply(request)
        return RawReply(text, "stop", estimated_usage(request, text))
