"""Text files: reading whatever editors and spreadsheets write, and writing in one step or not at all."""

from __future__ import annotations

import difflib
import os
import unicodedata
import uuid
from collections.abc import Iterable, Mapping
from contextlib import suppress
from pathlib import Path

from rverror.base.errors import InputError, check_kind

PathLike = str | os.PathLike[str]


def read_bytes(path: PathLike) -> bytes:
    """Read a file whole.

    Raises
    ------
    InputError
        If the file cannot be read.
    """
    check_path(path)
    try:
        return Path(path).read_bytes()
    except (OSError, ValueError) as error:  # ValueError: a null byte in the name
        raise InputError(f"{path}: {_reason(error, 'read')}") from error


def file_head(path: PathLike, size: int) -> bytes:
    """Beginning of a file; empty where it cannot be read: whoever reads it whole says why."""
    with suppress(OSError, ValueError), open(path, "rb") as file:
        return file.read(size)
    return b""


def read_text(path: PathLike) -> str:
    """Read a UTF-8 text file, with or without a byte-order mark; line ends stay as they are.

    Raises
    ------
    InputError
        If the file cannot be read or is no UTF-8 text.
    """
    return decoded(path, read_bytes(path))


def decoded(
    path: PathLike, raw: bytes, encoding: str = "", *, otherwise: str = "", wanted: str = "a text file in UTF-8"
) -> str:
    """Text of a file.

    Parameters
    ----------
    path : str or path-like
        For messages.
    raw : bytes
    encoding : str
        Empty where nothing is stated: then UTF-8 it must be.
    otherwise : str
        What may be done in place of saving it as UTF-8, for the message; {} stands for an encoding.
    wanted : str
        What may be given in place of a file of bytes.

    Raises
    ------
    InputError
        If it is no text, or of another encoding.
    """
    if not encoding and raw.startswith((b"\xff\xfe", b"\xfe\xff")):
        raise InputError(f"{path}: the text is UTF-16; save it as UTF-8{otherwise.format('utf-16')}")
    if not encoding and b"\0" in raw:
        raise InputError(f"{path}: this is no text file (it holds zero bytes); give {wanted}")
    try:
        return raw.decode(encoding or "utf-8").removeprefix("\ufeff")
    except UnicodeDecodeError as error:
        line = raw.count(b"\n", 0, error.start) + 1
        what = f"{path}, line {line}: byte 0x{raw[error.start]:02x} is no {encoding or 'UTF-8'} text"
        remedy = (
            f"correct encoding = {encoding!r}" if encoding else f"save the file as UTF-8{otherwise.format('cp1252')}"
        )
        raise InputError(f"{what}; {remedy}") from error


def split_lines(text: str) -> list[str]:
    """Split at CR LF, LF or CR only, so that line numbers are those of an editor."""
    return text.replace("\r\n", "\n").replace("\r", "\n").split("\n")


def write_file(path: PathLike, content: str | bytes, *, overwrite: bool) -> None:
    """Write a file in one step: readers see the old file or the new one, never half of it.

    Parameters
    ----------
    path : str or path-like
        A symbolic link is followed.
    content : str or bytes
        A text is written as UTF-8.
    overwrite : bool
        Whether an existing file may be replaced.

    Raises
    ------
    InputError
        If the file exists and must not be replaced, the folder cannot be written to, or the text is no Unicode.
    """
    if not overwrite and os.path.lexists(path):
        raise InputError(f"{path}: the file exists; choose another name or allow overwriting")
    try:
        raw = content.encode("utf-8") if isinstance(content, str) else content
        target = Path(path).resolve()
        if target.is_dir():
            raise IsADirectoryError
        # Beside the target, because a rename is one step only within one file system.
        temporary = target.with_name(f".{target.name[:100]}.{uuid.uuid4().hex}.tmp")
        try:
            with temporary.open("xb") as file:
                file.write(raw)
                file.flush()
                os.fsync(file.fileno())
            if target.exists():
                temporary.chmod(target.stat().st_mode & 0o7777)
            temporary.replace(target)
        except BaseException:
            with suppress(OSError):
                temporary.unlink(missing_ok=True)
            raise
    except (OSError, ValueError) as error:
        raise InputError(f"{path}: {_reason(error, 'write')}") from error


def is_printable(name: PathLike) -> bool:
    """Tell whether a name holds no control character and no byte that is no Unicode, so that a report can quote it."""
    return all(unicodedata.category(letter) not in ("Cc", "Cs") for letter in os.fspath(name))


def printable(text: str) -> str:
    r"""Text for people: what cannot be printed shows as its escape.

    Examples
    --------
    >>> printable("a\x07b")
    'a\\x07b'
    """
    return "".join(c if c.isprintable() else c.encode("unicode_escape", "backslashreplace").decode() for c in text)


def joined(lines: Iterable[str]) -> str:
    r"""Text of lines for people, each `printable`; ends with a line end.

    Examples
    --------
    >>> joined(["a", "b\x07"])
    'a\nb\\x07\n'
    """
    return "".join(f"{printable(line)}\n" for line in lines)


def describe(key: str, indices: Mapping[str, object]) -> str:
    """Name of an effect for people.

    Parameters
    ----------
    key : str
        A key of the catalogue.
    indices : mapping

    Returns
    -------
    str

    Examples
    --------
    >>> describe("crank.eccentricity", {"crank": 0, "disc": 1})
    'crank.eccentricity (crank 0, disc 1)'
    """
    inside = ", ".join(f"{name} {value}" for name, value in indices.items())
    return f"{key} ({inside})" if inside else key


def file_name(path: str) -> str:
    """Last part of a path, of either kind of slash."""
    return path.replace("\\", "/").rpartition("/")[2]


def check_path(path: object) -> None:
    """Refuse what names no file.

    Raises
    ------
    InputError
    """
    check_kind("path", path, (str, os.PathLike), "give the path of a file first, such as 'unit.toml'")


def check_name(path: PathLike) -> None:
    """Refuse a file whose name cannot be printed, for reports and models quote it.

    Raises
    ------
    InputError
        If the name holds control characters or bytes that are no Unicode.
    """
    if not is_printable(path):
        raise InputError(f"{os.fspath(path)!a}: the file name holds characters that cannot be printed; rename the file")


def shown(value: object, longest: int = 40) -> str:
    """Value from a file in quotes, on one line, cut where it is long."""
    words = repr(value)
    return words if len(words) <= longest else f"{words[: longest - 4]}...{words[-1]}"


def did_you_mean(word: str, known: Iterable[str]) -> str:
    """`` did you mean 'x'?`` for the nearest known word in whatever case, else nothing."""
    by_lower = {one.lower(): one for one in known}
    close = difflib.get_close_matches(word.lower(), by_lower, n=1, cutoff=0.6)
    return f" did you mean {by_lower[close[0]]!r}?" if close else ""


def some(values: Iterable[object], limit: int = 5) -> str:
    """List a few numbers or names.

    Examples
    --------
    >>> some(["A", "B"]), some("ABCDEF")
    ('A, B', 'A, B, C, D, E, ...')
    """
    listed = list(values)
    return ", ".join(map(str, listed[:limit])) + (", ..." if len(listed) > limit else "")


#: Why a file cannot be read or written, with the remedy, by what is raised.
_REASONS: Mapping[type[Exception], str] = {
    IsADirectoryError: "this is a folder; give a file",
    NotADirectoryError: "a part of the path is a file, not a folder; check the path",
    PermissionError: "no permission to {verb} it; change the permissions or choose another place",
    UnicodeEncodeError: "a text holds a character that is no UTF-8; remove it",
}


def _reason(error: Exception, verb: str) -> str:
    if isinstance(error, FileNotFoundError):
        return f"there is no such {'file; check the path' if verb == 'read' else 'folder; make it first'}"
    if type(error) in _REASONS:
        return _REASONS[type(error)].format(verb=verb)
    if isinstance(error, OSError):
        return f"cannot {verb} it ({error.strerror or 'input/output error'}); check the disk and the path"
    return f"cannot {verb} it ({error}); check the path"
