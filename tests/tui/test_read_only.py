"""A read-only screen looks: no key and no command of it changes the bench, reads a file or writes one."""

from __future__ import annotations

import inspect
from pathlib import Path

import pytest

from tests.tui.looking import SMALL, WIDE, looking
from trcvtui import files
from trcvtui.history import waveform_text as wave_files
from trcvtui.picture.protocol import READ_ONLY_COMMANDS
from trcvtui.tui import clipboard_and_files
from trcvtui.tui import clipboard_and_files as keepsake


@pytest.mark.parametrize("size", [SMALL, WIDE], ids=["80x24", "140x45"])
async def test_a_read_only_screen_commands_nothing(size: tuple[int, int]) -> None:
    async with looking(size) as looker:
        looker.app.only_looks = True
        await looker.press("n", "space", "K", "S", "7", "r")
        assert looker.lines == []
        assert "this screen is read-only" in " ".join(looker.text.split())
        await looker.press("4", "colon")
        await looker.type("save scenario x.toml")
        await looker.press("enter")
        assert looker.lines == []
        await looker.press("colon")
        await looker.type("expect TRCV_C_1 EN_R=1")
        await looker.press("enter")
        assert looker.lines == ["expect TRCV_C_1 EN_R=1"], "to look is allowed"


READ_ONLY_SCREENS = {
    "MainScreen", "HelpScreen", "DescriptionScreen", "CurveScreen", "CommandPalette", "Screen",
}  # fmt: skip


async def test_no_key_and_no_command_of_the_palette_does_more_than_look(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    kept: list[object] = []
    monkeypatch.setattr(keepsake, "write_file", lambda *what, **how: kept.append(what))
    monkeypatch.setattr(keepsake, "copy_by_program", kept.append)
    monkeypatch.setattr(clipboard_and_files, "copy_by_program", kept.append)
    monkeypatch.setattr(wave_files, "write_file", lambda *what, **how: kept.append(what))
    monkeypatch.setattr(files, "read_bounded", lambda *what: kept.append(what))
    async with looking(WIDE) as looker:
        app = looker.app
        app.only_looks = True

        async def back(did: str) -> None:
            assert {type(screen).__name__ for screen in app.screen_stack} <= READ_ONLY_SCREENS, did
            while app.screen is not app.main:
                app.pop_screen()
                await looker.pilot.pause()
            assert not [line for line in looker.lines if line.split()[0] not in READ_ONLY_COMMANDS], did

        done = {"app.quit", "quit", "suspend_process"}
        for pane in "12345678":
            await looker.pilot.press(pane)
            for key, bound in list(app.screen.active_bindings.items()):
                if bound.binding.action not in done:
                    done.add(bound.binding.action)
                    await looker.pilot.press(pane, key, "enter")
                    await back(f"{pane} {key}")
        assert len(done) > 60 and app.is_running
        for command in list(app.get_system_commands(app.screen)):
            if command.title not in ("Quit", "Command line"):
                done_by_it = command.callback()
                if inspect.isawaitable(done_by_it):
                    await done_by_it
                await looker.pilot.pause()
                await back(command.title)
        for line in (
            "lab",
            "udt open /etc/passwd",
            "scenarios",
            "export timing vcd",
            "save project",
            "",
        ):
            app.submit(line)
            await looker.pilot.pause()
            await back(line)
        assert app._send_line("set TRCV_C_1 CONT=1") is None, "no way into the engine but this list"
        assert app.is_running
    assert kept == []


async def test_a_curve_looks_only() -> None:
    async with looking(WIDE) as looker:
        looker.app.only_looks = True
        await looker.press("6", "enter")
        assert type(looker.app.screen).__name__ == "CurveScreen"
