"""The bench's screen in a browser on this machine, through textual-serve, read-only without `--write`.

Rule 1: the server listens only on 127.0.0.1 and answers only its own pages. Otherwise any other page in the
same browser could command the bench. So the Host and the Origin of every request are checked.
Rule 2: a request needs the printed address, as other users of this machine can reach the port. The address
holds a random token. For the token the browser gets a cookie, which every later request must show.
Rule 3: there is one engine, which ends with this process. Each tab is a separate process that shows the
engine. At most MOST_TABS such processes run.
"""

from __future__ import annotations

import asyncio
import hmac
import json
import os
import re
import secrets
import shlex
import socket
import sys
from collections.abc import Callable
from contextlib import closing, suppress
from functools import partial
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Final

from trcvtui.engine.driver import EXIT_WAIT_S, EngineDriver
from trcvtui.errors import UserError, mistake
from trcvtui.picture.protocol import MOST_TABS, EngineStopped

if TYPE_CHECKING:
    from aiohttp import web
    from textual_serve.app_service import AppService

HOST: Final = "127.0.0.1"
TOKEN_PARAMETER: Final = "token"
SOCKET_PATH: Final = "/ws"  # textual-serve starts a tab here
MOST_CELLS: Final = 1000  # width or height: a larger screen would take minutes to draw
SHUTDOWN_S: Final = 0.5  # for pages to close; a tab ends with its engine
MOST_TYPED_CHARACTERS: Final = 1 << 16  # of one message
# textual-serve's page loads a font from another host, although it has the font itself.
OUTSIDE_LINK: Final = re.compile(r"<link[^>]*https?://(?!127\.0\.0\.1)[^>]*>")
FONT_STYLE: Final = """<style>@font-face {
      font-family: "Roboto Mono"; src: url("/static/fonts/RobotoMono-VariableFont_wght.ttf");
    }</style>"""
QUIET_HEADERS: Final = {"Referrer-Policy": "no-referrer", "Cache-Control": "no-store"}
FOREIGN_REFUSAL: Final = "this bench accepts only pages that it has sent itself\n"
UNKNOWN_REFUSAL: Final = "open the whole address that `trcvtui serve` printed\n"
FULL_REFUSAL: Final = f"{MOST_TABS} screens are open already; close one\n"
PAGE_HEAD: Final = """<head>
    <title>%s</title>
    <link rel="icon" href="data:image/svg+xml,<svg xmlns='http://www.w3.org/2000/svg' viewBox='0 0 8 8'>
      <path d='M1 1v6l6-3z' fill='limegreen'/></svg>">
    <script>const waits = setInterval(() => {
      const keys = document.querySelector("textarea");
      if (keys) { keys.focus(); clearInterval(waits); }
    }, 20);</script>"""


def refuse_root(write: bool, as_root: bool) -> None:
    """Raise UserError if root runs `serve --write` without --as-root."""
    if write and not as_root and hasattr(os, "geteuid") and os.geteuid() == 0:
        found = "root, whose files a browser could then write"
        raise mistake("trcvtui serve --write", found, "another user, or --as-root if that is meant")


class AccessControl:
    """Accepts only requests from our own pages (rule 1) that show the token or the cookie (rule 2)."""

    def __init__(self, port: int) -> None:
        self.token = secrets.token_urlsafe(32)
        self.port = port
        self.address = f"http://{HOST}:{port}"
        # With the port in its name: a browser keeps the cookies of all ports of a host together.
        self.cookie = f"trcvtui-{port}"
        self._own = {f"{host}:{port}" for host in (HOST, "localhost")}

    @property
    def url(self) -> str:
        return f"{self.address}/?{TOKEN_PARAMETER}={self.token}"

    def find_refusal(self, host: str, origin: str | None, is_socket: bool) -> str:
        """Return why a request is refused even with the right token, or "" if rule 1 allows it.

        A browser always names the Origin of a websocket, so one without Origin is not from our page.
        """
        if host.lower() not in self._own or (origin is None and is_socket):
            return FOREIGN_REFUSAL
        scheme, _, named = (origin or "").lower().partition("://")
        return FOREIGN_REFUSAL if origin is not None and (scheme != "http" or named not in self._own) else ""

    def is_token(self, shown: str | None) -> bool:
        """Return whether a text is the token; the time taken does not tell where the two differ."""
        return hmac.compare_digest((shown or "").encode(), self.token.encode())

    def grant_cookie(self) -> web.Response:
        """Set the cookie and redirect, so that the browser's history contains no token."""
        from aiohttp import web

        answer = web.Response(status=303, headers={"Location": f"{self.address}/", **QUIET_HEADERS})
        answer.set_cookie(self.cookie, self.token, httponly=True, samesite="Strict", path="/")
        return answer


def serve(project: Path, kernel: str, port: int, write: bool, theme: str | None) -> None:
    """Serve until Ctrl+C; raise UserError."""
    try:
        import textual_serve.server  # noqa: F401
        from aiohttp import web
    except ImportError:
        found, expected = "no textual-serve", "it: pip install 'trcvtui[serve]'"
        raise mistake("trcvtui serve", found, expected) from None
    door = open_listener(port)
    entrance = AccessControl(door.getsockname()[1])
    how = "every command is carried out" if write else "read-only; --write allows commands"
    about = f"{project} in a browser, {how}; Ctrl+C ends it\n"
    try:
        with closing(EngineDriver(project, kernel, read_only=not write, is_shared=True)) as engine:
            engine.wait_for_project()
            command, begin = command_line(project, engine.door, write, theme), partial(revive_engine, engine)
            answers = application(command, entrance, f"trcvtui {project.name}", about, begin)
            web.run_app(answers, sock=door, print=None, shutdown_timeout=SHUTDOWN_S)
    except (EngineStopped, OSError) as failed:
        found = str(failed).splitlines()[-1]
        raise mistake("trcvtui serve", found, "room for an engine: see `ulimit -n` and TMPDIR") from None


def revive_engine(engine: EngineDriver) -> str:
    """If the engine has ended, print why and restart it. Return why the restart failed, or ""."""
    try:
        engine.poll_picture()
    except EngineStopped as stopped:
        sys.stderr.write(f"{str(stopped).strip()}\n")
        engine.restart()
        try:
            engine.wait_for_project()
        except (UserError, EngineStopped) as wrong:
            engine.wait_for_message(EXIT_WAIT_S)  # its end must be over when the next tab tries again
            return f"{wrong}\n"
    return ""


async def application(
    command: str, entrance: AccessControl, title: str, about: str, begin: Callable[[], str]
) -> web.Application:
    """Return the web application, which prints its address first. A tab runs `begin`, then `command`."""
    from aiohttp import web
    from textual_serve.server import Server

    class LoopbackServer(Server):
        async def _process_messages(self, websocket: web.WebSocketResponse, app_service: AppService) -> None:
            """Pass on what the page sends; textual-serve's method fails on unknown messages."""
            run, loop = app_service._task, asyncio.get_running_loop()
            if run is not None:  # close the page when the process of its tab has ended
                run.add_done_callback(lambda _: loop.create_task(websocket.close()))
            async for message in websocket:
                match _parse_message(message.data):
                    case ["stdin", str(typed)] if len(typed) <= MOST_TYPED_CHARACTERS:
                        await app_service.send_bytes(typed.encode(errors="replace"))
                    case ["resize", {"width": width, "height": height}]:
                        await app_service.set_terminal_size(_parse_size(width), _parse_size(height))
                    case ["ping", content]:
                        await websocket.send_json(["pong", content])
                    case ["blur" | "focus" as what, *_]:
                        await getattr(app_service, what)()

        async def handle_index(self, request: web.Request) -> web.StreamResponse:
            """Send the page with our own head, and without links to other hosts."""
            page = await super().handle_index(request)
            if isinstance(page, web.Response):
                page.text = OUTSIDE_LINK.sub(FONT_STYLE, page.text or "").replace(
                    "<head>", PAGE_HEAD % escape(title), 1
                )
                page.headers.update(QUIET_HEADERS)
            return page

        async def on_startup(self, app: web.Application) -> None:
            """Print the address in place of textual-serve's banner."""
            sys.stdout.write(f"{entrance.url}\n")
            sys.stdout.flush()
            sys.stderr.write(about)

    screens = asyncio.BoundedSemaphore(MOST_TABS)

    @web.middleware
    async def _check_access(request, handler):  # type: ignore[no-untyped-def]
        refused = entrance.find_refusal(
            request.host, request.headers.get("Origin"), request.path == SOCKET_PATH
        )
        if refused:  # rule 1
            return web.Response(status=403, text=refused)
        if request.path == "/" and entrance.is_token(request.query.get(TOKEN_PARAMETER)):
            return entrance.grant_cookie()
        if not entrance.is_token(request.cookies.get(entrance.cookie)):  # rule 2
            return web.Response(status=403, text=UNKNOWN_REFUSAL)
        if request.path != SOCKET_PATH:
            return await handler(request)
        if screens.locked():  # rule 3: MOST_TABS run
            return web.Response(status=503, text=FULL_REFUSAL)
        async with screens:
            if wrong := begin():
                return web.Response(status=503, text=wrong)
            query = request.query
            size = {name: _parse_size(query[name]) for name in ("width", "height") if name in query}
            return await handler(request.clone(rel_url=request.rel_url.update_query(size)))

    app = await LoopbackServer(command, HOST, entrance.port, title=title)._make_app()
    app.middlewares.append(_check_access)
    return app


def _parse_message(data: object) -> object:
    """Return the content of a message of the page, None if it is not JSON."""
    with suppress(ValueError, RecursionError):
        return json.loads(data) if isinstance(data, str) else None
    return None


def _parse_size(value: object) -> int:
    """Return a width or a height of 1 to MOST_CELLS; 80 if it is not a number."""
    text = str(value)[:9]
    return min(max(int(text), 1), MOST_CELLS) if text.isdecimal() else 80


def open_listener(port: int) -> socket.socket:
    """Return a socket that listens on loopback; raise UserError if the port is not free."""
    door = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
    try:
        door.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        door.bind((HOST, port))
        door.listen()  # before the address is printed
    except (OSError, OverflowError) as failed:
        door.close()
        raise mistake("--port", f"{port}: {failed}", "a free port, or 0 for any") from None
    return door


def command_line(project: Path, door: Path, write: bool, theme: str | None) -> str:
    """Return the command of a tab, quoted for the shell that textual-serve starts."""
    words = [sys.executable, "-m", "trcvtui", "run", str(project), "--attach", str(door)]
    words += [] if write else ["--read-only"]
    words += ["--theme", theme] if theme else []
    return f"exec {shlex.join(words)}"
