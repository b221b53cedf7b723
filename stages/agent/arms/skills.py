"""What every arm's robot has in common: its map, exploration, who holds what, and calls that make no sense."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from math import hypot
from typing import Protocol

from scenewright.stages.agent.arms.stations import spots, spots_near, spots_on
from scenewright.stages.agent.body import Body
from scenewright.stages.agent.exploration import explore
from scenewright.stages.agent.goals import CARRIERS
from scenewright.stages.agent.language.program import PlanError
from scenewright.stages.agent.language.values import ObjectMap, Observation, Outcome, SceneObject, Value
from scenewright.stages.agent.scene_map import Item, SceneMap
from scenewright.stages.agent.senses import Base, Position


class Skills(Protocol):
    """The calls of the plan language as an arm carries them out. `holding`: what it believes to hold."""

    scene: SceneMap
    holding: Item | None

    def call(self, name: str, arguments: tuple[Value, ...]) -> Value:
        """Carry out a call whose arguments are of the right sorts. Raises PlanError for one without sense."""
        ...


class CommonSkills(ABC):
    """Checks a call and hands it to the arm's own way of doing it."""

    def __init__(self, body: Body) -> None:
        self._body = body
        self.scene = SceneMap(body)
        self.scene.sweep(body)
        self.holding: Item | None = None

    def call(self, name: str, arguments: tuple[Value, ...]) -> Value:
        """Carry out a call."""
        if name == "explore_global":
            explore(self._body, self.scene)
            return self.scene.global_map()
        if name == "explore_local":
            furniture_key = self.scene.in_front(self._body.base)
            return self.explore_local(furniture_key) if furniture_key else ObjectMap()
        target = arguments[0]
        if name == "report_observation" and isinstance(target, str):
            if target not in ("stay", "rest"):
                raise PlanError("wrong_arguments", 'a picture is of an object, of "stay" or of "rest"')
            furniture_key = self.scene.in_front(self._body.base)
            if target == "rest" and furniture_key:
                return self.picture_of(self.scene.scene_object(furniture_key))
            return self.picture_of_hand()
        assert isinstance(target, SceneObject)
        if target.key not in self.scene.furniture and target.key not in self.scene.items:
            raise PlanError("unknown_object", f"{target.key} is no longer where it was: explore_local() again")
        act: Callable[[SceneObject], Value] = getattr(self, f"_call_{name}")
        return act(target)

    def _call_report_observation(self, target: SceneObject) -> Observation:
        return self.picture_of(target)

    def _call_navigate(self, target: SceneObject) -> Outcome:
        return self.navigate(target)

    def _call_grasp(self, target: SceneObject) -> Outcome:
        if target.key in self.scene.furniture:
            raise PlanError("wrong_arguments", f"{target.key} is furniture and cannot be grasped")
        if self.holding is not None:
            raise PlanError("hand_full", f"the hand holds {self.holding.key}", nearest="place(object) -> bool")
        return self.grasp(self.scene.items[target.key])

    def _call_place(self, target: SceneObject) -> Outcome:
        self._needs_something()
        return self.place(target)

    def _call_place_among(self, target: SceneObject) -> Outcome:
        self._needs_something()
        if target.key in self.scene.furniture:
            raise PlanError("wrong_arguments", f"{target.key} is furniture", nearest="place(object) -> bool")
        item = self.scene.items[target.key]
        alike = [i.position for i in self.scene.items.values() if i.label == item.label and i.place == item.place]
        middle = (sum(p[0] for p in alike) / len(alike), sum(p[1] for p in alike) / len(alike), alike[0][2])
        at = spots_near(self.scene, item.place, middle)
        return self.place_at(item.place, self.scene.furniture[item.place].label, at)

    def _call_open(self, target: SceneObject) -> Outcome:
        return self._turn(target, opening=True)

    def _call_close(self, target: SceneObject) -> Outcome:
        return self._turn(target, opening=False)

    def _turn(self, target: SceneObject, *, opening: bool) -> Outcome:
        if not target.door:
            raise PlanError("no_door", f"{target.key} has no door")
        if self.holding is not None:
            raise PlanError("hand_full", f"the hand holds {self.holding.key}", nearest="place(object) -> bool")
        return self.pull(target.key, opening=opening)

    def _needs_something(self) -> None:
        if self.holding is None:
            raise PlanError("nothing_in_hand", "the hand holds nothing", nearest="grasp(object) -> bool")

    def places_on(self, target: SceneObject) -> tuple[str, str, list[Position]]:
        """Return furniture, class of what is meant to carry, and positions to try, of a target of `place`: within a
        small carrier, on furniture, or beside a thing that carries nothing."""
        if target.key in self.scene.furniture:
            return target.key, target.label, spots(self.scene, target.key, self._body.base)
        item = self.scene.items[target.key]
        if item.label in CARRIERS:
            return item.place, item.label, spots_on(self.scene, item)
        at = spots(self.scene, item.place, self._body.base)
        at.sort(key=lambda p: hypot(p[0] - item.position[0], p[1] - item.position[1]))
        return item.place, self.scene.furniture[item.place].label, at

    def took(self, item: Item) -> None:
        """Believe that the hand holds a thing."""
        self.holding = item
        self.scene.items.pop(item.key, None)

    def put(self, place: str, at: Position) -> None:
        """Believe that what the hand held is at a position."""
        item = self.holding
        assert item is not None
        item.position, item.place = at, place
        self.scene.items[item.key] = item
        self.holding = None

    def drive(self, base: Base, toward: str) -> bool:
        """Drive to a base pose before something, along the shortest known way."""
        return self._body.drive(base, toward).ok

    # What differs from arm to arm.
    @abstractmethod
    def explore_local(self, place: str) -> ObjectMap:
        """Look at the furniture in front."""

    @abstractmethod
    def picture_of_hand(self) -> Observation:
        """Say what the hand holds."""

    @abstractmethod
    def picture_of(self, target: SceneObject) -> Observation:
        """Say what is seen of a thing from near by, or on furniture."""

    @abstractmethod
    def navigate(self, target: SceneObject) -> Outcome:
        """Drive before something."""

    @abstractmethod
    def grasp(self, item: Item) -> Outcome:
        """Take a thing."""

    @abstractmethod
    def place(self, target: SceneObject) -> Outcome:
        """Put down what is held."""

    @abstractmethod
    def place_at(self, place: str, label: str, at: list[Position]) -> Outcome:
        """Put down what is held at one of some positions on furniture, over something of a class."""

    @abstractmethod
    def pull(self, key: str, *, opening: bool) -> Outcome:
        """Open or close a door."""
