"""The parts of generated rooms: public ones with all rungs, and sealed ones that nobody can have tuned on."""

from __future__ import annotations

import hashlib
import shutil
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from datetime import UTC, datetime
from pathlib import Path

from benchmarks.board.inputs import HEADLINE, LADDER, PUBLIC, RUNGS, Generator, RoomInputs
from benchmarks.board.judge import judge
from benchmarks.board.method import Method, MethodFailed
from benchmarks.board.reconstruct import ARMS, reconstruct
from benchmarks.board.records import Line, Trial, judge_digest, key_of

PUBLIC_PART, SEALED_PART = "public", "sealed"
OURS, THESIS, REFERENCE = "ours", "thesis", "reference"
REFERENCE_COMMIT = "412dc5f3"
"""The commit that claims of better are paired with."""
SEALED_RECIPES = ("kitchen", "office", "bedroom", "room", *("household", "lodging") * 4)
"""One sealed room each."""
MOST_DRAWS = 20
"""Seeds that are tried for a sealed room: some hold no room."""
FAILED = {"failed": 1.0}
"""Figures of an arm that ended without a scene: `zeros` of the figures makes of it what it is worth."""


@dataclass(frozen=True)
class Setting:
    """What is measured, against what, and where everything lies."""

    method: Method
    reference: Method
    generator: Generator
    work: Path
    kept: Path
    board: Method
    """The checkout that judges."""
    data: Path
    """Folder of the recorded logs."""
    keep: bool = False
    """Leave the artifacts (100 MB a room)."""

    def line(self, trial: Trial, arm: str, method: Method, **told: Mapping[str, object]) -> Line:
        """Return the line of a trial, with who measured what."""
        return Line.model_validate(
            {
                "trial": trial,
                "key": key_of(trial, method.digest, asdict(ARMS[arm]), judge_digest()),
                "commit": method.commit,
                "committed": method.committed,
                "digest": method.digest,
                "clean": method.clean and self.board.clean,
                "board": self.board.commit,
                "judge": judge_digest(),
                "day": datetime.now(UTC).date().isoformat(),
                **told,
            }
        )

    def read_kept(self, key: str) -> Line | None:
        """Return the line that is kept under a key."""
        file = self.kept / f"{key}.json"
        return Line.model_validate_json(file.read_bytes()) if file.is_file() else None

    def keep_line(self, line: Line) -> Line:
        """Keep a line; it appears whole."""
        self.kept.mkdir(parents=True, exist_ok=True)
        partial = self.kept / f"{line.key}.partial"
        partial.write_text(line.model_dump_json() + "\n", encoding="utf-8")
        partial.replace(self.kept / f"{line.key}.json")
        return line


def sealed_seed(digest: str, number: int, draw: int) -> int:
    """Return the seed of a sealed room: whoever changes a line of the method gets other rooms."""
    return int(hashlib.sha256(f"{digest}/{number}/{draw}".encode()).hexdigest()[:7], 16)


def measure_public(setting: Setting, room: str, rungs: Sequence[str] = ()) -> Iterator[Line]:
    """Yield the lines of a public room: every rung where it is one of the ladder, else the headline alone."""
    chosen = rungs or (RUNGS if room in LADDER else (HEADLINE,))
    for rung in chosen:
        trials = {Trial(part=PUBLIC_PART, case=rung, seed=room, arm=OURS): (setting.method, OURS)}
        yield from _measure(setting, trials, room)
    _clear(setting, room)


def measure_sealed(setting: Setting, number: int) -> Iterator[Line]:
    """Yield the lines of a sealed room under everything at once: ours, the reference's, the thesis's."""
    room = sealed_room(setting, number)
    arms = {OURS: (setting.method, OURS), THESIS: (setting.method, THESIS)}
    if setting.reference.digest != setting.method.digest:
        arms[REFERENCE] = (setting.reference, OURS)
    trials = {Trial(part=SEALED_PART, case=HEADLINE, seed=room, arm=arm): what for arm, what in arms.items()}
    yield from _measure(setting, trials, room)
    _clear(setting, room)


def sealed_room(setting: Setting, number: int) -> str:
    """Return the name of a sealed room, the first drawn seed that holds one. Raises MethodFailed when none does."""
    recipe = SEALED_RECIPES[number]
    for draw in range(MOST_DRAWS):
        name = f"{recipe}-{sealed_seed(setting.method.digest, number, draw)}"
        try:
            setting.generator.room(name, RUNGS[HEADLINE])
        except MethodFailed as error:
            if draw == MOST_DRAWS - 1 or error.command != "synthesize":
                raise
            continue
        return name
    raise AssertionError("the loop returns or raises")


def _measure(setting: Setting, trials: Mapping[Trial, tuple[Method, str]], room: str) -> Iterator[Line]:
    """Yield the line of each trial of one room and rung, kept or measured."""
    inputs: RoomInputs | None = None
    for trial, (method, arm) in trials.items():
        kept = setting.read_kept(key_of(trial, method.digest, asdict(ARMS[arm]), judge_digest()))
        if kept is None:
            rung = RUNGS[trial.case]
            inputs = inputs or setting.generator.room(room, rung)
            folder = setting.work / room / f"{rung.recording}{'_bent' * rung.bent}"
            kept = setting.keep_line(_one(setting, trial, method, arm, inputs, folder / method.commit))
        yield kept


def _one(setting: Setting, trial: Trial, method: Method, arm: str, inputs: RoomInputs, folder: Path) -> Line:
    rung = RUNGS[trial.case]
    try:
        made, seconds = reconstruct(method, arm, inputs, folder, estimated=rung.estimated)
    except MethodFailed as error:
        return setting.line(trial, arm, method, figures=FAILED, facts={"failed": str(error)})
    return setting.line(trial, arm, method, figures=judge(inputs, made), seconds=seconds)


def _clear(setting: Setting, room: str) -> None:
    if not setting.keep:
        shutil.rmtree(setting.work / room, ignore_errors=True)


def public_rooms() -> tuple[str, ...]:
    """Return the public rooms, those of the ladder first."""
    return (*LADDER, *(room for room in PUBLIC if room not in LADDER))
