"""What actions cost and how they fail, by the tables of Srinivas 2024 (docs/TIDY.md)."""

from __future__ import annotations

from pydantic import Field
from scenewright.stages.kit.training.declaration import TrainingDeclaration, TrainingParameters


class TimesTraining(TrainingParameters):
    """Options; a fit takes no time, so that `quick` changes nothing."""

    write: bool = Field(False, description="Write data/tableware/thesis_times.json")


TRAINING = TrainingDeclaration(
    name="thesis-times",
    summary="what actions at a table cost and how they fail, on the thesis's tables",
    package=__name__,
    parameters=TimesTraining,
)
