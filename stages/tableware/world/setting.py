"""What a plan goes by beside a policy's own rules: the sizes of things, what of them is only guessed, and the hand."""

from __future__ import annotations

from dataclasses import dataclass

from scenewright.stages.tableware.world.items import STANDARD, DishSizes


@dataclass(frozen=True)
class Gripper:
    """A hand with two parallel jaws [m]; the usual one is the thesis's (Srinivas 2024, section 6.4)."""

    opening: float = 0.085
    jaw_height: float = 0.045
    finger: float = 0.011
    """Half the width of a finger; what lies under the jaws when they come down is in the way (ours)."""


@dataclass(frozen=True)
class Setting:
    """Sizes and hand."""

    sizes: DishSizes = STANDARD
    gripper: Gripper = Gripper()
    stacking: bool = True
    """Whether walls and feet are known, which decide how high a pile becomes; else nothing is put on anything."""
    alike: frozenset[str] | None = None
    """Letters of the kinds whose things measure alike, where each was measured by itself: only these are lifted side
    by side. None: all of a kind measure what `sizes` say, and what does not is refused."""
