"""`hil scope` as a process of its own, and a page of it without a browser."""

from __future__ import annotations

import json
import subprocess
import sys
import urllib.error
import urllib.request
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from processes import DEADLINE_S
from websockets.sync.client import ClientConnection, connect

from hil.scope.messages import read_frame


@contextmanager
def scope(folder: Path, *arguments: str) -> Iterator[str]:
    """Start it in a folder on a free port; yields its address."""
    process = subprocess.Popen(
        [sys.executable, "-m", "hil.cli", "scope", "--port", "0", *arguments],
        cwd=folder,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    try:
        assert process.stdout is not None
        told = process.stdout.readline()
        assert told.startswith("scope: http://"), (told, process.stderr)
        yield told.removeprefix("scope: ").strip()
    finally:
        process.terminate()
        _, errors = process.communicate(timeout=DEADLINE_S)
        assert "Traceback" not in errors, errors


class ScopeClient:
    """A page: the messages that came, by kind, and the points put together as the page does it."""

    def __init__(self, socket: ClientConnection) -> None:
        self.socket = socket

    def send(self, do: str, **message: Any) -> None:
        """Send a message."""
        self.socket.send(json.dumps({"do": do, **message}))

    def next(self, *kinds: str) -> tuple[dict[str, Any], np.ndarray]:
        """Return the next message of one of these kinds, and its values if it is a frame."""
        while True:
            data = self.socket.recv(timeout=DEADLINE_S)
            header, values = (json.loads(data), np.empty(0)) if isinstance(data, str) else read_frame(data)
            if header["kind"] in kinds:
                return header, values


@contextmanager
def page_of(address: str, **headers: str) -> Iterator[ScopeClient]:
    """Open a page."""
    place, _, query = address.removeprefix("http://").partition("/")
    with connect(f"ws://{place}/rows{query}", additional_headers=headers or None) as socket:
        yield ScopeClient(socket)


def post(address: str, body: dict[str, Any]) -> tuple[int, dict[str, Any]]:
    """Ask to save; returns the status and the answer."""
    base, _, query = address.partition("?")
    request = urllib.request.Request(f"{base}save" + (f"?{query}" if query else ""), json.dumps(body).encode())
    try:
        with urllib.request.urlopen(request) as answer:
            return answer.status, json.load(answer)
    except urllib.error.HTTPError as error:
        with error:
            return error.code, json.load(error)
