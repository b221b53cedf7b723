"""Ours, which pulls no dish that carries others."""

from __future__ import annotations

from dataclasses import replace

from stages.tableware.planning.joint import JointPolicy
from stages.tableware.planning.policy import DeclaredPolicy
from stages.tableware.policies import ours

RULES = replace(ours.RULES, loaded_pulls=False)
POLICY = DeclaredPolicy(JointPolicy, RULES, rivals=ours.RIVALS)
