"""Options that the commands of tableware share. Cheap to import."""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal

from pydantic import Field
from scenewright.stages.kit.stage import Parameters
from scenewright.stages.tableware import policies
from scenewright.stages.tableware.found_by_place import names_in

TierName = Literal["tier0_cups", "tier0_bowls", "tier0_utensils", "tier1", "tier2", "tier3"]
if TYPE_CHECKING:
    PolicyName = str
else:
    PolicyName = Literal[names_in(policies)]
THESIS_TIMES = "tableware/thesis_times.json"
PHYSICS_TIMES = "tableware/physics_times.json"
"""Files below data/: times of actions and chances, fitted to the thesis's tables; times of the arm in physics."""
ChancesName = Literal["exact", "thesis", "thesis_spills", "thesis_failures"]


class ActionTimes(Parameters):
    """The time model, and what goes wrong."""

    times_of: TierName = Field("tier1", description="Tier of the thesis whose fitted times of actions are taken")
    trip_seconds: float | None = Field(None, gt=0.0, le=600.0, description="Seconds of a trip, instead of the fit's")
    stack_seconds: float | None = Field(None, ge=0.0, le=600.0, description="Seconds of a stacking, likewise")
    pull_seconds: float | None = Field(None, ge=0.0, le=600.0, description="Seconds of a pull, likewise")
    delay: float = Field(0.0, ge=0.0, le=60.0, description="Seconds that a farther bin adds to each trip, each way")
    chances: ChancesName = Field(
        "thesis",
        description="Failures: none; missed pulls and slipping second piles, as the thesis measured; also "
        "utensils that slide off dishes, as in physics, or drops as often as its trials failed",
    )
