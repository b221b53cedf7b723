"""Ours with all that the jaws allow, whether physics bears it or not."""

from __future__ import annotations

from stages.tableware.planning.joint import JointPolicy
from stages.tableware.planning.policy import DeclaredPolicy
from stages.tableware.planning.rules import Rules
from stages.tableware.policies import ours

RULES = Rules()
POLICY = DeclaredPolicy(JointPolicy, RULES, rivals=ours.RIVALS)
