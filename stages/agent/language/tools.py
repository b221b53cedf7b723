"""The calls of the plan language: table 3.1 (Han 2024), doors, and the ways to end. What they do is up to the arm."""

from __future__ import annotations

from dataclasses import dataclass

from scenewright.stages.agent.language.values import Outcome, SceneObject

THING, TEXT = "object", "text"


@dataclass(frozen=True)
class Tool:
    """A call: what it takes, in words for the prompt, and whether it makes the robot act (an execution)."""

    name: str
    takes: tuple[tuple[str, ...], ...]
    """For every argument the sorts that it may be."""
    returns: str
    says: str
    acts: bool = False
    ends: bool = False

    @property
    def signature(self) -> str:
        """As documentation says it: `grasp(object) -> bool`."""
        return f"{self.name}({', '.join(' or '.join(sorts) for sorts in self.takes)}) -> {self.returns}"


TOOLS = (
    Tool("explore_global", (), "ObjectMap", "Drive through all rooms; the furniture that was seen."),
    Tool("explore_local", (), "ObjectMap", "Look around with the wrist camera; the things on what is in front."),
    Tool(
        "report_observation",
        ((THING, TEXT),),
        "Observation",
        'Take a picture of a thing from near by, or of the hand ("stay").',
    ),
    Tool("navigate", ((THING,),), "bool", "Drive to a piece of furniture, or before a thing, facing it.", acts=True),
    Tool("grasp", ((THING,),), "bool", "Take a thing of the local map into the empty hand.", acts=True),
    Tool("place", ((THING,),), "bool", "Put what the hand holds onto a thing or piece of furniture.", acts=True),
    Tool("place_among", ((THING,),), "bool", "Put what the hand holds into the middle of things like this.", acts=True),
    Tool("open", ((THING,),), "bool", "Open the door or drawer of a piece of furniture in front.", acts=True),
    Tool("close", ((THING,),), "bool", "Close it.", acts=True),
    Tool("done", (), "nothing", "The task is done, and this was checked. Ends the session.", ends=True),
    Tool("give_up", ((TEXT,),), "nothing", "The task cannot be done, and why. Ends the session.", ends=True),
    Tool("ask", ((TEXT,),), "nothing", "A question to the user. Ends the session.", ends=True),
)
BY_NAME = {tool.name: tool for tool in TOOLS}


def sort_of(value: object) -> str:
    """Return the sort of a value, as messages name it."""
    match value:
        case SceneObject():
            return THING
        case str():
            return TEXT
        case bool() | Outcome():
            return "bool"
        case int() | float():
            return "number"
        case None:
            return "nothing"
        case tuple() | range():
            return "list"
    return type(value).__name__
