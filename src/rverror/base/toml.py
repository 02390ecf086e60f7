"""TOML with the line of every mistake: what model files and tolerance files share."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any, NoReturn, cast

from rverror.base import units
from rverror.base.errors import InputError
from rverror.base.text import did_you_mean, shown, split_lines

#: How people write a quantity of each dimension of an error source.
EXAMPLES = {
    "length": "5 um",
    "angle": "10 arcsec",
    "time": "0.5 ms",
    "temperature_rise": "10 K",
    "compliance": "0.5 arcsec/(N*m)",
    "contact_compliance": "1 um/kN",
    "slope": "10 arcsec/turn",
}

#: Keys from the outermost table inwards, with the number of the entry after the name of an array of tables.
KeyPath = tuple[str | int, ...]
Table = Mapping[str, Any]

#: How the last line of a value over several lines ends: only there is it tried whether it is complete.
_END_OF_VALUE = re.compile(r"(?:[]}]|\"\"\"|''')\s*(?:#.*)?$")
_LOOSE_QUANTITY = re.compile(r"\s*([\w.\"-]+)\s*=\s*([-+.\w]*\d\s*[A-Za-z*/][\w*/]*+)\s*(#.*)?$")


@dataclass(frozen=True)
class TomlText:
    """Content of a TOML text, with the line of every key; `read_toml` makes it.

    Attributes
    ----------
    path : str
        Name of the file, for messages.
    content : dict
        What tomllib reads.
    lines : mapping
        Line of each place, from 1.
    """

    path: str
    content: dict[str, Any]
    lines: Mapping[KeyPath, int]

    def refuse(self, place: KeyPath, message: str) -> NoReturn:
        """Refuse with the line of a place, or of the nearest table around it.

        Raises
        ------
        InputError
            Always.
        """
        while place and place not in self.lines:
            place = place[:-1]
        line = f", line {self.lines[place]}" if place else ""
        raise InputError(f"{self.path}{line}: {message}")

    @contextmanager
    def refusing(self, place: KeyPath | Callable[[str], KeyPath], what: str = "") -> Iterator[None]:
        """Refuse with its line what is refused inside by a ValueError.

        Parameters
        ----------
        place : tuple or callable
            Of what is at fault, or what finds that by the message.
        what : str
            Said before the message.

        Raises
        ------
        InputError
        """
        try:
            yield
        except ValueError as error:
            said = str(error)
            if isinstance(error, InputError) and said.startswith((f"{self.path}, line ", f"{self.path}: ")):
                raise  # by its own line
            self.refuse(place(said) if callable(place) else place, f"{what}{said}")

    def check_keys(self, place: KeyPath, table: Table, known: Sequence[str], what: str) -> None:
        """Refuse the first key of a table that is not known.

        Parameters
        ----------
        place : tuple
            Of the table.
        table : mapping
        known : sequence of str
            Keys that the table may have.
        what : str
            What the message calls a key of the table.

        Raises
        ------
        InputError
            If there is such a key.
        """
        for key in table:
            if key not in known:
                hint = did_you_mean(key, known)
                self.refuse((*place, key), f"unknown {what} {shown(key)};{hint} the keys are {', '.join(known)}")

    def table(self, *place: str) -> dict[str, Any]:
        """Content of a table; empty where there is none.

        Raises
        ------
        InputError
            If something else stands there.
        """
        found: Any = self.content
        for depth, key in enumerate(place, 1):
            found = found.get(key, {})
            if not isinstance(found, dict):
                remedy = f"write '[{'.'.join(place[:depth])}]' and keys below it"
                self.refuse(place[:depth], f"{key} = {shown(found)} is no table; {remedy}")
        return cast("dict[str, Any]", found)

    def tables(self, name: str) -> list[tuple[KeyPath, dict[str, Any]]]:
        """Places and contents of an array of tables; empty where there is none.

        Raises
        ------
        InputError
            If something else stands there.
        """
        listed = self.content.get(name, [])
        if not isinstance(listed, list):
            self.refuse((name,), f"{name} is a single table; write '[[{name}]]', with two brackets, above each {name}")
        for i, item in enumerate(listed):
            if not isinstance(item, dict):
                remedy = f"write each {name} below '[[{name}]]'"
                self.refuse((name, i), f"{name} holds {shown(item)}, which is no table; {remedy}")
        return [((name, i), item) for i, item in enumerate(listed)]

    def checked(
        self, place: KeyPath, table: Table, key: str, fits: Callable[[Any], bool], must: str, default: Any = None
    ) -> Any:
        """Value of a key, which has to fit.

        Parameters
        ----------
        place : tuple
            Of the table.
        table : mapping
        fits : callable
            Tells whether a value is of its kind and within its bounds.
        must : str
            What it must be, and the remedy, for the message.
        default
            What a table without the key gets.

        Raises
        ------
        InputError
            If the value does not fit.
        """
        if key in table and not fits(table[key]):
            self.refuse((*place, key), f"{key} = {shown(table[key])}: must be {must}")
        return table.get(key, default)

    def string(self, place: KeyPath, table: Table, key: str) -> str:
        """Text of a key, empty where there is none; parameters as of `checked`.

        Raises
        ------
        InputError
            If the value is no text.
        """
        return cast(str, self.checked(place, table, key, is_text, f'a text; write {key} = "..." with quotes', ""))

    def quantity(self, place: KeyPath, value: object, dimension: str, example: str) -> float:
        """Value written as a text with a unit.

        It comes back in the core unit; a slope may be a bare number, for it has no unit.  The last key of its place
        names it in messages, which tell the example too.

        Raises
        ------
        InputError
            If there is no number, no unit, one of another dimension, or an uncertainty is below 0.
        """
        key = place[-1]
        if not (is_text(value) or is_number(value)):
            self.refuse(place, f"{key} = {shown(value)}: must be a text with a unit; write '{example}'")
        if not isinstance(value, str):
            if dimension != "slope":
                self.refuse(place, f"{key} = {shown(value)} has no unit; write it as a text like '{example}'")
            value = repr(value)
        try:
            number = units.parse(value, dimension)
        except ValueError as error:
            # The remedy of the units edge knows the dimension only, this one the key.
            self.refuse(place, f"{key}: {str(error).partition(';')[0]}; write it like '{example}'")
        if key == "uncertainty" and number < 0:
            self.refuse(place, f"uncertainty = {shown(value)}: must be 0 or more; write it like '{example}'")
        return number


def is_text(value: object) -> bool:
    """Tell a text."""
    return isinstance(value, str)


def is_number(value: object) -> bool:
    """Tell a number, which true and false are not."""
    return isinstance(value, (int, float)) and not isinstance(value, bool)


def is_whole(value: object) -> bool:
    """Tell a whole number."""
    return isinstance(value, int) and not isinstance(value, bool)


def read_toml(path: str, text: str) -> TomlText:
    """Read a TOML text and find the line of every key; tomllib keeps no lines.

    Parameters
    ----------
    path : str
        Name of the file, for messages.

    Raises
    ------
    InputError
        If the text is no TOML; one line that names file, line and remedy.

    Examples
    --------
    >>> read_toml("model.toml", "name = 'x'").lines
    {('name',): 1}
    """
    try:
        content = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise InputError(_syntax_message(path, text, str(error))) from error
    except (RecursionError, ValueError) as error:  # tables within tables without end, numbers too long
        raise InputError(f"{path}: no valid TOML: {error}; correct the file") from error
    return TomlText(path, content, _lines(text))


def _syntax_message(path: str, text: str, message: str) -> str:
    match = re.search(r"\(at line (\d+), column (\d+)\)", message)
    if match is None:
        line = len(split_lines(text.rstrip()))
        place, message = f", line {line}", message.replace("(at end of document)", "at the end of the file")
    else:
        line = int(match[1])
        place, message = f", line {line}, column {match[2]}", message[: match.start()].rstrip()
    loose = _LOOSE_QUANTITY.match(split_lines(text)[line - 1])
    remedy = f'write {loose[1]} = "{loose[2]}", with quotes' if loose else "correct this line"
    return f"{path}{place}: no valid TOML: {message}; {remedy}"


def _lines(text: str) -> dict[KeyPath, int]:
    """Line of every key of a valid text, whose statements are read one by one."""
    lines: dict[KeyPath, int] = {}
    table: KeyPath = ()
    counts: dict[KeyPath, int] = {}  # number of the latest entry of each array of tables
    statement, first = "", 1
    for number, line in enumerate(split_lines(text), 1):
        statement += f"{line}\n"
        if number > first and not _END_OF_VALUE.search(line):
            continue
        try:
            said: Any = tomllib.loads(statement)
        except tomllib.TOMLDecodeError:
            continue  # its value goes on
        is_header = statement.lstrip().startswith("[")
        place: KeyPath = () if is_header else table
        while isinstance(said, dict) and len(said) == 1:
            ((key, said),) = said.items()
            place = (*place, key)
            if is_header and isinstance(said, list):
                counts[place], said = counts.get(place, -1) + 1, said[0]
            if is_header and place in counts:
                place = (*place, counts[place])
        table = place if is_header else table
        for length in range(1, len(place) + 1):
            lines.setdefault(place[:length], first)
        statement, first = "", number + 1
    return lines


def quoted(text: str) -> str:
    r"""Text as TOML writes it, in quotes.

    Examples
    --------
    >>> print(quoted('a "b"'))
    "a \"b\""
    """
    escapes = {"\\": "\\\\", '"': '\\"', "\n": "\\n", "\t": "\\t", "\r": "\\r"}
    letters = (escapes.get(c) or (c if c.isprintable() else f"\\U{ord(c):08x}") for c in text)
    return f'"{"".join(letters)}"'
