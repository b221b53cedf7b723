"""Ours, which pulls no dish that carries others."""

from __future__ import annotations

from dataclasses import replace

from scenewright.stages.tableware.planning.joint import JointPolicy
from scenewright.stages.tableware.planning.policy import DeclaredPolicy
from scenewright.stages.tableware.policies import ours

RULES = replace(ours.RULES, loaded_pulls=False)
POLICY = DeclaredPolicy(JointPolicy, RULES, rivals=ours.RIVALS)
