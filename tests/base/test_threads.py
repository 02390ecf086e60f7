"""Threads: a diagnosis from the shell takes one for BLAS; work on several is done once, in order, whole."""

from __future__ import annotations

import threading
from dataclasses import replace

import pytest

from rverror.base.threads import BLAS_THREADS, at_most, cores, each, each_part, one_for_a_diagnosis, threads
from rverror.model.catalogue import extended, source


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
    assert environment == {"HOME": "/home/me", **dict.fromkeys(BLAS_THREADS, "1")}


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


def test_as_many_threads_as_are_asked_for_or_as_there_are_cores(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("NUMBA_NUM_THREADS", raising=False)
    assert threads() == min(cores(), 16)
    for said, count in (("3", 3), ("1", 1), ("0", min(cores(), 16)), ("many", min(cores(), 16)), ("400", 16)):
        monkeypatch.setenv("NUMBA_NUM_THREADS", said)
        assert threads() == count


def test_results_are_in_order_and_a_thread_starts_no_others(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("NUMBA_NUM_THREADS", "3")
    both = threading.Barrier(3, timeout=20)  # three at once, or it breaks

    def work(item: int) -> tuple[int, int, list[int]]:
        both.wait()
        return item, threads(), each(lambda one: one + item, [1, 2])

    assert each(work, [5, 6, 7]) == [(item, 1, [item + 1, item + 2]) for item in (5, 6, 7)]


def test_no_more_threads_than_a_block_allows(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("NUMBA_NUM_THREADS", "8")
    with at_most(3):
        assert threads() == 3
        with at_most(5):  # not more than those around it
            assert threads() == 3
        with at_most(1):
            assert threads() == 1
    assert threads() == 8


def test_what_is_set_where_threads_begin_holds_on_them(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("NUMBA_NUM_THREADS", "2")
    mine = replace(source("sensor.encoder_eccentricity"), key="sensor.of_my_own")
    with extended(mine):
        assert each(source, [mine.key] * 4) == [mine] * 4


@pytest.mark.parametrize("size", [0, 1, 7, 64, 65, 500])
@pytest.mark.parametrize("count", ["1", "2", "5"])
def test_parts_are_whole_blocks_that_make_up_the_range(monkeypatch: pytest.MonkeyPatch, size: int, count: str) -> None:
    monkeypatch.setenv("NUMBA_NUM_THREADS", count)
    parts: list[slice] = []
    each_part(parts.append, size, 8)
    parts.sort(key=lambda part: part.start)
    assert [at for part in parts for at in range(part.start, part.stop)] == list(range(size))
    assert all(part.start % 8 == 0 for part in parts)
    assert len(parts) <= int(count)


def test_what_fails_on_a_thread_is_raised(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("NUMBA_NUM_THREADS", "2")
    with pytest.raises(ZeroDivisionError):
        each(lambda item: 1 / item, [1, 0, 2])
