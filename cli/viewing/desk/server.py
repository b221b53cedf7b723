"""The server of a page: for this machine alone, and whoever knows the address, which nobody can guess."""

from __future__ import annotations

import json
import secrets
from collections.abc import Callable
from typing import Any

from pydantic import Field, ValidationError
from scenewright.cli.viewing.desk.desk import Desk, Stale
from scenewright.schemas.base import Model
from scenewright.schemas.edits import Text
from scenewright.schemas.errors import ScenewrightError
from scenewright.stages.edit.edits_file import Changed
from scenewright.stages.kit.services.receiving import BoundedHandler, BoundedServer

HOST = "127.0.0.1"
LARGEST_REQUEST = 200_000
"""Largest request [bytes]: a hundred things with long names, and a long note."""
HEADERS = {
    "Cache-Control": "no-store",
    "Referrer-Policy": "no-referrer",
    "X-Frame-Options": "DENY",
    "X-Content-Type-Options": "nosniff",
    "Cross-Origin-Resource-Policy": "same-origin",
}


class Asked(Model):
    """What a page asks for: an edit, or that one be deleted."""

    artifact: str
    """Digest of what the page shows."""
    revision: str
    """Of edits.toml, as the page knows it."""
    edit: dict[str, Any] | None = None
    """`what` and the fields; things by name."""
    remove: int | None = Field(default=None, ge=1)
    by: Text = ""
    note: Text = ""


class Question(Model):
    """Words that a page asks for."""

    text: Text


class DeskServer(BoundedServer):
    """Serves one desk. Raises MachineFailure when the port cannot be had."""

    def __init__(self, desk: Desk, port: int) -> None:
        self.desk = desk
        token = secrets.token_urlsafe(24)
        routes = {
            f"/{token}/": {"GET": _Handler.page},
            f"/{token}/now": {"GET": _Handler.now},
            f"/{token}/do": {"POST": _Handler.do},
            f"/{token}/ask": {"POST": _Handler.ask},
        }
        super().__init__(HOST, port, type("_Here", (_Handler,), {"routes": routes}))
        self.page_address = f"{self.address}/{token}/"


class _Handler(BoundedHandler):
    server: DeskServer
    routes: dict[str, dict[str, Callable[[_Handler], None]]] = {}
    largest_body = LARGEST_REQUEST
    tells_routes = False
    own_pages_only = True

    def page(self) -> None:
        try:
            self.answer(200, self.server.desk.page(), HEADERS, kind="text/html; charset=utf-8")
        except ScenewrightError as error:
            self.answer(500, str(error).encode(), HEADERS, kind="text/plain; charset=utf-8")

    def now(self) -> None:
        self.answer(200, json.dumps(self.server.desk.now()).encode(), HEADERS)

    def do(self) -> None:
        self._send_answer(lambda body: self._do(Asked.model_validate_json(body)))

    def ask(self) -> None:
        self._send_answer(lambda body: self.server.desk.ask(Question.model_validate_json(body).text))

    def _send_answer(self, answer: Callable[[bytes], dict[str, Any]]) -> None:
        body = self.body()
        if body is None:
            return
        try:
            if self.headers.get_content_type() != "application/json":
                self.refuse(415, "this takes application/json")
                return
            self.answer(200, json.dumps(answer(body)).encode(), HEADERS)
        except ValidationError:
            self.refuse(400, "this is nothing that the page asks for")
        except (Changed, Stale) as error:
            self.refuse(409, str(error))
        except ScenewrightError as error:
            self.refuse(403 if self.server.desk.read_only else 422, str(error))
        finally:
            self.done()

    def _do(self, request: Asked) -> dict[str, Any]:
        desk, at = self.server.desk, {"artifact": request.artifact, "revision": request.revision}
        if request.remove is not None:
            return desk.remove(request.remove, **at)
        return desk.append(request.edit or {}, **at, by=request.by, note=request.note)
