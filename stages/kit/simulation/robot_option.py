"""The option --robot of every step that has an arm: its words, and the files that decide what it means. Cheap."""

from __future__ import annotations

from typing import Any

from pydantic import Field
from scenewright.schemas.errors import UsageError
from scenewright.stages.kit.stage import Parameters

USUAL_ROBOT = "panda"
"""The robot of a step where no other is named, and of artifacts that name none."""
DESCRIPTION = "Robot of data/robots/, or a description of your own (a .toml file)"


def robot_option(where: str = "", default: str = USUAL_ROBOT) -> Any:
    """Return the field `robot` of a step's Parameters. `where` says in which runs there is an arm at all, or which."""
    return Field(default, description=f"{DESCRIPTION}{f'; {where}' if where else ''}")


def robot_files(robot: str) -> tuple[str, ...]:
    """Return the files of `data/` that describe a robot, the user's own by their whole path. Raises UsageError for a
    description that is no TOML."""
    from scenewright.stages.kit.simulation.robot_description import FOLDER, description_files

    files = [file.resolve() for file in description_files(robot)]
    return tuple(str(file.relative_to(FOLDER.parent) if FOLDER in file.parents else file) for file in files)


def check_robot_acts(parameters: Parameters, *, acts: bool, without: str, hint: str) -> None:
    """Raise UsageError for a robot that was chosen where none acts: the message is `--robot: ` and `without`."""
    chosen = getattr(parameters, "robot", None)
    if not acts and chosen != type(parameters).model_fields["robot"].default:
        raise UsageError(f"--robot {chosen}: {without}", hint=hint)
