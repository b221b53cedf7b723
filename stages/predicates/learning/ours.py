"""Our learner: a synthesiser over the grammar, a set of all old labels, questions, and a search for what is not known.

It hears a sentence, takes it for a phrase with a meaning, and keeps what it says as a label. Whatever follows from an
action that was allowed, or a goal that was reached, is a label too. A meaning is the cheapest that agrees with all
labels; where one label stands against cheap meanings, the learner asks again, and says what it no longer believes.
"""

from __future__ import annotations

import itertools
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence

import numpy as np
from scenewright.stages.kit.predicates.evaluating import Evaluator
from scenewright.stages.kit.predicates.vocabulary import Perceived
from scenewright.stages.kit.tasks.strips import Atom
from scenewright.stages.predicates.learning.memory import Memory, Turn
from scenewright.stages.predicates.learning.operators import Transition
from scenewright.stages.predicates.learning.phrases import Phrase, phrase_of
from scenewright.stages.predicates.learning.synthesis import FOLLOWED, Label, Synthesiser
from scenewright.stages.predicates.teacher.simulated import Teacher

MOST_QUESTIONS = 3
"""Most questions about one phrase, by which it is told apart from its rivals; by eye."""
ASKED_AGAIN = 2.0
"""Weight of a sentence that was confirmed."""
MOST_TRIES = 3
"""Most tries of an action in one situation, when nothing that was named speaks against it; by eye."""
DOUBT_AFTER = 2
"""Episodes without their goal after which what was said once is tried."""


class OursLearner:
    """Learns from a teacher; `memory` may hold what another domain taught."""

    label = "ours"
    plans = True
    """Whether it follows plans while it is taught."""

    def __init__(self, teacher: Teacher, actions: Sequence[str], seed: int, memory: Memory | None = None) -> None:
        self.memory = memory or Memory()
        self.setting = self.memory.setting
        self.teacher, self.actions = teacher, tuple(actions)
        self.random = np.random.default_rng([seed, 11])
        self._synthesiser = Synthesiser(self.memory.states, self.setting)
        self._tried: Counter[tuple[str, ...]] = Counter()
        self._refusals: list[tuple[tuple[str, ...], Atom, Perceived]] = []
        self._asked: Counter[Phrase] = Counter()
        self._facts: tuple[Perceived | None, bool, dict[str, tuple[str, ...]]] = (None, False, {})
        self.sought: tuple[Atom, frozenset[Atom]] | None = None
        """An action that is to be tried, and what has to hold first."""
        self.seeking: Counter[tuple[Atom, frozenset[Atom]]] = Counter()
        """How often each of these was sought: no more than MOST_TRIES times."""
        self.missed = 0
        """Episodes that ended without their goal."""

    # ---- what it hears -----------------------------------------------------------------------------------------

    def refused(self, state: Perceived, action: Atom, sentence: str) -> None:
        """Take in that an action was not allowed, and what was said about it."""
        situation = self._situation(state, action)
        self._tried[situation] += 1
        self._refusals.append((situation, action, state))
        if not sentence:
            return
        phrase, objects = self._hear(state, sentence, f"{' '.join(action)}")
        variables = dict(zip(action[1:], ("?a", "?b"), strict=False))
        if all(name in variables for name in objects):
            key = (action[0], phrase, tuple(variables[name] for name in objects))
            self.memory.stated[key] = self.memory.stated.get(key, 0) + 1
            for transition in self.memory.transitions:
                if transition.action[0] == action[0]:
                    self._follows(phrase, key[2], transition)
        self._understand(phrase, state)

    def allowed(self, before: Perceived, action: Atom, after: Perceived) -> None:
        """Take in that an action was allowed and done: what the teacher named for it held."""
        self._tried[self._situation(before, action)] += 1
        transition = Transition(action, self.memory.remember(before), self.memory.remember(after))
        self.memory.transitions.append(transition)
        for name, phrase, variables in list(self.memory.stated):
            if name == action[0]:
                self._follows(phrase, variables, transition)
                self._understand(phrase, before)

    def _follows(self, phrase: Phrase, variables: tuple[str, ...], transition: Transition) -> None:
        binding = dict(zip(("?a", "?b"), transition.action[1:], strict=False))
        objects = tuple(binding[variable] for variable in variables)
        source = f"{FOLLOWED}{transition.action[0]} {' '.join(variables)}"
        self.memory.labels[phrase].append(Label(transition.before, objects, True, source, 1.0))

    def unmet(self, state: Perceived, parts: list[tuple[str, tuple[str, ...]]], sentence: str) -> None:
        """Take in what the teacher misses of a goal."""
        if not sentence:
            return
        phrase, objects = self._hear(state, sentence, "done")
        fitting = [(part, names) for part, names in parts if set(objects) <= set(names)]
        # The part that speaks of the same things; of several, one that nobody has explained yet.
        fitting.sort(
            key=lambda entry: (
                -len(Phrase(entry[0], 0).concepts & phrase.concepts),
                len(self.memory.goals.get(entry[0], [])),
            )
        )
        self._understand(phrase, state)
        if not fitting:
            return
        part, names = fitting[0]
        places = tuple(names.index(name) for name in objects)
        meanings, phrases = self.memory.meanings, self.memory.goals[part]
        if all(meanings.get(known_phrase) != meanings[phrase] or at != places for known_phrase, at in phrases):
            phrases.append((phrase, places))

    def reached(self, state: Perceived, parts: list[tuple[str, tuple[str, ...]]]) -> None:
        """Take in that a goal was reached: all that was missed of it holds."""
        number = self.memory.remember(state)
        for part, objects in parts:
            for phrase, places in self.memory.goals.get(part, []):
                goal_objects = tuple(objects[index] for index in places)
                self.memory.labels[phrase].append(Label(number, goal_objects, True, "goal"))
                self._understand(phrase, state)

    def _hear(self, state: Perceived, sentence: str, about: str) -> tuple[Phrase, tuple[str, ...]]:
        self.memory.dialogue.append(Turn("teacher", sentence, about))
        phrase, objects = self._phrase_of(sentence, state)
        turn = len(self.memory.dialogue) - 1
        label = Label(self.memory.remember(state), objects, False, "sentence", 1.0, turn)
        self.memory.labels[phrase].append(label)
        return phrase, objects

    def _phrase_of(self, sentence: str, state: Perceived) -> tuple[Phrase, tuple[str, ...]]:
        """Return a sentence as a phrase and its objects."""
        return phrase_of(sentence, state.names)

    # ---- what it makes of it -----------------------------------------------------------------------------------

    def _understand(self, phrase: Phrase, state: Perceived) -> None:
        """Find the meaning anew; ask again about a sentence that stands against it, and between rivals."""
        labels = self.memory.labels[phrase]
        meaning = self._synthesiser.best(phrase, labels)
        for _ in range(4):
            if not meaning.violated:
                break
            self._mend(phrase, labels, [labels[index] for index in meaning.violated])
            meaning = self._synthesiser.best(phrase, labels)
        self.memory.meanings[phrase] = meaning.means
        while meaning.rivals and self._asked[phrase] < MOST_QUESTIONS:
            question = self._telling(meaning.means, meaning.rivals, phrase, state)
            if question is None:
                break
            self._asked[phrase] += 1
            self._ask(phrase, question, state)
            meaning = self._synthesiser.best(phrase, labels)
            self.memory.meanings[phrase] = meaning.means

    def _mend(self, phrase: Phrase, labels: list[Label], violated: list[Label]) -> None:
        """Do something about labels that a cheap meaning contradicts: ask again, or stop believing a precondition."""
        for label in violated:
            if label.source in ("sentence", "answer") and label.weight < ASKED_AGAIN:
                if self._question(phrase, label.objects, self.memory.states[label.state]) != label.holds:
                    labels.remove(label)
                    self._disbelieve(phrase, label)
                else:
                    label.weight = ASKED_AGAIN
                return
        for label in violated:
            if label.source.startswith(FOLLOWED):
                _, action, *variables = label.source.split()
                self.memory.stated.pop((action, phrase, tuple(variables)), None)
                labels[:] = [each for each in labels if each.source != label.source]
                sentence = phrase.text.replace("object ", "")
                self.memory.disbelieved.append(f"that {action} fails when {sentence}: it was done all the same")
                return
            if label.source == "goal":
                labels.remove(label)
                return

    def reconsider(self) -> None:
        """Take stock after an episode that missed its goal. Once DOUBT_AFTER did, ask again about what alone makes a
        phrase mean what it does: sentences and answers without which it would mean something else."""
        self.missed += 1
        doubted = ASKED_AGAIN + self.missed - DOUBT_AFTER
        for phrase, labels in list(self.memory.labels.items()) if self.missed >= DOUBT_AFTER else []:
            for label in [each for each in labels if each.source in ("sentence", "answer") and each.weight < doubted]:
                other_labels = [each for each in labels if each is not label]
                if self._synthesiser.best(phrase, other_labels).means == self.memory.meanings[phrase]:
                    continue
                if self._question(phrase, label.objects, self.memory.states[label.state]) == label.holds:
                    label.weight += 1.0
                else:
                    labels.remove(label)
                    self._disbelieve(phrase, label)
                    self._understand(phrase, self.memory.states[label.state])

    def _disbelieve(self, phrase: Phrase, label: Label) -> None:
        turn = self.memory.dialogue[label.turn]
        turn.believed = False
        question_text = f"{self.memory.dialogue[label.turn - 1].text} " if label.source == "answer" else ""
        self.memory.disbelieved.append(question_text + turn.text)
        action, *objects = turn.about.split() or [""]
        variables = dict(zip(objects, ("?a", "?b"), strict=False))
        key = (action, phrase, tuple(variables.get(name, name) for name in label.objects))
        if self.memory.stated.get(key, 0) > 1:
            self.memory.stated[key] -= 1
        else:
            self.memory.stated.pop(key, None)

    def _telling(
        self, means: object, rivals: tuple[object, ...], phrase: Phrase, state: Perceived
    ) -> tuple[str, ...] | None:
        """Return objects, now, for which rivals disagree most evenly; None when they agree on all that is here."""
        evaluator = Evaluator(state, self.setting.given)
        trees = [means, *rivals]
        best, best_objects = 0, None
        for objects in itertools.permutations(state.names, phrase.arguments):
            binding = dict(zip(("?a", "?b"), objects, strict=False))
            count_true = sum(evaluator.truth(tree, binding) for tree in trees)  # type: ignore[arg-type]
            if min(count_true, len(trees) - count_true) > best:
                best, best_objects = min(count_true, len(trees) - count_true), objects
        return best_objects

    def _ask(self, phrase: Phrase, objects: tuple[str, ...], state: Perceived) -> None:
        holds = self._question(phrase, objects, state)
        turn = len(self.memory.dialogue) - 1
        self.memory.labels[phrase].append(Label(self.memory.remember(state), objects, holds, "answer", 1.0, turn))

    def _question(self, phrase: Phrase, objects: tuple[str, ...], state: Perceived) -> bool:
        """Ask whether a complaint is right of objects in a state; returns whether its predicate holds."""
        text = phrase.text
        for number, name in enumerate(objects, start=1):
            text = text.replace(f"<{number}>", name)
        wrong = self.teacher.answer(state, phrase.text, objects)
        self.memory.questions += 1
        self.memory.dialogue.append(Turn("robot", f"Is it so that {text}?"))
        self.memory.dialogue.append(Turn("teacher", "yes" if wrong else "no", "question"))
        return not wrong

    # ---- what it tries -----------------------------------------------------------------------------------------

    def explore(self, state: Perceived) -> Atom | None:
        """Return the action in the situation that was tried least, of those that nothing is known against."""
        stated = self.memory.preconditions()
        atoms = self.memory.see(state)
        unexplained = self._unexplained_refusals(stated)
        best: list[Atom] = []
        fewest = 10**9
        for name in self.actions:
            for objects in itertools.permutations(state.names, self.setting.arity[name]):
                action = (name, *objects)
                binding = dict(zip(("?a", "?b"), objects, strict=False))
                preconditions = {(atom[0], *(binding[term] for term in atom[1:])) for atom in stated.get(name, ())}
                if not preconditions <= atoms:
                    continue
                situation = self._situation(state, action)
                count = self._tried[situation] - unexplained[situation]
                if count < fewest:
                    best, fewest = [], count
                if count == fewest:
                    best.append(action)
        return best[int(self.random.integers(len(best)))] if best else None

    def worth_trying(self, state: Perceived) -> Iterator[tuple[tuple[int, ...], Atom, frozenset[Atom]]]:
        """Yield actions that would tell most, with what has to hold first, and an order: smaller is better.

        Those that were never allowed, with all that was named for them; and, once DOUBT_AFTER episodes went amiss, any
        without one precondition that no action changes and that does not hold: it may be what the teacher was wrong
        about. Left out is what can be tried here and was, MOST_TRIES times, in such a situation."""
        done = {transition.action[0] for transition in self.memory.transitions}
        atoms, changing = self.memory.see(state), self._changing()
        stated_counts = self._stated_counts()
        for name in self.actions:
            times_stated = {atom: count for (action, atom), count in stated_counts.items() if action == name}
            for objects in itertools.permutations(state.names, self.setting.arity[name]):
                action = (name, *objects)
                times_of_bound = {_bound(atom, objects): count for atom, count in times_stated.items()}
                lacking = {atom: times_of_bound[atom] for atom in times_of_bound if atom not in atoms}
                doubted = [atom for atom in lacking if atom[0] not in changing]
                remaining = frozenset(times_of_bound) - set(doubted)
                if self.seeking[action, remaining] >= MOST_TRIES or (
                    remaining <= atoms and not self.little_tried(state, action)
                ):
                    continue
                if name not in done and not doubted:
                    yield (0, 0), action, remaining
                elif self.missed >= DOUBT_AFTER and len(doubted) == 1:
                    yield (1 + (name in done), lacking[doubted[0]]), action, remaining

    def _stated_counts(self) -> Counter[tuple[str, Atom]]:
        """Return action and precondition -> how often it was named."""
        names = self.memory.names()
        counts: Counter[tuple[str, Atom]] = Counter()
        for (action, phrase, variables), count in self.memory.stated.items():
            counts[action, (names[phrase], *variables)] += count
        return counts

    def doubtful(self, state: Perceived) -> Atom | None:
        """Return an action to try against what was said, which may be wrong: the one with the least against it.

        Of an action that was never allowed, whose preconditions were never seen to hold together and were said but
        once; and, once DOUBT_AFTER episodes went amiss, of any: first those that speak against nothing but what no
        action changes, then those that were named least, and were tried least in such a situation."""
        atoms, changing, stated_counts = self.memory.see(state), self._changing(), self._stated_counts()
        done = {transition.action[0] for transition in self.memory.transitions}
        weighted: list[tuple[tuple[int, ...], Atom]] = []
        for name in self.actions:
            preconditions = [(atom, count) for (action, atom), count in stated_counts.items() if action == name]
            never = name not in done and not self._held_together(name, [atom for atom, _ in preconditions])
            if not preconditions or not (never or self.missed >= DOUBT_AFTER):
                continue
            for objects in itertools.permutations(state.names, self.setting.arity[name]):
                against = [entry for entry in preconditions if _bound(entry[0], objects) not in atoms]
                tried = (name, *objects)
                if not against:
                    continue
                if self.missed >= DOUBT_AFTER:
                    fixed = sum(atom[0] in changing for atom, _ in against)
                    weight = sum(count for _, count in against) + self._tried[self._situation(state, tried)]
                    weighted.append(((weight, fixed), tried))
                elif max(count for _, count in against) == 1:
                    weighted.append(((len(against),), tried))
        fewest = [tried for weight, tried in weighted if weight == min(weighted)[0]]
        return fewest[int(self.random.integers(len(fewest)))] if fewest else None

    def _changing(self) -> set[str]:
        """Return the predicates that some action was seen to change."""
        atoms_of_state = {number: self.memory.see(self.memory.states[number]) for number in self._ends()}
        return {
            atom[0]
            for transition in self.memory.transitions
            for atom in atoms_of_state[transition.before] ^ atoms_of_state[transition.after]
        }

    def _ends(self) -> set[int]:
        return {number for each in self.memory.transitions for number in (each.before, each.after)}

    def _held_together(self, name: str, wanted: list[Atom]) -> bool:
        """Whether all of what was named for an action held at once, for some objects, in a state that was seen."""
        for state in self.memory.states:
            atoms_held = self.memory.see(state)
            for objects in itertools.permutations(state.names, self.setting.arity[name]):
                if all(_bound(atom, objects) in atoms_held for atom in wanted):
                    return True
        return False

    def curious(self, state: Perceived) -> bool:
        """Whether there is an action that was never tried in such a situation."""
        action = self.explore(state)
        if action is None:
            return False
        situation = self._situation(state, action)
        return self._tried[situation] <= self._unexplained_refusals(self.memory.preconditions())[situation]

    def _unexplained_refusals(self, stated: Mapping[str, frozenset[Atom]]) -> Counter[tuple[str, ...]]:
        """Return how often an action was refused in a situation though all that was named for it held: nothing was
        said, or what is no longer believed. Such an action is tried again, until it was tried MOST_TRIES times."""
        tries: Counter[tuple[str, ...]] = Counter()
        predicates = self.memory.predicates()
        for situation, action, state in self._refusals:
            evaluator = Evaluator(state, predicates)
            preconditions = (_bound(atom, action[1:]) for atom in stated.get(action[0], ()))
            if self._tried[situation] < MOST_TRIES and all(map(evaluator.holds, preconditions)):
                tries[situation] += 1
        return tries

    def little_tried(self, state: Perceived, action: Atom | None) -> bool:
        """Whether an action was tried less than MOST_TRIES times in such a situation."""
        return action is not None and self._tried[self._situation(state, action)] < MOST_TRIES

    def _situation(self, state: Perceived, action: Atom) -> tuple[str, ...]:
        """Return what matters of a state for an action, as far as one can see: what kind of things they are, whether
        something is held, what rests on or within what."""
        if self._facts[0] is not state:
            holding_predicate = self.setting.held
            evaluator = Evaluator(state, self.setting.given)
            full = any(evaluator.holds((holding_predicate, name)) for name in state.names)
            self._facts = (state, full, {name: self.setting.facts(state, name) for name in state.names})
        _, full, facts = self._facts
        return (action[0], f"full:{full}", *(fact for name in action[1:] for fact in facts[name]))


def _bound(atom: Atom, objects: Sequence[str]) -> Atom:
    binding = dict(zip(("?a", "?b"), objects, strict=False))
    return (atom[0], *(binding[term] for term in atom[1:]))
