"""The page on which a person cuts, for this machine alone and whoever knows the address, which nobody can guess."""

from __future__ import annotations

import base64
import io
import json
import secrets
import threading
from collections.abc import Callable
from pathlib import Path
from typing import Literal

import numpy as np
from PIL import Image
from pydantic import ValidationError
from scenewright.schemas.base import Model
from scenewright.schemas.cutting_demonstrations import CategoryName
from scenewright.stages.cutting.recording.panels import NoCut
from scenewright.stages.cutting.recording.session import Session
from scenewright.stages.kit.services.receiving import BoundedHandler, BoundedServer

HOST = "127.0.0.1"
PAGE = Path(__file__).with_name("page.html")


class Asked(Model):
    """What the page asks for."""

    do: Literal["look", "cut", "undo", "finish", "end"]
    points: tuple[tuple[float, float], tuple[float, float]] | None = None
    category: CategoryName | None = None
    """With `finish`; None: it stops midway."""


class RecordingServer(BoundedServer):
    """Serves one session. Raises MachineFailure when the port cannot be had."""

    def __init__(self, session: Session, port: int) -> None:
        self._session, self._turn = session, threading.Lock()
        token = secrets.token_urlsafe(24)
        routes = {f"/{token}": {"GET": _Handler.page}, f"/{token}/do": {"POST": _Handler.do}}
        super().__init__(HOST, port, type("_Here", (_Handler,), {"routes": routes}))
        self.page_address = f"{self.address}/{token}"

    def do(self, asked: Asked) -> dict[str, object]:
        """Do what is asked, one thing at a time, and say what lies there then. Raises NoCut."""
        with self._turn:
            session = self._session
            message = ""
            if asked.do == "cut":
                if asked.points is None:
                    raise NoCut("a cut needs two points")
                message = session.cut(np.array(asked.points))
            elif asked.do == "undo":
                message = session.undo()
            elif asked.do == "finish":
                message = session.finish(asked.category)
            picture = io.BytesIO()
            Image.fromarray(session.shown.color).save(picture, "PNG")
            return {
                "said": message,
                "picture": base64.b64encode(picture.getvalue()).decode(),
                "trials": session.trials,
                "cuts": len(session.trial.cuts),
                "pieces": len(session.trial.final),
            }

    def end(self) -> None:
        """Serve no more; from any thread."""
        threading.Thread(target=self.shutdown, daemon=True).start()


class _Handler(BoundedHandler):
    server: RecordingServer
    routes: dict[str, dict[str, Callable[[_Handler], None]]] = {}
    largest_body = 4096
    tells_routes = False
    own_pages_only = True

    def page(self) -> None:
        headers = {"Cache-Control": "no-store", "Referrer-Policy": "no-referrer", "X-Frame-Options": "DENY"}
        self.answer(200, PAGE.read_bytes(), headers, kind="text/html; charset=utf-8")

    def do(self) -> None:
        body = self.body()
        if body is None:
            return
        try:
            request_read = Asked.model_validate_json(body)
            if request_read.do == "end":
                self.answer(200, json.dumps({"said": "ended"}).encode())
                self.server.end()
            else:
                self.answer(200, json.dumps(self.server.do(request_read)).encode())
        except ValidationError:
            self.refuse(400, "this is nothing that the page asks for")
        except NoCut as refused:
            self.refuse(409, str(refused))
        finally:
            self.done()
