"""Settings of the documentation site: ``make docs`` builds it into docs/_build/html.

The pages are the Markdown files of this folder, as they are read on a code host. What only the site
has comes from here: the options of each command from click, the gallery from ``examples/``, the
reference from docstrings.
"""

import os
import sys
from pathlib import Path

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("PYVISTA_OFF_SCREEN", "true")
HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(HERE / "_ext"), str(HERE.parent / "src")]

import for_the_site  # noqa: E402
import gallery_pictures  # noqa: E402

import warpspace  # noqa: E402

project = "warpspace"
author = "warpspace developers"
copyright = "warpspace developers"  # noqa: A001
version = release = warpspace.__version__

extensions = [
    "myst_parser",
    "numpydoc",
    "sphinx.ext.autodoc",
    "sphinx.ext.autosummary",
    "sphinx_click",
    "sphinx_design",
    "sphinx_gallery.gen_gallery",
    "for_the_site",
]
source_suffix = {".md": "markdown", ".rst": "restructuredtext"}
exclude_patterns = ["_build", "_ext", "_templates", "gallery/*.py", "gallery/*.ipynb"]
templates_path = ["_templates"]
nitpicky = False  # types in docstrings are words for readers, "ndarray, [..., 3], mm"

smartquotes = False  # "--at" is an option, no dash
myst_heading_anchors = 4
myst_enable_extensions = ["colon_fence", "linkify"]
myst_linkify_fuzzy_links = False

# --- gallery -------------------------------------------------------------------------------------

sphinx_gallery_conf = {
    "examples_dirs": [str(HERE.parent / "examples")],
    "gallery_dirs": ["gallery"],
    "filename_pattern": r"\.py$",
    "ignore_pattern": rf"({'|'.join(gallery_pictures.TOOLS)})\.py$",
    "reset_argv": "gallery_pictures.target_argument",
    "image_scrapers": ("gallery_pictures.add_pictures",),
    "reset_modules": (),
    "within_subsection_order": "gallery_pictures.InGalleryOrder",
    "download_all_examples": False,
    "show_memory": False,
    "min_reported_time": 1e9,
    "show_signature": False,
    "remove_config_comments": True,
    "abort_on_example_error": False,
    "thumbnail_size": (400, 300),
    "plot_gallery": os.environ.get("WARPSPACE_GALLERY", "draw") == "draw",
}

# --- reference -----------------------------------------------------------------------------------

autosummary_generate = True
autodoc_typehints = "none"
autodoc_member_order = "bysource"
autodoc_default_options = {"members": True, "show-inheritance": True}
numpydoc_show_class_members = False
numpydoc_xref_param_type = False

# --- pages ---------------------------------------------------------------------------------------

html_theme = "pydata_sphinx_theme"
html_title = "warpspace"
html_static_path = ["_static"]
html_css_files = ["site.css"]
html_extra_path = [str(gallery_pictures.EXTRA)]
html_copy_source = False
html_show_sourcelink = False
html_theme_options = {
    "logo": {"text": "warpspace"},
    "navbar_end": ["theme-switcher"],
    "show_prev_next": True,
    "footer_start": ["copyright"],
    "footer_end": [],
    "secondary_sidebar_items": ["page-toc"],
    "show_toc_level": 2,
    "pygments_light_style": "a11y-high-contrast-light",
    "pygments_dark_style": "a11y-high-contrast-dark",
}
html_sidebars = {"index": [], "tutorial": []}

# --- links ---------------------------------------------------------------------------------------

linkcheck_timeout = 10
linkcheck_retries = 1
linkcheck_workers = 4
linkcheck_anchors = False
linkcheck_ignore = [r"https?://(127\.0\.0\.1|localhost)", r"^\.\./", r".*/scenes/.*\.html$"]

for_the_site.prepare(HERE)
