"""Errors that users of files and of the command line see."""

from __future__ import annotations

import functools
import warnings
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import Any, ParamSpec, TypeVar, cast

P = ParamSpec("P")
R = TypeVar("R")

#: Version in which former names and forms that still work come to their end.
FORMER_UNTIL = "2.0.0"


class InputError(ValueError):
    """Input that cannot be used, in one line: what, where, the bound, the remedy."""


@contextmanager
def refusing(before: str, after: str = "") -> Iterator[None]:
    """Refuse by an `InputError` what is refused inside by a ValueError.

    Parameters
    ----------
    before, after : str
        Said around its message.

    Raises
    ------
    InputError

    Examples
    --------
    >>> with refusing("run.csv: ", "; correct it"):
    ...     float("x")
    Traceback (most recent call last):
    rverror.base.errors.InputError: run.csv: could not convert string to float: 'x'; correct it
    """
    try:
        yield
    except ValueError as problem:
        raise InputError(f"{before}{problem}{after}") from problem


@contextmanager
def needing(what: str, extra: str, otherwise: str = "") -> Iterator[None]:
    """Refuse what needs a library that cannot be imported inside.

    Parameters
    ----------
    what : str
        Needs which library, for the message.
    extra : str
        Of rverror, with which that is installed.
    otherwise : str
        What may be done instead.

    Raises
    ------
    InputError
    """
    try:
        yield
    except ImportError as error:
        raise InputError(f"{what}; install it with: pip install 'rverror[{extra}]'{otherwise}") from error


def warn_former(former: str, now: str) -> None:
    """Warn the caller of a function of a former name or form of a call, which still works.

    Parameters
    ----------
    former, now : str
        As users write it, and as they shall.

    Warns
    -----
    DeprecationWarning
    """
    text = f"{former} is {now} now; write that: the old form ends with version {FORMER_UNTIL}"
    warnings.warn(text, DeprecationWarning, stacklevel=3)


def former_name(former: str, now: str) -> Any:
    """Property of a class that has an attribute under its former name, with a warning.

    Parameters
    ----------
    former, now : str
        Names of the attribute.
    """

    def read(thing: object) -> Any:
        kind = type(thing).__name__
        warn_former(f"{kind}.{former}", f"{kind}.{now}")
        return getattr(thing, now)

    return property(read, doc=f"Former name of `{now}`.")


def renamed(**now: str) -> Callable[[Callable[P, R]], Callable[P, R]]:
    """Let a function take former names of its arguments, each with a warning.

    Parameters
    ----------
    **now : str
        By former name the name of the argument now.

    Returns
    -------
    callable
        The decorator.

    Examples
    --------
    >>> @renamed(speed="input_speed")
    ... def turns(*, input_speed):
    ...     return input_speed
    >>> turns(input_speed=2.0)
    2.0
    """

    def decorate(function: Callable[P, R]) -> Callable[P, R]:
        @functools.wraps(function)
        def with_former(*args: P.args, **kwargs: P.kwargs) -> R:
            for name in kwargs.keys() & now.keys():
                warn_former(f"{function.__name__}(..., {name}=)", f"{function.__name__}(..., {now[name]}=)")
                if now[name] in kwargs:
                    raise InputError(f"{name} and {now[name]} are the same; give {now[name]}")
                kwargs[now[name]] = kwargs.pop(name)
            return function(*args, **kwargs)

        return with_former

    return decorate


def check_kind(name: str, value: object, kind: type | tuple[type, ...], remedy: str) -> None:
    """Refuse an argument of another kind, in one line that says what to give.

    Parameters
    ----------
    name : str
        Of the argument.
    value : object
    kind : type or tuple of type
        What it must be.
    remedy : str

    Raises
    ------
    InputError

    Examples
    --------
    >>> check_kind("model", 3.0, str, "give a name")
    Traceback (most recent call last):
    rverror.base.errors.InputError: model is a float, not a str; give a name
    """
    if not isinstance(value, kind):
        wanted = " or ".join(one.__name__ for one in (kind if isinstance(kind, tuple) else (kind,)))
        raise InputError(f"{name} is {_a(value)}, not {_with_article(wanted)}; {remedy}")


def check_each(name: str, values: object, kind: type | tuple[type, ...], remedy: str) -> None:
    """Refuse what is no row of things of a kind, as `check_kind` does each of them.

    Raises
    ------
    InputError

    Examples
    --------
    >>> check_each("runs", [1.0], str, "give a list of names")
    Traceback (most recent call last):
    rverror.base.errors.InputError: runs: one is a float, not a str; give a list of names
    """
    if isinstance(values, str) or not isinstance(values, Sequence):
        raise InputError(f"{name} is {_a(values)}, not a list; {remedy}")
    for item in cast("Sequence[object]", values):
        check_kind(f"{name}: one", item, kind, remedy)


def _a(value: object) -> str:
    return "None" if value is None else _with_article(type(value).__name__)


def _with_article(noun: str) -> str:
    return f"{'an' if noun[0] in 'AEIOaeio' else 'a'} {noun}"
