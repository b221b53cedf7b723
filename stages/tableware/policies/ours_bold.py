"""Ours with all that the jaws and a pull allow, whether physics holds it in the air or not."""

from __future__ import annotations

from scenewright.stages.tableware.planning.joint import JointPolicy
from scenewright.stages.tableware.planning.policy import DeclaredPolicy
from scenewright.stages.tableware.planning.rules import Rules
from scenewright.stages.tableware.policies import ours

RULES = Rules(steady_pulls=True)
POLICY = DeclaredPolicy(JointPolicy, RULES, rivals=ours.RIVALS)
