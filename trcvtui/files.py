"""Reads the user's files whole, up to a limit. Writes a new file and renames it: it is never half written.

Rule 1: a FIFO, a device or a folder under the name of a file is refused at once, without waiting.
Rule 2: a write that fails leaves the old file as it was, and no new file beside it.
Rule 3: a file that this process has read is not overwritten, unless the caller sets `is_own`.
Rule 4: after `refuse_files` this process opens no file. A read-only screen needs no files.
Rule 5: inside `substitute_disk` a FilesRead gives the files by name. Nothing is read from the disk.
"""

from __future__ import annotations

import errno
import io
import os
import stat
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, suppress
from typing import IO, Final

from trcvtui.errors import UserError, mistake

FileName = str | os.PathLike[str]
EXPECTED_READABLE: Final = "a file that can be read"
EXPECTED_WRITABLE: Final = "a file that can be written"
MOST_DIGESTED: Final = 1 << 20  # bytes of a certificate or a key
_SPECIAL_FILE_KINDS: Final = (
    (stat.S_ISFIFO, "a FIFO"),
    (stat.S_ISCHR, "a device"),
    (stat.S_ISBLK, "a device"),
    (stat.S_ISSOCK, "a socket"),
    (stat.S_ISDIR, "a folder"),
)
_refusal_reasons: list[str] = []  # why no file is opened any more
_paths_read: set[str] = set()  # the real paths of what has been read
_read_recorders: list[FilesRead] = []  # the last one keeps what is read
_disk_substitutes: list[FilesRead] = []  # the last one is read in place of the disk


class FilesRead:
    """Contents of files that were read, by name. `digests` has SHA-256 of files without stored content.

    Relative names are relative to `folder`.
    """

    def __init__(
        self,
        folder: str = "",
        contents: Iterable[tuple[str, bytes]] = (),
        digests: Iterable[tuple[str, str]] = (),
    ) -> None:
        self.folder, self.contents, self.digests = folder or os.getcwd(), dict(contents), dict(digests)
        self.sink: Callable[[str, bytes | str], None] | None = None  # gets each new or changed content
        self.on_progress: Callable[[str, float], None] | None = None  # gets the part that is read, 0 to 1

    def store(self, path: FileName, content: bytes | str) -> None:
        """Store the content (bytes) or the digest (str) of a file."""
        name = os.fspath(path)
        known: bytes | str | None = self.contents.get(name, self.digests.get(name))
        if isinstance(content, bytes):
            self.contents[name] = content
        else:
            self.digests[name] = content
        if self.sink is not None and known != content:
            self.sink(name, content)

    def content(self, path: FileName) -> bytes:
        """Return the content of a file; raise FileNotFoundError if the content is not stored."""
        try:
            return self.contents[os.fspath(path)]
        except KeyError:
            raise FileNotFoundError(errno.ENOENT, os.strerror(errno.ENOENT)) from None


@contextmanager
def record_reads(files: FilesRead) -> Iterator[None]:
    """Inside the block, store in `files` each file that this process reads."""
    _read_recorders.append(files)
    try:
        yield
    finally:
        _read_recorders.remove(files)


@contextmanager
def substitute_disk(files: FilesRead) -> Iterator[None]:
    """Inside the block take each file from `files`, not from the disk."""
    _disk_substitutes.append(files)
    try:
        yield
    finally:
        _disk_substitutes.pop()


def is_disk_replaced() -> bool:
    """Return whether `substitute_disk` replaces the disk, so that libraries must not open files."""
    return bool(_disk_substitutes)


def is_folder(path: FileName) -> bool:
    return not _disk_substitutes and os.path.isdir(path)


def make_folder(path: FileName, key: str) -> None:
    """Make a folder if it does not exist. If that fails, raise UserError that names `key`."""
    try:
        os.mkdir(path)
    except FileExistsError:
        if not os.path.isdir(path):
            raise mistake(f"{key} {path}", "a file", "a folder, or a free name") from None
    except OSError as failed:
        raise mistake(f"{key} {path}", reason_of(failed), "a folder that can be created") from None


@contextmanager
def make_folder_or_undo(path: FileName, key: str) -> Iterator[None]:
    """Make a folder if it does not exist. If the block fails, remove the new folder if empty."""
    is_new = not os.path.lexists(path)
    make_folder(path, key)
    try:
        yield
    except BaseException:
        if is_new:
            with suppress(OSError):
                os.rmdir(path)
        raise


def absolute_name(path: FileName) -> str:
    """Return a name that does not depend on the current folder."""
    return os.path.join(_disk_substitutes[-1].folder if _disk_substitutes else os.getcwd(), path)


def refuse_files(why: str) -> None:
    """From now on refuse to open files in this process. `why` is the reason in the error."""
    _refusal_reasons.append(why)


def allow_files() -> None:
    _refusal_reasons.clear()


def read_bounded(path: FileName, most: int) -> bytes:
    """Return at most `most` + 1 bytes of a regular file; raise OSError or ValueError.

    One byte more than `most` means that the file is larger.
    """
    if _disk_substitutes:  # rule 5
        return _disk_substitutes[-1].content(path)[: most + 1]
    with open_to_read(path) as file:
        content = file.read(most + 1)
    if _read_recorders:
        _read_recorders[-1].store(path, content)
    return content


class _ProgressFile(io.BufferedReader):
    """A file that reports before each read how much of the file has been read."""

    def read(self, size: int | None = -1, /) -> bytes:
        if _read_recorders and (how_far := _read_recorders[-1].on_progress) is not None:
            how_far(self.name, self.tell() / (os.fstat(self.fileno()).st_size or 1))
        return super().read(size)


@contextmanager
def open_to_read(path: FileName) -> Iterator[IO[bytes]]:
    """Give a regular file to read piece by piece; raise OSError or ValueError."""
    _check_files_allowed()
    # O_NONBLOCK: without it, opening a FIFO waits for a writer (rule 1).
    handle = os.open(path, os.O_RDONLY | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_BINARY", 0))
    with _ProgressFile(io.FileIO(path, opener=lambda *_: handle)) as file:
        _refuse_special_file(os.fstat(handle).st_mode)
        _paths_read.add(os.path.realpath(path))
        yield file


def check_readable(path: FileName) -> None:
    """Refuse a file that `read_bounded` refuses; call this before a library opens the file by name."""
    if _disk_substitutes:
        if os.fspath(path) not in _disk_substitutes[-1].digests:
            _disk_substitutes[-1].content(path)
        return
    _check_files_allowed()
    _refuse_special_file(os.stat(path).st_mode)
    _paths_read.add(os.path.realpath(path))
    if _read_recorders:
        _read_recorders[-1].store(path, _digest(path))


def _digest(path: FileName) -> str:
    from hashlib import sha256

    with open_to_read(path) as file:
        return sha256(file.read(MOST_DIGESTED)).hexdigest()


def refuse_overwriting_input(path: FileName, where: str, inputs: Iterable[FileName] = ()) -> None:
    """Raise UserError if the file to write is one of `inputs`, or was read before."""
    # Compared by path: the inode number of a deleted file is used again.
    others = (*_paths_read, *inputs) if os.path.exists(path) else inputs  # a missing file was not read
    if any(is_same_file(path, each) for each in others):
        raise mistake(where, f"{path}, which is read here", "another name")


def reason_of(failed: OSError | ValueError) -> str:
    """Return why a file could not be read or written: words of the system in quotes, or ours."""
    if isinstance(failed, IsADirectoryError):
        return "a folder"
    text = getattr(failed, "strerror", None) or str(failed)
    return f"'{text}'" if text == os.strerror(getattr(failed, "errno", 0) or 0) else text


def create_file(path: FileName, where: str, replaces: bool = False) -> IO[bytes]:
    """Return a new file, mode 0600, unbuffered, to write piece by piece.

    Raise UserError if the name is taken and `replaces` is False, or if the system refuses.
    """
    try:
        _check_files_allowed()
        flags = os.O_RDWR | os.O_CREAT | os.O_EXCL | getattr(os, "O_BINARY", 0)
        if replaces and os.path.lexists(path):
            _refuse_target(path, os.path.realpath(path), where, is_new=False)
            os.unlink(path)
        return open(os.open(path, flags, 0o600), "r+b", buffering=0)
    except FileExistsError:
        raise mistake(where, f"{path}, which is there already", "the name of a new file") from None
    except (OSError, ValueError) as failed:
        raise _make_write_error(path, where, failed) from None


@contextmanager
def open_private_file() -> Iterator[tuple[int, str]]:
    """Give a private file and the name by which a library opens it. After the block, remove the file.

    The file is in memory if the system has such files, else in the folder for temporary files (mode 0600).
    """
    make = getattr(os, "memfd_create", None)
    if make is not None and os.path.isdir("/proc/self/fd"):
        handle = make("trcvtui")
        name = f"/proc/self/fd/{handle}"
    else:
        import tempfile

        handle, name = tempfile.mkstemp()
    try:
        yield handle, name
    finally:
        os.close(handle)
        if not name.startswith("/proc"):
            os.unlink(name)


@contextmanager
def replace_file(
    path: FileName, where: str, is_own: bool = False, is_new: bool = False, mode: int = 0o666
) -> Iterator[IO[bytes]]:
    """Give a file to write. After the block, the file replaces `path` on the disk in one step.

    If the block fails, nothing has changed. Raise UserError for a file that was read (unless `is_own`),
    for a path that is no regular file, for a taken name if `is_new`, and if the system refuses.
    """
    try:
        _check_files_allowed()
        whole = os.path.realpath(path)
        _refuse_target(path, whole, where, is_new)
        beside = os.path.join(
            os.path.dirname(whole), f".{os.path.basename(whole)[:100]}.{os.urandom(6).hex()}.new"
        )
        handle = os.open(beside, os.O_WRONLY | os.O_CREAT | os.O_EXCL | getattr(os, "O_BINARY", 0), mode)
    except (OSError, ValueError) as failed:
        raise _make_write_error(path, where, failed) from None
    try:
        with open(handle, "wb") as file:
            yield file
            file.flush()
            os.fsync(file.fileno())
        if not is_own:
            refuse_overwriting_input(path, where)  # rule 3; only now, as the block may have read files
        _keep_mode(whole, beside)
        _put_in_place(beside, whole, is_new)
    except (OSError, ValueError) as failed:
        _remove_quietly(beside)
        raise _make_write_error(path, where, failed) from None
    except BaseException:  # rule 2, also for an error of the block
        _remove_quietly(beside)
        raise


def write_file(
    path: FileName, content: str | bytes, where: str, is_own: bool = False, is_new: bool = False
) -> None:
    """Write this content as `replace_file` does. Text becomes UTF-8 with unchanged line ends."""
    with replace_file(path, where, is_own, is_new) as file:
        file.write(content.encode() if isinstance(content, str) else content)


def is_same_file(one: FileName, other: FileName) -> bool:
    """Return whether two names are one file, also through links."""
    try:
        return os.path.samefile(one, other)
    except (OSError, ValueError):
        return os.path.realpath(one) == os.path.realpath(other)


def _check_files_allowed() -> None:
    if _refusal_reasons:
        raise OSError(errno.EPERM, _refusal_reasons[-1])


def _refuse_special_file(mode: int) -> None:
    if not stat.S_ISREG(mode):
        kind = next((name for is_kind, name in _SPECIAL_FILE_KINDS if is_kind(mode)), "no regular file")
        raise OSError(errno.EINVAL, kind)


def _refuse_target(path: FileName, whole: str, where: str, is_new: bool) -> None:
    if is_new and os.path.lexists(path):
        raise mistake(where, f"{path}, which is there already", "the name of a new file")
    if os.path.exists(whole):
        _refuse_special_file(os.stat(whole).st_mode)
        if not os.access(whole, os.W_OK):  # a rename ignores the file's own permission
            raise PermissionError(errno.EACCES, os.strerror(errno.EACCES))


def _keep_mode(whole: str, beside: str) -> None:
    if os.path.exists(whole):
        os.chmod(beside, os.stat(whole).st_mode & 0o7777)


def _put_in_place(beside: str, whole: str, is_new: bool) -> None:
    if not is_new:
        os.replace(beside, whole)
    else:
        _link_in_place(beside, whole)
    _sync_folder(os.path.dirname(whole))


def _link_in_place(beside: str, whole: str) -> None:
    # A link fails if the name was taken meanwhile, a rename would not; not every file system has links.
    try:
        os.link(beside, whole)
    except FileExistsError:
        raise
    except OSError:
        os.replace(beside, whole)
    else:
        os.unlink(beside)


def _sync_folder(folder: str) -> None:
    try:
        handle = os.open(folder, os.O_RDONLY)
    except OSError:  # Windows opens no folder
        return
    try:
        os.fsync(handle)
    except OSError:
        return  # the file is in place; some file systems cannot sync a folder
    finally:
        os.close(handle)


def _remove_quietly(path: str) -> None:
    try:
        os.unlink(path)
    except OSError:
        return  # the caller reports the first error


def _make_write_error(path: FileName, where: str, failed: OSError | ValueError) -> UserError:
    reason = reason_of(failed)
    folder = os.path.dirname(os.path.abspath(path)) if "\0" not in str(path) else ""
    if isinstance(failed, FileNotFoundError) and not os.path.isdir(folder):
        return mistake(where, f"{path}: no folder {folder}", "an existing folder")
    return mistake(where, reason if str(path) in where else f"{path}: {reason}", EXPECTED_WRITABLE)
