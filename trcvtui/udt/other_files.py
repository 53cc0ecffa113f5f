"""Files of other tools, one in each row: what they are, how to recognise them, what to use instead.

Rule: the content decides before the suffix, except for zip archives. Type files and captures share rows.
"""

from __future__ import annotations

import re
import shlex
from typing import Final, NamedTuple

from trcvtui.errors import mistake

HEAD_BYTES: Final = 4096  # bytes of a file that are searched
_ST: Final = "its types as text: TYPE ... END_TYPE"
_XML_EXPECTED: Final = "PLCopen XML (in CODESYS: Project > Export PLCopenXML)"
_DUT: Final = "the .TcDUT file of each type"
_CAPTURE_EXPECTED: Final = "pcapng: editcap -F pcapng {0} {0}.pcapng"
_NEVER_MATCHES: Final = "(?!)"


class _OtherFile(NamedTuple):
    what: str
    expected: str
    suffix: str = _NEVER_MATCHES
    content: bytes = _NEVER_MATCHES.encode()


_OTHER_FILES: Final = (
    _OtherFile("a Microsoft Network Monitor 2.x capture", _CAPTURE_EXPECTED, content=rb"\AGMBU"),
    _OtherFile("a Microsoft Network Monitor 1.x capture", _CAPTURE_EXPECTED, content=rb"\ARTSS"),
    _OtherFile("a Sun snoop capture", _CAPTURE_EXPECTED, content=rb"\Asnoop\x02"),
    _OtherFile("a Rockwell Studio 5000 export (L5X)", _ST, "l5x", rb"<RSLogix5000Content\b"),
    _OtherFile("a Rockwell Studio 5000 export (L5K)", _ST, "l5k", rb"(?m)^\s*IE_VER\s*:="),
    _OtherFile("a Rockwell Studio 5000 project (ACD)", _ST, "acd"),
    _OtherFile("a CANopen or POWERLINK device file (XDD)", _ST, "xdc", rb"<(\w+:)?ISO15745Profile"),
    _OtherFile("a Schneider Control Expert (Unity Pro) export (XEF, XDD)", _ST, "[xz]ef|x(dd|db|sy|pg)",
               rb"<\w+ExchangeFile\b"),
    _OtherFile("an Omron Sysmac Studio export (XML)", _ST, content=rb"//www\.ia\.omron\.com/Smc"),
    _OtherFile("an Omron Sysmac Studio project (SMC2)", _ST, "smc2?|csm2"),
    _OtherFile("a CODESYS export (.export)", _XML_EXPECTED, "export", rb"<ExportFile>"),
    _OtherFile("a CODESYS project (.project)", _XML_EXPECTED, "project|projectarchive"),
    _OtherFile("a Siemens TIA Portal project (.zap, .ap)", "its types as .udt or .xml", r"z?ap\d\d"),
    _OtherFile("a Siemens SIMATIC SD text file (.s7res)", "the .s7dcl file beside it", "s7res"),
    _OtherFile("a Beckhoff TwinCAT POU (.TcPOU)", _DUT, "tcpou|tcio", rb"<TcPlcObject[^>]*>\s*<(POU|Itf)\b"),
    _OtherFile("a Beckhoff TwinCAT project (.tsproj, .tmc)", _DUT, "tsproj|plcproj|tmc"),
    _OtherFile("a zip archive", "the files in it, unpacked", content=rb"\APK\x03\x04"),
)  # fmt: skip


def refuse_other_file(name: str, head: bytes, expected: str = "") -> None:
    """Raise UserError if a file matches a row. `expected` replaces the row's text, except for captures."""
    text, suffix = head[:HEAD_BYTES].replace(b"\0", b""), name.rpartition(".")[2]  # UTF-16, too
    is_xml = re.match(rb"[\xef\xbb\xbf\xfe\xff\s]*<", text)  # text that is not XML may quote such tags
    rows = [row for row in _OTHER_FILES if is_xml or row.content[:1] not in b"</"]
    found = [row for row in rows if re.search(row.content, text)]
    named = [row for row in _OTHER_FILES if re.fullmatch(row.suffix, suffix, re.IGNORECASE)]
    for row in named + found if text.startswith(b"PK") else found + named:  # many formats are zip archives
        wanted = row.expected if not expected or row.expected is _CAPTURE_EXPECTED else expected
        what = f"{row.what}, which is not supported" if head else "an empty file"
        raise mistake(name, what, wanted.format(shlex.quote(name)))
