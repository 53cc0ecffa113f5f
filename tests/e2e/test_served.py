"""The screen in a browser: on loopback, read-only unless told otherwise, one bench for all; a Chromium."""

from __future__ import annotations

import asyncio
import json
import os
import re
import signal
import subprocess
import sys
import urllib.error
import urllib.request
from collections.abc import AsyncIterator, Callable, Iterator
from contextlib import AbstractAsyncContextManager, asynccontextmanager, contextmanager, suppress
from email.message import Message
from pathlib import Path
from typing import Any

import pytest
from aiohttp import ClientSession, ClientWebSocketResponse, WSMsgType, WSServerHandshakeError
from aiohttp.web import AppRunner, SockSite
from textual_serve.app_service import AppService

from tests.chromium import CHROMIUM, PATIENCE_S, Tab, chromium
from trcvtui.cli.main import main
from trcvtui.engine.driver import EngineDriver
from trcvtui.picture.bench_update import UpdateRequest
from trcvtui.picture.protocol import MOST_TABS
from trcvtui.snapshots.bench import LineAnswer
from trcvtui.tui.served import (
    MOST_CELLS,
    MOST_TYPED_CHARACTERS,
    AccessControl,
    application,
    command_line,
    open_listener,
    refuse_root,
)

PROJECT = Path(__file__).parents[2] / "configs" / "passive.toml"


@contextmanager
def served(folder: Path, *options: str) -> Iterator[str]:
    """Serve a project; give the page's address."""
    with serving(folder, *options) as (printed, _):
        yield printed


@contextmanager
def serving(
    folder: Path, *options: str, project: Path = PROJECT
) -> Iterator[tuple[str, subprocess.Popen[str]]]:
    """Serve a project; give the page's address, which is the first line on stdout, and the process."""
    home = {"XDG_STATE_HOME": str(folder / "state"), "XDG_CONFIG_HOME": str(folder / "config")}
    home["TMPDIR"] = str(folder / "tmp")
    (folder / "tmp").mkdir(mode=0o755)
    words = [sys.executable, "-m", "trcvtui", "serve", str(project), "--kernel", "sim", *options]
    process = subprocess.Popen(
        words, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env={**os.environ, **home}
    )
    try:
        assert process.stdout is not None
        yield process.stdout.readline().strip(), process
    finally:
        process.send_signal(signal.SIGINT)
        process.communicate(timeout=PATIENCE_S)


class NotFollowed(urllib.request.HTTPRedirectHandler):
    """Show where an answer points to, and do not go there."""

    def redirect_request(self, *answer: object) -> None:
        """Leave the answer as it is."""


def asked(address: str, **headers: str) -> tuple[int, Message, str]:
    opener = urllib.request.build_opener(NotFollowed)
    try:
        with opener.open(urllib.request.Request(address, headers=headers), timeout=30) as page:
            return page.status, page.headers, page.read().decode()
    except urllib.error.HTTPError as refused:
        return refused.code, refused.headers, refused.read().decode()


def fetched(address: str, **headers: str) -> tuple[int, str]:
    status, _, text = asked(address, **headers)
    return status, text


def let_in(printed: str) -> tuple[str, str]:
    """Open the printed address as a browser does; return the address without the token, and the cookie."""
    status, headers, _ = asked(printed)
    assert status == 303
    home, cookie = headers["Location"], headers["Set-Cookie"]
    assert "HttpOnly" in cookie and "SameSite=Strict" in cookie
    assert "token" not in home
    return home.rstrip("/"), cookie.partition(";")[0]


def test_the_page_is_there_on_loopback_alone_and_for_nobody_elses_page(tmp_path: Path) -> None:
    with served(tmp_path) as printed:
        assert re.fullmatch(r"http://127\.0\.0\.1:\d+/\?token=[\w-]{43}", printed)
        address, cookie = let_in(printed)
        status, page = fetched(address, Cookie=cookie)
        assert status == 200
        assert "textual" in page and "trcvtui passive.toml" in page
        assert fetched(address, Cookie=cookie, Host="evil.example")[0] == 403
        assert fetched(address, Cookie=cookie, Host=f"LOCALHOST:{address.rpartition(':')[2]}")[0] == 200
        outside = re.compile(r"(?:https?:)?//(?!127\.0\.0\.1:)(?!www\.w3\.org/2000/svg)[\w.-]+\.[a-z]")
        css = fetched(re.findall(r'href="([^"]*xterm\.css)"', page)[0], Cookie=cookie)[1]
        for text in (page, re.sub(r"/\*.*?\*/", "", css, flags=re.DOTALL)):
            assert outside.findall(text) == [], "no other host is asked for anything"
        for origin in ("http://evil.example", "null", f"https{address[4:]}"):
            assert fetched(f"{address}/ws", Cookie=cookie, Origin=origin)[0] == 403
        assert fetched(f"{address}/ws", Cookie=cookie)[0] == 403, "each page names its Origin at a websocket"


def test_another_user_of_the_machine_who_has_no_token_gets_nothing(tmp_path: Path) -> None:
    with served(tmp_path) as printed:
        address, cookie = let_in(printed)
        name, _, token = cookie.partition("=")
        wrong = f"{name}={'A' * len(token)}"
        for path in ("/", "/ws", "/static/css/xterm.css", "/download/x", "/?token=", f"/?token={token}x"):
            for shown in ({}, {"Cookie": wrong}, {"Cookie": f"{name}="}, {"Cookie": f"trcvtui-1={token}"}):
                assert asked(address + path, Origin=address, **shown)[0] == 403, path


@asynccontextmanager
async def answering(monkeypatch: pytest.MonkeyPatch) -> AsyncIterator[tuple[Any, list[dict[str, str]]]]:
    """Serve, and give what opens a websocket, and the environments of the screens that were started.

    In the place of a screen stands a program that is there at once, and ends when it is told anything.
    """
    started, environments, start = [], [], asyncio.create_subprocess_shell

    async def started_and_kept(command: str, **how: Any) -> asyncio.subprocess.Process:
        started.append(await start(command, **how))
        environments.append(how["env"])
        return started[-1]

    monkeypatch.setattr(asyncio, "create_subprocess_shell", started_and_kept)
    door = open_listener(0)
    entrance = AccessControl(door.getsockname()[1])
    runner = AppRunner(await application("exec head -c 1", entrance, "a bench", "about it", lambda: ""))
    await runner.setup()
    try:
        await SockSite(runner, door).start()
        address = entrance.address
        headers = {"Cookie": f"{entrance.cookie}={entrance.token}", "Origin": address}
        socket = address.replace("http", "ws") + "/ws"
        async with ClientSession(headers=headers) as session, asyncio.timeout(PATIENCE_S):
            yield lambda size="": session.ws_connect(socket + size), environments
    finally:
        await runner.cleanup()
        for program in started:  # the loop ends with this test: nothing of it may still run
            with suppress(ProcessLookupError):
                program.kill()
            await program.wait()
            program._transport.close()  # type: ignore[attr-defined]


async def test_screens_are_bounded_and_one_that_is_closed_makes_room(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    async with answering(monkeypatch) as (connect, _):
        open_ones = [await connect() for _ in range(MOST_TABS)]
        with pytest.raises(WSServerHandshakeError) as full:
            await connect()
        assert full.value.status == 503
        await open_ones.pop().close()
        while True:  # the server ends the screen before it counts it as gone
            try:
                open_ones.append(await connect())
                break
            except WSServerHandshakeError:
                await asyncio.sleep(0.05)
        for each in open_ones:
            await each.close()


async def test_what_no_page_of_ours_sends_is_left_out_and_no_screen_has_a_senseless_size(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    sizes: list[tuple[int, int]] = []

    async def set_size(_: AppService, width: int, height: int) -> None:
        sizes.append((width, height))

    monkeypatch.setattr(AppService, "set_terminal_size", set_size)
    wrong = ("no JSON", "{}", "[]", "7", "[" * 9999, '["stdin"]', '["stdin", 5]', '["resize", null]', "[[]]")
    async with answering(monkeypatch) as (connect, environments):
        page = await connect("?width=99999999&height=-5")
        for text in (*wrong, json.dumps(["stdin", "x" * (MOST_TYPED_CHARACTERS + 1)])):
            await page.send_str(text)
        await page.send_bytes(b"\xff")
        for width, height in ((120, 30), (10**9, "x"), (0, float("nan"))):
            await page.send_json(["resize", {"width": width, "height": height}])
        await page.send_json(["ping", "still here"])
        assert await page.receive_json() == ["pong", "still here"]
        await page.close()
    assert (environments[0]["COLUMNS"], environments[0]["ROWS"]) == (str(MOST_CELLS), "80")
    assert sizes == [(120, 30), (MOST_CELLS, 80), (1, 80)]
    assert [record for record in caplog.records if record.exc_info] == []


def test_root_says_that_a_browser_may_write_as_root(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(os, "geteuid", lambda: 0)
    assert main(["serve", str(PROJECT), "--write"]) == 2
    err = capsys.readouterr().err
    assert "root" in err and "--as-root" in err and len(err.splitlines()) == 1
    refuse_root(write=True, as_root=True)
    refuse_root(write=False, as_root=False)
    monkeypatch.setattr(os, "geteuid", lambda: 1000)
    refuse_root(write=True, as_root=False)


def test_a_wrong_project_is_told_before_anything_is_served(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["serve", str(tmp_path / "none.toml")]) == 2
    assert len(capsys.readouterr().err.splitlines()) == 1


def test_a_port_that_is_no_port_is_told(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["serve", str(PROJECT), "--port", "70000"]) == 2
    assert capsys.readouterr().err.startswith("--port: found 70000: ")


def test_without_textual_serve_one_line_says_how_to_get_it(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setitem(sys.modules, "textual_serve.server", None)
    assert main(["serve", str(PROJECT)]) == 2
    assert capsys.readouterr().err == (
        "trcvtui serve: found no textual-serve, expected it: pip install 'trcvtui[serve]'\n"
    )


def test_a_served_screen_is_read_only_unless_told_otherwise() -> None:
    path, door = Path("a folder/it's.toml"), Path("/tmp/door")
    assert command_line(path, door, False, None).endswith("--attach /tmp/door --read-only")
    written = command_line(path, door, True, "light")
    assert "--read-only" not in written and written.endswith("--theme light")
    assert "'a folder/it'\"'\"'s.toml'" in written, "a shell reads it as one word"


def test_an_expectation_of_a_read_only_bench_reads_no_file(tmp_path: Path) -> None:
    secret = tmp_path / "secret"
    secret.write_bytes(b"hidden")
    driver = EngineDriver(PROJECT, "sim", read_only=True)
    try:
        driver.wait_for_project()
        driver.submit(f"expect peer P1 received file {secret}")
        driver.submit("expect rx file /nowhere")
        answers: list[LineAnswer] = []
        while len(answers) < 2:
            driver.request(UpdateRequest())
            driver.wait_for_message(1)
            picture = driver.poll_picture()
            answers += picture.answers if picture else ()
    finally:
        driver.close()
    assert all("read-only" in answer.error for answer in answers), answers


# -- one bench ------------------------------------------------------------------------------------------

NO_TEXT = re.compile(r"\x1b\[[0-9;?<]*[a-zA-Z]|\x1b[()].")
SCAN = re.compile(r"scan (\d+) ·")


class Page:
    """What a browser shows of one tab, as text; `heard` is all that has come since the last key."""

    def __init__(self, socket: ClientWebSocketResponse) -> None:
        self._socket = socket
        self._bytes = b""

    @property
    def heard(self) -> str:
        return NO_TEXT.sub("", self._bytes.decode(errors="replace"))

    async def press(self, keys: str) -> None:
        self._bytes = b""
        await self._socket.send_json(["stdin", keys])

    async def until(self, pattern: str) -> str:
        """Read until it is shown; return the first group of its last match."""
        while not (found := re.findall(pattern, self.heard, re.DOTALL)):
            message = await self._socket.receive(PATIENCE_S)
            assert message.type in (WSMsgType.BINARY, WSMsgType.TEXT), f"closed; {self.heard[-2000:]}"
            self._bytes += message.data if isinstance(message.data, bytes) else b""
        return str(found[-1])

    async def end(self) -> None:
        async for _ in self._socket:
            pass


@asynccontextmanager
async def browser(printed: str) -> AsyncIterator[Callable[[], AbstractAsyncContextManager[Page]]]:
    """Give what opens a tab as a page of ours does."""
    address, cookie = let_in(printed)
    async with ClientSession(headers={"Cookie": cookie, "Origin": address}) as session:

        @asynccontextmanager
        async def tab() -> AsyncIterator[Page]:
            where = f"{address.replace('http', 'ws')}/ws?width=100&height=30"
            async with session.ws_connect(where) as socket:
                yield Page(socket)

        async with asyncio.timeout(PATIENCE_S):
            yield tab


async def test_a_toggle_in_one_tab_is_seen_in_another_and_a_reload_shows_the_same_run(tmp_path: Path) -> None:
    with served(tmp_path, "--write", "--as-root") as printed:
        async with browser(printed) as tab:
            async with tab() as first, tab() as second:
                await first.until("q quit")
                assert "READ-ONLY" not in first.heard and "8083" not in first.heard
                await second.until("q quit")
                await first.press("n")
                await second.until("EN_R ─┤ ■ 1")
                scan = int(await second.until(SCAN.pattern))
                await second.press(":add data more INT\r")
                await second.until(r"\+1 unsaved")
                await second.press("q")  # nothing is lost
                await second.end()
                await first.press("R")
                await first.until("R once more records the run, for all tabs")
                await first.press(":mark\r")
                await first.until("marked after scan")
            async with tab() as again:
                await again.until("EN_R ─┤ ■ 1")
                assert int(await again.until(SCAN.pattern)) > scan
                await again.press("4")
                await again.until(" 1    0.000  16#7000")


async def test_without_write_a_tab_looks_on_and_says_so(tmp_path: Path) -> None:
    with served(tmp_path) as printed:
        async with browser(printed) as tab, tab() as looker:
            await looker.until("RUN .* READ-ONLY .*this screen shows")
            await looker.press("n")
            await looker.until("this screen is read-only")


def children_of(pid: int) -> list[int]:
    return [*map(int, Path(f"/proc/{pid}/task/{pid}/children").read_text().split())]


def child_of(pid: int, word: bytes) -> int:
    return next(child for child in children_of(pid) if word in Path(f"/proc/{child}/cmdline").read_bytes())


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="looks into /proc")
async def test_a_page_ends_with_its_process_and_serve_does_not_wait_for_one_that_stands_still(
    tmp_path: Path,
) -> None:
    with serving(tmp_path) as (printed, process):
        async with browser(printed) as tab:
            async with tab() as page:
                await page.until(SCAN.pattern)
                os.kill(child_of(process.pid, b"--attach"), signal.SIGKILL)
                await page.end()
            async with tab() as page:
                await page.until(SCAN.pattern)
                stopped = child_of(process.pid, b"--attach")
                os.kill(stopped, signal.SIGSTOP)
    os.kill(stopped, signal.SIGCONT)


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="looks into /proc")
async def test_an_engine_that_ended_is_started_anew_by_a_new_tab_and_ends_with_a_killed_serve(
    tmp_path: Path,
) -> None:
    project = tmp_path / "P.toml"
    project.write_text(PROJECT.read_text())
    with serving(tmp_path, project=project) as (printed, process):
        async with browser(printed) as tab:
            async with tab() as first:
                await first.until(SCAN.pattern)
                os.kill(child_of(process.pid, b"spawn_main"), signal.SIGKILL)
                await first.until("ENGINE ENDED")
            project.write_text("broken")
            with pytest.raises(WSServerHandshakeError) as refused:
                async with tab():
                    pass
            assert refused.value.status == 503
            project.write_text(PROJECT.read_text())
            async with tab() as second:
                await second.until(SCAN.pattern)
                assert "8083" not in second.heard
                [door] = (tmp_path / "tmp").glob("trcvtui-*/bench")
                assert (door.stat().st_mode & 0o777, door.parent.stat().st_mode & 0o777) == (0o600, 0o700)
                below = children_of(process.pid)
                assert len(below) >= 2, "an engine and a tab"
                process.kill()
                while any(Path(f"/proc/{pid}").exists() for pid in below):
                    await asyncio.sleep(0.05)
                assert not door.parent.exists()


def test_too_few_descriptors_are_told_in_one_line(tmp_path: Path) -> None:
    words = f"ulimit -n 6; exec {sys.executable} -m trcvtui serve {PROJECT} --kernel sim"
    env = {**os.environ, "TMPDIR": str(tmp_path)}
    done = subprocess.run(["sh", "-c", words], capture_output=True, text=True, timeout=PATIENCE_S, env=env)
    assert [*tmp_path.iterdir()] == []
    assert done.returncode == 2
    assert len(done.stderr.splitlines()) == 1 and "ulimit" in done.stderr


# -- a real browser --------------------------------------------------------------------------------------

HEARS = """
    window.heard = "";
    const Plain = WebSocket;
    window.WebSocket = class extends Plain {
      constructor(...how) {
        super(...how);
        this.addEventListener("message", async (said) => {
          const bytes = said.data instanceof Blob ? await said.data.arrayBuffer() : said.data;
          window.heard += typeof bytes == "string" ? bytes : new TextDecoder().decode(bytes);
        });
      }
    };
"""


async def shown_in(tab: Tab, pattern: str) -> str:
    """Wait until a tab has been told it; return the first group of its last match."""
    heard = ""
    while not (found := re.findall(pattern, heard, re.DOTALL)):
        await asyncio.sleep(0.1)
        heard = NO_TEXT.sub("", str(await tab.value("window.heard")))
    return str(found[-1])


async def reload(tab: Tab) -> None:
    await tab.ask("Page.enable")
    await tab.ask("Page.addScriptToEvaluateOnNewDocument", source=HEARS)
    await tab.ask("Page.reload")


@pytest.mark.skipif(CHROMIUM is None, reason="needs chromium")
async def test_two_tabs_of_a_browser_share_one_bench_and_keys_go_to_it_at_once(tmp_path: Path) -> None:
    with served(tmp_path, "--write", "--as-root") as address:
        home = address.partition("?")[0]
        async with chromium(tmp_path, address) as tab, asyncio.timeout(PATIENCE_S):
            await reload(tab)
            scan = int(await shown_in(tab, SCAN.pattern))
            assert await tab.value("document.title") == "trcvtui passive.toml"
            assert await tab.is_true("document.querySelector('link[rel=icon]').href.startsWith('data:')")
            await shown_in(tab, "q quit")
            async with tab.beside(home) as other:
                await reload(other)
                await shown_in(other, "q quit")
                await tab.ask("Page.bringToFront")
                await tab.type("n")  # nothing was clicked
                await shown_in(other, "EN_R is 1")
                assert "8083" not in str(await other.value("window.heard"))
            await tab.ask("Page.reload")
            await shown_in(tab, "EN_R is 1")
            assert int(await shown_in(tab, SCAN.pattern)) > scan
