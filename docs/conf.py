"""Settings of the documentation: `make docs` builds it into build/docs."""

import sys
from pathlib import Path

from pygments.lexers.special import TextLexer
from sphinx.application import Sphinx

import sprung

sys.path.insert(0, str(Path(__file__).parent / "_ext"))

project = "Sprung"
author = "The Sprung developers"
copyright = "The Sprung developers"  # noqa: A001
version = release = sprung.__version__

extensions = [
    "myst_parser",
    "sphinx.ext.autodoc",
    "sphinx.ext.autosummary",
    "numpydoc",
    "sphinx_gallery.gen_gallery",
    "mathml",
    "outside_pages",
    "python_reference",
    "command_reference",
    "file_reference",
    "wire_reference",
]
exclude_patterns = ["_ext", "tutorials"]
if tags.has("quick"):  # the tests leave out the packages' docstrings, which take most of the time
    exclude_patterns.append("reference/python/[!i]*")
    suppress_warnings = ["toc.excluded", "ref.class", "ref.func", "ref.meth"]
language = "en_GB"
default_role = "py:obj"

# Links: all that can be checked without a network is.
nitpicky = True
nitpick_ignore_regex = [
    (r"py:obj", r".*"),  # names in single backticks: linked where they are public, code otherwise
    (r"py:.*", r"(?!sprung\.).*"),  # types of other packages
    (r"py:.*", r"sprung\.\w+\.\w+\..*"),  # types that a package uses and does not export
    (r"py:.*", r"sprung\._.*"),
]

myst_enable_extensions = ["dollarmath", "amsmath", "deflist", "colon_fence", "attrs_inline"]
myst_heading_anchors = 4
myst_links_external_new_tab = False

autosummary_generate = False
autodoc_member_order = "bysource"
autodoc_typehints = "signature"
autodoc_preserve_defaults = True
python_use_unqualified_type_names = True
python_maximum_signature_line_length = 100
numpydoc_show_class_members = False
numpydoc_xref_param_type = False

sphinx_gallery_conf = {
    "examples_dirs": ["tutorials"],
    "gallery_dirs": ["gallery"],
    "filename_pattern": r"/plot_",
    "ignore_pattern": r"__init__\.py",
    "backreferences_dir": "gallery/backreferences",
    "doc_module": ("sprung",),
    "download_all_examples": False,
    "show_signature": False,
    "capture_repr": (),
    "min_reported_time": 3600,
    "remove_config_comments": True,
    "matplotlib_animations": False,
    "write_computation_times": False,  # that page loads scripts from elsewhere
    "plot_gallery": not tags.has("quick"),
    "abort_on_example_error": True,
}

html_theme = "pydata_sphinx_theme"
html_title = "Sprung"
html_static_path = ["_static"]
html_css_files = ["sprung.css"]
html_favicon = "_static/mark.svg"
html_show_sourcelink = False
html_show_search_summary = False  # it needs a server
html_copy_source = False
html_theme_options = {
    "logo": {"text": "Sprung", "image_light": "_static/mark.svg", "image_dark": "_static/mark-dark.svg"},
    "navbar_end": ["theme-switcher"],
    "navbar_align": "left",
    "header_links_before_dropdown": 7,
    "secondary_sidebar_items": ["page-toc"],
    "show_prev_next": True,
    "navigation_with_keys": False,
    "footer_start": ["copyright"],
    "footer_center": [],
    "footer_end": [],
    "pygments_light_style": "a11y-high-contrast-light",
    "pygments_dark_style": "a11y-high-contrast-dark",
}
html_sidebars = {"index": [], "start": []}


def setup(app: Sphinx) -> None:
    """Register the language of the picture of the floors, which a test reads."""
    app.add_lexer("floors", TextLexer)
