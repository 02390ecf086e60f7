"""Errors that users of files and of the command line see."""

from __future__ import annotations


class InputError(ValueError):
    """Input that cannot be used, in one line: what, where, the bound, the remedy."""
