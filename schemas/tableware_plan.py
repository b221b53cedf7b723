"""Kind `tableware_plan`: actions that clear a table, what they should take, and what was refused.

The fields u_G, u_P, u_PG, u_S and u_SG are equations 6.1 to 6.5 of Srinivas 2024; points are world [m], angles the
direction in which the jaws close, in the table's plane [rad].
"""

from __future__ import annotations

from typing import Annotated, ClassVar, Literal

from pydantic import Field, model_validator
from scenewright.schemas.artifact import Artifact, Document
from scenewright.schemas.base import Model, Name, Vector3
from scenewright.schemas.tableware_dishes import TablewareDishes
from scenewright.schemas.tableware_scene import MOST_ITEMS, TablewareItem, check_carriers

Chance = Annotated[float, Field(ge=0.0, le=1.0)]
Seconds = Annotated[float, Field(ge=0.0)]


class GraspFields(Model):
    """u_G: lift one thing or two with their loads, and take them to the bin (u_SG, u_S: what is put down elsewhere)."""

    items: tuple[Name, ...] = Field(min_length=1, max_length=2)
    p_G: Vector3
    theta_G: float

    @property
    def words(self) -> str:
        """The action as people read it."""
        return f"take {' and '.join(self.items)}"


class PullFields(Model):
    """u_P: pull `item` over the table to `target`."""

    item: Name
    target: Name
    p_S: Vector3
    theta_S: float
    p_E: Vector3
    theta_E: float

    @property
    def words(self) -> str:
        """The action as people read it."""
        return f"pull {self.item} to {self.target}"


class PullGraspFields(Model):
    """u_PG."""

    u_P: PullFields
    u_G: GraspFields

    @property
    def words(self) -> str:
        """The action as people read it."""
        return f"{self.u_P.words}, take both"


class StackFields(Model):
    """u_S: lift `u_G.items[0]` with its load and put it onto `onto`."""

    u_G: GraspFields
    onto: Name
    p_L: Vector3
    theta_L: float

    @property
    def words(self) -> str:
        """The action as people read it."""
        return f"stack {self.u_G.items[0]} on {self.onto}"


class StackGraspFields(Model):
    """u_SG."""

    u_S: StackFields
    u_G: GraspFields

    @property
    def words(self) -> str:
        """The action as people read it."""
        return f"{self.u_S.words}, take the pile"


ActionFields = GraspFields | PullFields | PullGraspFields | StackFields | StackGraspFields
ActionName = Literal["grasp", "pull", "pull_grasp", "stack", "stack_grasp"]
FIELD_OF: dict[str, str] = {"grasp": "u_G", "pull": "u_P", "pull_grasp": "u_PG", "stack": "u_S", "stack_grasp": "u_SG"}


class TablewareAction(Model):
    """One action: exactly the field that `name` says is set."""

    name: ActionName
    u_G: GraspFields | None = None
    u_P: PullFields | None = None
    u_PG: PullGraspFields | None = None
    u_S: StackFields | None = None
    u_SG: StackGraspFields | None = None
    seconds: Seconds
    """When nothing slips."""
    risk: Chance
    """Chance that something falls off the table, by the chances the plan was made with."""

    @model_validator(mode="after")
    def _one_field_is_set(self) -> TablewareAction:
        filled = [field for field in FIELD_OF.values() if getattr(self, field) is not None]
        if filled != [FIELD_OF[self.name]]:
            raise ValueError(f"a {self.name} has {FIELD_OF[self.name]} and nothing else, here: {filled or 'nothing'}")
        return self

    @classmethod
    def of(cls, name: str, fields: ActionFields, *, seconds: float, risk: float) -> TablewareAction:
        """Return the action of a name with its fields; pydantic's error where they do not go together."""
        return cls.model_validate({"name": name, FIELD_OF[name]: fields, "seconds": seconds, "risk": risk})

    @property
    def fields(self) -> ActionFields:
        """The one field that is set."""
        fields: ActionFields = getattr(self, FIELD_OF[self.name])
        return fields

    @property
    def words(self) -> str:
        """The action as people read it."""
        return self.fields.words


class TablewareStep(Model):
    """An action with the table before it."""

    action: TablewareAction
    before: tuple[TablewareItem, ...]


class ImpossiblePair(Model):
    """Why two things cannot be taken together in one way, as they stand."""

    primitive: Literal["multi_grasp", "pull", "stack"]
    first: Name
    second: Name
    kind: str
    """`too_far_apart`, `turned`, `heights_differ`, `too_tall`, `unlike`, `in_the_way`, `off_table`, `loaded`,
    `no_room`, `tips`, `wider`, `on_utensil`, `too_many_utensils`, `sizes_estimated`."""
    message: str
    objects: tuple[Name, ...] = ()
    """What is in the way."""


class RefusedItem(Model):
    """What was seen and is not planned for."""

    name: str
    position: Vector3
    radius: float
    """Of the circle around it, which no action touches [m]."""
    reason: Literal[
        "unknown_object", "unsure", "outside_workspace", "in_a_refused_pile", "too_tall_to_lift", "other_size"
    ]
    message: str


class TimesOfActions(Model):
    """The time model: seconds of a trip to the bin, a stacking, a pull; `delay` is added to each trip twice."""

    trip: float = Field(gt=0.0)
    stack: float = Field(ge=0.0)
    pull: float = Field(ge=0.0)
    delay: float = Field(0.0, ge=0.0)


class TablewarePlanFile(Model):
    """plan.json."""

    policy: str
    source: Literal["detections", "image", "truth"]
    """Where the items come from."""
    times: TimesOfActions
    chances: Literal["exact", "thesis", "thesis_spills", "thesis_failures"]
    items: tuple[TablewareItem, ...] = Field(max_length=MOST_ITEMS)
    """What is planned for."""
    dishes: TablewareDishes | None = None
    """The sizes and the gripper that were planned with; None: the standard ones."""
    sizes: Literal["known", "estimated"] = "known"
    """Estimated: `dishes` holds the medians of what was measured in the image; nothing is stacked."""
    steps: tuple[TablewareStep, ...]
    seconds: Seconds
    """When nothing slips."""
    trips: int = Field(ge=0)
    expected_seconds: Seconds
    """Mean over `draws` of what chance decides, planning anew where it has to be; so are the next three."""
    expected_trips: float = Field(ge=0.0)
    expected_objects_per_trip: float = Field(ge=0.0)
    risk: Chance
    """Share of the draws in which something was dropped or left."""
    draws: int = Field(ge=1)
    impossible: tuple[ImpossiblePair, ...] = ()
    refused: tuple[RefusedItem, ...] = ()
    notes: tuple[str, ...] = ()
    """What vision did not handle."""
    statement: str
    """In one line: what is planned for, and what was not handled."""

    @model_validator(mode="after")
    def _carriers_are_there(self) -> TablewarePlanFile:
        check_carriers(self.items)
        for step in self.steps:
            check_carriers(step.before)
        return self


class TablewarePlan(Artifact):
    """`plan.json`, `plan.txt`, `plan.mcap` (ROS 2 messages), `strip.png` (the table before and after each action);
    `detections.png` when an image was there."""

    kind: ClassVar[str] = "tableware_plan"
    description: ClassVar[str] = "actions that clear a table"
    info = Document(TablewarePlanFile, "plan.json")
