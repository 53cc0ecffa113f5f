"""Source formats of UDTs, one row each, and reading a file of any format.

Rule: help, completion, the lab and docs/udt.md use the rows. There is no other list of formats.
"""

from __future__ import annotations

import os
import re
from collections.abc import Callable, Iterable, Mapping
from contextlib import suppress
from functools import lru_cache, partial
from importlib import import_module
from typing import Any, Final, NamedTuple

from trcvtui.errors import UserError, collect_problems, mistake, raise_all_problems
from trcvtui.files import EXPECTED_READABLE, read_bounded, reason_of
from trcvtui.udt.ast import Declarations, SenderLayout
from trcvtui.udt.layout.rules import CODESYS, S7
from trcvtui.udt.other_files import HEAD_BYTES, refuse_other_file
from trcvtui.udt.sources.st import VARIABLES_NOTE, read_spec, read_st
from trcvtui.udt.sources.st_cursor import SourceDialect
from trcvtui.udt.type_set import NO_TYPES, TypeSet, build_type, join_declarations
from trcvtui.udt.types import Type

SourcePath = str | os.PathLike[str]

TIA: Final = SourceDialect(has_header=True, layout=S7.name)
SIMATIC_SD: Final = SourceDialect(layout=S7.name)
B_AND_R: Final = SourceDialect(enum_base="DINT")
CODESYS_2: Final = SourceDialect(has_objects=True)
# TwinCAT 3 aligns to 8 (Beckhoff). In CODESYS the device decides, 8 on most; for B&R and C the C compiler.
NATURAL: Final = CODESYS.name
_NESTED_COMMENTS_MARK: Final = r"\(\* @NESTEDCOMMENTS := '(Yes|No)' \*\)"


class TypeFormat(NamedTuple):
    """One format of type files: its name, the extensions of its files, its reader.

    `read` gets the text and name of a file. If the format has a `root`, `read` gets only that XML element.
    `needs` is what has to be installed. `sender` is the layout of most devices that use such files.
    """

    name: str
    extensions: tuple[str, ...]
    read: Callable[..., Declarations] = read_st
    root: str = ""
    needs: str = ""
    sender: str = ""

    def read_declarations(self, content: Any, name: str) -> Declarations:
        read = self.read(content) if self.root else self.read(content, name)
        sender = SenderLayout(self.sender, self.name.split()[0])
        return read if read.sender.layout else read._replace(sender=sender)


def _read_codesys_2(text: str, name: str) -> Declarations:
    marks = re.findall(_NESTED_COMMENTS_MARK, text)
    nests = "No" not in marks or "Yes" in marks
    return read_st(text, name, dialect=CODESYS_2._replace(nests_comments=nests))


def _lazy_reader(module: str, kind: str = "") -> Callable[..., Declarations]:
    """Return a reader that imports the module for XML or C when the first such file is read."""

    def read(*given: Any) -> Declarations:
        reader = getattr(import_module(f"{__name__}.{module}"), f"read_{kind or module}")
        declared: Declarations = reader(*given)
        return declared

    return read


_READ_TWINCAT = _lazy_reader("plcopen", "twincat")

FORMATS: Final = {
    row.name: row
    for row in (
        TypeFormat("IEC text", (".st", ".iecst", ".txt"), read_st),
        TypeFormat("TIA source", (".udt", ".scl", ".db", ".awl"), partial(read_st, dialect=TIA)),
        TypeFormat("SIMATIC SD", (".s7dcl",), partial(read_st, dialect=SIMATIC_SD)),
        TypeFormat("CODESYS 2.3", (".exp",), _read_codesys_2),
        TypeFormat("B&R", (".typ", ".var"), partial(read_st, dialect=B_AND_R), sender=NATURAL),
        TypeFormat("TwinCAT", (".tcdut", ".tcgvl"), _READ_TWINCAT, "TcPlcObject", sender=NATURAL),
        TypeFormat("PLCopen", (".xml",), _lazy_reader("plcopen"), root="project", sender=NATURAL),
        TypeFormat("Siemens Openness", (".xml",), _lazy_reader("openness"), root="Document"),
        TypeFormat("C header", (".h", ".hpp"), _lazy_reader("c_header"), needs="the extra c", sender=NATURAL),
    )
}
# How a text without a suffix is recognised: by the first of these found in it.
_FORMAT_SIGNS = {
    r"\A\s*<": "PLCopen",  # or another XML: its root element decides
    r"\(\* @NESTEDCOMMENTS": "CODESYS 2.3",
    r'(?im)^[ \t]*(?:TYPE[ \t]+(?:"|UDT[ \t])|DATA_BLOCK[ \t]|VERSION[ \t]*:)': "TIA source",
    r"(?i)\bEND_(?:STRUCT|UNION|TYPE|VAR)\b": "IEC text",
    r"(?m)^[ \t]*(?:#[ \t]*(?:include|define|pragma|if)|typedef|struct|union|enum)\b": "C header",
}
LARGEST_FILE = 10 * 1024 * 1024
BYTE_ORDER_MARKS = ((b"\xef\xbb\xbf", "utf-8"), (b"\xff\xfe", "utf-16-le"), (b"\xfe\xff", "utf-16-be"))


def extensions() -> list[str]:
    """Return the extensions of all formats, in lower case."""
    return list(dict.fromkeys(extension for row in FORMATS.values() for extension in row.extensions))


def formats_text() -> str:
    """Return all formats as text, such as `.st .iecst .txt (IEC text), .udt .scl (TIA source)`."""
    return ", ".join(
        f"{' '.join(row.extensions)} ({row.name}" + (f", needs {row.needs})" if row.needs else ")")
        for row in FORMATS.values()
    )


def type_files_in(folder: SourcePath) -> list[str]:
    """Return the names of the files in a folder that have the extension of a format."""
    known = extensions()
    try:
        return sorted(name for name in os.listdir(folder) if os.path.splitext(name)[1].lower() in known)
    except OSError:
        return []


def complete_type_path(typed: str, base: SourcePath) -> list[str]:
    """Return the completions of a typed path: type files, and folders with a / at the end."""
    head = typed[: typed.rfind("/") + 1]
    folder = os.path.join(base, os.path.expanduser(head))
    names = type_files_in(folder)
    with suppress(OSError):
        names += sorted(
            f"{each.name}/" for each in os.scandir(folder) if each.is_dir() and each.name[0] != "."
        )
    return [head + name for name in names]


def parse_source(text: str, name: str, extension: str = "") -> Declarations:
    """Return what a text declares if read as a file with this extension. Errors call the file `name`."""
    rows = [row for row in FORMATS.values() if extension.lower() in row.extensions]
    if not extension:
        found = (name for sign, name in _FORMAT_SIGNS.items() if re.search(sign, text))
        rows = [FORMATS[next(found, "IEC text")]]
    return parse_xml_source(text, name) if rows[0].root else rows[0].read_declarations(text, name)


def parse_xml_source(text: str, name: str) -> Declarations:
    """Return what an XML file declares. The root element, not the extension, decides the format."""
    from trcvtui.udt.sources.xml_source import read_xml

    root = read_xml(text, name)
    rows = {row.root: row for row in FORMATS.values() if row.root}
    if root.name not in rows:
        *others, last = (f"<{name}> ({rows[name].name})" for name in sorted(rows, key=str.casefold))
        raise mistake(root.where, f"<{root.name[:40]}>", f"{', '.join(others)} or {last}")
    return rows[root.name].read_declarations(root, name)


def read_files(
    paths: Iterable[SourcePath],
    constants: Mapping[str, int] | None = None,
    has_system_types: bool = False,
    contents: Mapping[Any, bytes] = {},  # of files that are in memory already
) -> TypeSet:
    """Return the types of files that may use each other; raise UserError for files that cannot be read."""
    files: list[Declarations] = []
    paths = list(paths)
    with raise_all_problems() as problems:
        for path in paths:
            with collect_problems(problems):
                read = parse_file(str(path), contents[path]) if path in contents else declarations_in(path)
                files.append(qualify_variables(read, path, paths))
    return join_declarations(files, ", ".join(map(str, paths)) or NO_TYPES.where, constants, has_system_types)


def qualify_variables(read: Declarations, path: SourcePath, paths: Iterable[SourcePath]) -> Declarations:
    """Return what a file declares, variables as `folder/name` if another file has the same file name."""
    folder, name = os.path.split(str(path))
    if not folder or not any(VARIABLES_NOTE in each.notes for each in read.types):
        return read
    if [os.path.basename(each).casefold() for each in map(str, paths)].count(name.casefold()) < 2:
        return read
    return read._replace(types=tuple([each._replace(name=f"{folder}/{each.name}") for each in read.types]))


def set_header_context(paths: Iterable[SourcePath], long_size: int | None) -> None:
    """Set the size of `long` and the macros of the other headers, as a C header has neither."""
    from trcvtui.udt.sources.c_source import LONG_SIZE, OTHER_HEADERS

    headers = [path for path in paths if os.path.splitext(path)[1].lower() in FORMATS["C header"].extensions]
    texts: list[str] = []
    for path in headers if len(headers) > 1 else ():
        with suppress(UserError):  # reported when its types are read
            texts.append(decode_text(content_of(path)))
    LONG_SIZE.set(long_size)
    OTHER_HEADERS.set("\n".join(texts))


def parse_type(text: str, types: TypeSet = NO_TYPES, where: str = "type") -> Type:
    """Return the type of a line such as `ARRAY[0..99] OF Telegram`; raise UserError."""
    return build_type(read_spec(text, where), types)


def decode_text(data: bytes) -> str:
    """Decode by byte order mark or XML declaration, else as UTF-8, else as Windows-1252. Never fails."""
    for mark, codec in BYTE_ORDER_MARKS:
        if data.startswith(mark):
            return data[len(mark) :].decode(codec, "replace")
    codecs = ["utf-8"]
    if data[:400].lstrip(b"\0 \t\r\n").startswith(b"<"):
        from trcvtui.udt.sources.xml_source import xml_codec

        codecs = [xml_codec(data) or "utf-8", "utf-8"]
    for codec in codecs:
        with suppress(LookupError, UnicodeError):
            return data.decode(codec)
    return data.decode("cp1252", "replace")


def declarations_in(path: SourcePath) -> Declarations:
    """Return what a file declares; raise UserError if it cannot be read at all."""
    extension = _known_extension(str(path))
    return declarations_of(content_of(path), str(path), extension)


@lru_cache(maxsize=16)  # usually one file of a project is new, and the others unchanged
def parse_file(path: str, content: bytes) -> Declarations:
    """Return what a file with this content declares; raise UserError as `declarations_in` does."""
    return declarations_of(content, path, _known_extension(path))


def _known_extension(path: str) -> str:
    extension = os.path.splitext(path)[1]
    if extension.lower() not in ["", *extensions()]:
        with suppress(OSError, ValueError):  # an unreadable file: report its suffix
            refuse_other_file(path, read_bounded(path, HEAD_BYTES))
        raise mistake(path, f"suffix '{extension}'", "a file of type " + ", ".join(extensions()))
    return extension


def declarations_of(data: bytes, name: str, extension: str = "") -> Declarations:
    """Return what the bytes of a file declare; without an extension the text decides the format."""
    refuse_other_file(name, data)
    text = decode_text(data)
    if "\0" in text:
        found = "NUL bytes, as in binary data or UTF-16 without a byte order mark"
        raise mistake(name, found, "text in UTF-8, or in UTF-16 with its mark")
    return parse_source(text, name, extension)


def content_of(path: SourcePath) -> bytes:
    try:
        data = read_bounded(path, LARGEST_FILE)
    except (OSError, ValueError) as failed:
        raise mistake(str(path), reason_of(failed), EXPECTED_READABLE, "file") from None
    if len(data) > LARGEST_FILE:
        raise mistake(str(path), "a larger file", f"at most {LARGEST_FILE} bytes of source text")
    return data
