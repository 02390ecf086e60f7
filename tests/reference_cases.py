"""The reference cases, solved once on a coarse turn, and their files, for the tests of cases and of comparison."""

from __future__ import annotations

import argparse
import functools
import math

import numpy as np

from rverror.app import reference_commands as cli_reference
from rverror.app.terminal import add_commands
from rverror.base.units import ARCSEC
from rverror.reference.cases import definitions, solve

CASES = {case.name: case for case in definitions()}


TURN = 2 * math.pi


@functools.cache
def solved_cases():
    """Every case, on a coarser turn; once for all test files of a process."""
    return {name: solve(case, points=512) for name, case in CASES.items()}


def write(path, files):
    path.mkdir(exist_ok=True)
    for name, content in files.items():
        (path / name).write_bytes(content)


def wave(theta, *lines):
    """Sum of amplitude * cos(order * theta - phase), arcsec."""
    return ARCSEC * sum(size * np.cos(order * theta - phase) for order, size, phase in lines)


def command(*words):
    parser = argparse.ArgumentParser()
    add_commands(parser.add_subparsers(required=True), cli_reference)
    options = parser.parse_args([str(word) for word in words])
    options.run(options)
