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

__getattr__ = exported(__name__)
