"""The user's settings in the config folder: theme and keys. Each mistake is one line in `problems`.

config.toml: theme = "dark" | "light" | "ansi" | one of Textual's, such as "nord"
(without a theme the terminal's colours decide). keys.toml: action = "key", or a list of keys. Lower-case
letters belong to pins and panes, so an action may have a lower-case letter only as its default key.
"""

from __future__ import annotations

import os
import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final, Literal

from rich.console import Console
from textual.binding import Binding, BindingType
from textual.keys import Keys, _character_to_key, format_key

from trcvtui.errors import UserError
from trcvtui.project.tables import expected_name, quote, read_toml
from trcvtui.tui.widgets.theme import THEMES

FEW_COLOUR_SYSTEMS: Final = (None, "standard")
COLOUR_SYSTEMS: Final[tuple[Literal["standard", "256", "truecolor"], ...]] = ("standard", "256", "truecolor")
CONFIG_FILE, KEYMAP_FILE = "config.toml", "keys.toml"
FIXED_KEYS: Final = frozenset((
    *("tab", "shift+tab", "enter", "escape", "up", "down", "left", "right", "backspace", "ctrl+q", "ctrl+c"),
    *"0123456789",
))  # fmt: skip
KEY_NAMES: Final = frozenset(key.value for key in Keys if not key.value.startswith("<"))
EXPECTED_KEY: Final = "one character, or a key such as f5, ctrl+k or pageup"


@dataclass(frozen=True, slots=True)
class ScreenSettings:
    """`keymap` has the keys of each changed action; `names` has the new key for a changed default key."""

    theme: str = "dark"
    keymap: Mapping[str, str] = field(default_factory=dict)
    names: Mapping[str, str] = field(default_factory=dict)
    problems: tuple[str, ...] = ()


def config_folder() -> Path:
    from platformdirs import user_config_path  # read when first asked for

    return user_config_path("trcvtui", appauthor=False)


def load_settings(bindings: Iterable[BindingType], theme: str | None = None) -> ScreenSettings:
    """Return the settings. The theme comes from NO_COLOR, else from `theme`, else from the file."""
    own = [binding for binding in bindings if isinstance(binding, Binding)]
    folder, problems = config_folder(), list[str]()
    config = _read_table(folder / CONFIG_FILE, problems)
    chosen = theme if theme in THEMES else _read_theme(config, folder / CONFIG_FILE, problems)
    keymap = _read_keymap(_read_table(folder / KEYMAP_FILE, problems), folder / KEYMAP_FILE, own, problems)
    names = {_format_key_name(b.key): _format_key_name(keymap[b.id]) for b in own if b.id in keymap}
    return ScreenSettings("ansi" if "NO_COLOR" in os.environ else chosen, keymap, names, tuple(problems))


def _read_table(path: Path, problems: list[str]) -> dict[str, Any]:
    try:
        os.lstat(path)  # a missing file is no problem; a dead link is one
        return read_toml(path)
    except FileNotFoundError:
        pass
    except OSError as failed:
        problems.append(f"{path}: found no readable file ({failed.strerror}), expected one")
    except UserError as wrong:
        problems += wrong.lines()
    return {}


def theme_for(environ: Mapping[str, str]) -> str:
    """Return the theme for the environment. A terminal with at most 16 colours keeps its own colours."""
    name = environ.get("TEXTUAL_COLOR_SYSTEM", "auto")  # Textual uses it, also in a browser
    system = name if name in COLOUR_SYSTEMS else "auto"
    console = Console(color_system=system, force_terminal=True, _environ=environ)
    return "ansi" if console.color_system in FEW_COLOUR_SYSTEMS else "dark"


def _read_theme(config: Mapping[str, Any], path: Path, problems: list[str]) -> str:
    default = theme_for(os.environ)
    for key in config:
        if key != "theme":
            problems.append(f"{path}: found {quote(key)}, expected theme")
    theme = config.get("theme", default)
    if isinstance(theme, str) and theme in THEMES:
        return theme
    problems.append(f"{path}: theme: found {quote(theme)}, expected one of {', '.join(THEMES)}")
    return default


# -- keys --------------------------------------------------------------------------------------------------


def _read_keymap(
    config: Mapping[str, Any], path: Path, bindings: list[Binding], problems: list[str]
) -> dict[str, str]:
    own: dict[str, set[str]] = {}
    for binding in bindings:
        for key in binding.key.split(",") if binding.id else ():
            own.setdefault(str(binding.id), set()).add(_parse_key(key) or key)
    keymap: dict[str, str] = {}
    for action, given in config.items():
        if action not in own:
            problems.append(f"{path}: found {quote(action)}, expected {expected_name(action, own, 'action')}")
            continue
        kept = {key: other for other in own if other not in config for key in own[other]}  # keys in use
        kept |= {key: other for other, keys in keymap.items() for key in keys.split(",")}
        try:
            keymap[action] = ",".join(_parse_keys(given, own[action], kept))
        except ValueError as wrong:
            problems.append(f"{path}: {action}: {wrong}")
    return keymap


def _parse_keys(given: object, own: set[str], kept: Mapping[str, str]) -> list[str]:
    texts: list[Any] = given if isinstance(given, list) else [given]
    if not texts or not all(isinstance(text, str) for text in texts):
        raise ValueError(f"found {quote(given)}, expected {EXPECTED_KEY}, or a list of such")
    keys = []
    for text in texts:
        key = _parse_key(text)
        if key is None:
            raise ValueError(f"found {quote(text)}, expected {EXPECTED_KEY}")
        # A lower-case letter is a pin's or a pane's, unless it is a default key of this action.
        if key in FIXED_KEYS or (len(key) == 1 and key.islower() and key not in own):
            raise ValueError(f"found {quote(text)}, which pins and panes use, expected another key")
        if key in kept:
            raise ValueError(f"found {quote(text)}, which {kept[key]} uses, expected another key")
        keys.append(key)
    return keys


def _parse_key(text: str) -> str | None:
    """Return the name that key events use for a key; None if the text is no key."""
    if len(text) == 1:
        return _character_to_key(text) if text.isprintable() and not text.isspace() else None
    if text in KEY_NAMES or text in ("full_stop", "colon", "backslash", "question_mark"):
        return text
    plain = re.fullmatch(r"(?:(?:ctrl|shift|alt)\+)+([a-z0-9])", text)
    return text if plain else None


def _format_key_name(keys: str) -> str:
    name = format_key(keys.split(",")[0])
    return name.upper() if re.fullmatch(r"f\d+", name) else name
