"""What the site does beyond plain pages: formulas as MathML, pictures of the catalogue, the API's names, notebooks.

The pages are plain Markdown that also reads well where code is hosted.  A comment such as ``<!-- picture: NAME -->``
marks the place at which the site has more; Sphinx gets the page with that written out.
"""

from __future__ import annotations

import importlib
import inspect
import re
import shutil
from pathlib import Path
from types import GenericAlias
from typing import TYPE_CHECKING, Any

import catalogue_pictures
import catalogue_tables
import published_pictures
import speed_page
from docutils import nodes
from docutils.utils.math import latex2mathml
from numpydoc import docscrape_sphinx
from sphinx.domains.python import PythonDomain
from sphinx.pycode import ModuleAnalyzer, ast

import rverror

if TYPE_CHECKING:
    from nbformat import NotebookNode
    from sphinx.application import Sphinx
    from sphinx.domains.python import ObjectEntry
    from sphinx.environment import BuildEnvironment
    from sphinx.writers.html5 import HTML5Translator

DOCS = Path(__file__).parents[1]
EXAMPLES = DOCS.parent / "examples"
#: Ending of notebooks among the pages; a plain .py is a file to link to.
NOTEBOOK = ".nb.py"
#: Pages with pictures that the code draws.
WRITTEN = ("catalogue", "published", "theory/error-at-speed")
_FUNCTION = r"\\(?:(?:arc)?(?:sin|cos|tan)|sinh|cosh|cot|ln|operatorname\{\w+\})(?![a-zA-Z])"
# Sphinx 9.0 writes decorators out again, and fails at a dict with ** in it, as the options of commands are
ast._UnparseVisitor.visit_Dict = lambda visitor, node: "{...}"
_LONG = 45  # characters of a formula that may not fit into a line on a phone


# --- formulas ---------------------------------------------------------------------------------------------------------


def mathml(tex: str, *, block: bool) -> str:
    """Formula as MathML, which browsers show without script, by the converter that docutils brings.

    TeX takes one digit for each part of a fraction where the converter takes the whole number, sets functions off from
    their neighbours, writes an index beside a letter with an accent, not under it, stretches no bars and brackets, and
    draws a line over all of a mean.
    """
    tex = re.sub(r"(\\[dt]?frac)(\d)(\d)", r"\1{\2}{\3}", tex)
    tex = re.sub(rf"(?<=[\w}})])(\s*)({_FUNCTION})", r"\1\\,\2", tex)
    tex = re.sub(rf"({_FUNCTION}) *(?=\w|\\(?!bigl|Bigl|left)[a-zA-Z])", r"\1\\,", tex)
    tex = re.sub(r"(\\(?:d?dot|hat|bar|tilde) ?(?:\\[a-zA-Z]+|\w))(?=_)", r"\1{}", tex)
    written = latex2mathml.tex2mathml(tex, as_block=block)
    written = written.replace('<mover accent="false">', '<mrow class="mean">')
    written = re.sub(r'<mo accent="true">_</mo>\s*</mover>', "</mrow>", written)
    written = re.sub(r'<mo(?: class="math(?:open|close)")?>([⟨⟩‖])</mo>', r'<mo stretchy="false">\1</mo>', written)
    written = written.replace('<mo class="mathopen">|</mo>', '<mo stretchy="false" form="prefix">|</mo>')
    return re.sub(r'<mo(?: class="mathclose")?>\|</mo>', '<mo stretchy="false" form="postfix">|</mo>', written)


def visit_math(writer: HTML5Translator, node: nodes.math) -> None:
    """Write an inline formula."""
    tex = node.astext()
    written = mathml(tex, block=False)
    writer.body.append(f'<span class="long">{written}</span>' if len(tex) > _LONG else written)
    raise nodes.SkipNode


def visit_displaymath(writer: HTML5Translator, node: nodes.math_block) -> None:
    """Write a formula that stands by itself; one that is too wide scrolls alone."""
    writer.body.append(writer.starttag(node, "div", CLASS="formula"))
    writer.body.append(mathml(node.astext(), block=True) + "</div>\n")
    raise nodes.SkipNode


# --- pages that are written from the code -----------------------------------------------------------------------------


def catalogue() -> str:
    """The catalogue page with the pictures of every source."""
    page = catalogue_tables.catalogue_markdown(lambda entry: raw(catalogue_pictures.figures(entry)))
    head, rest = page.split("\n", 1)
    return f"{head}\n\n{raw(catalogue_pictures.symbol())}\n{rest}"


def raw(html: str) -> str:
    """HTML as a block of a Markdown page."""
    return f"```{{raw}} html\n{html}\n```\n"


def picture(name: str) -> str:
    """A picture that a page asks for by its name, as a piece of HTML."""
    return (published_pictures if name in published_pictures.SWEEPS else speed_page).picture(name)


def modules() -> list[str]:
    """Every module by its full name, a room before what is in it."""
    package = Path(rverror.__file__).parent
    names = [".".join(path.relative_to(package.parent).with_suffix("").parts) for path in package.rglob("[!_]*.py")]
    names += [".".join(path.parent.relative_to(package.parent).parts) for path in package.rglob("__init__.py")]
    return sorted(names)


def modules_of(room: str) -> str:
    """Reference of a room and of all modules in it."""
    parts = []
    for name in modules():
        if f"{name}.".startswith(f"rverror.{room}."):
            members = ", ".join(own_names(name))
            option = f"\n   :members: {members}" if members else ""
            parts.append(f"## {name}\n\n```{{eval-rst}}\n.. automodule:: {name}{option}\n```\n")
    return "\n".join(parts)


def own_names(module: str) -> list[str]:
    """Public names that a module defines and describes, in the order of its text."""
    loaded, told = importlib.import_module(module), ModuleAnalyzer.for_module(module)
    told.analyze()
    described = {name for owner, name in told.find_attr_docs() if not owner}
    mine = {
        name
        for name, thing in vars(loaded).items()
        # unwrapped: a cached function is no function to `inspect`
        if (inspect.isclass(thing) or inspect.isfunction(inspect.unwrap(thing)))
        and getattr(thing, "__module__", "") == module
    }
    aliases = {name for name, thing in vars(loaded).items() if isinstance(thing, GenericAlias)}
    public = [name for name in (mine | described) - aliases if not name.startswith("_")]
    return sorted(public, key=lambda name: told.tagorder.get(name, 0))


def formulas_as_they_stand(app: Sphinx, kind: str, name: str, thing: Any, options: Any, lines: list[str]) -> None:
    """Keep formulas of docstrings, set off by four spaces, from being read as markup."""
    section, written = "", []
    for at, line in enumerate(lines):
        if set(line.strip()) == {"-"} and at:
            section = lines[at - 1].strip()
        before = next((text for text in reversed(lines[:at]) if text.strip()), "")
        set_off = len(line) - len(line.lstrip()) >= len(before) - len(before.lstrip()) + 4
        free = section in ("", "Notes") and at > 0 and not lines[at - 1].strip()
        if line.strip() and set_off and free and not before.lstrip().startswith(("- ", ">>>", "..")):
            indent = " " * (len(before) - len(before.lstrip()))
            written += [f"{indent}::", ""]
        written.append(line)
    lines[:] = written


def short_types(
    app: Sphinx, kind: str, name: str, thing: Any, options: Any, signature: str | None, returns: str | None
) -> tuple[str | None, str | None]:
    """Say types in signatures without their modules, and arrays as short as the code does."""

    def short(text: str) -> str:
        bare = re.sub(r"~(?:\w+\.)*(\w+)", r"\1", text)
        return re.sub(r"ndarray\[tuple\[Any, \.\.\.\], dtype\[(\w+)\]\]", r"NDArray[\1]", bare)

    return signature and short(signature), returns and short(returns)


def public_names(package: str) -> str:
    """Table of the names that a package gives, each with a link and its first sentence."""
    lines = ["| name | |", "| --- | --- |"]
    for name in dir(importlib.import_module(package)):
        if name.startswith("__"):
            continue
        full, sentence = described(package, name)
        if full != f"rverror.{name}":  # no room: the page lists those with their purposes
            lines.append(f"| {{py:obj}}`{package}.{name} <{full}>` | {sentence} |")
    return "\n".join(lines)


def described(package: str, name: str) -> tuple[str, str]:
    """Full name under which a public name is described, and the first sentence of what is said of it."""
    thing = getattr(importlib.import_module(package), name)
    if inspect.ismodule(thing):
        return thing.__name__, (inspect.getdoc(thing) or "").partition("\n")[0].removesuffix(".")
    if inspect.isclass(thing) or inspect.isfunction(thing):
        text = (inspect.getdoc(thing) or "").replace("\n", " ")
        return f"{thing.__module__}.{name}", re.split(r"\.(?:\s|$)", text, maxsplit=1)[0].replace("`", "")
    for module in modules():  # a constant
        said = ModuleAnalyzer.for_module(module).find_attr_docs().get(("", name))
        if said and getattr(importlib.import_module(module), name) is thing:
            return f"{module}.{name}", said[0].removesuffix(".")
    raise LookupError(f"{package}.{name}: no `#:` comment says what it is")


def write_out(app: Sphinx, docname: str, source: list[str]) -> None:
    """Give Sphinx the page with what only the site has."""
    text = catalogue() if docname == "catalogue" else source[0]
    text = re.sub(r"<!-- modules: (.+) -->", lambda found: modules_of(found[1]), text)
    text = re.sub(r"<!-- public names: (.+) -->", lambda found: public_names(found[1]), text)
    text = re.sub(r"<!-- picture: (.+) -->", lambda found: raw(picture(found[1])), text)
    # notebooks are pages here; other examples are files
    text = re.sub(r"\]\(((?:\.\./)*)\.\./examples/notebooks/([\w-]+)\.py\)", rf"](\1notebooks/\2{NOTEBOOK})", text)
    text = re.sub(r"\]\(((?:\.\./)+(?:examples/[\w-]+\.ipynb|[A-Z]+\.md))\)", r"](<path:\1>)", text)
    if docname.startswith("notebooks/"):
        text = re.sub(r"\]\(([\w-]+)\.py\)", rf"](\1{NOTEBOOK})", text)
    source[0] = text


def always_new(app: Sphinx, env: BuildEnvironment, *changes: Any) -> list[str]:
    """Pages that depend on the code, so on more than their own text."""
    return [name for name in env.found_docs if name in WRITTEN or name.startswith("api/")]


# --- time -------------------------------------------------------------------------------------------------------------


class Names(PythonDomain):
    """Sphinx's names of Python, which looks through all of them for each type in each signature: here once for each."""

    def find_obj(
        self, env: BuildEnvironment, modname: str, classname: str, name: str, type: str | None, searchmode: int = 0
    ) -> list[tuple[str, ObjectEntry]]:
        """As Sphinx finds it."""
        known = self.__dict__.setdefault("known", {})
        bare = name.removesuffix("()")
        if self.objects.keys().isdisjoint(
            {bare, *(f"{place}.{bare}" for place in (modname, classname, f"{modname}.{classname}"))}
        ):
            modname = classname = ""  # found by its ending or not at all, wherever it is asked for
        asked = (modname, classname, name, type, searchmode, len(self.objects))
        if asked not in known:
            known[asked] = super().find_obj(env, modname, classname, name, type, searchmode)
        return list(known[asked])


def one_template() -> None:
    """Let numpydoc make its template once, not anew for each of thousands of docstrings."""
    made = docscrape_sphinx.SandboxedEnvironment
    kept: list[Any] = []

    def environment(loader: Any) -> Any:
        if not kept:
            kept.append(made(loader=loader))
        return kept[0]

    docscrape_sphinx.SandboxedEnvironment = environment


# --- notebooks --------------------------------------------------------------------------------------------------------


def copy_notebooks(app: Sphinx) -> None:
    """Put the notebooks of ``examples/notebooks`` among the pages; one that is gone there goes here too."""
    folder = DOCS / "notebooks"
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir()
    for path in sorted((EXAMPLES / "notebooks").glob("*.py")):
        shutil.copy2(path, folder / (path.stem + NOTEBOOK))


def read_notebook(text: str) -> NotebookNode:
    """Notebook in percent format, to be run in the folder that it comes from."""
    import jupytext
    from nbformat.v4 import new_code_cell

    notebook = jupytext.reads(text, fmt="py:percent")
    there = new_code_cell("%cd -q ../../examples/notebooks", id="where", metadata={"tags": ["remove-cell"]})
    notebook.cells.insert(0, there)
    return notebook


def setup(app: Sphinx) -> dict[str, Any]:
    """Tell Sphinx."""
    one_template()
    app.add_domain(Names, override=True)
    app.add_html_math_renderer("mathml", (visit_math, None), (visit_displaymath, None))
    app.connect("builder-inited", copy_notebooks)
    app.connect("env-get-outdated", always_new)
    app.connect("autodoc-process-docstring", formulas_as_they_stand, priority=400)  # before numpydoc
    app.connect("autodoc-process-signature", short_types)
    app.connect("source-read", write_out)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
