"""docs/bibliography.md has every text that the package cites by number, and says where it is cited."""

from __future__ import annotations

import ast
import re
from collections import defaultdict

import rverror
from modules import TREES
from pages import DOCS, text

#: Number of a source: no part of a name, such as RV-003, and no end of a number.
CITED = re.compile(r"(?<![\w.,-])00\d(?!\w)")
SECTIONS = dict(re.findall(r"^## (\d{3})\n(.*?)(?=^## |\Z)", text(DOCS / "bibliography.md"), re.MULTILINE | re.DOTALL))


def citing() -> dict[str, set[str]]:
    """Files that cite a source: in a docstring, or as the reference of an entry in the catalogue."""
    found: dict[str, set[str]] = defaultdict(set)
    for module, tree in TREES.items():
        for node in ast.walk(tree):
            if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef):
                for number in CITED.findall(ast.get_docstring(node) or ""):
                    found[number].add(module)
    for entry in rverror.CATALOGUE.values():
        for number in CITED.findall(entry.reference):
            found[number].add(entry.vector.__module__)
    return {
        number: {module.removeprefix("rverror.").replace(".", "/") + ".py" for module in modules}
        for number, modules in found.items()
    }


def test_numbers_are_told_from_names_and_amounts() -> None:
    assert CITED.findall("Sources 000 and 001; 003's RV-003, 0.002, 1,004, order 1000") == ["000", "001", "003"]


def test_every_source_that_is_cited_is_in_the_bibliography_with_who_cites_it() -> None:
    cited = citing()
    assert set(cited) == set(SECTIONS)
    for number, told in SECTIONS.items():
        listed = re.findall(r"`([\w/]+\.py)`", told.partition("- Cited in")[2])
        assert sorted(listed) == sorted(cited[number]), number


def test_every_source_says_what_it_is_what_is_used_and_what_is_wrong() -> None:
    for told in SECTIONS.values():
        assert all(part in told for part in ("\n- Used: ", "\n- Wrong there: ", "\n- Cited in "))
