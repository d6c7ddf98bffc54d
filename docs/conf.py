"""The site made from the pages of the repository by `tools/site.sh`. No text is copied: Sphinx reads the
pages where they lie, so their links work here and in the repository alike."""

from pathlib import Path

project = "hybank"
author = "the hybank developers"
copyright = author

extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.autosummary", "numpydoc"]

# The source folder is the repository; the site consists of these pages.
root_doc = "docs/index"
include_patterns = [
    "README.md",
    "ARCHITECTURE.md",
    "CHANGELOG.md",
    "CONTRIBUTING.md",
    "docs/*.md",
    "docs/tutorials/*.md",
    "benches/*.md",
    "examples/README.md",
    "filters/README.md",
    "ibr/README.md",
]

myst_heading_anchors = 3
suppress_warnings = ["myst.header", "misc.highlighting_failure"]

autodoc_member_order = "bysource"
# It belongs to the Python of its own package manager.
autodoc_mock_imports = ["gnuradio"]
numpydoc_show_class_members = False

html_theme = "furo"
html_title = "hybank"


def setup(app):
    """Appends the lists of pages to the first one: in the repository that page is read without them."""

    def append(app, page, source):
        if page == root_doc:
            source[0] += "\n" + Path(__file__).with_name("contents.myst").read_text()

    app.connect("source-read", append)
