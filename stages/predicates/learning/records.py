"""A learner's memory as a document, and back."""

from __future__ import annotations

from collections import defaultdict
from typing import Any

from scenewright.schemas.errors import BadInput
from scenewright.schemas.learned_domain import (
    DialogueTurn,
    DoneAction,
    GoalMeaning,
    HeardPhrase,
    LabelledExample,
    LearnedDomainFile,
    LearnedPredicate,
    SeenBody,
    SeenObject,
    SeenRoom,
    SeenState,
    StatedPrecondition,
)
from scenewright.stages.kit.predicates.expressions import Predicate, check, read, text_of
from scenewright.stages.kit.predicates.room import Body, RoomState
from scenewright.stages.kit.predicates.vocabulary import Perceived
from scenewright.stages.predicates.language.saying import say
from scenewright.stages.predicates.learning.memory import Memory, Turn
from scenewright.stages.predicates.learning.operators import Transition
from scenewright.stages.predicates.learning.phrases import Phrase
from scenewright.stages.predicates.learning.setting import SETTINGS
from scenewright.stages.predicates.learning.synthesis import Label
from scenewright.stages.predicates.learning.thesis_memory import THESIS, ThesisMemory
from scenewright.stages.predicates.state import Seen, State


def document_of(memory: Memory, **rest: Any) -> LearnedDomainFile:
    """Return domain.json; `rest` are its fields that the memory does not hold."""
    names = memory.names()
    phrases = list(memory.meanings)
    number_of_phrase = {phrase: number for number, phrase in enumerate(phrases)}
    return LearnedDomainFile(
        predicates=tuple(
            LearnedPredicate(name=each.name, arguments=each.arguments, means=text_of(each.means), said=say(each))
            for each in memory.predicates().values()
        ),
        phrases=tuple(
            HeardPhrase(
                text=phrase.text,
                arguments=phrase.arguments,
                predicate=names[phrase],
                examples=tuple(
                    LabelledExample(
                        state=label.state,
                        objects=label.objects,
                        holds=label.holds,
                        source=label.source,
                        weight=label.weight,
                        turn=label.turn,
                    )
                    for label in memory.labels[phrase]
                ),
            )
            for phrase in phrases
        ),
        preconditions=tuple(
            StatedPrecondition(action=action, phrase=number_of_phrase[phrase], variables=variables, times=times)
            for (action, phrase, variables), times in memory.stated.items()
        ),
        goals=tuple(
            GoalMeaning(text=text, phrase=number_of_phrase[phrase], places=places)
            for text, entries in memory.goals.items()
            for phrase, places in entries
        ),
        transitions=tuple(
            DoneAction(action=each.action, before=each.before, after=each.after) for each in memory.transitions
        ),
        setting=memory.setting.name,
        states=tuple(_seen_state(state) for state in memory.states if isinstance(state, State)),
        rooms=tuple(_seen_room(state) for state in memory.states if isinstance(state, RoomState)),
        dialogue=tuple(
            DialogueTurn(speaker=turn.speaker, text=turn.text, about=turn.about, believed=turn.believed)
            for turn in memory.dialogue
        ),
        disbelieved=tuple(memory.disbelieved),
        sentences=memory.sentences,
        questions=memory.questions,
        **rest,
    )


def _seen_state(state: State) -> SeenState:
    return SeenState(
        objects={name: SeenObject(**vars(seen_object)) for name, seen_object in state.objects.items()},
        gripper_x=state.gripper_x,
        gripper_y=state.gripper_y,
        opening=state.opening,
        mass=state.mass,
    )


def _seen_room(state: RoomState) -> SeenRoom:
    return SeenRoom(
        bodies={name: SeenBody(**vars(body)) for name, body in state.bodies.items()},
        supported=state.supported,
        contained=state.contained,
        held=state.held,
        reach=state.reach,
        hand_opening=state.hand_opening,
    )


def _states_of(document: LearnedDomainFile) -> list[Perceived]:
    kitchens = [
        State(
            {name: Seen(**seen_object.model_dump()) for name, seen_object in state.objects.items()},
            state.gripper_x,
            state.gripper_y,
            state.opening,
            state.mass,
        )
        for state in document.states
    ]
    rooms = [
        RoomState(
            {name: Body(**body.model_dump()) for name, body in room.bodies.items()},
            dict(room.supported),
            dict(room.contained),
            room.held,
            room.reach,
            room.hand_opening,
        )
        for room in document.rooms
    ]
    return [*kitchens, *rooms]


def memory_of(document: LearnedDomainFile, where: str) -> Memory:
    """Return the memory of a document. Raises BadInput naming what refers to nothing, or is no expression."""
    predicates = {
        each.name: Predicate(each.name, each.arguments, read(each.means, f"{where}: {each.name}"))
        for each in document.predicates
    }
    setting = SETTINGS[document.setting]
    check(predicates, setting.words)
    memory = ThesisMemory(setting) if document.learner.startswith(THESIS) else Memory(setting)
    memory.states = _states_of(document)
    phrases = [Phrase(each.text, each.arguments) for each in document.phrases]
    for phrase, entry in zip(phrases, document.phrases, strict=True):
        if entry.predicate not in predicates:
            raise _refuse(where, f"there is no predicate {entry.predicate!r}")
        if predicates[entry.predicate].arguments != entry.arguments:
            raise _refuse(where, f"{entry.predicate} is not about {entry.arguments} objects")
        predicate = predicates[entry.predicate]
        given_predicate = setting.given.get(entry.predicate)
        memory.meanings[phrase] = (
            (predicate.name, *predicate.variables) if given_predicate == predicate else predicate.means
        )
        for example in entry.examples:
            if example.state >= len(memory.states) or len(example.objects) != entry.arguments:
                raise _refuse(where, f"an example of {entry.text!r} names no state, or other objects")
            if not set(example.objects) <= set(memory.states[example.state].names):
                raise _refuse(where, f"an example of {entry.text!r} names objects that its state has not")
            memory.labels[phrase].append(Label(**example.model_dump()))
    for stated in document.preconditions:
        phrase = _phrase(phrases, stated.phrase, where)
        memory.stated[stated.action, phrase, stated.variables] = stated.times
    memory.goals = defaultdict(list)
    for goal in document.goals:
        memory.goals[goal.text].append((_phrase(phrases, goal.phrase, where), goal.places))
    for done in document.transitions:
        if max(done.before, done.after) >= len(memory.states):
            raise _refuse(where, "an action refers to a state that is not there")
        memory.transitions.append(Transition(done.action, done.before, done.after))
    memory.dialogue = [Turn(**turn.model_dump()) for turn in document.dialogue]
    memory.disbelieved = list(document.disbelieved)
    memory.questions = document.questions
    return memory


def _phrase(phrases: list[Phrase], number: int, where: str) -> Phrase:
    if number >= len(phrases):
        raise _refuse(where, f"there is no phrase {number}")
    return phrases[number]


def _refuse(where: str, message: str) -> BadInput:
    return BadInput(f"{where}: {message}", hint="teach it again (scenewright predicates teach)")
