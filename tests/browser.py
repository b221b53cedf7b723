"""A real browser without a screen, driven over the WebDriver protocol (W3C), which is plain HTTP."""

from __future__ import annotations

import contextlib
import json
import shutil
import socket
import subprocess
import time
import urllib.request
from collections.abc import Callable, Iterator
from typing import Any

import pytest

ELEMENT = "element-6066-11e4-a52e-4f735466cecf"
DRIVER = shutil.which("chromedriver")


def needs_browser(test: Callable[..., None]) -> Callable[..., None]:
    """Mark a test that drives a browser: it is slow, and skipped where there is none."""
    absent = pytest.mark.skipif(DRIVER is None, reason="no browser here: install chromium and chromium-driver")
    return pytest.mark.slow(absent(test))


WEBGL = ("--use-angle=swiftshader", "--enable-unsafe-swiftshader")
"""WebGL by the processor."""


class Browser:
    """One window."""

    def __init__(self, address: str, arguments: tuple[str, ...]) -> None:
        self._base = address
        always = ["--headless=new", "--no-sandbox", "--disable-dev-shm-usage", "--window-size=1600,1000"]
        wanted = {
            "browserName": "chrome",
            "goog:chromeOptions": {"args": [*always, *arguments]},
            "goog:loggingPrefs": {"browser": "ALL"},
        }
        wanted = {"capabilities": {"alwaysMatch": wanted}}
        self._base = f"{address}/session/{self.ask('POST', '/session', wanted)['sessionId']}"

    def ask(self, method: str, path: str, body: Any = None) -> Any:
        """Ask the driver; return its value."""
        data = None if method == "GET" else json.dumps(body or {}).encode()
        request = urllib.request.Request(self._base + path, data, {"Content-Type": "application/json"}, method=method)
        with urllib.request.urlopen(request, timeout=120) as reply:
            return json.load(reply)["value"]

    def open(self, address: str) -> None:
        self.ask("POST", "/url", {"url": address})

    def find(self, selector: str) -> str:
        found = self.ask("POST", "/element", {"using": "css selector", "value": selector})
        return str(found[ELEMENT])

    def press(self, selector: str) -> None:
        self.ask("POST", f"/element/{self.find(selector)}/click")

    def click_at(self, selector: str, x: float, y: float) -> None:
        """Click so many pixels right of and below the middle of an element."""
        origin = {ELEMENT: self.find(selector)}
        moves = [
            {"type": "pointerMove", "origin": origin, "x": round(x), "y": round(y)},
            {"type": "pointerDown", "button": 0},
            {"type": "pointerUp", "button": 0},
        ]
        mouse = {"type": "pointer", "id": "mouse", "parameters": {"pointerType": "mouse"}, "actions": moves}
        self.ask("POST", "/actions", {"actions": [mouse]})

    def text(self, selector: str) -> str:
        return str(self.ask("GET", f"/element/{self.find(selector)}/text"))

    def wait_for(self, selector: str, words: str) -> str:
        """Return the text of an element once it holds these words."""
        deadline = time.monotonic() + 20
        while words not in (text := self.text(selector)):
            assert time.monotonic() < deadline, f"{text!r}, not {words!r}"
            time.sleep(0.05)
        return text

    def run(self, script: str, *given: Any) -> Any:
        """Return what a script of the page returns."""
        return self.ask("POST", "/execute/sync", {"script": script, "args": list(given)})

    def keys(self, text: str) -> None:
        """Press keys, one after the other, wherever the focus is."""
        actions = [{"type": kind, "value": key} for key in text for kind in ("keyDown", "keyUp")]
        self.ask("POST", "/actions", {"actions": [{"type": "key", "id": "keys", "actions": actions}]})

    def complaints(self) -> list[str]:
        """Return the warnings and errors of the console since it was asked last."""
        entries = self.ask("POST", "/se/log", {"type": "browser"})
        return [entry["message"] for entry in entries if entry["level"] in ("WARNING", "SEVERE")]

    def screenshot(self) -> str:
        """Return the page as PNG, in base 64."""
        return str(self.ask("GET", "/screenshot"))


@contextlib.contextmanager
def browser(*arguments: str) -> Iterator[Browser]:
    """Start a browser, by default without a graphics card."""
    assert DRIVER is not None
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    driver = subprocess.Popen([DRIVER, f"--port={port}"], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    try:
        deadline = time.monotonic() + 20
        while True:
            with contextlib.suppress(OSError), socket.create_connection(("127.0.0.1", port), timeout=1):
                break
            assert time.monotonic() < deadline, "the driver does not answer"
            time.sleep(0.05)
        opened = Browser(f"http://127.0.0.1:{port}", arguments or ("--disable-gpu",))
        try:
            yield opened
        finally:
            opened.ask("DELETE", "")
    finally:
        driver.terminate()
        driver.wait(10)
