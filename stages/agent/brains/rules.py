"""The `rules` brain: no language model. It takes the words apart by patterns, lets the task planner order the steps,
and writes one of them at a time.

A state machine: `Beliefs` are its state, `transitions` change it by what came back, and the first of the brain's
`_steps` is the next program. How far it looks at what was done is the arm's `Style`.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator

from scenewright.stages.agent.brains.beliefs import Asked, Beliefs, Check, Duty, Style, fits
from scenewright.stages.agent.brains.brain import Reply
from scenewright.stages.agent.brains.slips import Slips
from scenewright.stages.agent.brains.steps import Step, steps_to, steps_to_door
from scenewright.stages.agent.brains.transitions import learn
from scenewright.stages.agent.brains.words import NotUnderstood, understood
from scenewright.stages.agent.goals import CARRIERS, FURNITURE, Among, Description, Gather, Goal, Move, Shut
from scenewright.stages.agent.language.interpreter import Ran
from scenewright.stages.agent.language.values import SceneObject

SEVERAL = 2
"""Fewest things that have a middle to gather at; one alone is its own middle."""
MOST_TROUBLES = 30
"""Troubles after which a session is given up."""
MOST_PICTURES = 2
"""Pictures taken of a thing that looks used, to see whether it is."""


class RulesBrain:
    """Pursues goals in their order, one step a program."""

    label = "rules"

    def __init__(self, words: str, style: Style, slips: Slips) -> None:
        self._style, self._slips, self._turn = style, slips, 0
        self._refusal, goals = "", tuple[Goal, ...]()
        try:
            goals = understood(words)
        except NotUnderstood as error:
            self._refusal = str(error)
        self.beliefs = Beliefs(goals, style)
        self._gathered = ""
        """Where things are being gathered."""

    def reply(self, last: Ran | None) -> Reply:
        """Return the next step as a program."""
        self._turn += 1
        if self._refusal:
            return _end("ask", self._refusal)
        if last is not None:
            learn(self.beliefs, last)
        if self.beliefs.troubles > MOST_TROUBLES:
            return _end("give_up", f"{self.beliefs.troubles} things went wrong")
        return self._next()

    def _next(self) -> Reply:
        return next(filter(None, self._steps()))

    def _steps(self) -> Iterator[Reply | None]:
        """Yield what may have to be done, the most pressing first: duties, what is in the hand, goals, the end."""
        beliefs, duties = self.beliefs, self.beliefs.duties
        if not beliefs.explored and not any(note.looked for note in beliefs.notes.values()):
            yield self._write("See what is here.", Asked("explore_local"), "here = explore_local()")
        if beliefs.check is not None:
            yield self._picture(beliefs.check)
        if Duty.STEP_ASIDE in duties:
            yield self._step_aside()
        if Duty.LOOK_AGAIN in duties:
            yield self._look("Something is not as expected: look again.")
        if beliefs.held is not None:
            yield self._use_hand(beliefs.held)
        yield from map(self._toward, beliefs.goals)
        for lost in beliefs.missed():
            yield self._where_is(lost) or _end("give_up", f"{lost.key} got lost on the way")
        for reason in filter(None, map(beliefs.left_over, beliefs.goals)):
            yield _end("give_up", reason)
        yield self._write("Everything is where it belongs.", Asked("done"), "done()")

    # ---- what comes before every goal ----

    def _picture(self, check: Check) -> Reply:
        """Look at what was done."""
        if check.where == "spot":
            return self._call("Does it lie there?", "report_observation", check.target)
        why, pose = ("Is it in the hand?", "stay") if check.where == "hand" else ("Does it lie there?", "rest")
        return self._write(why, Asked("report_observation"), f'report_observation("{pose}")')

    def _step_aside(self) -> Reply:
        """Drive before the thing itself, or before the furniture anew: another base pose, perhaps."""
        self.beliefs.demand(Duty.STEP_ASIDE, False)
        key = self.beliefs.asked.key
        target = self.beliefs.things.get(key) or self.beliefs.rooms.get(key)
        if target is not None:
            return self._call("Try from elsewhere.", "navigate", target)
        if Duty.LOOK_AGAIN in self.beliefs.duties:
            return self._look("Look again.")
        return self._write("Think again.", Asked(), "print()")

    def _use_hand(self, held: SceneObject) -> Reply | None:
        """Bring what is in the hand to where a goal has it, or put it back, near something where the furniture is not
        known yet."""
        beliefs = self.beliefs
        goals = () if Duty.PUT_BACK in beliefs.duties else beliefs.wanted_by(held)
        if goals:
            return next(filter(None, map(self._toward, goals)), None)
        beliefs.demand(Duty.PUT_BACK)
        near = [t for t in beliefs.things.values() if t.place == held.place and t.label not in CARRIERS]
        if held.place not in beliefs.rooms and not near:
            return self._explore()
        if beliefs.at != held.place and not self._style.skilled:
            return self._step(Step("navigate", held.place))
        target = beliefs.rooms[held.place] if held.place in beliefs.rooms else near[0]
        return self._call("That is not it: put it back.", "place", target)

    # ---- goals ----

    def _toward(self, goal: Goal) -> Reply | None:
        """Return the next step towards a goal; None where it is met."""
        match goal:
            case Shut(what=what, opened=opened):
                return self._shut(what, opened)
            case Gather(what=what, onto=onto):
                return self._gather(what, onto)
            case Among(what=what, around=around):
                return self._bring(Move(what, around), "place_among")
            case Move():
                return self._bring(goal, "place")

    def _shut(self, what: Description, opened: bool) -> Reply | None:
        beliefs = self.beliefs
        if not beliefs.explored:
            return self._explore()
        if not beliefs.furniture(what):
            return _end("give_up", f"there is no {what.text}")
        place = next((place for place in beliefs.able(what) if beliefs.rooms[place].opened != opened), None)
        if place is None:
            return None
        if beliefs.gave_up(place, "door"):
            return _end("give_up", f"the door of {place} does not move")
        return self._step(steps_to_door(beliefs.at, place, opened=opened)[0])

    def _gather(self, what: Description, onto: Description) -> Reply | None:
        beliefs = self.beliefs
        if not beliefs.explored:
            return self._explore()
        unseen = self._seen_less_than(self._style.thorough, beliefs.furniture(onto))
        if unseen and beliefs.held is None:
            return self._go_and_look(unseen[0])
        able = beliefs.able(onto)
        if not able:
            return self._no_way(onto)
        things = beliefs.fitting(what)
        counts = Counter(thing.place for thing in things)
        if self._gathered not in able:
            self._gathered = max(able, key=lambda place: (counts[place], place == beliefs.at))
        best = self._gathered
        thing = beliefs.held or next((t for t in things if t.place != best), None)
        if thing is None:
            return None if things else self._search(what, [])
        return self._deliver(thing, what, beliefs.rooms[best], "place")

    def _bring(self, goal: Move, how: str) -> Reply | None:
        """Return the next step that brings one thing, or all there are; `how` is the call that puts it down."""
        beliefs, what, onto, among = self.beliefs, goal.what, goal.onto, how == "place_among"
        starts = beliefs.furniture(Description((goal.start,))) if goal.start else []
        if goal.start or onto.labels[0] in FURNITURE:
            if not beliefs.explored:
                return self._explore()
            if goal.start and not starts:
                return _end("give_up", f"there is no {goal.start}")
        if beliefs.held is None:
            everywhere = goal.every or among
            needed = starts if goal.start else [beliefs.began] if everywhere and beliefs.began else []
            unseen = self._seen_less_than(self._style.thorough if everywhere else 1, needed)
            if unseen:
                return self._go_and_look(unseen[0])
        surely = beliefs.fitting(what)
        fitting = [
            t
            for t in beliefs.things.values()
            if t in surely or (beliefs.anyway(t, goal) and not beliefs.notes[t.key].rejected)
        ]
        there = [t for t in fitting if beliefs.is_on(t, onto, how)]
        away = [
            t for t in fitting if t not in there and (not goal.start or t.place in starts or t.label in beliefs.handled)
        ]
        if beliefs.held is None and there and not (goal.every and away):
            return None
        if not goal.every:  # one is enough: rather another one, and nobody has to be brought a wrong one
            away = [t for t in away if not beliefs.may_be_other(t, what)]
        nearest = min(away, key=lambda t: (t.place != beliefs.at, -t.ahead, t.key), default=None)
        thing = beliefs.held or nearest
        if thing is None:
            return self._search(what, starts)
        target = beliefs.carrier(onto)
        if target is None:
            return self._no_way(onto) if onto.labels[0] in FURNITURE else self._search(onto, [])
        if target.top and goal.inside:
            return _end("give_up", f"I put things on the {target.label}, not into it")
        if among and self._style.skilled and beliefs.held is None and len(beliefs.fitting(onto)) < SEVERAL:
            return _end("give_up", f"one {onto.text} is all that was surely seen: it has no middle")
        return self._deliver(thing, what, target, how)

    def _deliver(self, thing: SceneObject, what: Description, target: SceneObject, how: str) -> Reply:
        """Return the next step that brings a thing to a target."""
        beliefs, skilled = self.beliefs, self._style.skilled
        holding = beliefs.held is not None
        if not holding and thing.place == beliefs.at and self._needs_picture(thing, what):
            return self._call("Is it what it looks like?", "report_observation", thing)
        source, place = "" if holding else thing.place, target.place or target.key
        doors = frozenset(key for key, item in beliefs.rooms.items() if item.door)
        on_top = {key for key, item in ((source, thing), (place, target)) if item.top}
        shut = frozenset(key for key in doors - on_top if not beliefs.rooms[key].opened)
        steps = steps_to(beliefs.at, source, place, shut, doors)
        if skilled:
            steps = tuple(step for step in steps if step.name != "navigate") or steps
        match steps[0].name if steps else "":
            case "":
                return _end("give_up", f"no steps bring {thing.key} to {target.key}")
            case "grasp":
                return self._call(f"Take {thing.key}.", "grasp", thing)
            case "place":
                return self._call(f"Put it on {target.key}.", how, target)
            case _:
                return self._step(steps[0])

    def _needs_picture(self, thing: SceneObject, what: Description) -> bool:
        clean = what.clean and thing.used is None and self._style.skilled
        return not self.beliefs.notes[thing.key].checked and (self._style.pictures or clean)

    # ---- looking ----

    def _search(self, what: Description, places: list[str]) -> Reply:
        """Look where nobody looked yet, tables first, what has doors last; from other sides after that."""
        beliefs, notes = self.beliefs, self.beliefs.notes
        if beliefs.held is not None and beliefs.explored:
            return _end("give_up", f"no {what.text} was found to put it on")
        lost = next((t for t in beliefs.lost if fits(what, t)), None)
        step = self._where_is(lost) if lost else None
        if step is not None:
            return step
        for thing in beliefs.things.values():
            doubtful = self._style.skilled and what.clean and thing.label in what.labels and thing.used
            if doubtful and notes[thing.key].failed["picture"] < MOST_PICTURES:
                notes[thing.key].failed["picture"] += 1
                return self._call("Is it really used?", "report_observation", thing)
        if not beliefs.explored:
            return self._explore()
        rooms = beliefs.rooms
        order = places or sorted(rooms, key=lambda k: (rooms[k].door, rooms[k].label != "table", k != beliefs.at))
        for rounds in range(1, self._style.rounds + 1):
            for place in self._seen_less_than(rounds, order):
                if not notes[place].rejected:
                    return self._go_and_look(place)
        return self._not_found(what, sum(notes[place].looked > 0 for place in order))

    def _not_found(self, what: Description, places: int) -> Reply:
        beliefs = self.beliefs
        for thing in beliefs.fitting(what):
            if beliefs.may_be_other(thing, what):
                other = beliefs.notes[thing.key].disputed
                return _end("ask", f"is {thing.key} a {thing.label}, or a {other}?")
        for thing in beliefs.things.values():
            if beliefs.notes[thing.key].unmoved and fits(what, thing):
                said = f"{thing.key} could not be moved, and no other {what.text} was found in {places} places"
                return _end("give_up", said)
        return _end("give_up", f"no {what.text} was found in {places} places")

    def _where_is(self, lost: SceneObject) -> Reply | None:
        """Look once more where something got lost; None where that was done often enough."""
        if self.beliefs.gave_up(lost.key, "lost"):
            return None
        self.beliefs.notes[lost.key].failed["lost"] += 1
        if self.beliefs.at != lost.place and lost.place in self.beliefs.rooms:
            return self._step(Step("navigate", lost.place))
        return self._look(f"Where is {lost.key}?")

    def _seen_less_than(self, times: int, places: list[str]) -> list[str]:
        return [place for place in places if self.beliefs.notes[place].looked < times]

    def _go_and_look(self, place: str) -> Reply:
        """Go before furniture, open it where it has a door, and look; each in its turn."""
        beliefs, note = self.beliefs, self.beliefs.notes[place]
        if beliefs.gave_up(place, "navigate", "door"):
            note.rejected = True
            note.looked += self._style.rounds
            return self._next()  # there is one place less to look at
        item = beliefs.rooms.get(place)
        just_opened = beliefs.asked == ("open", place) and (note.several or (item is not None and item.top))
        again = note.looked > 0 and self._style.skilled and beliefs.asked != ("navigate", place) and not just_opened
        if item is not None and (beliefs.at != place or again):
            return self._step(Step("navigate", place))
        on_top = item is not None and item.top and not note.looked
        next_door = item is not None and item.more and beliefs.asked != ("open", place)
        if item is not None and item.door and (not item.opened or next_door) and not on_top:
            return self._step(Step("open", place))
        return self._look("What is here?")

    def _no_way(self, onto: Description) -> Reply:
        known = self.beliefs.furniture(onto)
        return _end("give_up", f"the {onto.text} cannot be reached" if known else f"there is no {onto.text}")

    # ---- programs ----

    def _look(self, why: str) -> Reply:
        at = self.beliefs.at
        return self._write(why, Asked("explore_local", at), f"{self.beliefs.map_name(at)} = explore_local()")

    def _explore(self) -> Reply:
        return self._write("See what there is.", Asked("explore_global"), "rooms = explore_global()")

    def _step(self, step: Step) -> Reply:
        return self._call(f"{step.name} {step.furniture}", step.name, self.beliefs.rooms[step.furniture])

    def _call(self, why: str, name: str, target: SceneObject) -> Reply:
        in_rooms = target.key in self.beliefs.rooms
        written = f"rooms[{target.key!r}]" if in_rooms else self.beliefs.notes[target.key].written
        return self._write(why, Asked(name, target.key), f"{name}({written})")

    def _write(self, why: str, asked: Asked, line: str) -> Reply:
        self.beliefs.asked = asked
        return Reply(why, self._slips.written(line, self._turn))


def _end(word: str, reason: str) -> Reply:
    """Return the program that ends the session."""
    return Reply(reason, f"{word}({reason!r})")
