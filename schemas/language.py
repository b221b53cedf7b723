"""What a run asked of a language model: counted, and kept beside the result."""

from __future__ import annotations

from scenewright.schemas.base import Model
from scenewright.schemas.plan import Failure


class LanguageRecord(Model):
    """How often a language model was asked in a run, what it cost and what went wrong."""

    backend: str
    """`scripted:<name>`, `recorded:<model>` or `openai:<model>`."""
    model: str
    calls: int
    """Questions that were put to the model: what the LLM3 paper counts as #LM."""
    re_prompts: int
    """Times it was asked again because its reply could not be read; no calls."""
    repeats: int
    """HTTP requests that were sent again after a fault that may pass (429, 5xx, a time-out)."""
    prompt_tokens: int
    completion_tokens: int
    estimated: bool
    """Whether some of these tokens were estimated (a quarter of the characters), as the server did not count them."""
    failures: tuple[Failure, ...] = ()
    """Every reply that could not be used, and what ended the run, in order."""
