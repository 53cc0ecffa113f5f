"""The model of the lab: types from files, one type laid out in two profiles, and the bytes to decode.

Rule: this file sends no command to the PLC. If a type changes in its file, the lab changes, but DATA does
not.
"""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Final

from trcvtui.diagnosis.stream_messages import StreamMessage
from trcvtui.errors import UserError, mistake
from trcvtui.history.records import AT_END, MOST_WINDOW, HistoryRequest, HistoryWindow, JobSpan
from trcvtui.tui.formatting import plain
from trcvtui.tui.lab.collapsible_tree import FoldTree
from trcvtui.tui.view_model.view_model import ViewModel
from trcvtui.udt.compare.compare import Comparison, Summary
from trcvtui.udt.compare.fit import Fit, rank, verdict
from trcvtui.udt.layout.layout import BYTE_ORDERS, Layout, Profile, lay_out
from trcvtui.udt.layout.rules import LAYOUT_ALIASES, LAYOUTS, TEXT_FORMS, LayoutRules
from trcvtui.udt.sources import read_files
from trcvtui.udt.type_set import NO_TYPES, TypeSet
from trcvtui.udt.types import Type
from trcvtui.wording import count

# Rule 1: only a message shows how long the sender's telegram is; DATA and jobs have the length of our type.
# Rule 2: a saved file that breaks a good type changes nothing but the error line.

FileStamp = tuple[int, int] | None  # time of the last change in ns, and size; None: no file


class TypeFiles:
    """Types of one or more files. `trouble` is the error in the files as they are on the disk now."""

    def __init__(
        self, paths: Iterable[Path], constants: Mapping[str, int], types: TypeSet | None = None
    ) -> None:
        self.paths = tuple(paths)
        self.constants = dict(constants)
        self.types = types or NO_TYPES
        self.trouble = ""
        self._stamps = self._file_stamps()
        if types is None:
            self.types = self._read()

    @property
    def name(self) -> str:
        names = [path.name for path in self.paths]
        return (
            names[0] + (f" and {len(names) - 1} more" if len(names) > 1 else "") if names else "the project"
        )

    def reload_if_changed(self) -> bool:
        """Read the files again if one has changed; return whether the types have changed."""
        stamps = self._file_stamps()
        if stamps == self._stamps:
            return False
        self._stamps = stamps
        return self._read_again()

    def add_constants(self, constants: Mapping[str, int]) -> bool:
        """Read the files with more constants; return whether the types have changed."""
        self.constants |= constants
        return self._read_again()

    def _read_again(self) -> bool:
        try:
            fresh = self._read()
        except UserError as refused:
            self.trouble = refused.lines()[0]
            return False
        lost = [name for key, (name, _) in self.types.types.items() if key not in fresh.types]
        new = [problem for problem in fresh.problems if problem not in self.types.problems]
        if lost and new:  # rule 2
            self.trouble = str(new[0])
            return False
        self.types, self.trouble = fresh, ""
        return True

    def _read(self) -> TypeSet:
        return read_files(self.paths, self.constants) if self.paths else NO_TYPES

    def _file_stamps(self) -> tuple[FileStamp, ...]:
        return tuple(_file_stamp(path) for path in self.paths)


def _file_stamp(path: Path) -> FileStamp:
    try:
        found = os.stat(path)
    except (OSError, ValueError):
        return None
    return found.st_mtime_ns, found.st_size


DATA, JOB, LAST_JOB, MESSAGE, HEX = "data", "job", "last", "message", "hex"
SOURCES: Final = (DATA, JOB, LAST_JOB, MESSAGE, HEX)
MOST_MESSAGES: Final = 8  # profiles are judged by the newest messages
SOURCE_TITLES: Final = {
    DATA: "DATA of the selected instance",
    JOB: "the bytes of its running job so far",
    LAST_JOB: "its last job that ended with DONE",
    MESSAGE: "a message of the peer, as it was sent",
    HEX: "hex bytes that you type or paste",
}


class LabBytes:
    """The bytes that the lab shows; `back` counts the messages that came after the shown message."""

    def __init__(self, view_model: ViewModel) -> None:
        self._view_model = view_model
        self.source = DATA
        self.is_chosen = False  # by the user
        self.back = 0
        self.typed = b""
        self._last: JobSpan | None = None

    def choose_initial(self) -> str:
        """Choose DATA, or the job if DATA was never written. Keep the user's choice. Return a remark."""
        if self.is_chosen or self.source not in (DATA, JOB):
            return ""
        declared, is_empty = self._view_model.declaration, not any(self._view_model.data)
        self.source = JOB if is_empty and self._view_model.job_bytes and not self._is_data_written() else DATA
        if self.source == DATA or declared is None:
            return ""
        return f"DATA {plain(declared.name)} has never been written: these are the bytes of the running job"

    def _is_data_written(self) -> bool:
        snapshot, instance = self._view_model.snapshot, self._view_model.instance
        if snapshot is None or instance is None:
            return False
        return any(one.jobs_done for one in snapshot.instances if one.data == instance.data and not one.sends)

    def make_request(self) -> HistoryRequest | None:
        """Return the request for the stream. The messages rank the profiles, even while DATA is shown."""
        instance = self._view_model.instance
        if instance is None:
            return None
        window, job = self.window(), None
        if window is not None and self.source == LAST_JOB:
            mine = [span for span in window.jobs if span.instance == instance.name and span.done]
            self._last = mine[-1] if mine else self._last
            job = self._last.position if self._last is not None else None
        return HistoryRequest(instance.connect, AT_END, MOST_WINDOW, job_at=job)

    def window(self) -> HistoryWindow | None:
        window, instance = self._view_model.past_window, self._view_model.instance
        if window is None or not instance or window.connect != instance.connect:
            return None
        return window if window.content or window.begin == window.end else None  # None: it has no stream yet

    # -- the bytes ----------------------------------------------------------------------------------

    @property
    def content(self) -> bytes:
        match self.source:
            case "data":
                return self._view_model.data
            case "job":
                return self._view_model.job_bytes
            case "last":
                window = self.window()
                return window.job[1] if window is not None and window.job is not None else b""
            case "message":
                found = self._chosen_message()
                return found.content if found else b""
            case _:
                return self.typed

    @property
    def name(self) -> str:
        size = f"{len(self.content)} B"
        match self.source:
            case "data":
                declared = self._view_model.declaration
                return f"DATA {plain(declared.name)}, {size}" if declared else "no DATA"
            case "job":
                return f"job of {plain(self._view_model.selected)}, {size} so far"
            case "last":
                number = f" {self._last.number}" if self._last is not None else ""
                return f"last job{number}, {size}" if self.content else "no job has ended yet"
            case "message":
                found = self._chosen_message()
                return f"{plain(found.name)}, {size}" if found else f"no message{self._doubt() or ' yet'}"
            case _:
                return f"typed hex, {size}"

    def _uses_messages(self) -> bool:
        return self.source not in (LAST_JOB, HEX) and bool(self.messages())

    def _chosen_message(self) -> StreamMessage | None:
        messages = self.messages()
        self.back = max(0, min(self.back, len(messages) - 1))
        return messages[-1 - self.back] if messages else None

    def messages(self) -> list[StreamMessage]:
        """Return the complete messages of the stream, oldest first."""
        return [] if self.window() is None else self._view_model.messages

    def _doubt(self) -> str:
        """Return why message ends are unknown, or "". Pauses count if the least size divides all sizes."""
        window, messages = self.window(), self.messages()
        sizes = [len(message.content) for message in messages if message.by_pauses]
        is_known = bool(messages) and not any(size % min(sizes) for size in sizes)
        if is_known or self.source == HEX or window is None or not window.recvs:
            return ""
        cause = f"pieces of {min(sizes)} to {max(sizes)} B came" if sizes else "bytes came without a pause"
        return f" ({cause}: where a message ends is not known)"

    def evidence(self) -> tuple[list[bytes], bool]:
        """Return the bytes to judge profiles by, and whether the sender decided their lengths.

        While DATA or the running job is shown, return the received messages, if their ends are known.
        """
        known = [] if self._doubt() else [message.content for message in self.messages()]
        if known and self._uses_messages():
            return known[-MOST_MESSAGES:], True
        content = self.content
        return [content] if content else [], self.source == HEX or content in known

    @property
    def evidence_name(self) -> str:
        doubt, messages = self._doubt(), self.messages()
        if doubt or not self._uses_messages():
            return self.name + doubt * (self.source != MESSAGE or bool(messages))
        by_pauses = " by pauses" * messages[-1].by_pauses
        return count(min(MOST_MESSAGES, len(messages)), "message") + by_pauses

    # -- choosing -----------------------------------------------------------------------------------

    def step_messages(self, messages: int) -> None:
        self.source, self.is_chosen = MESSAGE, True
        self.back = max(0, min(self.back - messages, max(0, len(self.messages()) - 1)))


OURS, THEIRS = "ours", "theirs"
FIRST_LAYOUT: Final = "natural8"  # the guess for theirs: a C compiler
OTHER_LAYOUT: Final = "packed"  # the guess if ours is natural8
PROFILE_WORDS: Final = (*LAYOUTS, *LAYOUT_ALIASES, *BYTE_ORDERS, *TEXT_FORMS)


class Lab:
    """One type, two profiles, some bytes; layouts, tree and comparison are made on demand."""

    def __init__(self, view_model: ViewModel) -> None:
        self._view_model = view_model
        self.bytes = LabBytes(view_model)
        self.opened: TypeFiles | None = None  # a file that you opened in place of the project's
        self._own = self._project_files()
        self._project = view_model.project
        ours = profile_of(view_model.project.layout)
        self.profiles = {OURS: ours, THEIRS: ours}
        self._is_guess = True  # theirs, until you choose it
        self.news = ""  # the last event, in a sentence
        self.fits: tuple[Fit, ...] = ()
        self._remark = ""  # of the bytes, when the lab was opened
        self.fitted_by = ""  # names the bytes that `fits` was judged by
        self._is_early = False  # judged before the messages had come
        self.asked_for: tuple[str, ...] = ()  # the constants in the last question
        self.revision = 0  # counts changes of type or profiles
        self.type_name = ""
        self.type: Type | None = None
        self.choose_type("")

    def choose_initial(self) -> None:
        """Choose the bytes to show when the lab opens."""
        if self.news == self._remark:
            self.news = ""  # DATA may have been written since the remark
        self._remark = self.bytes.choose_initial()
        self.news = self._remark or self.news

    # -- types --------------------------------------------------------------------------------------

    def _project_files(self) -> TypeFiles:
        project = self._view_model.project
        return TypeFiles(project.udt_files, project.constants, project.types)

    @property
    def files(self) -> TypeFiles:
        return self.opened or self._own

    @property
    def base(self) -> Path:
        """Return the project's folder: a file that is not in the current folder is looked for there."""
        return self._view_model.project.base

    def type_names(self) -> list[str]:
        declared = self._view_model.declaration
        names = self.files.types.names()
        if declared is None or self.opened is not None:
            return names
        return list(dict.fromkeys([self._spell_name(declared.type_name), *names]))

    def _spell_name(self, name: str) -> str:
        known = self.files.types.types.get(name.casefold())
        return known[0] if known else name

    def choose_type(self, name: str) -> None:
        """Show a type; for "", the type of DATA, else the first type. Raise UserError for a bad type."""
        names = self.type_names()
        name = name or next(iter(names), "")
        self.type_name, self.type = name, self._find_type(name) if name else None
        if self._is_guess:
            self.profiles[THEIRS] = self._guess_theirs()
        self._clear_results()

    def _guess_theirs(self) -> Profile:
        """Return the sender's likely profile: by the type's source, else a common layout unlike ours."""
        ours, sender = self.profiles[OURS], self.files.types.sender_layout(self.type_name).layout
        if sender not in ("", ours.layout):
            return profile_of(LAYOUTS[sender])
        return ours._replace(layout=FIRST_LAYOUT if ours.layout != FIRST_LAYOUT else OTHER_LAYOUT)

    def _find_type(self, name: str) -> Type:
        declared = self._view_model.declaration
        is_known = name.casefold() in self.files.types.types
        if not is_known and declared is not None and declared.type_name == name:
            return declared.type
        return self.files.types.get_type(name, "udt type")

    def open_type_file(self, path: Path) -> None:
        """Show the types of a file; raise UserError if it cannot be read or has no good type."""
        fresh = TypeFiles([path], self._view_model.project.constants)
        if not fresh.types.types and not fresh.types.unknown_constants:
            problems = fresh.types.problems
            raise UserError(problems) if problems else mistake(str(path), "no type", "a type")
        self.opened, self.news = fresh, f"{path.name} is open; changes of the file are read at once"
        self.choose_type("")

    def use_project_types(self) -> None:
        self.opened, self.news = None, "the types of the project"
        self.choose_type("")

    def reload_if_changed(self) -> bool:
        """Read changed files again; return whether types or the error line have changed."""
        before, trouble = self.our_size_text, self.files.trouble
        if not self.files.reload_if_changed():
            if self.files.trouble == trouble:
                return False
            self.news = ""
            return True
        self._report_changed_types(before)
        return True

    def _choose_type_again(self) -> None:
        try:
            self.choose_type(self.type_name)
        except UserError:
            self.choose_type("")

    def _report_changed_types(self, before: str) -> None:
        self._choose_type_again()
        self.news = (
            f"{self.files.name} has changed: {plain(self.type_name)} now {self.our_size_text or 'gone'}"
        )
        if before and before != self.our_size_text:
            self.news += f", before {before}"
        declared = self._view_model.declaration
        if self.opened is None and declared is not None:
            self.news += f"; DATA {plain(declared.name)} stays as it is until R (resize) or a restart"

    def add_constants(self, constants: dict[str, int]) -> None:
        self.files.add_constants(constants)
        self._choose_type_again()
        unknown = self.files.types.unknown_constants
        self.news = f"still unknown: {', '.join(unknown[:3])}" if unknown else "all constants are known"

    def follow_bench(self) -> None:
        """Rank the profiles once messages have come; choose the type again if project types changed."""
        if self._is_early and self.bytes.window() is not None:
            self.rank_profiles()
        project = self._view_model.project
        if project is self._project:
            return
        is_other = project.path != self._project.path or project.types is not self._project.types
        self._project = project
        if is_other and self.opened is None:  # an edit of other parts leaves the types as they are
            self._own = self._project_files()
            self._choose_type_again()

    # -- layouts ------------------------------------------------------------------------------------

    def _clear_results(self) -> None:
        self.revision += 1
        self._layouts: dict[str, Layout | None] = {}
        self._tree: FoldTree | None = None
        self._comparison: Comparison | None = None
        self.fits, self.fitted_by = (), ""

    def layout(self, side: str) -> Layout | None:
        """Return the type laid out on one side, or None if there is no type or no possible layout."""
        if side not in self._layouts:
            self._layouts[side] = self._lay_out(side)
        return self._layouts[side]

    def _lay_out(self, side: str) -> Layout | None:
        if self.type is None:
            return None
        try:
            return lay_out(self.type, self.rules(side), self.type_name)
        except UserError as refused:
            self.news = f"{side}: {refused.lines()[0]}"
            return None

    def rules(self, side: str) -> LayoutRules:
        own, profile = self._view_model.project.layout, self.profiles[side]
        if profile.layout == own.name:  # keep the other layout settings of the project
            base = replace(own, byte_order=profile.byte_order)
            return base if profile.text == own.text.name else replace(base, text=profile.rules.text)
        return profile.rules

    @property
    def our_size_text(self) -> str:
        ours = self.layout(OURS)
        return f"{ours.size} B" if ours else ""

    @property
    def tree(self) -> FoldTree | None:
        ours = self.layout(OURS)
        if self._tree is None and ours is not None:
            self._tree = FoldTree(ours, self.layout(THEIRS) or ours)
        return self._tree

    def choose_profile(self, side: str, profile: Profile) -> None:
        if profile == self.profiles[side]:
            return
        kept, fits = self.fitted_by, self.fits
        self.profiles[side] = profile
        self._is_guess = self._is_guess and side == OURS
        self._clear_results()
        self.fits, self.fitted_by, self.news = fits, kept, ""  # the ranking stays: you try its rows

    def swap_order(self, side: str) -> None:
        profile = self.profiles[side]
        order = "big" if profile.byte_order == "little" else "little"
        self.choose_profile(side, profile._replace(byte_order=order))

    def next_text_form(self, side: str) -> None:
        profile, forms = self.profiles[side], list(TEXT_FORMS)
        text = forms[(forms.index(profile.text) + 1) % len(forms)]
        self.choose_profile(side, profile._replace(text=text))

    def exchange_profiles(self) -> None:
        ours, theirs = self.profiles[OURS], self.profiles[THEIRS]
        self.choose_profile(OURS, theirs)
        self.choose_profile(THEIRS, ours)

    # -- the comparison -----------------------------------------------------------------------------

    def comparison(self) -> Comparison | None:
        ours, theirs = self.layout(OURS), self.layout(THEIRS)
        if self._comparison is None and ours is not None and theirs is not None:
            self._comparison = Comparison(ours, theirs)
        return self._comparison

    def summary(self) -> Summary | None:
        """Compare all members and return the summary, None if there is nothing to compare."""
        comparison = self.comparison()
        return comparison.summary(comparison.rows(self.bytes.content)) if comparison else None

    def next_difference(self, leaf: int, step: int) -> int | None:
        """Return the nearest differing leaf after `leaf`, or before it if `step` < 0, or None for none."""
        comparison = self.comparison()
        if comparison is None:
            return None
        first, stop = (leaf + 1, None) if step > 0 else (0, leaf)
        rows = enumerate(comparison.rows(self.bytes.content, first, stop), first)
        differing = (number for number, row in rows if row.differs)
        return next(differing, None) if step > 0 else max(differing, default=None)

    def rank_profiles(self) -> None:
        messages, is_framed = self.bytes.evidence()
        self.fits, self.fitted_by = (), self.bytes.evidence_name
        self._is_early = self.bytes.window() is None  # the engine has not sent the messages yet
        if self.type is not None and messages:
            own, sender = self.rules(OURS), self.files.types.sender_layout(self.type_name).layout
            self.fits = rank(self.type, messages, self.type_name, framed=is_framed, own=own, sender=sender)

    @property
    def judgement(self) -> str:
        if not self.fitted_by:
            return ""
        if not self.fits:
            return f"{self.fitted_by}: no bytes to judge by"
        return f"By {self.fitted_by}: {verdict(self.fits)}"


def profile_of(rules: LayoutRules) -> Profile:
    return Profile(rules.name, rules.byte_order, rules.text.name)


def profile_from(words: Sequence[str], before: Profile, where: str) -> Profile:
    """Return a profile with some of its words replaced, as by `natural8 big nul`; raise UserError."""
    profile = before
    for word in words:
        if word in LAYOUTS or word in LAYOUT_ALIASES:
            name = LAYOUT_ALIASES.get(word, word)
            rules = LAYOUTS[name]
            profile = Profile(name, rules.byte_order, rules.text.name)
        elif word in BYTE_ORDERS:
            profile = profile._replace(byte_order=word)
        elif word in TEXT_FORMS:
            profile = profile._replace(text=word)
        else:
            raise mistake(where, f"'{plain(word)[:40]}'", "one of " + ", ".join(PROFILE_WORDS))
    return profile
