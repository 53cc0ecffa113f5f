"""The user's files: whole or not at all, never over what was read, never a FIFO, a device or a folder."""

from __future__ import annotations

import errno
import os
import stat
from collections.abc import Iterator
from pathlib import Path

import pytest

from trcvtui import files
from trcvtui.cli.main import main
from trcvtui.errors import UserError
from trcvtui.files import (
    allow_files,
    read_bounded,
    reason_of,
    refuse_files,
    refuse_overwriting_input,
    replace_file,
    write_file,
)

SCENARIO = """
dialect = "baosky"
[[connect]]
name = "C1"
ActiveEstablished = false
LocalAddress = "127.0.0.1"
[[instance]]
name = "X"
block = "TRCV_C"
connect = "C1"
[scenario]
name = "s"
steps = "run 2"
"""
WHERE = "here"


@pytest.fixture(autouse=True)
def nothing_read_before() -> Iterator[None]:
    """Begin with a process that has read no file."""
    before = set(files._paths_read)
    files._paths_read.clear()
    yield
    files._paths_read.update(before)


def refusal(path: Path, content: str = "new", **how: bool) -> str:
    with pytest.raises(UserError) as refused:
        write_file(path, content, WHERE, **how)
    return str(refused.value)


def test_a_file_is_written_whole_with_the_rights_it_had_and_nothing_stands_beside_it(tmp_path: Path) -> None:
    path = tmp_path / "x.toml"
    write_file(path, "first", WHERE)
    path.chmod(0o640)
    write_file(path, "second", WHERE)
    assert path.read_text() == "second"
    assert stat.S_IMODE(path.stat().st_mode) == 0o640
    assert os.listdir(tmp_path) == ["x.toml"]


def test_a_link_stays_a_link_and_its_file_is_written(tmp_path: Path) -> None:
    (tmp_path / "real").mkdir()
    target, link = tmp_path / "real" / "x.toml", tmp_path / "x.toml"
    target.write_text("old")
    link.symlink_to(target)
    write_file(link, "new", WHERE)
    assert link.is_symlink() and target.read_text() == "new"


def test_a_full_disk_leaves_the_old_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "x.toml"
    path.write_text("old")

    def full(handle: int) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(os, "fsync", full)
    assert "No space left on device" in refusal(path)
    assert path.read_text() == "old" and os.listdir(tmp_path) == ["x.toml"]


def test_an_interrupted_writer_leaves_the_old_file(tmp_path: Path) -> None:
    path = tmp_path / "x.toml"
    path.write_text("old")
    with pytest.raises(KeyboardInterrupt), replace_file(path, WHERE) as file:
        file.write(b"half")
        raise KeyboardInterrupt
    assert path.read_text() == "old" and os.listdir(tmp_path) == ["x.toml"]


def test_what_was_read_is_not_written_over_by_any_of_its_names(tmp_path: Path) -> None:
    source, hard, soft = tmp_path / "x.st", tmp_path / "hard.st", tmp_path / "soft.st"
    source.write_text("TYPE")
    os.link(source, hard)
    soft.symlink_to(source)
    read_bounded(source, 100)
    assert refusal(source) == f"here: found {source}, which is read here, expected another name"
    assert "which is read here" in refusal(soft)
    assert "which is read here" in refusal(hard)
    with pytest.raises(UserError, match="which is read here"):
        refuse_overwriting_input(hard, WHERE, [source])
    write_file(source, "mine", WHERE, is_own=True)
    assert source.read_text() == "mine"


def test_a_new_file_takes_nobodys_name(tmp_path: Path) -> None:
    path = tmp_path / "x.toml"
    with replace_file(path, WHERE, is_new=True) as file:
        file.write(b"mine")
    with (
        pytest.raises(UserError, match="File exists"),
        replace_file(tmp_path / "y.toml", WHERE, is_new=True) as file,
    ):
        (tmp_path / "y.toml").write_text("somebody was quicker")
    assert (tmp_path / "y.toml").read_text() == "somebody was quicker"
    assert "which is there already" in refusal(path, is_new=True)
    (tmp_path / "dangling").symlink_to(tmp_path / "nowhere")
    assert "there already" in refusal(tmp_path / "dangling", is_new=True)
    assert sorted(os.listdir(tmp_path)) == ["dangling", "x.toml", "y.toml"]


def test_a_fifo_a_device_and_a_folder_are_refused_at_once(tmp_path: Path) -> None:
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    for path, kind in ((pipe, "a FIFO"), (Path("/dev/null"), "a device"), (tmp_path, "a folder")):
        with pytest.raises(OSError) as failed:  # of a folder it has the system's words
            read_bounded(path, 10)
        assert reason_of(failed.value) == kind
        assert kind in refusal(path)
    assert stat.S_ISFIFO(pipe.stat().st_mode)


@pytest.mark.parametrize(
    "words",
    [
        ["scenario", "PIPE"],
        ["scenario", "ok.toml", "--out", "PIPE"],
        ["run", "PIPE"],
        ["udt", "show", "PIPE"],
        ["udt", "decode", "t.st", "--type", "T", "@PIPE"],
        ["udt", "export", "t.st", "--to", "lua", "--out", "PIPE"],
        ["st", "PIPE"],
    ],
    ids=lambda words: " ".join(words),
)
def test_no_command_waits_for_a_fifo(
    words: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    os.mkfifo("PIPE")
    os.mkfifo("PIPE.st")
    Path("ok.toml").write_text(SCENARIO)
    Path("t.st").write_text("TYPE T : STRUCT a : INT; END_STRUCT END_TYPE")
    given = ["PIPE.st" if words[1] == "show" and word == "PIPE" else word for word in words]
    assert main(given) == 2
    err = capsys.readouterr().err
    assert "a FIFO" in err and len(err.splitlines()) == 1


def test_out_never_names_an_input(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    project, steps = SCENARIO.split("[scenario]")
    texts = {
        "alone.toml": SCENARIO,
        "bench.toml": '[[udt]]\nfile = "t.st"\n' + project,
        "steps.toml": 'project = "bench.toml"\n[scenario]' + steps,
        "t.st": "TYPE T : STRUCT a : INT; END_STRUCT END_TYPE",
    }
    texts["bench.toml"] = project + '[[udt]]\nfile = "t.st"\n'
    for name, text in texts.items():
        Path(name).write_text(text)
    os.link("t.st", "hard.st")
    for words in (
        ["scenario", "alone.toml", "--out", "alone.toml"],
        ["scenario", "steps.toml", "--out", "bench.toml"],
        ["scenario", "steps.toml", "--out", "t.st"],
        ["scenario", "steps.toml", "--out", "hard.st"],
        ["udt", "export", "t.st", "--to", "lua", "--out", "t.st"],
        ["udt", "export", "t.st", "--to", "lua", "--out", "hard.st"],
    ):
        assert main(words) == 2
        error = capsys.readouterr().err
        assert "which is read here" in error and error.count("\n") == 1  # told once
    os.remove("hard.st")
    assert {name: Path(name).read_text() for name in texts} == texts
    assert sorted(os.listdir()) == sorted(texts)
    assert main(["scenario", "steps.toml", "--out", "result.txt"]) == 0
    assert "passed" in Path("result.txt").read_text() or Path("result.txt").stat().st_size


def test_a_process_whose_files_are_closed_reads_and_writes_none(tmp_path: Path) -> None:
    path = tmp_path / "x.toml"
    path.write_text("old")
    refuse_files("this screen is read-only")
    try:
        with pytest.raises(OSError, match="read-only"):
            read_bounded(path, 10)
        assert "read-only" in refusal(path)
    finally:
        allow_files()
    assert read_bounded(path, 10) == b"old"
