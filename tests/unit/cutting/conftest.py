"""What was learned of a dozen demonstrations."""

from __future__ import annotations

import pytest
from scenewright.stages.cutting.demonstrations.trials import make_trial
from scenewright.stages.cutting.ours.grammar import Grammar, learn


@pytest.fixture(scope="session")
def grammar() -> Grammar:
    return learn([make_trial("n1m1", (0, k)) for k in range(12)], 0)
