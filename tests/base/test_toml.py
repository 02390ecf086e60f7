"""TOML texts: the line of every place, and refusals that name it."""

from __future__ import annotations

import tomllib

import pytest
from hypothesis import given, strategies as st

from rverror.base.errors import InputError
from rverror.base.toml import EXAMPLES, KeyPath, read_toml
from rverror.base.units import parse

TEXT = """\
# remark = 1
name = "x"
note = '''
  other = 3
'''

[drive]  # [other]
"two words" . inner = 1
  'a=b' = "c = d"

[[part]]
size = 1

  [part.box]
  deep.er = 2

[[part]]
size = 2
  [[part.hole]]
  depth = 3
"""


def test_lines_of_places() -> None:
    assert read_toml("x.toml", TEXT).lines == {
        ("name",): 2,
        ("note",): 3,
        ("drive",): 7,
        ("drive", "two words"): 8,
        ("drive", "two words", "inner"): 8,
        ("drive", "a=b"): 9,
        ("part",): 11,
        ("part", 0): 11,
        ("part", 0, "size"): 12,
        ("part", 0, "box"): 14,
        ("part", 0, "box", "deep"): 15,
        ("part", 0, "box", "deep", "er"): 15,
        ("part", 1): 17,
        ("part", 1, "size"): 18,
        ("part", 1, "hole"): 19,
        ("part", 1, "hole", 0): 19,
        ("part", 1, "hole", 0, "depth"): 20,
    }


@pytest.mark.parametrize(
    "value",
    ["[\n  [1, 2],\n  [3, 4]\n]", "[\n  { a = 1 },\n]  # [b]", "'''\n[b]\n'''", '"""\n]\n\'\'\'\n"""'],
)
def test_values_over_several_lines_hold_no_table(value: str) -> None:
    toml = read_toml("x.toml", f'[drive]\nsizes = {value}\n"a \\"b\\"" = 1\n')
    after = 3 + value.count("\n")
    assert toml.lines == {("drive",): 1, ("drive", "sizes"): 2, ("drive", 'a "b"'): after}


def test_every_place_with_a_line_is_in_the_content() -> None:
    toml = read_toml("x.toml", TEXT)
    for place in toml.lines:
        item: object = toml.content
        for key in place:
            item = item[key]  # type: ignore[index]


NAMES = st.text(st.characters(codec="utf-8", exclude_categories=["Cc"], exclude_characters="'"), max_size=20)


@given(st.lists(st.tuples(NAMES, st.integers(0, 3), st.text(" \t", max_size=20)), unique_by=lambda item: item[0]))
def test_line_of_any_key(keys: list[tuple[str, int, str]]) -> None:
    text, expected, number = "", {}, 0
    for name, blank, indent in keys:
        text += "\n" * blank + f"{indent}'{name}'{indent}= 'a = b'\n"
        number += blank + 1
        expected[(name,)] = number
    toml = read_toml("x.toml", text)
    assert toml.lines == expected
    assert toml.content == tomllib.loads(text)


@pytest.mark.parametrize(
    ("place", "said"),
    [
        (("part", 1, "size"), "x.toml, line 18: no"),
        (("part", 1, "missing", "deeper"), "x.toml, line 17: no"),
        (("missing",), "x.toml: no"),
        ((), "x.toml: no"),
    ],
)
def test_refusal_names_the_line_of_the_nearest_place(place: KeyPath, said: str) -> None:
    with pytest.raises(InputError) as caught:
        read_toml("x.toml", TEXT).refuse(place, "no")
    assert str(caught.value) == said


@pytest.mark.parametrize(
    ("line", "said"),
    [
        ("size = 5 um", 'write size = "5 um", with quotes'),
        ("size = -1.5e-3mm  # drawing", 'write size = "-1.5e-3mm", with quotes'),
        ("size = 412 N*m", 'write size = "412 N*m", with quotes'),
        ("size = 5 um 6 um", "correct this line"),
        ("size = um", "correct this line"),
    ],
)
def test_syntax_error_names_line_and_remedy(line: str, said: str) -> None:
    with pytest.raises(InputError, match=r"^x\.toml, line 2, column \d+: no valid TOML: ") as caught:
        read_toml("x.toml", f"name = 1\n{line}\n")
    assert str(caught.value).endswith(f"; {said}")


@pytest.mark.parametrize("dimension", EXAMPLES)
def test_examples_are_of_their_dimension(dimension: str) -> None:
    assert read_toml("x.toml", "").quantity(("size",), EXAMPLES[dimension], dimension, "") == parse(
        EXAMPLES[dimension], dimension
    )
