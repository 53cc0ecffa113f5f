"""Source formats of UDTs: file suffix -> reader, and the one way from a file to its types."""

from __future__ import annotations

import os
from collections.abc import Callable, Collection, Iterable, Mapping
from contextlib import suppress

from trcvtui.errors import Problem, UserError, mistake
from trcvtui.files import READABLE, read_bytes, reason_of
from trcvtui.udt.ast import Declarations
from trcvtui.udt.sources.b_and_r import read_b_and_r
from trcvtui.udt.sources.codesys2 import read_exp
from trcvtui.udt.sources.siemens import read_simatic_sd, read_tia, refuse_texts
from trcvtui.udt.sources.st import read_st
from trcvtui.udt.type_set import TypeSet, join

Path = str | os.PathLike[str]
Reader = Callable[[str, str], Declarations]


def read_xml_file(text: str, name: str) -> Declarations:
    """Return what an XML file declares; its reader is imported by the first such file."""
    from trcvtui.udt.sources import xml_file

    return xml_file.read_xml_file(text, name)


def refuse_export(text: str, name: str) -> Declarations:
    """Raise the UserError of a CODESYS 3 `.export`."""
    from trcvtui.udt.sources import xml_file

    return xml_file.refuse_export(text, name)


def read_c(text: str, name: str) -> Declarations:
    """Return what a C header declares; its reader is imported by the first such file."""
    from trcvtui.udt.sources import c_header

    return c_header.read_c(text, name)


READERS: dict[str, Reader] = {
    ".st": read_st,
    ".iecst": read_st,
    ".txt": read_st,
    ".udt": read_tia,
    ".scl": read_tia,
    ".s7dcl": read_simatic_sd,
    ".s7res": refuse_texts,
    ".exp": read_exp,
    ".typ": read_b_and_r,
    ".var": read_b_and_r,
    ".tcdut": read_xml_file,
    ".tcgvl": read_xml_file,
    ".xml": read_xml_file,
    ".export": refuse_export,
    ".h": read_c,
}
LIBRARY = "the library"
LARGEST_FILE = 10 * 1024 * 1024
BYTE_ORDER_MARKS = ((b"\xef\xbb\xbf", "utf-8"), (b"\xff\xfe", "utf-16-le"), (b"\xfe\xff", "utf-16-be"))


def read_file(path: Path, constants: Mapping[str, int] | None = None) -> TypeSet:
    """Return the types of a file, good and bad; raise UserError when it cannot be read at all."""
    return join([_declarations(path)], str(path), constants)


def read_files(
    paths: Iterable[Path],
    constants: Mapping[str, int] | None = None,
    last_wins: Collection[str] = (),
    library: str = "",
) -> TypeSet:
    """Return the types of several files, which may use each other's; raise UserError as read_file does.

    `library`: types in ST that are there without any file; one of the same name in a file comes first.
    """
    files: list[Declarations] = []
    if library:
        files.append(read_st(library, LIBRARY))
        last_wins = {*last_wins, *(declared.name for declared in files[0].types)}
    problems: list[Problem] = []
    paths = list(paths)
    for path in paths:
        try:
            files.append(_declarations(path))
        except UserError as refused:
            problems.extend(refused.problems)
    if problems:
        raise UserError(problems)
    return join(files, ", ".join(map(str, paths)), constants, last_wins)


def decode_text(data: bytes) -> str:
    """Return the text of a file: by mark, XML declaration, UTF-8 or Windows-1252; never fails."""
    for mark, codec in BYTE_ORDER_MARKS:
        if data.startswith(mark):
            return data[len(mark) :].decode(codec, "replace")
    if data[:400].lstrip(b"\0 \t\r\n").startswith(b"<"):
        from trcvtui.udt.sources.xml_source import xml_codec

        declared = xml_codec(data)
        if declared:
            with suppress(LookupError, UnicodeError):
                return data.decode(declared)
    try:
        return data.decode("utf-8")
    except UnicodeDecodeError:
        return data.decode("cp1252", "replace")


def _declarations(path: Path) -> Declarations:
    suffix = os.path.splitext(path)[1]
    reader = READERS.get(suffix.lower())
    if reader is None:
        found = "Is a directory" if os.path.isdir(path) else f"suffix '{suffix}'"
        raise mistake(str(path), found, "a file of type " + ", ".join(READERS))
    text = decode_text(_content(path))
    if "\0" in text[:2]:
        found = "zero bytes, as in UTF-16 without a byte order mark"
        raise mistake(str(path), found, "UTF-8, or UTF-16 with its mark")
    return reader(text, str(path))


def _content(path: Path) -> bytes:
    try:
        data = read_bytes(path, LARGEST_FILE)
    except (OSError, ValueError) as failed:
        raise mistake(str(path), reason_of(failed), READABLE) from None
    if len(data) > LARGEST_FILE:
        raise mistake(str(path), "a larger file", f"at most {LARGEST_FILE} bytes of source text")
    return data
