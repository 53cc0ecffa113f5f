"""Paths of the demo and the examples that come with the program; an example is found by its name."""

from __future__ import annotations

import os
from collections.abc import Iterator
from itertools import takewhile
from pathlib import Path
from typing import Final

from trcvtui.errors import mistake

CONFIGS_FOLDER: Final = "configs"


def demo_path() -> Path:
    return Path(__file__).parent / "demo" / "demo.toml"


def configs_path() -> Path:
    """Return the folder of the examples: inside the package of a wheel, or beside the source."""
    inside = Path(__file__).parent / CONFIGS_FOLDER
    return inside if inside.is_dir() else Path(__file__).parents[1] / CONFIGS_FOLDER


def state_folder() -> Path:
    """Return the folder for files whose path the user did not give. For a service systemd sets it."""
    from platformdirs import user_state_path  # only when needed: a faster start

    given = os.environ.get("STATE_DIRECTORY", "").partition(":")[0]
    return Path(given) if given else user_state_path("trcvtui", appauthor=False)


def runtime_folder() -> Path:
    """Return the folder where a user's running programs find each other. For a service, systemd sets it."""
    from tempfile import gettempdir  # only when needed: a faster start

    given, of_user = os.environ.get("RUNTIME_DIRECTORY", ""), os.environ.get("XDG_RUNTIME_DIR", "")
    if given:
        return Path(given.partition(":")[0])
    return Path(of_user, "trcvtui") if of_user else Path(gettempdir(), f"trcvtui-{os.geteuid()}")


def resolve_path(text: str) -> Path:
    """Return the file that a word of the command line names. Raise UserError if it names two examples.

    The user's own files come first. Otherwise a path such as `configs/types/weight.st` names a file that
    comes with the program. A name without folder and suffix, as `80c5-partner-closes`, names an example.
    """
    path = Path(text)
    if os.path.lexists(path):
        return path
    if path.parts[:1] == (CONFIGS_FOLDER,) and ".." not in path.parts:
        came_along = configs_path().joinpath(*path.parts[1:])
        return came_along if came_along.exists() else path
    if path.suffix or len(path.parts) != 1:
        return path
    found = sorted(configs_path().rglob(f"{_escape_glob(text)}.toml"))
    if len(found) > 1:
        names = " and ".join(str(Path(CONFIGS_FOLDER) / each.relative_to(configs_path())) for each in found)
        raise mistake(text, f"the name of {names}", "one of them")
    return found[0] if found else path


def list_examples(word: str | None = None) -> Iterator[str]:
    """Yield a line for each project and story. With `word`, yield all lines with it, also scenarios."""
    root = configs_path()
    shown = ("stories/*.toml", "guide/*.toml", "*.toml", "tls/*.toml", "scenarios/stories/*.toml")
    for pattern in ("**/*.toml",) if word else shown:
        for path in sorted(root.glob(pattern)):
            head = takewhile(lambda line: line.startswith("#"), path.read_text("utf-8").splitlines())
            sentence = " ".join(line.removeprefix("# ") for line in head).partition(". ")[0].rstrip(".")
            line = f"{Path(CONFIGS_FOLDER, path.relative_to(root))!s:<49}  {sentence}."
            if word is None or word.lower() in line.lower():
                yield line
    for folder in () if word else sorted((root / "scenarios").iterdir()):
        yield f"configs/scenarios/{folder.name}/: {len(list(folder.glob('*.toml')))} scenarios"


def _escape_glob(name: str) -> str:
    return "".join(f"[{letter}]" if letter in "*?[" else letter for letter in name)
