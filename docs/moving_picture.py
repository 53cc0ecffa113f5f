"""Join screens, each an SVG of rich, to one SVG that shows them in turn: CSS alone, no script."""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import Final, NamedTuple

NAME: Final = re.compile(r"terminal-\d+")  # rich derives it from the content
STYLE: Final = re.compile(r"^\s*\.terminal-(r\d+) \{([^}]*)\}\n?", re.MULTILINE)
CLASS: Final = re.compile(r'class="terminal-(r\d+)"')
TITLE: Final = re.compile(r'<text class="terminal-title".*?</text>')
BACKGROUND: Final = re.compile(r'<rect [^>]*shape-rendering="crispEdges"/>')
TEXT: Final = re.compile(r'<text class="s\d+".*?</text>')
MOTION: Final = "@media (prefers-reduced-motion: no-preference)"


class Frame(NamedTuple):
    """A screen as SVG, and for how many seconds it is shown."""

    svg: str
    seconds: float


class _Turns:
    """Which frames show what; each set of frames is one class of the style sheet."""

    def __init__(self, frames: Sequence[Frame]) -> None:
        self._frames = frames
        self._classes: dict[frozenset[int], str] = {}

    def groups(self, drawn: Sequence[Sequence[str]]) -> str:
        """Return what is drawn, frame by frame, with each thing once."""
        shown: dict[str, set[int]] = {}
        for number, things in enumerate(drawn):
            for thing in things:
                shown.setdefault(thing, set()).add(number)
        groups: dict[frozenset[int], list[str]] = {}
        for thing, numbers in shown.items():
            groups.setdefault(frozenset(numbers), []).append(thing)
        return "\n".join(
            f'<g class="{self._classes.setdefault(numbers, f"g{len(self._classes)}")}">{"".join(things)}</g>'
            for numbers, things in groups.items()
        )

    def style_sheet(self) -> str:
        """Return the animations; where no motion is wanted the last frame is shown."""
        last = len(self._frames) - 1
        still = [f".{name} {{ visibility: hidden }}" for ns, name in self._classes.items() if last not in ns]
        return "\n".join([*still, MOTION + " {", *map(self._animation, self._classes), "}"])

    def _animation(self, numbers: frozenset[int]) -> str:
        name, whole = self._classes[numbers], sum(frame.seconds for frame in self._frames)
        steps, begin = [], 0.0
        for number, frame in enumerate(self._frames):
            steps.append(
                f"{begin / whole:.2%} {{visibility: {'visible' if number in numbers else 'hidden'}}}"
            )
            begin += frame.seconds
        return (
            f"@keyframes {name} {{{' '.join(steps)}}}\n"
            f".{name} {{ animation: {name} {whole:g}s step-end infinite }}"
        )


def moving(frames: Sequence[Frame]) -> str:
    """Return one SVG of frames that have the same size."""
    styles: dict[str, str] = {}  # the text of a style: its class
    screens = [_with_styles(NAME.sub("terminal", frame.svg), styles) for frame in frames]
    turns = _Turns(frames)
    svg = screens[-1]
    for part in (TITLE, BACKGROUND, TEXT):
        first = part.search(svg)
        assert first is not None, part.pattern
        joined = turns.groups([part.findall(screen) for screen in screens])
        svg = svg[: first.start()] + joined + part.sub("", svg[first.start() :])
    looks = "\n".join(f".{name} {{ {text} }}" for text, name in styles.items())
    return STYLE.sub("", svg).replace("</style>", f"{looks}\n{turns.style_sheet()}\n    </style>", 1)


def _with_styles(svg: str, styles: dict[str, str]) -> str:
    """Return a screen whose classes are those of all screens."""
    own = {name: styles.setdefault(text.strip(), f"s{len(styles)}") for name, text in STYLE.findall(svg)}
    return CLASS.sub(lambda found: f'class="{own[found[1]]}"', svg)
