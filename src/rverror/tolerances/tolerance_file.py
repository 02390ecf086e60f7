"""Tolerance files: TOML with the line of every mistake, or a table of rows; and copies with other widths."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, NoReturn

from rverror.base import units
from rverror.base.errors import InputError
from rverror.base.spreadsheet import TABLES, table_rows
from rverror.base.text import PathLike, read_text, shown, split_lines, write_file
from rverror.base.toml import EXAMPLES, KeyPath, Table, TomlText, is_number, is_text, is_whole, read_toml
from rverror.model.catalogue import CATALOGUE
from rverror.model.effects import Model
from rverror.model.model_file import source_of
from rverror.tolerances.cost import SAME_WIDTH, Cost, Grades, Reciprocal, ReciprocalSquare
from rverror.tolerances.declared import Tolerance, known_names, tolerance, width_and_centre
from rverror.tolerances.dependence import correlations, fits
from rverror.tolerances.grades import class_of, gear_limit, it_width

_WITH_UNIT = ("tolerance", "lower", "upper", "mean", "size", "diameter", "module", "at", "least", "largest")
_CURVE = ("curve", "price", "at", "base")
_EXAMPLE = "write a first line such as 'key, tolerance[um], distribution'"


def is_table(name: str) -> bool:
    """Whether a file of this name is a table, not a TOML text."""
    return Path(name).suffix.lower() in TABLES


def read_table(path: PathLike) -> TomlText:
    """Read a table of tolerances: the same content as a TOML text has, with the row of each.

    Parameters
    ----------
    path : str or path-like
        Its first row has the names of the columns, a unit in brackets where the cells have none; ``key`` is needed.
        Rows that begin with # are left out, and so are empty ones.

    Raises
    ------
    InputError
        If the file cannot be read, a column is not known, or a cell cannot be what its column says.
    """
    name = str(path)
    rows = table_rows(path)
    if not rows:
        raise InputError(f"{name}: the table is empty; {_EXAMPLE}")
    (line, heads), *body = rows
    columns = [_column(name, line, head) for head in heads]
    if "key" not in [column for column, _ in columns]:
        raise InputError(f"{name}, line {line}: no column 'key'; {_EXAMPLE}")
    if not body:
        raise InputError(f"{name}: no tolerance below the first line; add a row for each")
    listed = []
    for number, row in body:
        if any(cell for cell in row[len(columns) :]):
            raise InputError(f"{name}, line {number}: {len(row)} cells for {len(columns)} columns; correct the row")
        where = f"{name}, line {number}"
        cells = ((*column, cell) for column, cell in zip(columns, row, strict=False))
        given = {column: _cell(column, cell, unit) for column, unit, cell in cells if column and cell}
        listed.append(_entry(where, given))
    return TomlText(name, {"tolerance": listed}, {("tolerance", i): number for i, (number, _) in enumerate(body)})


def _column(name: str, line: int, head: str) -> tuple[str, str]:
    """Column and unit of a title."""
    title, _, unit = head.partition("[")
    title = title.strip().lower().replace(" ", "_")
    if title and title not in _CELLS:
        said = known_names("columns", _CELLS, title)
        raise InputError(f"{name}, line {line}: unknown column {shown(title)};{said}")
    return title, unit.rstrip("] ")


def _cell(name: str, cell: str, unit: str) -> Any:
    """Value of a cell, with the unit of its column where it has none itself.

    A cell that cannot be read stays a text, which the check of kinds refuses.
    """
    if name in _WITH_UNIT and unit and not any(letter.isalpha() for letter in cell.replace("e", "")):
        cell = f"{cell} {unit}"
    try:
        return _CELLS[name](cell)
    except (LookupError, ValueError):
        return cell


def _entry(where: str, entry: dict[str, Any]) -> dict[str, Any]:
    """Content of a ``[[tolerance]]`` table of the values of its columns."""
    for ends, name in ((("lower", "upper"), "tolerance"), (("least", "largest"), "bounds")):
        pair = [entry.pop(end) for end in ends if end in entry]
        if len(pair) == 1 or (pair and name in entry):
            raise InputError(f"{where}: {' and '.join(ends)} are two, in place of {name}; give both or neither")
        if pair:
            entry[name] = pair
    indices, cost = ({name: entry.pop(name) for name in names if name in entry} for names in (_INDICES, _CURVE))
    if indices:
        entry["indices"] = indices
    if cost:
        entry["cost"] = {"curve": "reciprocal", **cost}
    if "parameter" in entry:
        entry["parameters"] = entry.pop("parameter")
    return entry


def _parts(cell: str) -> list[str]:
    return [part.strip() for part in cell.split(",")]


def _index(cell: str) -> Any:
    found = [int(part) if part.lstrip("-").isdigit() else part for part in _parts(cell)]
    return found[0] if len(found) == 1 else found


def _correlations(cell: str) -> dict[str, float]:
    """Names and numbers of ``cams: 0.6; bores: -0.2``."""
    pairs = [part.rsplit(":", 1) for part in cell.split(";") if part.strip()]
    return {other.strip(): float(value) for other, value in pairs}


def _fit(cell: str) -> dict[str, Any]:
    """Other tolerance, classes and order of ``bores: 3 opposite``."""
    other, classes = cell.removesuffix(" opposite").rsplit(":", 1)
    return {"with": other.strip(), "classes": int(classes), "opposite": cell.endswith(" opposite")}


#: Indent, and what follows the value, of a line that holds one key with a text.
_VALUE = re.compile(r"""(\s*)["']?(?:tolerance|grade)["']?\s*=\s*(?:"[^"]*"|'[^']*'|\[[^\]#]*\])(\s*(?:#.*)?)$""")
_SIZES = ("tolerance", "grade", "samples")
#: What a grade needs to know of the part, by the standard, with an example; ISO 286, ISO 1328.
_PARTS = {"size": "32 mm"}, {"diameter": "13.5 mm", "module": "1.5 mm"}
_INDICES = tuple(dict.fromkeys(index.name for entry in CATALOGUE.values() for index in entry.indices))
_FLAGS = dict.fromkeys(("true", "yes", "1", "x"), True) | dict.fromkeys(("false", "no", "0", ""), False)


def _is_list(value: object) -> bool:
    return isinstance(value, list)


def _is_table(value: object) -> bool:
    return isinstance(value, dict)


def _is_correlations(value: object) -> bool:
    return isinstance(value, dict) and all(map(is_number, value.values()))


#: Of a key: whether a value is of its kind; what it must be, with an example; what reads it in a cell of a table.
_FIELDS: Mapping[str, tuple[Callable[[Any], bool], str, Callable[[str], Any] | None]] = {
    **dict.fromkeys(("name", "distribution", "phase"), (is_text, "a text, in quotes", str)),
    **dict.fromkeys(("capability", "shape", "correlation"), (is_number, "a bare number, such as 1.0", float)),
    "classes": (is_whole, "a whole number, such as 4", int),
    "fixed": (lambda v: isinstance(v, bool), "true or false, in a cell yes or no", lambda cell: _FLAGS[cell.lower()]),
    "correlated_with": (_is_correlations, "like { cams = 0.6 }, in a cell 'cams: 0.6; bores: -0.2'", _correlations),
    "fit": (_is_table, "like { with = 'bores', classes = 3 }, in a cell 'bores: 3' or 'bores: 3 opposite'", _fit),
    "parameters": (lambda v: _is_list(v) and v, 'a list, such as ["%(parameter)s"]', _parts),
    "indices": (_is_table, "a table; write indices = { %(index)s = 0 }", None),
    "samples": (_is_list, 'a list of measured values, such as ["%(size)s", "%(size)s"]', None),
    "bounds": (lambda v: _is_list(v) and len(v) == 2, 'two widths, the smaller first: ["%(size)s", "%(size)s"]', None),
}
_LENGTHS = ("size", "diameter", "module")
_CHECKED = ("key", "tolerance", "grade", *_LENGTHS, "mean")  # where they are used
_KEYS = (*_CHECKED, *_FIELDS, "cost")
#: What reads the cells of each column of a table.
_CELLS: Mapping[str, Callable[[str], Any]] = {
    **dict.fromkeys((*_CHECKED, "lower", "upper", "least", "largest", "curve", "at"), str),
    **{name: read for name, (_, _, read) in _FIELDS.items() if read},
    "parameter": _parts,
    **dict.fromkeys(("price", "base"), float),
    **dict.fromkeys(_INDICES, _index),
}

_CURVES: Mapping[str, type[Reciprocal | ReciprocalSquare]] = {
    "reciprocal": Reciprocal,
    "reciprocal_square": ReciprocalSquare,
}
#: Of each kind of cost its keys and an example.
_COSTS = {
    "curve": (_CURVE, 'cost = { curve = "reciprocal", price = 12.0, at = "%s", base = 3.0 }'),
    "grades": (("grades", *_LENGTHS), 'cost = { grades = { IT4 = 40.0, IT5 = 22.0 }, size = "32 mm" }'),
    "table": (("table",), 'cost = { table = [["%s", 30.0]] }'),
}


def load_tolerances(path: PathLike, model: Model | None = None) -> tuple[Tolerance, ...]:
    """Read a tolerance file.

    Parameters
    ----------
    path : str or path-like
        TOML; or a table, CSV or xlsx, with a row for each tolerance.
    model : Model, optional
        Whose tolerances they are: indices that it does not have are refused here.

    Returns
    -------
    tuple of Tolerance

    Raises
    ------
    InputError
        If the file cannot be used; one line that names file, line, key and remedy.

    Notes
    -----
    The keys of a ``[[tolerance]]`` table, and the columns of a table, stand in docs page ``theory/budget.md``.

    Examples
    --------
    >>> import tempfile
    >>> from pathlib import Path
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     file = Path(folder, "tolerances.toml")
    ...     size = file.write_text('[[tolerance]]\\nkey = "crank.eccentricity"\\ntolerance = "5 um"\\n')
    ...     load_tolerances(file)[0].width
    0.005
    """
    name = str(path)
    return _read(read_table(path) if is_table(name) else _parsed(name, read_text(path)), model)


def save_widths(
    source_path: PathLike,
    target_path: PathLike,
    widths: Sequence[float],
    *,
    grades: Sequence[str | None] | None = None,
    overwrite: bool = False,
) -> None:
    """Copy a tolerance file, comments and all, with other widths; what does not change stays as written.

    Parameters
    ----------
    source_path, target_path : str or path-like
        The same file only with `overwrite`.
    widths : sequence of float
        One for each entry, core units.  Written with four digits, rounded down, so that no error grows.
    grades : sequence of str or None, optional
        Grade of each entry; written where the entry has a grade and it fits the width.
    overwrite : bool, optional
        Whether an existing target may be replaced.

    Raises
    ------
    InputError
        If the source is no tolerance file, the numbers do not fit its entries, a width belongs to samples or stands
        where it cannot be replaced, or the target exists or cannot be written.

    Examples
    --------
    >>> import tempfile
    >>> from pathlib import Path
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     old, new = Path(folder, "tolerances.toml"), Path(folder, "finer.toml")
    ...     size = old.write_text('[[tolerance]]\\nkey = "crank.eccentricity"\\ntolerance = "5 um"  # drawing 12\\n')
    ...     save_widths(old, new, [0.004])
    ...     new.read_text().splitlines()[2]
    'tolerance = "4 um"  # drawing 12'
    """
    name = str(source_path)
    if is_table(name):
        raise InputError(f"{name}: widths are saved in a copy of a TOML file, not of a table; take them from --json")
    text = read_text(source_path)
    where = _parsed(name, text)
    before = _read(where, None)
    named = [None] * len(before) if grades is None else list(grades)
    if not len(before) == len(widths) == len(named):
        raise InputError(f"{name}: {len(widths)} widths for {len(before)} tolerances; give one for each")
    for item, width in zip(before, widths, strict=True):
        if not 0 < width < math.inf:
            raise InputError(f"{name}: width = {width:g} for {item.label}: must be above 0 and finite")
    lines = split_lines(text)
    for i, (item, width, grade) in enumerate(zip(before, widths, named, strict=True)):
        if not math.isclose(item.width, width, rel_tol=SAME_WIDTH):
            entry = _Entry(where, *where.tables("tolerance")[i])
            at, line = entry.changed(lines, item, width, grade)
            lines[at] = line
    changed = "\n".join(lines)
    after = _read(_parsed(name, changed), None)
    if any(not math.isclose(item.width, width, rel_tol=1e-3) for item, width in zip(after, widths, strict=True)):
        raise InputError(f"{name}: the new widths would not read back; write each tolerance = ... on a line of its own")
    write_file(target_path, changed.replace("\n", "\r\n") if "\r\n" in text else changed, overwrite=overwrite)


def _rounded_down(width: float, dimension: str) -> float:
    """Width of four digits in the unit in which people read it; as it is where it has no more."""
    shown_width = units.to_display(width, dimension)
    step = 10.0 ** (math.floor(math.log10(shown_width)) - 3)
    return math.floor(shown_width / step * (1 + SAME_WIDTH)) * step * width / shown_width


def _parsed(name: str, text: str) -> TomlText:
    if not text.strip():
        raise InputError(f"{name}: the file is empty; write '[[tolerance]]' and 'key = \"crank.eccentricity\"'")
    where = read_toml(name, text)
    where.check_keys((), where.content, ("name", "tolerance"), "top-level key")
    where.string((), where.content, "name")
    if not where.tables("tolerance"):
        where.refuse((), "no tolerance; write '[[tolerance]]' and 'key = \"crank.eccentricity\"'")
    return where


def _read(where: TomlText, model: Model | None) -> tuple[Tolerance, ...]:
    """Tolerances of a text or a table."""
    found = tuple(_Entry(where, place, table).read(model) for place, table in where.tables("tolerance"))
    with where.refusing(()):
        correlations(found)
        fits(found)
    return found


class _Entry:
    """Reader of one ``[[tolerance]]`` table."""

    def __init__(self, where: TomlText, place: KeyPath, table: Table) -> None:
        self.where, self.place, self.table = where, place, table
        self.source = source_of(where, place, table)
        where.check_keys(place, table, _KEYS, "key of [[tolerance]]")
        every, names = self.source.parameters, table.get("parameters", ())
        chosen = [p for p in every if _is_list(names) and p.name in names] or every  # others are refused with it
        self.dimension = chosen[0].dimension
        self.example = EXAMPLES[self.dimension]
        index = next((index.name for index in self.source.indices), "disc")
        examples = {"parameter": every[0].name, "index": index, "size": self.example}
        for name, (fits_kind, must, _) in _FIELDS.items():
            where.checked(place, table, name, fits_kind, must % examples)

    def refuse(self, name: str, message: str) -> NoReturn:
        """Refuse with the line of a key."""
        self.where.refuse((*self.place, name), message)

    def read(self, model: Model | None) -> Tolerance:
        """Make the tolerance, and see that its indices are those of the model."""
        table = self.table
        size, samples = self._size()
        # what a file says has a unit
        width = f"{size!r} {units.CORE_UNITS[self.dimension]}" if isinstance(size, float) else size
        given = {name: table[name] for name, (_, _, read) in _FIELDS.items() if read and name in table}
        with self.where.refusing(lambda said: (*self.place, self._blamed(said))):
            item = tolerance(
                self.source.key,
                width,
                samples=samples,
                mean=self._with_units("mean"),
                bounds=self._with_units("bounds"),
                cost=self._cost(),
                **given,
                **self._indices(),
            )
            if model is not None:
                item.instances(model.mechanism)
        return item

    def changed(self, lines: Sequence[str], item: Tolerance, width: float, grade: str | None) -> tuple[int, str]:
        """Place and content of the line that gives the entry another width."""
        given = next(name for name in _SIZES if name in self.table)
        if given == "samples":
            self.refuse(
                "samples", f"{self.source.key}: the width is that of the samples; write fixed = true to keep it"
            )
        at = self.where.lines.get((*self.place, given), 0) - 1
        found = _VALUE.match(lines[at]) if at >= 0 else None
        if found is None:
            self.refuse(given, f"{given} stands among other things; write it on a line of its own")
        if given == "grade" and grade is not None and self._is_width_of(grade, width):
            return at, f'{found[1]}grade = "{grade}"{found[2]}'
        return at, f'{found[1]}tolerance = "{self.written(item, width)}"{found[2]}'

    def written(self, item: Tolerance, width: float) -> str:
        """Another width as a text: with two limits where the table has two, the mean held."""
        unit = units.DISPLAY_UNITS[self.dimension]
        width = _rounded_down(width, self.dimension)
        if "tolerance" not in self.table or width_and_centre(self.table["tolerance"], self.dimension)[1] is None:
            return f"{units.to_display(width, self.dimension):.4g} {unit}"
        mean, middle = next(iter(item.mean.values())), item.distribution.middle
        upper, lower = (units.to_display(mean + (middle + side) * width, self.dimension) for side in (1, -1))
        return f"{upper:+.12g}/{lower:+.12g} {unit}"

    def _is_width_of(self, grade: str, width: float) -> bool:
        try:
            return math.isclose(self._grade(grade, self.table, ("grade",)), width, rel_tol=SAME_WIDTH)
        except InputError:  # a name of the user's own
            return False

    def _blamed(self, message: str) -> str:
        """Key whose line a refusal of the values gets: the one that it begins with."""
        name = message.removeprefix(f"{self.source.key}: ").partition(" ")[0].rstrip(":")
        if name == "tolerance" or any(name == parameter.name for parameter in self.source.parameters):
            name = next((size for size in _SIZES if size in self.table), "key")
        return name if name in self.table else "key"

    def _number(self, name: str, table: Mapping[str, Any], place: KeyPath) -> float:
        must = f"a bare number; write {name} = 1.0"
        return float(self.where.checked((*self.place, *place), table, name, is_number, must, 0.0))

    def _quantity(self, name: str, value: object) -> float:
        return self.where.quantity((*self.place, name), value, self.dimension, self.example)

    def _with_units(self, name: str) -> Any:
        """What a key says, refused where it has no unit."""
        value = self.table.get(name)
        for one in value.values() if isinstance(value, dict) else value if isinstance(value, list) else [value]:
            if not isinstance(one, str | None):
                self._quantity(name, one)
        return value

    def _indices(self) -> dict[str, Any]:
        known = [index.name for index in self.source.indices]
        value: dict[str, Any] = self.table.get("indices", {})
        for name, item in value.items():
            if name not in known:
                said = known_names("indices", known, name)
                self.refuse("indices", f"{self.source.key}: no index {shown(name)};{said}")
            items = item if isinstance(item, list) else [item]
            if not items or any(isinstance(i, bool) or not isinstance(i, (int, str)) for i in items):
                self.refuse("indices", f"{name} = {shown(item)}: must be a whole number, a name, or a list of them")
        return value

    def _size(self) -> tuple[Any, list[Any] | None]:
        """Width, or samples in its place."""
        given = [name for name in _SIZES if name in self.table]
        if len(given) != 1:
            problem = f"{' and '.join(given)} side by side" if given else "no tolerance"
            self.refuse(
                given[-1] if given else "key",
                f'{self.source.key}: {problem}; give one of tolerance = "{self.example}", grade with size, or samples',
            )
        if given == ["samples"]:
            return None, self._with_units("samples")
        if given == ["grade"]:
            return self._grade(self.where.string(self.place, self.table, "grade"), self.table, ("grade",)), None
        return self._with_units("tolerance"), None

    def _grade(self, grade: str, table: Mapping[str, Any], place: KeyPath) -> float:
        """What a grade leaves: half the width of ISO 286, or the limit of a toothing by ISO 1328."""
        at = (*self.place, *place)
        if self.dimension != "length":
            self.where.refuse(at, f"{self.source.key}: a grade is of a length, and this is none; give a tolerance")
        with self.where.refusing(at):
            number = class_of(grade)
        needed, other = _PARTS if number is None else _PARTS[::-1]
        what = "the size of the part" if number is None else "the gear's reference diameter and module"
        if missing := [name for name in needed if name not in table]:
            added = ", ".join(f'{name} = "{needed[name]}"' for name in missing)
            self.where.refuse(at, f"a grade needs {what}; add {added}")
        if beside := [name for name in other if name in table]:
            self.where.refuse(at, f"{beside[0]} beside the grade {grade!r}, which needs {what} alone; leave it out")
        sizes = {name: self.where.quantity((*at[:-1], name), table[name], "length", needed[name]) for name in needed}
        with self.where.refusing(at):
            if number is None:
                return it_width(grade, **sizes) / 2
            found = self._indices().get("harmonic", 1)
            waves = [h for h in (found if isinstance(found, list) else [found]) if isinstance(h, int)]
            return gear_limit(self.source.key, number, harmonics=waves, **sizes)

    def _cost(self) -> Cost | None:
        value = self.table.get("cost")
        if value is None:
            return None
        kinds = [kind for kind in _COSTS if isinstance(value, dict) and kind in value]
        if not isinstance(value, dict) or len(kinds) != 1:
            said = "several kinds of cost" if kinds else "no kind of cost"
            examples = " or ".join(map(self._cost_example, _COSTS))
            self.refuse("cost", f"cost = {shown(value)}: {said}; write {examples}")
        kind = kinds[0]
        self.where.check_keys((*self.place, "cost"), value, _COSTS[kind][0], f"key of a cost with {kind}")
        with self.where.refusing((*self.place, "cost"), "cost: "):
            return {"curve": self._curve, "grades": self._grades, "table": self._price_table}[kind](value)

    def _cost_example(self, kind: str) -> str:
        return _COSTS[kind][1].replace("%s", self.example)

    def _curve(self, value: Mapping[str, Any]) -> Cost:
        curve = value["curve"]
        if curve not in _CURVES:
            self.refuse("cost", f"no cost curve {shown(curve)}; the curves are {', '.join(_CURVES)}")
        for name in ("price", "at"):
            if name not in value:
                self.refuse("cost", f"the cost has no {name}; write {self._cost_example('curve')}")
        price = self._number("price", value, ("cost",))
        base = self._number("base", value, ("cost",))
        return _CURVES[curve](price=price, at=self._quantity("cost", value["at"]), base=base)

    def _grades(self, value: Mapping[str, Any]) -> Cost:
        prices = value["grades"]
        if not isinstance(prices, dict) or not prices:
            self.refuse("cost", f"grades = {shown(prices)}: must be a table; write {self._cost_example('grades')}")
        names = tuple(prices)
        widths = tuple(self._grade(name, value, ("cost",)) for name in names)
        return Grades(widths, tuple(self._number(name, prices, ("cost", "grades")) for name in names), names)

    def _price_table(self, value: Mapping[str, Any]) -> Cost:
        rows = value["table"]
        if not isinstance(rows, list) or not all(isinstance(row, list) and len(row) == 2 for row in rows):
            self.refuse("cost", f"table = {shown(rows)}: must be pairs; write {self._cost_example('table')}")
        widths = tuple(self._quantity("cost", row[0]) for row in rows)
        prices = tuple(self._number("price", {"price": row[1]}, ("cost",)) for row in rows)
        return Grades(widths, prices, tuple(str(row[0]) for row in rows))
