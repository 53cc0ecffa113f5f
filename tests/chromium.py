"""A headless Chromium of a test's own, spoken to by its debugging protocol."""

from __future__ import annotations

import asyncio
import json
import re
import shutil
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Any

from aiohttp import ClientSession, ClientWebSocketResponse

CHROMIUM = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)
PATIENCE_S = 60


class Tab:
    """One page of a Chromium, spoken to by its debugging protocol."""

    def __init__(self, socket: ClientWebSocketResponse, session: ClientSession, debugger: str) -> None:
        self._socket, self._session, self._debugger = socket, session, debugger
        self._number = 0

    @asynccontextmanager
    async def beside(self, address: str) -> AsyncIterator[Tab]:
        """Open another tab of the same browser."""
        async with self._session.put(f"http://{self._debugger}/json/new?{address}") as answer:
            page = await answer.json(content_type=None)
        async with self._session.ws_connect(page["webSocketDebuggerUrl"], max_msg_size=0) as socket:
            yield Tab(socket, self._session, self._debugger)

    async def ask(self, method: str, **parameters: Any) -> dict[str, Any]:
        self._number += 1
        await self._socket.send_json({"id": self._number, "method": method, "params": parameters})
        async for message in self._socket:
            answer = json.loads(message.data)
            if answer.get("id") == self._number:
                assert "error" not in answer, answer
                return dict(answer["result"])
        raise AssertionError("the browser has gone")

    async def is_true(self, script: str) -> bool:
        return await self.value(script) is True

    async def value(self, script: str) -> Any:
        answer = await self.ask("Runtime.evaluate", expression=script, returnByValue=True)
        return answer["result"].get("value")

    async def type(self, text: str) -> None:
        """Press the keys of a text; a line end is enter."""
        for character in text:
            key = {"key": "Enter", "code": "Enter", "windowsVirtualKeyCode": 13} if character == "\n" else {}
            written = "\r" if character == "\n" else character
            await self.ask(
                "Input.dispatchKeyEvent", type="keyDown", text=written, **(key or {"key": character})
            )
            await self.ask("Input.dispatchKeyEvent", type="keyUp", **(key or {"key": character}))


@asynccontextmanager
async def chromium(folder: Path, address: str) -> AsyncIterator[Tab]:
    assert CHROMIUM is not None
    words = ["--headless", "--no-sandbox", "--disable-gpu", "--remote-debugging-port=0", address]
    profile = folder / "profile"
    process = await asyncio.create_subprocess_exec(
        CHROMIUM, *words, f"--user-data-dir={profile}", stderr=asyncio.subprocess.PIPE, limit=1 << 20
    )
    try:
        assert process.stderr is not None
        found = None
        while found is None:
            line = (await asyncio.wait_for(process.stderr.readline(), PATIENCE_S)).decode(errors="replace")
            assert line, "Chromium ended"
            found = re.search(r"DevTools listening on ws://([\d.:]+)/", line)
        async with ClientSession() as session:
            async with session.get(f"http://{found[1]}/json") as answer:
                page = next(each for each in await answer.json() if each["type"] == "page")
            async with session.ws_connect(page["webSocketDebuggerUrl"], max_msg_size=0) as socket:
                yield Tab(socket, session, found[1])
    finally:
        process.kill()
        await process.wait()
