"""InterPreT: what words mean is learned from corrections, and plans are made with it (docs/INTERPRET.md)."""

from __future__ import annotations

from typing import TYPE_CHECKING

from scenewright.stages.kit.exports import exported

if TYPE_CHECKING:
    from scenewright.stages.predicates.execution import (
        Abstraction,
        Attempt,
        Planner,
        Replayed,
        Replays,
        World,
        attempt,
        oracle,
        timed_plan,
    )
    from scenewright.stages.predicates.learning.memory import Memory
    from scenewright.stages.predicates.learning.opening import STAND_IN
    from scenewright.stages.predicates.learning.ours import OursLearner
    from scenewright.stages.predicates.learning.random_exploration import RandomLearner
    from scenewright.stages.predicates.learning.setting import KITCHEN_GIVEN
    from scenewright.stages.predicates.learning.thesis import ThesisLearner, stand_in
    from scenewright.stages.predicates.learning.thesis_memory import ThesisMemory
    from scenewright.stages.predicates.measure.accuracy import balanced_accuracy, drawn_cases
    from scenewright.stages.predicates.measure.operators import Done, allowed_accuracy, expected_share
    from scenewright.stages.predicates.tasks import SETS, Task, tasks_of
    from scenewright.stages.predicates.teacher.simulated import SimulatedTeacher, Wording
    from scenewright.stages.predicates.training import Training, train
    from scenewright.stages.predicates.truth import true_domain, truth_of
    from scenewright.stages.predicates.world.catalogue import DOMAINS, kitchen_file

_MODULES = {
    "Abstraction": "scenewright.stages.predicates.execution",
    "Attempt": "scenewright.stages.predicates.execution",
    "Planner": "scenewright.stages.predicates.execution",
    "Replayed": "scenewright.stages.predicates.execution",
    "Replays": "scenewright.stages.predicates.execution",
    "World": "scenewright.stages.predicates.execution",
    "attempt": "scenewright.stages.predicates.execution",
    "oracle": "scenewright.stages.predicates.execution",
    "timed_plan": "scenewright.stages.predicates.execution",
    "Memory": "scenewright.stages.predicates.learning.memory",
    "STAND_IN": "scenewright.stages.predicates.learning.opening",
    "OursLearner": "scenewright.stages.predicates.learning.ours",
    "RandomLearner": "scenewright.stages.predicates.learning.random_exploration",
    "KITCHEN_GIVEN": "scenewright.stages.predicates.learning.setting",
    "ThesisLearner": "scenewright.stages.predicates.learning.thesis",
    "stand_in": "scenewright.stages.predicates.learning.thesis",
    "ThesisMemory": "scenewright.stages.predicates.learning.thesis_memory",
    "balanced_accuracy": "scenewright.stages.predicates.measure.accuracy",
    "drawn_cases": "scenewright.stages.predicates.measure.accuracy",
    "Done": "scenewright.stages.predicates.measure.operators",
    "allowed_accuracy": "scenewright.stages.predicates.measure.operators",
    "expected_share": "scenewright.stages.predicates.measure.operators",
    "SETS": "scenewright.stages.predicates.tasks",
    "Task": "scenewright.stages.predicates.tasks",
    "tasks_of": "scenewright.stages.predicates.tasks",
    "SimulatedTeacher": "scenewright.stages.predicates.teacher.simulated",
    "Wording": "scenewright.stages.predicates.teacher.simulated",
    "Training": "scenewright.stages.predicates.training",
    "train": "scenewright.stages.predicates.training",
    "true_domain": "scenewright.stages.predicates.truth",
    "truth_of": "scenewright.stages.predicates.truth",
    "DOMAINS": "scenewright.stages.predicates.world.catalogue",
    "kitchen_file": "scenewright.stages.predicates.world.catalogue",
}

__getattr__ = exported(__name__, _MODULES)
