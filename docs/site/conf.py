"""The documentation site: the repository's own Markdown, and the public names from their docstrings. CONTRIBUTING says how to build it.

The sources are read from the repository's root, so that links between documents are the same in a checkout and in the site.
"""

from __future__ import annotations

import hdvplan

project = "hdvplan"
author = copyright = "The hdvplan developers"  # noqa: A001 - Sphinx's name
version = release = hdvplan.__version__

extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.napoleon", "sphinx.ext.viewcode"]
root_doc = "docs/site/index"
include_patterns = ["*.md", "docs/**.md", "results/**.md", "roads/README.md", "benchmarks/README.md", "benchmarks/competitors.md"]
exclude_patterns = [".*", "build", "dist", "site", "hdvplan", "tests"]
suppress_warnings = ["toc.not_included"]  # tables of results, which the text links to

myst_heading_anchors = 3  # links to headings, as code hosts make them

autodoc_member_order = "bysource"
autodoc_typehints = "signature"
autodoc_preserve_defaults = True
napoleon_google_docstring = True
napoleon_numpy_docstring = False

smartquotes = False  # an apostrophe is a derivative in formulas

html_theme = "furo"
html_title = f"hdvplan {version}"
html_additional_pages = {"index": "start.html"}  # the address that people open leads to the first page
html_copy_source = False
html_show_search_summary = False  # excerpts are fetched, which browsers refuse for files on disk
html_show_sphinx = False
templates_path = ["."]
