"""Typing fast: letters and Backspaces in one burst, in every field of every screen that there is."""

from __future__ import annotations

import gc
import importlib
import pkgutil
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from textual import events
from textual.screen import Screen
from textual.widgets import Input

import trcvtui.tui
from tests.tui.looking import WIDE, looking
from tests.tui.on_a_bench import BenchLooker, on_a_bench
from trcvtui.net.connection.config import ConnectConfig
from trcvtui.project.file import load_project
from trcvtui.scenario.scenario import ScenarioFiles
from trcvtui.tui.copy_formats import YankScreen, make_copy_source
from trcvtui.tui.curve import CurveScreen
from trcvtui.tui.doctor import DoctorScreen
from trcvtui.tui.fleet.app import FleetHelpScreen, FleetScreen
from trcvtui.tui.fleet.card import FleetCardScreen
from trcvtui.tui.forms.add_screen import AddScreen, ChangeScreen, ChoiceField
from trcvtui.tui.forms.description import DescriptionScreen
from trcvtui.tui.forms.fields import ProjectPart
from trcvtui.tui.forms.messages import LibraryScreen, UdtForm, make_udt_form
from trcvtui.tui.framings import FramingScreen
from trcvtui.tui.lab.lab import Lab
from trcvtui.tui.lab.panes import ConstantsForm, ProblemsScreen
from trcvtui.tui.lab.screen import LabScreen
from trcvtui.tui.main import MainScreen
from trcvtui.tui.prompt import PromptInput
from trcvtui.tui.replay import ReplayScreen
from trcvtui.tui.scenarios.panes import ScenarioListModel
from trcvtui.tui.scenarios.screen import ScenariosScreen
from trcvtui.tui.widgets.dialogs import (
    ChoiceScreen,
    Dialog,
    FieldsDialog,
    FormDialog,
    QuitTapScreen,
    ResultScreen,
    ViewDialog,
)
from trcvtui.tui.widgets.help import HelpScreen
from trcvtui.tui.widgets.screens import FullScreen, SideScreen
from trcvtui.tui.widgets.typed_lines import EntryField

CONFIGS = Path(__file__).parents[2] / "configs"


def modules_of_the_screen() -> None:
    for module in pkgutil.walk_packages(trcvtui.tui.__path__, "trcvtui.tui."):
        importlib.import_module(module.name)


def all_of(base: type[Any]) -> set[type[Any]]:
    modules_of_the_screen()
    found, waiting = set(), [base]
    while waiting:
        for kind in waiting.pop().__subclasses__():
            waiting.append(kind)
            if kind.__module__.startswith("trcvtui."):
                found.add(kind)
    return found


def described() -> list[ConnectConfig]:
    project = load_project(CONFIGS / "s7-iso-active.toml")
    return list(project.connects)


def udt_form(looker: BenchLooker) -> UdtForm:
    form = make_udt_form("Telegram {}", "udt", looker.app.view_model)
    assert form is not None
    return form


# How each screen is opened; a new one without a line here fails the test below.
BASES = {FullScreen, SideScreen, Dialog, ViewDialog, FieldsDialog, FormDialog}  # never opened themselves
SAME_FIELDS = {ReplayScreen}  # as MainScreen
OPENED: dict[type[Any], Callable[[BenchLooker], Screen[Any] | None]] = {
    MainScreen: lambda looker: None,
    AddScreen: lambda looker: AddScreen(lambda: looker.app.view_model.project, "peer", {}),
    ChangeScreen: lambda looker: ChangeScreen(
        lambda: looker.app.view_model.project, ProjectPart("connect", "C1")
    ),
    UdtForm: udt_form,
    ConstantsForm: lambda looker: ConstantsForm(["GVL.MAX", "GVL.MIN"], "a file"),
    LibraryScreen: lambda looker: LibraryScreen("P1", looker.app.view_model.project),
    ResultScreen: lambda looker: ResultScreen("trial", "Every split", "", lambda width: []),
    ProblemsScreen: lambda looker: ProblemsScreen(["one"]),
    QuitTapScreen: lambda looker: QuitTapScreen("2 connections"),
    ChoiceScreen: lambda looker: ChoiceScreen("Types", [("abd", ""), ("xyz", "")], ""),
    YankScreen: lambda looker: YankScreen(make_copy_source(looker.app.view_model, False, False), "h"),
    HelpScreen: lambda looker: HelpScreen(looker.app.view_model, None),
    DescriptionScreen: lambda looker: DescriptionScreen(described(), described()[0].name, {}),
    DoctorScreen: lambda looker: DoctorScreen(looker.app.view_model),
    CurveScreen: lambda looker: CurveScreen(looker.app.view_model, "speed"),
    FramingScreen: lambda looker: FramingScreen(looker.app.view_model),
    LabScreen: lambda looker: LabScreen(looker.app.view_model, Lab(looker.app.view_model), lambda line: None),
    ScenariosScreen: lambda looker: ScenariosScreen(
        looker.app.view_model, lambda line: None, ScenarioListModel(ScenarioFiles((), False), None)
    ),
}

# Of another program: tests/tui/fleet types into the only field that they have.
ELSEWHERE = {FleetScreen, FleetHelpScreen, FleetCardScreen}

BACK = "\x7f"


def burst(text: str) -> list[events.Key]:
    names = {
        BACK: "backspace",
        "\r": "enter",
        "\t": "tab",
        " ": "space",
        "=": "equals_sign",
        "\x15": "ctrl+u",
    }
    return [events.Key(names.get(letter, letter), letter) for letter in text]


async def at_once(looker: BenchLooker, *keys: events.Event) -> None:
    for key in keys:
        looker.app.post_message(key)
    await looker.settle()


async def opened(looker: BenchLooker, kind: type[Any]) -> None:
    screen = OPENED[kind](looker)
    if screen is not None:
        await looker.app.push_screen(screen)
    assert type(looker.app.screen) is kind


def test_every_screen_is_typed_into_here() -> None:
    assert {kind for kind in all_of(Screen) if kind not in OPENED} == BASES | SAME_FIELDS | ELSEWHERE


def test_every_field_is_a_typed_field() -> None:
    assert {kind for kind in all_of(Input) if not issubclass(kind, EntryField)} == set()


@pytest.mark.parametrize("kind", OPENED, ids=lambda kind: kind.__name__)
async def test_what_is_typed_in_one_burst_stands_there_in_its_order(kind: type[Any]) -> None:
    async with on_a_bench(WIDE) as looker:
        await opened(looker, kind)
        for field in looker.app.screen.query(Input):
            for around in field.ancestors_with_self:
                around.display = True
            looker.app.screen.set_focus(field)
            field.value = ""
            await at_once(looker, *burst(f"ab{BACK}c 12{BACK}{BACK}{BACK}{BACK}3x{BACK}4"))
            assert field.value == "a34", field
            await at_once(looker, events.Paste("pasted"), *burst(f"{BACK}{BACK}!"))
            assert field.value == "a34past!", field
            field.value = ""


async def test_a_list_is_narrowed_by_letters_and_backspaces_in_their_order() -> None:
    async with on_a_bench(WIDE) as looker:
        await opened(looker, ChoiceScreen)
        await at_once(looker, *burst(f"abc{BACK}d"))
        screen = looker.app.screen
        assert isinstance(screen, ChoiceScreen)
        assert screen._list.typed == "abd"


async def test_a_whole_form_in_one_burst_with_the_key_that_opens_it_and_the_line_typed_after_it() -> None:
    async with on_a_bench(WIDE) as looker:
        shift_tab = events.Key("shift+tab", None)
        name = burst(f"\x15C8{BACK}9\t\t\t\x152{BACK}7001\rT")
        await at_once(
            looker, *burst("A"), shift_tab, *burst(f"\x15conm{BACK}nect\t"), *name, *burst(f"x{BACK}y")
        )
        line = "add connect C9 ActiveEstablished=false LocalAddress=127.0.0.1 LocalPort=7001"
        assert looker.lines == [line]
        assert looker.app.main.prompt._input.value == "trigger y"


async def test_another_block_in_one_burst_keeps_what_is_typed_after_it() -> None:
    async with on_a_bench(WIDE) as looker:
        await at_once(looker, *burst(f"A\t\x15TSEND_D{BACK}C\tC1{BACK}2"))
        form = looker.app.screen
        assert isinstance(form, AddScreen)
        assert {f.key: f.value for f in form.query(ChoiceField)}["connect"].endswith("C2")


@pytest.mark.screen
async def test_leaving_while_a_suggestion_has_not_begun_leaves_nothing_unawaited() -> None:
    async with looking(WIDE) as looker:
        await looker.press(":")
        with warnings.catch_warnings(record=True) as told:
            warnings.simplefilter("always")
            looker.app.screen.query_one(PromptInput).value = "se"
            looker.app.workers.cancel_all()  # as the end of the screen does
            await looker.settle()
            gc.collect()
    assert [str(each.message) for each in told] == []
