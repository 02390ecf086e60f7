"""Work in copies of a process: the same results, in order, whatever becomes of a copy, and nothing left behind."""

from __future__ import annotations

import os
import subprocess
import sys
import threading
import time

import pytest

from rverror.base.side_by_side import each

#: A test process has threads of its own, so what copies do is tried in a fresh one.
HEAD = "import os, time\nfrom rverror.base.side_by_side import each\nhere = os.getpid()\n"
linux = pytest.mark.skipif(sys.platform != "linux", reason="processes are copied on Linux alone")


def printed(body: str) -> list[str]:
    done = subprocess.run([sys.executable, "-c", HEAD + body], capture_output=True, text=True, timeout=60, check=False)
    assert done.stderr == ""
    return done.stdout.splitlines()


@linux
def test_results_are_in_order_and_come_from_several_processes() -> None:
    body = """
def work(item):
    time.sleep(0.02)
    return item**2, os.getpid()

found = each(work, range(40), jobs=3)
print([square for square, _ in found] == [item**2 for item in range(40)])
print(len({process for _, process in found}), here in {process for _, process in found})
try:
    os.waitpid(-1, 0)
except ChildProcessError:
    print("none left")
"""
    assert printed(body) == ["True", "3 True", "none left"]


@linux
def test_what_is_shared_comes_back_as_itself() -> None:
    body = """
bench, other = {"large": [0] * 10}, ["mine"]
found = each(lambda item: (time.sleep(0.02), bench, other, item)[1:], range(6), jobs=2, shared=[bench])
print(all(one is bench for one, _, _ in found))
print({tuple(two) for _, two, _ in found}, all(two is other for _, two, _ in found))
"""
    assert printed(body) == ["True", "{('mine',)} False"]


@linux
@pytest.mark.parametrize("end", ["os._exit(1)", "os.kill(os.getpid(), 9)", "raise ValueError", "return lambda: 0"])
def test_what_a_copy_does_not_send_is_done_here(end: str) -> None:
    body = f"""
def work(item):
    time.sleep(0.02)
    if os.getpid() != here:
        {end}
    return item

print(each(work, list("abcdef"), jobs=2))
"""
    assert printed(body) == [str(list("abcdef"))]


@linux
def test_where_no_copy_can_be_made_all_is_done_here() -> None:
    body = """
def refused():
    raise BlockingIOError

os.fork = refused
print(each(lambda item: (item, os.getpid() == here), [1, 2, 3], jobs=2))
"""
    assert printed(body) == ["[(1, True), (2, True), (3, True)]"]


@linux
def test_an_error_is_raised_as_by_one_process_and_ends_the_copies() -> None:
    body = """
def work(item):
    time.sleep(0.02 if item < 4 else 30)
    if item == 1:
        raise ValueError("item 1 has no answer")
    return item

began = time.monotonic()
try:
    each(work, [1, 1, 1, 1, 4], jobs=2)
except ValueError as error:
    print(error, time.monotonic() - began < 10)
try:
    os.waitpid(-1, 0)
except ChildProcessError:
    print("none left")
"""
    assert printed(body) == ["item 1 has no answer True", "none left"]


@pytest.mark.parametrize("jobs", [1, 2])
def test_a_process_of_several_threads_is_not_copied(jobs: int) -> None:
    done = threading.Event()
    other = threading.Thread(target=done.wait)
    other.start()

    def work(item: int) -> tuple[int, int]:
        time.sleep(0.05)  # a copy would come to its turn
        return item, os.getpid()

    try:
        assert each(work, range(5), jobs=jobs) == [(item, os.getpid()) for item in range(5)]
    finally:
        done.set()
        other.join()


@pytest.mark.parametrize("items", [[], [3]])
def test_nothing_and_one_item(items: list[int]) -> None:
    assert each(lambda item: item + 1, items, jobs=4) == [item + 1 for item in items]
