"""Settings of the site: ``sphinx-build -W -n -b html docs build/docs``."""

from __future__ import annotations

import sys
from importlib.metadata import version as version_of
from pathlib import Path

HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(HERE / "extensions"), str(HERE.parent)]

project = "excite"
author = "The excite developers"
release = version = version_of("excite-trajectories")

extensions = [
    "myst_parser",
    "sphinx.ext.autodoc",
    "sphinx.ext.autosummary",
    "sphinx.ext.napoleon",
    "sphinx_click",
    "public_names",  # the pages of the API
    "example_gallery",
    "repository_files",  # files outside this folder
    "readable_docstrings",
    "grouped_options",
    "drawn_equations",
]
exclude_patterns = ["extensions"]

myst_enable_extensions = ["deflist", "dollarmath"]
myst_heading_anchors = 4
suppress_warnings = ["myst.header"]  # tables of benchmarks begin at the third level
highlight_language = "text"
smartquotes = False  # two hyphens are an option
nitpick_ignore = [  # classes that are not public
    ("py:class", "FrictionCurves"),
    ("py:class", "Interpolation"),
    ("py:class", "Reduction"),
    ("py:class", "Window"),
    ("py:class", '{"effort"'),
    ("py:class", '"wrench"}'),
    ("py:exc", "UnknownName"),
]

default_role = "code"  # single backticks in docstrings are names
autodoc_typehints = "none"  # docstrings state types, with units and shapes
autodoc_class_signature = "separated"  # without `__init__`, which only lists the parameters again
autodoc_member_order = "bysource"
autosummary_generate = False
napoleon_google_docstring = False
napoleon_use_param = False
napoleon_use_rtype = False

html_theme = "furo"
html_title = f"excite {release}"
html_copy_source = False
html_show_sourcelink = False
html_show_copyright = False
html_static_path = ["_static"]
html_css_files = ["site.css"]
html_theme_options = {"navigation_with_keys": True}
html_math_renderer = "drawn"
