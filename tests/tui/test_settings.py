"""At home in any terminal: the user's keys and look, no colour, wide characters, help where one is."""

from __future__ import annotations

from pathlib import Path

import pytest
from msgspec.structs import replace

from tests.tui.fakes import TELEGRAM, bench_project, picture, story
from tests.tui.looking import BOTH, SMALL, WIDE, Looker, looking
from tests.tui.test_snapshots import FRAMES, READABLE, contrast
from trcvtui.cli.main import main
from trcvtui.cli.options import THEME_NAMES
from trcvtui.snapshots.bench import LineAnswer
from trcvtui.tui.app import BenchApp
from trcvtui.tui.formatting import clip, measure, pad, wrap_text
from trcvtui.tui.main import MainScreen
from trcvtui.tui.settings import ScreenSettings, load_settings
from trcvtui.tui.widgets.line_view import rule
from trcvtui.tui.widgets.theme import THEMES

LARGE = (200, 60)
CORNERS, SEEN = frozenset("╭╮╰╯┏┓┗┛"), 1.8  # of frames, and their contrast to what they stand on
SIZES = pytest.mark.parametrize("size", [SMALL, (120, 40), LARGE], ids=["80x24", "120x40", "200x60"])


@pytest.fixture
def config(tmp_path: Path) -> Path:
    folder = tmp_path / "config" / "trcvtui"
    folder.mkdir(parents=True)
    return folder


def settings(theme: str | None = None) -> ScreenSettings:
    return load_settings((*BenchApp.BINDINGS, *MainScreen.BINDINGS), theme)


def colours(looker: Looker) -> set[str]:
    found = set()
    for strip in looker.app.screen._compositor.render_strips():
        for segment in strip:
            for colour in (segment.style.color, segment.style.bgcolor) if segment.style else ():
                found.add(colour.name if colour is not None else "default")
    return found


# -- keys ----------------------------------------------------------------------------------------------


async def test_without_settings_nothing_is_said() -> None:
    assert settings() == ScreenSettings()


async def test_a_key_of_the_users_own_does_the_action_and_the_old_one_no_longer(config: Path) -> None:
    (config / "keys.toml").write_text('hold = "f6"\nzoom = ["f11", "Z"]\nprompt = "ctrl+k"\n')
    async with looking(WIDE) as looker:
        await looker.press("space")
        assert looker.lines == []
        await looker.press("f6")
        assert looker.lines == ["hold"]
        await looker.press("4", "Z")
        assert "1 Instances" not in looker.text
        await looker.press("f11", "ctrl+k")
        await looker.type("plc stop")
        await looker.press("enter")
        assert looker.lines == ["hold", "plc stop"]


async def test_keys_that_come_in_one_batch_obey_the_users_keymap(config: Path) -> None:
    (config / "keys.toml").write_text('prompt = ";"\n')
    async with looking(SMALL) as looker:
        for key in ("semicolon", *"mark"):
            await looker.pilot.press(key)
        await looker.press("enter")
        assert looker.lines == ["mark"]


async def test_footer_help_and_palette_name_the_users_keys(config: Path) -> None:
    (config / "keys.toml").write_text('hold = "f6"\nhelp = "f12"\n')
    async with looking(WIDE) as looker:
        assert "F6 hold" in looker.line("F12 help")
        place = looker.line("F6 hold").index("F6")
        await looker.pilot.click("#keys", offset=(place, 0))
        await looker.settle()
        assert looker.lines == ["hold"]
        abouts = {c.title: c.help for c in looker.app.get_system_commands(looker.app.screen)}
        assert abouts["Hold the scans"] == "hold · key F6"
        await looker.press("f12")
        assert "F6 " in looker.line("hold the scans, or resume them")
        await looker.press("f12")
        assert "1 Instances" in looker.text


@pytest.mark.parametrize(
    ("line", "told"),
    [
        ('hld = "f6"', "found 'hld', expected hold"),
        ('hold = "n"', "hold: found 'n', which pins and panes use, expected another key"),
        ('hold = "tab"', "hold: found 'tab', which pins and panes use, expected another key"),
        ('hold = "7"', "hold: found '7', which pins and panes use, expected another key"),
        ('hold = "S"', "hold: found 'S', which scenarios uses, expected another key"),
        ('hold = "F6"', "hold: found 'F6', expected one character, or a key such as f5, ctrl+k or pageup"),
        (
            "hold = 6",
            "hold: found 6, expected one character, or a key such as f5, ctrl+k or pageup, or a list",
        ),
        ("hold = []", "hold: found "),
        ("hold =", "expected TOML"),
        ("hold" + ".a" * 101 + " =", "line 2: found a key with 101 dots, expected at most 100"),
    ],
)
def test_a_wrong_entry_gives_one_clear_line_and_the_rest_holds(config: Path, line: str, told: str) -> None:
    (config / "keys.toml").write_text(f'zoom = "f11"\n{line}\n')
    found = settings()
    (problem,) = found.problems
    assert problem.startswith(str(config / "keys.toml")) and told in problem
    assert found.keymap == ({} if line[-1] == "=" else {"zoom": "f11"})


def test_two_actions_can_change_places(config: Path) -> None:
    (config / "keys.toml").write_text('freeze = "K"\nmark = "F"\n')
    assert settings().keymap == {"freeze": "K", "mark": "F"}
    assert settings().problems == ()


# -- looks ---------------------------------------------------------------------------------------------


@pytest.mark.parametrize("text", ['theme = "pink"', "theme = 1", 'colour = "red"'])
def test_a_look_that_is_none_is_told_and_the_dark_one_stands(config: Path, text: str) -> None:
    (config / "config.toml").write_text(text)
    found = settings()
    assert found.theme == "dark"
    assert len(found.problems) == 1


async def test_words_and_frames_are_seen_in_every_theme() -> None:
    async with looking(WIDE, picture(lines=story())) as looker:
        await looker.press("5")
        words = looker.text
        for theme in [*looker.app.available_themes.values()]:
            looker.app.theme = theme.name
            await looker.settle()
            assert looker.text == words, theme.name
            strips = looker.app.screen._compositor.render_strips()
            drawn = [(part.text.strip(), part.style) for strip in strips for part in strip if part.style]
            frames = {style for text, style in drawn if text and set(text) <= CORNERS}
            assert len(frames) >= 2, f"{theme.name}: the one with the focus is another one"
            if theme.ansi:
                paper = {"default", "color(0)" if theme.dark else "color(7)"}
                assert not {style.color.name for style in frames if style.color} & paper, theme.name
                continue
            inks = {style for text, style in drawn if text and not set(text) <= FRAMES}
            assert [style for style in inks if contrast(style) < READABLE] == [], theme.name
            assert [style for style in frames if contrast(style) < SEEN] == [], theme.name


def test_a_theme_is_named_in_the_config_or_the_command_line(
    config: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert {*THEME_NAMES} == {*THEMES}
    (config / "config.toml").write_text('theme = "nord"\n')
    assert (settings().theme, settings("dracula").theme) == ("nord", "dracula")
    assert main(["--theme", "pink"]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert all(f"'{name}'" in line for name in THEME_NAMES)


@BOTH
async def test_the_16_colour_look_uses_no_other_colour(size: tuple[int, int]) -> None:
    sixteen = {f"color({number})" for number in range(16)} | {"default"}
    async with looking(size, theme="ansi") as looker:
        for key in "12345678":
            await looker.press(key)
            assert colours(looker) <= sixteen
        assert len(colours(looker)) > 3


@BOTH
async def test_no_color_is_honoured_and_the_words_stay(
    size: tuple[int, int], monkeypatch: pytest.MonkeyPatch
) -> None:
    async with looking(size) as looker:
        words = looker.text
    monkeypatch.setenv("NO_COLOR", "1")
    async with looking(size, theme="light") as looker:
        assert looker.text == words
        assert colours(looker) == {"default"}
        await looker.press("2", "down", "down")
        reversed_ = [
            segment.text
            for strip in looker.app.screen._compositor.render_strips()
            for segment in strip
            if segment.style and segment.style.reverse
        ]
        assert reversed_, "the cursor shows without a colour"


async def test_the_palette_changes_the_look() -> None:
    async with looking(WIDE) as looker:
        (light,) = (c for c in looker.app.get_system_commands(looker.app.screen) if c.title == "Theme light")
        light.callback()
        await looker.settle()
        assert looker.app.theme == "bench-light"


# -- wide characters -------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("text", "width", "shown"),
    [
        ("测量值", 6, "测量值"),
        ("测量值", 5, "测量…"),
        ("测量值", 4, "测…"),
        ("测量值", 1, "…"),
        ("测量值", 0, ""),
        ("e\u0301tat", 4, "e\u0301tat"),
        ("🙂🙂", 3, "🙂…"),
    ],
)
def test_a_cut_counts_columns_not_characters(text: str, width: int, shown: str) -> None:
    assert clip(text, width) == shown
    assert measure(clip(text, width)) <= width


def test_padding_counts_columns() -> None:
    assert pad("测", 4) == "测  "
    assert pad("测", 4, right=True) == "  测"
    assert pad("测量", 3) == "测量"


def test_a_text_without_blanks_is_broken_where_the_columns_end() -> None:
    assert wrap_text("连接被对方关闭 ok", 9) == ("连接被对", "方关闭 ok")
    assert all(measure(line) <= 9 for line in wrap_text("a连接 被对方关闭了吗 🙂🙂🙂🙂🙂🙂", 9))


def test_a_rule_ends_where_the_line_ends() -> None:
    assert sum(measure(text) for text, _ in rule(20, ("测量值 ", "")).parts) == 20


@SIZES
async def test_wide_characters_push_no_frame_out_of_its_place(size: tuple[int, int]) -> None:
    answer = LineAnswer(1, 'peer P1 send text "测量值🙂"', "对方没有连接 " * 9)
    wide = TELEGRAM[:14] + "温度测量".encode() + TELEGRAM[26:]
    async with looking(size, picture(data=wide, answers=[answer])) as looker:
        for strip in looker.app.screen._compositor.render_strips():
            assert strip.cell_length == size[0]
        assert "测量值" in looker.text


async def test_a_project_with_a_wide_name_fits_its_header() -> None:
    async with looking(SMALL) as looker:
        project = replace(bench_project(), path=Path("/tmp/灌装线测试项目二号机组.toml"))
        await looker.show(replace(picture(), project=project, project_number=1))
        header = looker.app.screen._compositor.render_strips()[0]
        assert header.cell_length == SMALL[0]


# -- help where one is -----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("pane", "title", "says"),
    [
        ("2", "Here: 2 Block", "toggle the pin under the cursor"),
        ("5", "Here: 5 Received", "move by a byte"),
        ("7", "Here: 7 Peer", "send the message"),
        ("8", "Here: 8 Timing", "one scan back, one"),
    ],
)
@BOTH
async def test_help_begins_with_the_keys_of_the_focused_pane(
    size: tuple[int, int], pane: str, title: str, says: str
) -> None:
    async with looking(size) as looker:
        await looker.press(pane, "question_mark")
        lines = [line.strip(" │") for line in looker.text.splitlines()]
        at = next(number for number, line in enumerate(lines) if title in line)
        assert at <= 4, "the first thing that stands there"
        assert says in looker.text
        assert looker.text.count(title.removeprefix("Here: ") + " ") <= 2, "it does not come again below"
