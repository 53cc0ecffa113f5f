"""The pure functions after the screen: values to words, letters to pins, causes to reasons."""

from __future__ import annotations

import pytest

from tests.tui.fakes import MS, SECOND, bench_project
from trcvtui.commands.table import COMMANDS
from trcvtui.tui.completion import complete, list_verbs
from trcvtui.tui.formatting import bar, clip, wrap_text
from trcvtui.tui.peer_commands import make_send_line
from trcvtui.tui.widgets.help import letters_of
from trcvtui.tui.widgets.hex_view import CHARACTER_OF, CLASS_OF
from trcvtui.wording import age_text, format_ns, stamp_text


def test_times_are_written_with_their_unit() -> None:
    assert stamp_text(12_330 * MS) == "12.330"
    for ns, text in ((80_000, "0.08 ms"), (310_000, "0.31 ms"), (12 * MS, "12 ms"), (2_500 * MS, "2.5 s"),
                     (1_000 * SECOND, "16 min 40 s"), (7_200 * SECOND, "2 h 0 min")):  # fmt: skip
        assert format_ns(ns) == text
    for ns, text in ((0, "0.0 s"), (1_190 * MS, "1.1 s"), (9_999 * MS, "9.9 s"), (99 * SECOND, "99 s"),
                     (117 * SECOND, "117 s"), (720 * SECOND, "12 min"), (3 * 3600 * SECOND, "3 h"),
                     (-5, "0.0 s")):  # fmt: skip
        assert age_text(ns) == text


def test_what_is_cut_is_shown_to_be_cut() -> None:
    assert clip("receiving", 9) == "receiving"
    assert clip("receiving", 5) == "rece…"
    assert clip("receiving", 0) == ""


def test_one_byte_is_never_an_empty_bar() -> None:
    assert bar(0, 65535, 10) == ("", "─" * 10)
    assert bar(1, 65535, 10) == ("━", "─" * 9)
    assert bar(65535, 65535, 10) == ("━" * 10, "")


def test_control_characters_do_not_survive_wrapping() -> None:
    assert wrap_text("a\x1b[1m b", 40) == (r"a\x1b[1m b",)


def test_each_byte_has_a_class_and_one_printable_character() -> None:
    assert len(CLASS_OF) == len(CHARACTER_OF) == 256
    assert {*CLASS_OF} == {"null", "printable", "space", "control", "high"}
    assert all(len(c) == 1 and c.isprintable() for c in CHARACTER_OF)
    assert [CHARACTER_OF[b] for b in b"\x00A \n\x07\x80"] == ["⋄", "A", " ", "_", "•", "×"]


def test_pins_keep_their_letters_and_strangers_get_free_ones() -> None:
    assert letters_of(["EN_R", "CONT", "LEN", "ADHOC", "COM_RST"]) == {
        "EN_R": "n", "CONT": "t", "LEN": "l", "ADHOC": "a", "COM_RST": "x",
    }  # fmt: skip
    letters = letters_of(["TIMEOUT", "CONT", "ID", "REQ"])
    assert letters["CONT"] == "t"
    assert letters["TIMEOUT"] == "i"
    assert len(set(letters.values())) == 4


# -- commands ------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("line", "completed"),
    [
        ("", None),
        ("se", "set"),
        ("set TRCV_C_", "set TRCV_C_1"),
        ("set TRCV_C_1 C", "set TRCV_C_1 CONT="),
        ("set TRCV_C_1 CONT=1 E", "set TRCV_C_1 CONT=1 EN_R="),
        ("pulse TRCV_C_1 COM", "pulse TRCV_C_1 COM_RST"),
        ("pulse TRCV_C_1 L", None),
        ("peer P1 se", "peer P1 send"),
        ("peer P1 send udt T", "peer P1 send udt Telegram"),
        ("peer P1 send hex 01 sp", "peer P1 send hex 01 split="),
        ("fault recv EC", "fault recv ECONNRESET"),
        ("fault recv ECONNRESET on C", "fault recv ECONNRESET on C1"),
        ("link C2 d", "link C2 down"),
        ("plc r", "plc run"),
        ("tr", "trigger"),
        ("trigger TRCV_C_1 ST", "trigger TRCV_C_1 STATUS="),
        ("trigger TRCV_C_1 EN_R r", "trigger TRCV_C_1 EN_R rises"),
        ("trigger r", "trigger rx"),
        ("write sm", "write small"),
        ("expect TRCV_C_2 ST", "expect TRCV_C_2 STATUS="),
        ("nonsense x", None),
        ("cr", "create"),
        ("create TR", "create TRCV_C"),
        ("create TRCV_C ", "create TRCV_C TRCV_C_3"),
        ("create TRCV_C X con", "create TRCV_C X connect=C1"),
        ("create TRCV_C X connect=C1 da", "create TRCV_C X connect=C1 data=rx"),
        ("create TRCV_C X connect=C1 EN", "create TRCV_C X connect=C1 EN_R="),
        ("create NONE X con", None),
        ("delete TR", "delete TRCV_C_1"),
        ("download TR", "download TRCV_C_1"),
        ("resize r", "resize rx"),
        ("resize rx T", "resize rx Telegram"),
        ("resize rx ARRAY[0..9] O", "resize rx ARRAY[0..9] OF "),
        ("save s", "save scenario"),
        ("ma", "mark"),
        ("peer P1 rep", "peer P1 reply"),
    ],
)
def test_the_last_word_of_a_command_is_completed(line: str, completed: str | None) -> None:
    assert complete(line, bench_project()) == completed


def test_every_verb_that_a_prompt_takes_is_completed() -> None:
    assert set(COMMANDS) - {"wait"} <= set(list_verbs()), "a prompt does not wait"


def test_empty_options_are_left_out_of_a_send() -> None:
    options = (("split", " 3,7 "), ("gap", ""), ("repeat", "2"), ("every", "  "))
    assert make_send_line("P1", "hex", " 01 02 ", options) == "peer P1 send hex 01 02 split=3,7 repeat=2"
