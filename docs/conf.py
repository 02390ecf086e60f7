"""Sphinx's settings for these pages: `python -m sphinx -W -b html docs build/site`.

Nothing is fetched to build the site, and nothing to look at it.
"""

from __future__ import annotations

import gc
import hashlib
import os
import sys
from pathlib import Path

import rverror

# a page in hand is millions of nodes and no garbage: looked for as often as by default, it takes a seventh of the time
gc.set_threshold(20_000)

HERE = Path(__file__).parent
sys.path.insert(0, str(HERE / "_ext"))
# the notebooks' kernels are processes of their own
os.environ["PYTHONPATH"] = os.pathsep.join([str(HERE / "_ext"), *filter(None, [os.environ.get("PYTHONPATH")])])

project = "rverror"
author = copyright = "The rverror developers"
version = release = rverror.__version__

extensions = ["myst_nb", "sphinx.ext.autodoc", "numpydoc", "site_pages", "cross_links"]
source_suffix = {".md": "myst-nb", ".nb.py": "myst-nb"}
exclude_patterns = ["_*"]

# Markdown
myst_enable_extensions = ["dollarmath"]
myst_heading_anchors = 4
html_math_renderer = "mathml"

# the reference
autodoc_member_order = "bysource"
autodoc_typehints = "signature"  # numpydoc's sections say what it does not
autodoc_default_options = {"no-value": True}
autodoc_preserve_defaults = True
numpydoc_show_class_members = False
toc_object_entries = False  # a thousand names beside every page
default_role = "py:obj"

# notebooks, run once for each state of the package
nb_custom_formats = {".nb.py": "site_pages.read_notebook"}
nb_execution_mode = "cache"
nb_execution_cache_path = str(
    HERE.parent
    / "build"
    / "notebooks"
    / hashlib.sha256(
        b"".join(path.read_bytes() for path in sorted(Path(rverror.__file__).parent.rglob("*.py")))
    ).hexdigest()[:16]
)
nb_execution_raise_on_error = True
nb_execution_timeout = 300
nb_merge_streams = True

html_theme = "furo"
html_title = f"rverror {release}"
html_static_path = ["_static"]
html_css_files = ["rverror.css"]
