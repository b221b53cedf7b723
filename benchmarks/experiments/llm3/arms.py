"""Who proposes, under which budget, on which cases."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from scenewright.stages.pack import (
    HARD_CELLS,
    PUBLISHED_CELLS,
    Backtracking,
    Budget,
    CornerBacktracking,
    FixedLayout,
    Instance,
    LanguageProposer,
    OwnProposer,
    Proposer,
    RandomRestarts,
    RandomSampler,
    SymbolicProposer,
    hard_instance,
    placement_solver,
    published_instance,
    scripted_chat,
)

PUBLISHED = tuple(f"published/{cell}" for cell in PUBLISHED_CELLS)
HARD = tuple(f"hard/{cell}" for cell in HARD_CELLS)
EVERYWHERE = (*PUBLISHED, *HARD)
RIVAL_CALLS = 500
"""Motion-planner calls after which a sampler has failed on a harder instance."""
PROPOSALS = Budget(iterations=20)
"""The thesis's cap."""


@dataclass(frozen=True)
class Arm:
    """One row of the tables."""

    make: Callable[[int], Proposer]
    cases: tuple[str, ...] = EVERYWHERE
    sampler: bool = False
    """Proposes as often as it likes, within motion-planner calls."""

    def budget(self, case: str) -> Budget:
        """Return when an attempt has failed."""
        if not self.sampler:
            return PROPOSALS
        return Budget(1_000_000, RIVAL_CALLS if case in HARD else 20_000)


ARMS: dict[str, Arm] = {
    "ours": Arm(OwnProposer),
    "ours_no_reasons": Arm(lambda seed: OwnProposer(seed, reasons=False)),
    "scripted_backtrack": Arm(lambda s: LanguageProposer(scripted_chat("backtrack", s), variant="backtrack")),
    "scripted_backtrack_no_reasons": Arm(
        lambda s: LanguageProposer(scripted_chat("backtrack", s), variant="backtrack", reasons=False), PUBLISHED
    ),
    "scripted_scratch": Arm(lambda s: LanguageProposer(scripted_chat("scratch", s), variant="scratch")),
    "scripted_scratch_no_reasons": Arm(
        lambda s: LanguageProposer(scripted_chat("scratch", s), variant="scratch", reasons=False), PUBLISHED
    ),
    "scripted_symbolic": Arm(lambda s: SymbolicProposer(scripted_chat("symbolic", s), placement_solver)),
    "fixed_layout": Arm(lambda seed: FixedLayout(), PUBLISHED),
    "random": Arm(RandomSampler, ("published/easy", "published/medium"), sampler=True),
    "random_restarts": Arm(RandomRestarts, sampler=True),
    "backtracking": Arm(Backtracking, sampler=True),
    "backtracking_corners": Arm(CornerBacktracking, sampler=True),
}


def make_instance(case: str, seed: int) -> Instance:
    """Return the instance of `published/<cell>` or `hard/<cell>`."""
    suite, cell = case.split("/")
    return published_instance(cell, seed) if suite == "published" else hard_instance(cell, seed)
