"""What lies on the desk: an artifact, the edits of a file, and what these come to, said at once, on the artifact and on
what it was made from."""

from __future__ import annotations

import threading
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from scenewright.cli.edit_command import asked_edit
from scenewright.cli.edit_forms import forms_of
from scenewright.cli.explaining.explaining import sentences
from scenewright.cli.viewing.desk.asking import Asking
from scenewright.cli.viewing.desk.subjects import subjects_of
from scenewright.cli.viewing.view import viewer_of
from scenewright.schemas.edits import AnyEdit, AppliedEdit, Edit, EditsFile
from scenewright.schemas.errors import BadInput, ScenewrightError, UsageError
from scenewright.schemas.language_map import LanguageMap
from scenewright.schemas.plain_text import cleaned
from scenewright.schemas.vocabulary import load_vocabulary
from scenewright.stages.edit.edits_file import UNWRITTEN, Changed, append_edits, read_edits, remove_edit, revision_of
from scenewright.stages.engine.reading import open_artifact, read_manifest
from scenewright.stages.kit.viewing.canvas import Canvas
from scenewright.stages.kit.viewing.page.page_canvas import PageCanvas, ServedPage

SCRIPTS = tuple(Path(__file__).with_name(name) for name in ("editing.js", "asking.js"))
EMPTY = EditsFile(format="scenewright-edits", version=1)
"""What a desk without a file of edits applies."""


class Stale(BadInput):
    """What a page shows is no longer what there is."""


class Desk:
    """One artifact, one file of edits (or None: there is nothing to edit), one who asks at a time.

    Raises BadInput for an artifact that cannot be shown, or when neither it nor what it was made from can be edited.
    """

    def __init__(self, path: Path, edits: Path | None, *, read_only: bool = False) -> None:
        self.path, self.edits, self.read_only = path, edits, read_only or edits is None
        self._turn = threading.RLock()
        self._page: bytes = b""
        self._page_of: tuple[str, ...] = ()
        self._open()
        if edits is not None:
            read_edits(edits) if edits.exists() else None
            self._apply()

    # ---- what is there -----------------------------------------------------------------------------------------------
    def _open(self) -> None:
        artifact = open_artifact(self.path)
        if viewer_of(type(artifact)) is None:
            raise BadInput(f"{self.path}: a {artifact.kind!r} artifact has no view", hint="open its files elsewhere")
        self.subjects = [] if self.edits is None else subjects_of(artifact, self.edits)
        self._artifact = artifact
        self._asking = Asking(artifact) if isinstance(artifact, LanguageMap) else None
        self._applied: tuple[AnyEdit, ...] = ()
        self._records: list[AppliedEdit] = []
        self._revision: str | None = None
        self._trouble = ""

    @property
    def shown(self) -> str:
        """The digest of what is shown."""
        assert self._artifact.manifest is not None
        return self._artifact.manifest.content_digest

    def _there(self) -> str:
        """Return the digest of what lies in the folder now; raise BadInput when nothing whole does."""
        return read_manifest(self.path).content_digest

    def _apply(self) -> None:
        """Bring what is held up to what the file says now; a file that is broken is said, and changes nothing."""
        assert self.edits is not None
        try:
            revision = revision_of(self.edits)
            if revision == self._revision:
                return
            all_edits: Sequence[AnyEdit] = (read_edits(self.edits) if revision else EMPTY).edits
        except ScenewrightError as error:
            self._trouble = str(error)
            return
        self._trouble = ""
        done = len(self._applied)
        if tuple(all_edits[:done]) != self._applied:
            self._records, done = [], 0
            for subject in self.subjects:
                subject.restart()
        for record in (record for subject in self.subjects for record in subject.apply(all_edits[done:])):
            self._records.append(record.model_copy(update={"number": done + record.number}))
        self._records.sort(key=lambda record: record.number)
        self._applied, self._revision = tuple(all_edits), revision

    # ---- what the page shows -----------------------------------------------------------------------------------------
    def page(self) -> bytes:
        """Return the page of what there is now. Of a folder that is not whole at the moment, what was there before."""
        with self._turn:
            try:
                if self._there() != self.shown:
                    self._open()
            except ScenewrightError:
                pass  # half written, or gone: `now` says so on the page
            if self.edits is not None:
                self._apply()
            made_of = (self.shown, self._revision or "")
            if made_of != self._page_of:
                canvas = PageCanvas(f"{self._artifact.kind} {self.path.resolve().name}")
                self._draw(canvas)
                canvas.explain(sentences(self._artifact))
                script = "\n".join(path.read_text(encoding="utf-8") for path in SCRIPTS)
                self._page = canvas.page(ServedPage(script, self._facts()))
                self._page_of = made_of
            return self._page

    def _draw(self, canvas: Canvas) -> None:
        if self._shows_edits:
            self.subjects[0].draw(canvas)
            return
        draw = viewer_of(type(self._artifact))
        assert draw is not None
        draw(self._artifact, canvas)

    @property
    def _shows_edits(self) -> bool:
        """Whether what is shown is itself what edits are of, and not only made from that."""
        return bool(self.subjects) and isinstance(self._artifact, type(self.subjects[0].artifact))

    def _facts(self) -> dict[str, Any]:
        if self.edits is None:
            asks = {} if self._asking is None else {"asks": self._asking.facts()}
            return {"artifact": self.shown, **asks}
        return {
            "artifact": self.shown,
            "read_only": self.read_only,
            "revision": self._revision or "",
            "forms": [form | {"of": each.artifact.kind} for each in self.subjects for form in forms_of(each.table)],
            "classes": [entry.name for entry in load_vocabulary().classes],
            "next": [cleaned(f"{each.command()} --edits {self.edits} --out ...") for each in self.subjects],
            "shows_edits": self._shows_edits,
            **self.subjects[0].facts(),
        }

    def now(self) -> dict[str, Any]:
        """Return what there is now, as JSON: `artifact`, `trouble` in words, and, with edits, `revision`, `rows`,
        `things`."""
        with self._turn:
            trouble = ""
            try:
                if (shown_now := self._there()) != self.shown:
                    trouble = "what lies in the folder was made anew: load the page again to see it"
            except ScenewrightError as error:
                shown_now, trouble = "", cleaned(str(error))
            state: dict[str, Any] = {"artifact": shown_now, "trouble": trouble}
            if self.edits is not None:
                self._apply()
                rows = [
                    {**record.model_dump(mode="json"), "of": _edit_in_words(edit)} for record, edit in self._pairs()
                ]
                state |= {
                    "trouble": trouble or cleaned(self._trouble),
                    "revision": self._revision or "",
                    "rows": rows,
                    "things": [thing.name for thing in self.subjects[0].state.things()],
                }
            return state

    def _pairs(self) -> Iterator[tuple[AppliedEdit, Edit]]:
        return ((record, self._applied[record.number - 1]) for record in self._records)

    def ask(self, text: str) -> dict[str, Any]:
        """Return where a text fits. Raises UsageError where there is nothing to ask, and for a text that asks for
        nothing."""
        with self._turn:
            if self._asking is None:
                raise UsageError("words are asked of a language map", hint="scenewright splat language")
            return self._asking.answer(text)

    # ---- what the page asks for --------------------------------------------------------------------------------------
    def append(self, asked: Mapping[str, Any], *, artifact: str, revision: str, by: str, note: str) -> dict[str, Any]:
        """Write an edit down: `asked` are `what` and the fields, things by name. Return what there is then.

        Raises Stale when the page shows another artifact than there is, Changed when the file is not as the page knows
        it, UsageError and BadInput for an edit that is none.
        """
        with self._turn:
            file = self._check_fresh(artifact, revision)
            edit = asked_edit(by, note, self._with_anchors(asked))
            append_edits(file, [edit], as_read=revision)
            return self.now()

    def remove(self, number: int, *, artifact: str, revision: str) -> dict[str, Any]:
        """Delete the line of an edit, from 1. Raises as `append` does."""
        with self._turn:
            remove_edit(self._check_fresh(artifact, revision), number, as_read=revision)
            return self.now()

    def _check_fresh(self, artifact: str, revision: str) -> Path:
        if self.read_only or self.edits is None:
            raise UsageError("this page is for reading", hint="start it without --read-only, with --edit")
        if artifact != self.shown or self._there() != self.shown:
            raise Stale(f"{self.path}: what the page shows was made anew since", hint="load the page again")
        self._apply()
        if revision != (self._revision or ""):
            raise Changed(f"{self.edits}: somebody else has changed it meanwhile", hint=UNWRITTEN)
        return self.edits

    def _with_anchors(self, request: Mapping[str, Any]) -> dict[str, Any]:
        """Return the fields of an edit with anchors where things are named."""
        forms = {form["what"]: (each, form["fields"]) for each in self.subjects for form in forms_of(each.table)}
        edit_name = request.get("what")
        if not isinstance(edit_name, str) or edit_name not in forms:
            raise UsageError(f"there is no edit {edit_name!r:.40} here", hint=f"there are {', '.join(forms)}")
        subject, fields = forms[edit_name]
        return subject.fields(edit_name, fields, request)


def _edit_in_words(edit: Edit) -> str:
    """Return an edit in a few words."""
    values = edit.model_dump(mode="json", by_alias=True, exclude={"what", "by", "when", "note"}, exclude_defaults=True)
    of = values.get("of")
    anchors = of if isinstance(of, list) else [of] if isinstance(of, dict) else []
    words = [
        "{} at ({:.2f}, {:.2f}, {:.2f})".format(anchor["class"], *anchor["point"])
        for anchor in anchors
        if "point" in anchor
    ]
    values_text = [
        f"{key}: {value}" for key, value in values.items() if isinstance(value, str | int | float) and value != ""
    ]
    return cleaned(" + ".join(words) + (" → " if words and values_text else "") + ", ".join(values_text))
