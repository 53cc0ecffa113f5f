"""The same screen in a browser on this machine, through textual-serve; to look at, unless told otherwise.

Rule: 127.0.0.1 alone, and only for pages that come from here: another page in the same browser could else
speak to the bench (the Host and the Origin of every request are looked at).
"""

from __future__ import annotations

import re
import shlex
import socket
import subprocess
import sys
from pathlib import Path
from typing import Final

from trcvtui.errors import mistake

HOST: Final = "127.0.0.1"
# textual-serve's page asks another host for a font that it has itself.
OUTSIDE: Final = re.compile(r"<link[^>]*https?://(?!127\.0\.0\.1)[^>]*>")
FONT: Final = """<style>@font-face {
      font-family: "Roboto Mono"; src: url("/static/fonts/RobotoMono-VariableFont_wght.ttf");
    }</style>"""
FOREIGN: Final = "this bench is only for pages of its own\n"


def serve(project: Path, kernel: str, port: int, write: bool, theme: str | None) -> None:
    """Serve until Ctrl+C; raise UserError where textual-serve is not there or the port is taken."""
    try:
        from aiohttp import web
        from textual_serve.server import Server
    except ImportError:
        found, expected = "no textual-serve", "it: pip install 'trcvtui[serve]'"
        raise mistake("trcvtui serve", found, expected) from None

    class Loopback(Server):
        """Answers nobody but the pages that it has given out."""

        async def _make_app(self) -> web.Application:
            app = await super()._make_app()
            app.middlewares.append(_only_from_here)
            return app

        async def handle_index(self, request: web.Request) -> web.StreamResponse:
            """Give the page out without what it would fetch from elsewhere."""
            page = await super().handle_index(request)
            if isinstance(page, web.Response):
                page.text = OUTSIDE.sub(FONT, page.text or "")
            return page

        async def on_startup(self, app: web.Application) -> None:
            """Say where it is; textual-serve's own banner is left out."""
            sys.stdout.write(f"{self.public_url}\n")
            sys.stdout.flush()
            how = "every command is carried out" if write else "read-only; --write lets it command"
            sys.stderr.write(f"{project} in a browser, {how}; Ctrl+C ends it\n")

    @web.middleware
    async def _only_from_here(request, handler):  # type: ignore[no-untyped-def]
        own = {f"{host}:{end}" for host in (HOST, "localhost")}
        origin = request.headers.get("Origin")
        from_here = origin is None or origin.partition("://")[2].lower() in own
        if request.host.lower() not in own or not from_here:
            return web.Response(status=403, text=FOREIGN)
        return await handler(request)

    door = _listening(port)
    end = door.getsockname()[1]
    server = Loopback(command_line(project, kernel, write, theme), HOST, end, title=f"trcvtui {project.name}")
    web.run_app(server._make_app(), sock=door, print=None)


def _listening(port: int) -> socket.socket:
    door = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
    try:
        if sys.platform != "win32":
            door.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        door.bind((HOST, port))
        door.listen()  # before the address is told
    except (OSError, OverflowError) as failed:
        door.close()
        raise mistake("--port", f"{port}: {failed}", "a free port, or 0 for any") from None
    return door


def command_line(project: Path, kernel: str, write: bool, theme: str | None) -> str:
    """Return what a browser's screen is started with; textual-serve gives it to a shell."""
    words = [sys.executable, "-m", "trcvtui", "run", str(project), "--kernel", kernel]
    words += [] if write else ["--read-only"]
    words += ["--theme", theme] if theme else []
    return subprocess.list2cmdline(words) if sys.platform == "win32" else shlex.join(words)
