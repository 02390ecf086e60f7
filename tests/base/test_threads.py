"""Threads: a diagnosis from the shell takes one, whatever else is started is left alone."""

from __future__ import annotations

import pytest

from rverror.base.threads import THREADS, one_for_a_diagnosis


@pytest.mark.parametrize(
    "arguments",
    [
        ["python", "/home/me/.venv/bin/rverror", "diagnose", "model.toml"],
        ["python.exe", "C:/me/Scripts/rverror.exe", "diagnose"],
        ["python", "-m", "rverror", "diagnose", "model.toml"],
        ["python", "/usr/bin/rverror", "demo"],
    ],
)
def test_a_diagnosis_from_the_shell_takes_one(arguments: list[str]) -> None:
    environment = {"HOME": "/home/me"}
    one_for_a_diagnosis(environment, arguments, ["sys"])
    assert environment == {"HOME": "/home/me", **dict.fromkeys(THREADS, "1")}


@pytest.mark.parametrize(
    ("arguments", "environment", "loaded"),
    [
        (["python", "/bin/rverror", "diagnose"], {"OMP_NUM_THREADS": "4"}, []),
        (["python", "/bin/rverror", "diagnose"], {}, ["numpy"]),
        (["python", "/bin/rverror", "allocate", "diagnose"], {}, []),
        (["python", "/bin/rverror"], {}, []),
        (["python", "mine.py", "diagnose"], {}, []),
        (["python", "-m", "ipykernel_launcher"], {}, []),
        (["python"], {}, []),
        ([], {}, []),
    ],
)
def test_whoever_says_so_or_asks_for_something_else_is_left_alone(
    arguments: list[str], environment: dict[str, str], loaded: list[str]
) -> None:
    before = dict(environment)
    one_for_a_diagnosis(environment, arguments, loaded)
    assert environment == before
