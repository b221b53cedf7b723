"""Needle pose correction as in the thesis (i, j, k), and insertion without it."""

from __future__ import annotations

from scenewright.stages.suture.motion import primitives
from scenewright.stages.suture.motion.constants import CORRECTION_TURN, NORMAL_SAMPLES
from scenewright.stages.suture.motion.needle import UP_THE_WOUND
from scenewright.stages.suture.trials.belief import Belief, believed, mean_normal, middle_ends
from scenewright.stages.suture.trials.bench import CORNER, Bench, Failed
from scenewright.stages.suture.trials.looking import corner_looks, until_known
from scenewright.stages.suture.trials.places import NOMINAL
from scenewright.stages.suture.trials.policy import Trust


class NoCorrection:
    """Pose correction: one look where the needle was handed over, nominal turns."""

    def believed(self, bench: Bench, trust: Trust) -> Belief:
        """Return what is believed of the needle where it is. Raises Failed (I) where it can't be known."""
        bench.overhead()
        looked = until_known(lambda: bench.look("elsewhere"))
        if looked is None:
            raise Failed("I", "the needle could not be known before insertion")
        normal = looked.normal if looked.normal @ UP_THE_WOUND > 0 else -looked.normal
        return believed(bench.tools["right"], NOMINAL, normal, (looked.tip, looked.swage))


class NinetyDegrees:
    """Pose correction: to the corner, the normal along +y by ten looks, then 90 degrees about y."""

    def believed(self, bench: Bench, trust: Trust) -> Belief:
        """Return what is believed after the turns. Raises Failed (I) where the needle can't be known."""
        bench.overhead()
        bench.go("right", CORNER)
        bench.record("i: to the corner")
        looks = corner_looks(bench, trust, NORMAL_SAMPLES)
        normal = mean_normal(looks)
        bench.go("right", primitives.normal_to_y(bench.tools["right"], normal))
        bench.record("j: normal along y")
        # The needle has moved since the normals were seen, so its ends are looked at anew, as often.
        looks = corner_looks(bench, trust, NORMAL_SAMPLES)
        tool = bench.tools["right"]
        turns = primitives.final_turn(tool, CORRECTION_TURN)
        bench.move("right", turns)
        bench.record("k: 90 degrees about y")
        return believed(tool, turns[-1][:3, :3], UP_THE_WOUND, middle_ends(looks, tool[:3, 3]))
