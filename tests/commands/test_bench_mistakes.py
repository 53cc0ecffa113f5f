"""Each class of mistake in a bench command: the exact line that the user reads."""

from __future__ import annotations

import pytest

from tests.bench.bench_project import bench_project
from trcvtui.commands.table import parse_line, parse_script
from trcvtui.errors import UserError
from trcvtui.project.project import Project

UDINT = "a whole number from 0 to 4294967295"
HEX_BYTES = "hex bytes such as 01 02 0A"
DURATION = "a duration from T#0s on, such as T#5ms"
INPUTS = "EN_R, CONT, LEN, ADHOC, COM_RST"
MEMBERS = "members such as {speed=1.5, name='x', arr[0]=3}"


@pytest.fixture(scope="module")
def project(tmp_path_factory: pytest.TempPathFactory) -> Project:
    """Return the project of these tests."""
    return bench_project(tmp_path_factory.mktemp("bench"))


def said(line: str, project: Project) -> list[str]:
    with pytest.raises(UserError) as caught:
        parse_line(line, project, "w")
    return [str(problem) for problem in caught.value.problems]


VERBS = "set, pulse, peer, write, fault, link, plc, run, expect, create, delete, download, resize, add"
VERBS += ", remove, undo, ..."
NO_LINE = 'the name of a ComBuffer with source = "sim", but there is none'
FORMS = "hex, text, udt, file or random"
HOLE = "{n}, {n:2}, {n:2:big} or a checksum such as {crc32} or {crc16-modbus:little}"
FILL = "an offset, a width and a byte order such as n=4:2:big or crc32=8:little"
PATTERN = 'a pattern in double quotes such as "id=[0-9]+;"'
A_TYPE = "an IEC type or a UDT"

MISTAKES = [
    # a block that nobody knows: what it works on is not asked for
    ("add instance A block=TRCX", "w: instance A: block: found 'TRCX', expected TRCV"),
    # the verb
    ("frob", f"w: found 'frob', expected one of {VERBS}"),
    ("sett X CONT=1", "w: found 'sett', expected set"),
    ("SET X CONT=1", "w: found 'SET', expected set"),
    # a tap
    ("tap T to-plc hold", "w: found 'T', expected the name of a tap, but there is none"),
    # a simulated line
    ("feed C1 hex 01", f"w: found 'C1', expected {NO_LINE}"),
    # inputs
    ("set", "w: found nothing more, expected the name of an instance"),
    ("set X", "w: found nothing more, expected an input such as CONT=1"),
    ("set Z CONT=1", "w: found 'Z', expected one of X, Y"),
    ("set X CONT", "w: found 'CONT', expected PIN=VALUE such as CONT=1"),
    ("set X CONT = 1", "w: found 'CONT', expected PIN=VALUE such as CONT=1"),
    ("set X CONT=2", "w: found CONT='2', expected CONT=0 or CONT=1"),
    ("set X CONT=", "w: found CONT='', expected CONT=0 or CONT=1"),
    ("set X cont=1", "w: found 'cont', expected CONT"),
    ("set X REQ=1", f"w: found 'REQ', expected one of {INPUTS}"),
    ("set X DONE=1", f"w: found 'DONE', an output, expected one of {INPUTS}"),
    ("set X LEN=-1", f"w: found LEN='-1', expected {UDINT}"),
    ("set X LEN=4294967296", f"w: found LEN='4294967296', expected {UDINT}"),
    ("set X LEN=blink", f"w: found LEN='blink', expected {UDINT}"),
    ("pulse X", "w: found nothing more, expected an input such as EN_R"),
    ("pulse X LEN", "w: found 'LEN', a UDINT, expected a BOOL input"),
    ("pulse X ERROR", f"w: found 'ERROR', an output, expected one of {INPUTS}"),
    ("pulse X EN_R CONT", "w: found 'CONT', expected the end of the command"),
    # the program changes
    ("create", "w: found nothing more, expected a block such as TRCV_C"),
    ("create TRCW_C R2 connect=C1", "w: found 'TRCW_C', expected TRCV_C"),
    ("create TRCV_C", "w: found nothing more, expected a name for the new instance"),
    ("create TRCV_C X connect=C1", "w: found 'X', which is there already, expected a name of its own"),
    ("create TRCV_C rx connect=C1", "w: found 'rx', which is there already, expected a name of its own"),
    (
        "create TRCV_C 2R connect=C1",
        "w: found '2R', expected a name of letters, digits and _ that begins with no digit",
    ),
    ("create TRCV_C R2", "w: found no connect=, expected connect= and the name of a CONNECT"),
    ("create TRCV_C R2 connect=C9", "w: found connect=C9, expected C1"),
    ("create TRCV_C R2 connect=C1 data=q", "w: found data=q, expected one of rx, raw, n"),
    ("create TRCV_C R2 connect=C1 task=FAST", "w: found task=FAST, expected MAIN"),
    ("create TRCV_C R2 connect=C1 LEN=-1", f"w: found LEN='-1', expected {UDINT}"),
    ("create TCON T1 connect=C1 data=rx", "w: found 'data', expected nothing: TCON has no DATA"),
    ("create TCON T1 connect=C1 LEN=1", "w: found 'LEN', expected one of connect, task, REQ"),
    ("delete", "w: found nothing more, expected the name of an instance"),
    ("delete Z", "w: found 'Z', expected one of X, Y"),
    ("delete X now", "w: found 'now', expected the end of the command"),
    ("download Z", "w: found 'Z', expected one of X, Y"),
    ("resize Z INT", "w: found 'Z', expected one of rx, raw, n"),
    ("resize rx", f"w: found nothing more, expected {A_TYPE}"),
    ("resize rx Telegra", "w:1:1: found 'Telegra', expected a known type"),
    ("resize rx ARRAY[0..9999999] OF BYTE", "w: rx: found 10000000 bytes, expected at most 4194304 bytes"),
    # the PLC and its wires
    ("plc", "w: found nothing more, expected stop or run"),
    ("plc halt", "w: found 'halt', expected stop or run"),
    ("link C2 down", "w: found 'C2', expected C1"),
    ("link C1 cut", "w: found 'cut', expected down or up"),
    ("run", "w: found nothing more, expected a number of scans or a duration such as T#200ms"),
    ("run 0", "w: found '0', expected a whole number from 1 to 1000000000"),
    ("run 200ms", "w: found '200ms', expected a whole number from 1 to 1000000000"),
    ("run T#-1s", f"w: found 'T#-1s', expected {DURATION}"),
    ("run 5 scans", "w: found 'scans', expected the end of the command"),
    # faults
    ("fault", "w: found nothing more, expected a kernel call such as bind, or clear"),
    ("fault bnd", "w: found 'bnd', expected bind"),
    ("fault bind EADDRINUS", "w: found 'EADDRINUS', expected EADDRINUSE"),
    ("fault bind EXYZZY", "w: found 'EXYZZY', expected an errno name such as EADDRINUSE"),
    ("fault bind on C7", "w: found 'C7', expected C1"),
    ("fault bind nth=0", "w: found nth='0', expected a whole number from 1 to 1000000000"),
    ("fault bind times=never", "w: found times='never', expected a whole number from 1 to 1000000000"),
    ("fault bind once", "w: found 'once', expected on CONNECT, nth=1, times=1 or times=forever"),
    ("fault clear bind", "w: found 'bind', expected the end of the command"),
    # peers
    ("peer", "w: found nothing more, expected the name of a peer"),
    ("peer P3 close", "w: found 'P3', expected one of P1, P2"),
    (
        "peer P1",
        "w: found nothing more, expected one of connect, listen, close, rst, shutdown, "
        "stall, resume, send, play, reply, check, try-splits",
    ),
    ("peer P1 conect", "w: found 'conect', expected connect"),
    (
        "peer P1 listen",
        "w: found listen of the active peer 'P1', expected connect, or a peer with "
        "active = false",
    ),
    (
        "peer P2 connect",
        "w: found connect of the passive peer 'P2', expected listen, or a peer with "
        "active = true",
    ),
    ("peer P1 close now", "w: found 'now', expected the end of the command"),
    # payloads
    ("peer P1 send", "w: found nothing more, expected hex, text, udt, file or random"),
    ("peer P1 send 01 02", "w: found '01', expected one of hex, text, udt, file, random"),
    ("peer P1 send hex", f"w: found nothing more, expected {HEX_BYTES}"),
    ("peer P1 send hex split=3", f"w: found nothing more, expected {HEX_BYTES}"),
    ("peer P1 send hex 0G", f"w: hex, position 2: found 'G', expected {HEX_BYTES}"),
    ("peer P1 send hex 012", f"w: hex, position 1: found '012' with 3 digits, expected {HEX_BYTES}"),
    ("peer P1 send text abc", "w: found 'abc', expected a text in double quotes such as \"abc\""),
    ("peer P1 send text 'abc'", "w: found ''abc'', expected a text in double quotes such as \"abc\""),
    ('peer P1 send text ""', 'w: found "", expected at least one character'),
    ('peer P1 send text "abc', "w: found '\"abc', expected a closing \""),
    (r'peer P1 send text "\q"', r"w: text: found '\q', expected an escape: \r \n \t \0 \\ \" or \xNN"),
    ("peer P1 send random", "w: found nothing more, expected a number of bytes"),
    ("peer P1 send random 0", "w: found '0', expected a whole number from 1 to 16777216"),
    ("peer P1 send random 5 sead=1", "w: found 'sead', expected seed=1 or the end of the command"),
    ("peer P1 send hex 01 split=0", "w: found split='0', expected a whole number from 1 to 16777216"),
    ("peer P1 send hex 01 split=1,", "w: found split='', expected a whole number from 1 to 16777216"),
    ("peer P1 send hex 01 gap=20", f"w: found gap='20', expected {DURATION}"),
    ("peer P1 send hex 01 repeat=0", "w: found repeat='0', expected a whole number from 1 to 1000000"),
    (
        "peer P1 send hex 01 gap=T#1s twice",
        "w: found 'twice', expected one of split=, gap=, repeat=, every= or the end of "
        "the command",
    ),
    ("peer P1 send hex 01 gap=T#1s,2", f"w: found gap='2', expected {DURATION}"),
    # what is filled in
    ("peer P1 send hex 01 {m}", f"w: found '{{m}}', expected {HOLE}"),
    ("peer P1 send hex 01 {n:9}", f"w: found '{{n:9}}', expected {HOLE}"),
    ("peer P1 send hex 01 {crc32:2}", "w: found '{crc32:2}', expected one of little, big"),
    ("peer P1 send hex 0G {n}", f"w: hex, position 2: found 'G', expected {HEX_BYTES}"),
    ("peer P1 send hex {n} 0G", f"w: hex, position 6: found 'G', expected {HEX_BYTES}"),
    ("peer P1 send hex {crc32}", "w: found '{crc32}', expected at least one byte before the checksum"),
    ("peer P1 send hex 01 n=9", "w: found n=9 after 1 bytes, expected an offset from 0 to 1"),
    ("peer P1 send hex 01 n=x", "w: found n='x', expected a whole number from 0 to 16777216"),
    ("peer P1 send hex 01 n=0:9", f"w: found 'n=0:9', expected {FILL}"),
    ("peer P1 send hex 01 n=0:2:middle", "w: found 'n=0:2:middle', expected one of little, big"),
    # replies
    ("peer P1 reply", "w: found nothing more, expected on or off"),
    ("peer P1 reply maybe", "w: found 'maybe', expected on or off"),
    ("peer P1 reply off 0", "w: found '0', expected a whole number from 1 to 64"),
    ("peer P1 reply off 1 2", "w: found '2', expected the end of the command"),
    ("peer P1 reply on", "w: found nothing more, expected contains, starts, regex, field"),
    ("peer P1 reply on smells x", "w: found 'smells', expected one of contains, starts, regex, field"),
    ("peer P1 reply on contains hex 05", "w: found nothing more, expected send and a payload"),
    ("peer P1 reply on contains send hex 06", f"w: found nothing more, expected {FORMS}"),
    ("peer P1 reply on contains hex 05 send", f"w: found nothing more, expected {FORMS}"),
    ("peer P1 reply on regex a send hex 06", f"w: found 'a', expected {PATTERN}"),
    (
        'peer P1 reply on regex "(" send hex 06',
        "w: found '(': missing ), unterminated subpattern at position 0, expected a pattern",
    ),
    (
        'peer P1 reply on regex "a*" send hex 06',
        "w: found 'a*', which fits where nothing is, expected a pattern that needs a byte",
    ),
    ("peer P1 reply on field Telegran.id = 7 send hex 06", "w: found 'Telegran', expected Telegram"),
    (
        "peer P1 reply on field Telegram.idd = 7 send hex 06",
        "w: found 'Telegram.idd', which is not one value, expected a member of Telegram",
    ),
    ("peer P1 reply on field Telegram.id 7 send hex 06", "w: found '7', expected = and a value"),
    ("peer P1 reply on field Telegram.id = send hex 06", "w: found nothing more, expected a value"),
    (
        "peer P1 reply on contains random 4097 send hex 06",
        "w: found 4097 bytes, expected at most 4096 to look for",
    ),
    (
        "peer P1 reply on contains hex 05 send random 65537",
        "w: found 65537 bytes, expected at most 65536 of an answer",
    ),
    (
        'peer P1 reply on contains hex 05 send text "{n:x}"',
        "w: found '{n:x}', expected {n} or {n:3}, three digits",
    ),
    # self-checking traffic
    ("peer P1 check", "w: found nothing more, expected on or off"),
    ("peer P1 check on size=9", "w: found size='9', expected a whole number from 10 to 65507"),
    (
        "peer P1 check on often",
        "w: found 'often', expected size=64, every=T#100ms, on and an instance, or the end of the command",
    ),
    ("peer P1 check on on Y", "w: found 'Y', a TRCV_C, expected an instance that receives, with DATA"),
    ("peer P1 check off now", "w: found 'now', expected the end of the command"),
    # every split
    ("peer P1 try-splits", f"w: found nothing more, expected {FORMS}"),
    (
        "peer P1 try-splits hex 01 02",
        "w: found nothing more, expected on and the name of an instance that receives",
    ),
    ("peer P1 try-splits hex 01 on X", "w: found 1 byte(s), expected 2 to 1024 bytes, which can be cut"),
    ("peer P1 try-splits hex 01 02 on Z", "w: found 'Z', expected one of X, Y"),
    (
        "peer P1 try-splits hex 01 02 on X twice",
        "w: found 'twice', expected gap=T#30ms, differ=0, differ=any or the end of the command",
    ),
    ("peer P1 try-splits stop now", "w: found 'now', expected the end of the command"),
    ("peer P1 send udt", "w: found nothing more, expected the name of a UDT"),
    ("peer P1 send udt Telegran {}", "w: found 'Telegran', expected Telegram"),
    ("peer P1 send udt Telegram", "w: found nothing more, expected members in braces such as {speed=1.5}"),
    ("peer P1 send udt Telegram id=1", f"w: found 'id=1', expected {MEMBERS}"),
    ("peer P1 send udt Telegram {id=1", "w: found '{id=1', expected a closing }"),
    ("peer P1 send udt Telegram {id}", f"w: found '{{id}}', expected {MEMBERS}"),
    (
        "peer P1 send udt Telegram {id=1 speed=2}",
        "w: Telegram.id: found '1 speed=2', expected DINT, a whole number from "
        "-2147483648 to 2147483647",
    ),
    ("peer P1 send udt Telegram {name='a' id=1}", "w: found ' id=1}', expected , or } after a value"),
    ("peer P1 send udt Telegram {id=1} x", f"w: found ' x', expected {MEMBERS}"),
    (
        "peer P1 send udt Telegram {idd=1}",
        "w: Telegram, 'idd': found 'idd', expected a member or an index within "
        "bounds",
    ),
    # DATA
    ("write", "w: found nothing more, expected the name of a DATA variable"),
    ("write ry hex 01", "w: found 'ry', expected one of rx, raw, n"),
    ("write rx", "w: found nothing more, expected a value, or hex and bytes"),
    ("write rx 5", "w: found 'rx', which is not one value, expected the path of one, or hex and bytes"),
    ("write rx+4 5", "w: found 'rx+4', which is not one value, expected the path of one, or hex and bytes"),
    ("write rx+52 hex 01", "w: found byte 52 of 'rx', expected a byte from 0 to 51"),
    ("write rx+4.x hex 01", "w: found 'rx+4.x', expected rx, rx.speed, rx[3] or rx+4 (byte 4)"),
    (
        "write rx.sped 1",
        "w: found '.sped' in 'rx.sped', expected a member of Telegram, or an index "
        "within bounds",
    ),
    (
        "write raw[8] 1",
        "w: found '[8]' in 'raw[8]', expected a member of ARRAY[0..7] OF BYTE, or an "
        "index within bounds",
    ),
    ("write raw[7] 256", "w: raw.[7]: found '256', expected BYTE, a whole number from 0 to 255"),
    ("write n 1.5", "w: n: found '1.5', expected INT, a whole number from -32768 to 32767"),
    (
        "write raw hex 01 02 03 04 05 06 07 08 09",
        "w: found 9 bytes, expected at most 8, which is what there "
        "is",
    ),
    ("write rx.speed hex 01 02 03 04 05", "w: found 5 bytes, expected at most 4, which is what there is"),
    ("write n 1 2", "w: found '2', expected the end of the command"),
    # wait and expect
    ("wait", "w: found nothing more, expected an instance, a DATA variable or peer NAME"),
    ("expect Z STATUS=7004", "w: found 'Z', expected one of X, Y, rx, raw, n, peer"),
    ("expect X", "w: found nothing more, expected a pin such as STATUS=7006"),
    ("expect X 7004", "w: found '7004', expected PIN=VALUE such as STATUS=7006"),
    ("expect X STATE=7004", "w: found 'STATE', expected STATUS"),
    ("expect X STATUS=70040", "w: found STATUS='70040', expected four hex digits such as 7006"),
    ("expect X EN_R=blink", "w: found EN_R='blink', expected EN_R=0 or EN_R=1"),
    (
        "expect X STATUS=7004 within",
        "w: found 'within', expected within and one duration, such as within "
        "T#2s",
    ),
    ("expect X STATUS=7004 within 2s", f"w: found within '2s', expected {DURATION}"),
    ("wait within T#2s", "w: found nothing more, expected an instance, a DATA variable or peer NAME"),
    (
        "expect X trace",
        "w: trace: found no pattern, expected STATUS words such as 0001 7002+ 7006* "
        "7006{3} 80A1! 80C3!+ ...",
    ),
    ("expect rx trace 7006", "w: found 'rx', expected one of X, Y"),
    (
        "expect peer P1",
        "w: found nothing more, expected received, or a state: connected, listening, "
        "closed, reset, refused",
    ),
    ("expect peer P1 conected", "w: found 'conected', expected connected"),
    ("expect peer P1 closed now", "w: found 'now', expected the end of the command"),
    (
        "expect peer P1 received random 65537",
        "w: found 65537 bytes, expected at most 65536, which a peer "
        "keeps",
    ),
    ("expect rx {id=1}", "w: found 'rx', which is not one value, expected the path of one, or hex and bytes"),
    ("expect rx.id x", "w: rx.id: found 'x', expected DINT, a whole number from -2147483648 to 2147483647"),
]  # fmt: skip


@pytest.mark.parametrize(("line", "expected"), MISTAKES)
def test_a_mistake_is_one_line(project: Project, line: str, expected: str) -> None:
    assert said(line, project) == [expected]


def test_later_lines_are_read_as_the_changed_program_will_be(project: Project) -> None:
    script = """
        delete X
        set X CONT=1
        create TSEND_C X connect=C1
        set X REQ=1
        resize raw Telegram
        expect raw.speed 1.5
        expect raw[1] 3
    """
    with pytest.raises(UserError) as caught:
        parse_script(script, project, "s")
    assert [str(problem) for problem in caught.value.problems] == [
        "s: step 2 (set X CONT=1): found 'X', expected Y",
        "s: step 7 (expect raw[1] 3): found '[1]' in 'raw[1]', "
        "expected a member of Telegram, or an index within bounds",
    ]


def test_all_wrong_members_of_a_udt_are_told(project: Project) -> None:
    assert said("peer P1 send udt Telegram {id=x, speed=y}", project) == [
        "w: Telegram.id: found 'x', expected DINT, a whole number from -2147483648 to 2147483647",
        "w: Telegram.speed: found 'y', expected REAL, a number in its range, NaN, Infinity or -Infinity",
    ]


def test_a_file_that_is_not_there_is_named(project: Project) -> None:
    (line,) = said("peer P1 send file nix.bin", project)
    assert line.startswith("w: file: found No such file or directory: '")
    assert line.endswith("nix.bin', expected a file that can be read")


def test_braces_beyond_reason_are_refused(project: Project) -> None:
    braces = "{a=" * 100_000
    assert said(f"peer P1 send udt Telegram {braces}", project) == [
        "w: found braces nested too deeply, expected at most 32 levels"
    ]


def test_a_line_beyond_reason_is_refused(project: Project) -> None:
    assert said("x" * 1_000_001, project) == [
        "w: found 1000001 characters, expected at most 1000000 in a line"
    ]


def test_all_mistakes_of_a_script_are_told_with_number_and_line(project: Project) -> None:
    script = "set X CONT=1\nset Z CONT=1\n# a comment\nrun x   # all of it\nplc stop\n"
    with pytest.raises(UserError) as caught:
        parse_script(script, project, "s.toml")
    assert caught.value.lines() == [
        "s.toml: step 2 (set Z CONT=1): found 'Z', expected one of X, Y",
        "s.toml: step 3 (run x   # all of it): found 'x', expected a whole number from 1 to 1000000000",
    ]


def test_a_long_line_is_cut_in_its_message(project: Project) -> None:
    with pytest.raises(UserError) as caught:
        parse_script("frob " + "x" * 500, project, "s.toml")
    assert len(caught.value.lines()[0]) < 250


def test_control_codes_in_a_line_stay_visible_text(project: Project) -> None:
    with pytest.raises(UserError) as caught:
        parse_script("set \x1b[31mX CONT=1", project, "s.toml")
    assert caught.value.lines()[0].isprintable()


def test_only_the_end_of_a_line_ends_a_command(project: Project) -> None:
    with pytest.raises(UserError) as caught:
        parse_script("run 1\r\nfrob \u2028 \x0b \x85 run 2\nrun x", project, "s.toml")
    assert [line.split(":")[1].split("(")[0] for line in caught.value.lines()] == [" step 2 ", " step 3 "]
