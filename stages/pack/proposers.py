"""The proposers by the names of the command line."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from scenewright.stages.kit.language.chat import Chat
from scenewright.stages.pack.backtracking import Backtracking, CornerBacktracking
from scenewright.stages.pack.language_prompt import Variant
from scenewright.stages.pack.language_proposer import LanguageProposer, SymbolicProposer
from scenewright.stages.pack.own_proposer import OwnProposer, placement_solver
from scenewright.stages.pack.records import Proposer
from scenewright.stages.pack.sampling import FixedLayout, RandomRestarts, RandomSampler


@dataclass(frozen=True)
class Setting:
    """What a proposer may be made of."""

    seed: int
    reasons: bool
    """Whether it reads why an action failed, or only that it did."""
    trace_length: int
    """Attempts that a language model is shown."""
    chat: Callable[[Variant], Chat]
    """Opens the chat with a language model; scripted stand-ins follow the variant."""


def _backtrack(setting: Setting) -> Proposer:
    return LanguageProposer(
        setting.chat("backtrack"), variant="backtrack", reasons=setting.reasons, trace_length=setting.trace_length
    )


def _scratch(setting: Setting) -> Proposer:
    return LanguageProposer(
        setting.chat("scratch"), variant="scratch", reasons=setting.reasons, trace_length=setting.trace_length
    )


def _symbolic(setting: Setting) -> Proposer:
    return SymbolicProposer(
        setting.chat("symbolic"), placement_solver, trace_length=setting.trace_length, reasons=setting.reasons
    )


PROPOSERS: dict[str, Callable[[Setting], Proposer]] = {
    "ours": lambda setting: OwnProposer(setting.seed, reasons=setting.reasons),
    "backtrack": _backtrack,
    "scratch": _scratch,
    "symbolic": _symbolic,
    "random": lambda setting: RandomSampler(setting.seed),
    "random_restarts": lambda setting: RandomRestarts(setting.seed),
    "backtracking": lambda setting: Backtracking(setting.seed),
    "backtracking_corners": lambda setting: CornerBacktracking(setting.seed),
    "fixed_layout": lambda setting: FixedLayout(),
}
