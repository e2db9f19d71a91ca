"""The server of the scope: page, WebSocket of each open page, saving. It has no way to the axis.

On this computer's own address it needs no token; on any other one a token, and nothing can be saved. A page of another
origin is refused (RFC 6455, section 10.2), and so is a host name that is not this server's.
"""

from __future__ import annotations

import asyncio
import os
import secrets
import socket
import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, field
from ipaddress import ip_address
from pathlib import Path
from urllib.parse import urlsplit

import uvicorn
from starlette.applications import Starlette
from starlette.requests import HTTPConnection, Request
from starlette.responses import FileResponse, JSONResponse, Response
from starlette.routing import Mount, Route, WebSocketRoute
from starlette.staticfiles import StaticFiles
from starlette.websockets import WebSocket, WebSocketDisconnect

from hil.errors import InputError
from hil.scope.page_session import PageSession
from hil.scope.save import save

RATE_HZ = 30.0
STATIC = Path(__file__).parent / "static"
MOST_PAGES = 16
UNWATCHED_S = 30.0  # that somebody has to open the page after a short run
MOST_WAITING = 100  # messages of a page that are not taken yet: more come from no human


def is_loopback(host: str) -> bool:
    """True for an address that only this computer reaches."""
    if host == "localhost":
        return True
    try:
        return ip_address(host).is_loopback
    except ValueError:
        return False


@dataclass
class ScopeServer:
    """Serves pages. make_session: the state of a new page; folder: for what is saved, None: nothing is;
    token: that each request must have, "" without one."""

    make_session: Callable[[str], PageSession]
    folder: Path | None
    token: str = ""
    pages: dict[str, PageSession] = field(default_factory=dict)

    def app(self) -> Starlette:
        """Return the application."""
        return Starlette(
            routes=[
                Route("/", self._page),
                Route("/save", self._save, methods=["POST"]),
                WebSocketRoute("/rows", self._rows),
                Mount("/static", StaticFiles(directory=STATIC)),
            ]
        )

    def _refusal(self, connection: HTTPConnection) -> str:
        """Return why a request is refused, "" if it is not."""
        given = connection.query_params.get("token", "")
        if self.token and not secrets.compare_digest(given.encode(), self.token.encode()):
            return "the token is missing or wrong: open the address that hil scope printed"
        host, origin = connection.headers.get("host", ""), connection.headers.get("origin")
        if not self.token and not is_loopback(urlsplit(f"//{host}").hostname or ""):
            return "the host name is not that of this computer: open the address that hil scope printed"
        if origin is not None and urlsplit(origin).netloc != host:
            return "the request comes from a page of another origin"
        return ""

    async def _page(self, request: Request) -> Response:
        if refusal := self._refusal(request):
            return Response(refusal, 403)
        policy = "default-src 'self'; style-src 'self' 'unsafe-inline'; img-src 'self' data:; frame-ancestors 'none'"
        headers = {"Content-Security-Policy": policy, "Referrer-Policy": "no-referrer", "Cache-Control": "no-cache"}
        return FileResponse(STATIC / "index.html", headers=headers)

    async def _save(self, request: Request) -> Response:
        """Save a stretch of what a page shows: JSON with page, name, from_s, to_s -> path."""
        if refusal := self._refusal(request) or ("" if self.folder else "nothing is saved for other computers"):
            return JSONResponse({"refused": refusal}, 403)
        assert self.folder is not None
        try:
            wanted = await request.json()
            session = self.pages.get(wanted["page"])
            times = [None if wanted.get(key) is None else float(wanted[key]) for key in ("from_s", "to_s")]
            name = str(wanted["name"])
        except (ValueError, KeyError, TypeError, AttributeError):
            return JSONResponse({"refused": "given another form, allowed JSON: page, name, from_s, to_s"}, 400)
        if session is None:
            return JSONResponse({"refused": "the page is not connected: load it again"}, 404)
        try:
            rows = session.cut(*times)
            path = await asyncio.to_thread(save, rows, self.folder, name)
        except InputError as error:
            return JSONResponse({"refused": str(error)}, 400)
        return JSONResponse({"path": str(path), "rows": rows.end - rows.first})

    async def _rows(self, socket: WebSocket) -> None:
        """Serve one page until it closes."""
        if self._refusal(socket) or len(self.pages) >= MOST_PAGES:
            await socket.close(1008)
            return
        await socket.accept()
        identity = secrets.token_urlsafe(12)
        session = self.pages[identity] = self.make_session(identity)
        waiting: asyncio.Queue[str] = asyncio.Queue(MOST_WAITING)
        reader = asyncio.create_task(_receive(socket, waiting))
        due_s = time.monotonic()
        try:
            while not reader.done():
                texts = [waiting.get_nowait() for _ in range(waiting.qsize())]
                # in a thread: a long recording must not hold back the other pages
                for message in await asyncio.to_thread(session.step, texts):
                    await (socket.send_text(message) if isinstance(message, str) else socket.send_bytes(message))
                due_s = max(due_s + 1.0 / RATE_HZ, time.monotonic())
                await asyncio.sleep(due_s - time.monotonic())
        except (WebSocketDisconnect, RuntimeError):  # closed while something was sent
            pass
        finally:
            reader.cancel()
            del self.pages[identity]


async def _receive(socket: WebSocket, waiting: asyncio.Queue[str]) -> None:
    with suppress(WebSocketDisconnect, KeyError):  # KeyError: binary data
        while True:
            await waiting.put(await socket.receive_text())


def bound(host: str, port: int) -> socket.socket:
    """Return a listening socket. port 0: any free one. Raises InputError if it is taken or no address of this PC."""
    try:
        family = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM)[0][0]
        return socket.create_server((host, port), family=family, backlog=64)
    except OSError as error:
        why = error.strerror if isinstance(error, socket.gaierror) else os.strerror(error.errno or 0)
        raise InputError(f"{host}:{port}: cannot be used ({why}); give another --port or --host") from None


def address(listening: socket.socket, token: str) -> str:
    """Return the address to open in a browser."""
    host, port = listening.getsockname()[:2]
    shown = socket.gethostname() if ip_address(host).is_unspecified else f"[{host}]" if ":" in host else host
    return f"http://{shown}:{port}/" + (f"?token={token}" if token else "")


def serve(server: ScopeServer, listening: socket.socket, beside: int | None = None) -> None:
    """Serve until ctrl-C or SIGTERM, or until the process `beside` has ended and no page was open for UNWATCHED_S."""
    config = uvicorn.Config(
        server.app(),
        log_level="warning",
        ws="websockets-sansio",
        ws_per_message_deflate=False,  # on this computer it only takes time
        ws_max_size=1 << 16,
        timeout_graceful_shutdown=1,
    )
    running = uvicorn.Server(config)

    async def end_unwatched() -> None:
        watched_s = time.monotonic()
        while time.monotonic() - watched_s < UNWATCHED_S:
            await asyncio.sleep(0.5)
            if server.pages or Path(f"/proc/{beside}").exists():
                watched_s = time.monotonic()
        running.should_exit = True

    async def serving() -> None:
        watch = asyncio.create_task(end_unwatched()) if beside else None
        await running.serve(sockets=[listening])
        if watch is not None:
            watch.cancel()

    with suppress(KeyboardInterrupt):  # uvicorn raises it again when it has closed
        asyncio.run(serving())
