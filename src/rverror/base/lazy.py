"""Public names of a package, each loaded with its module when it is first asked for (PEP 562).

A package lists its names once, as imports under ``if TYPE_CHECKING`` in its ``__init__.py``: type checkers and editors
follow them there, and what is loaded late is read from the same lines.
"""

from __future__ import annotations

import ast
import functools
import pkgutil
import sys
from collections.abc import Callable, Mapping
from importlib import import_module
from typing import Any

from rverror.base.errors import warn_former


@functools.cache
def places(package: str) -> Mapping[str, tuple[str, str]]:
    """Where each public name of a package is defined.

    Parameters
    ----------
    package : str
        Full name of the package.

    Returns
    -------
    mapping of str to (str, str)
        By public name: the module, and the name there.  What the package imports from itself is a module of it.
    """
    return {
        alias.asname or alias.name: (node.module or "", alias.name)
        for block in ast.parse(pkgutil.get_data(package, "__init__.py") or b"").body
        if isinstance(block, ast.If) and ast.unparse(block.test) == "TYPE_CHECKING"
        for node in block.body
        if isinstance(node, ast.ImportFrom)
        for alias in node.names
    }


def modules(package: str) -> list[str]:
    """Public names of a package that are modules of it.

    Parameters
    ----------
    package : str
        Its full name.

    Returns
    -------
    list of str
    """
    return [name for name, (module, _) in places(package).items() if module == package]


def found(package: str, name: str, *, renamed: Mapping[str, str] | None = None) -> Any:
    """Load what a public name of a package stands for, or a former name of it.

    Parameters
    ----------
    package : str
        Full name of the package.
    name : str
        The name, or ``__all__``: the names of all that is no module, sorted.
    renamed : mapping of str to str, optional
        Of a package that has former names, by former name what stands in its place, from the package on.  Names of its
        modules are former names too.

    Returns
    -------
    object

    Raises
    ------
    AttributeError
        If there is no such name, and was none.

    Warns
    -----
    DeprecationWarning
        If the name is a former one.
    """
    if name == "__all__":
        return sorted(set(places(package)) - set(modules(package)))
    if name in places(package):
        module, own = places(package)[name]
        return import_module(f"{package}.{own}") if module == package else getattr(import_module(module), own)
    if renamed is not None and not name.startswith("_"):
        homes = (module for module in modules(package) if name in places(f"{package}.{module}"))
        if now := renamed.get(name) or next((f"{module}.{name}" for module in homes), None):
            warn_former(f"{package}.{name}", f"{package}.{now}")
            return functools.reduce(getattr, now.split("."), sys.modules[package])
    raise AttributeError(f"module {package!r} has no attribute {name!r}", name=name, obj=sys.modules[package])


def attach(
    package: str, renamed: Mapping[str, str] | None = None
) -> tuple[Callable[[str], Any], Callable[[], list[str]]]:
    """Make a package's ``__getattr__`` and ``__dir__``.

    Parameters
    ----------
    package : str
        Its full name, ``__name__``.
    renamed : mapping of str to str, optional
        As for `found`.

    Returns
    -------
    get : callable
        ``__getattr__``.
    names : callable
        ``__dir__``: every public name, those of modules too.
    """
    return functools.partial(found, package, renamed=renamed), lambda: sorted(places(package))
