"""What pages and docstrings say that Python answers, it answers."""

import doctest
from importlib import import_module

import pytest

from doc_pages import ROOT, blocks, pages

pytestmark = pytest.mark.nightly  # `make docs` runs them, too
WITH_BLOCKS = [page for page in pages() if blocks(page.read_text("utf-8"), "pycon")]
SOURCES = sorted((ROOT / "src").rglob("*.py"))
MODULES = [path for path in SOURCES if ">>> " in path.read_text("utf-8")]


def module_name(path):
    parts = path.relative_to(ROOT / "src").with_suffix("").parts
    return ".".join(parts).removesuffix(".__init__")


@pytest.mark.parametrize("page", WITH_BLOCKS, ids=lambda page: page.name)
def test_page(page):
    text = "\n".join(blocks(page.read_text("utf-8"), "pycon"))
    test = doctest.DocTestParser().get_doctest(text, {}, page.name, str(page), 0)
    assert test.examples
    assert doctest.DocTestRunner(verbose=False).run(test).failed == 0


@pytest.mark.parametrize("path", MODULES, ids=module_name)
def test_docstrings(path):
    result = doctest.testmod(import_module(module_name(path)), verbose=False)
    assert result.attempted > 0
    assert result.failed == 0


def test_the_public_verbs_have_examples():
    import warpspace

    for name in ("load_scene", "evaluate", "run_test", "calibrate"):
        assert ">>> " in (getattr(warpspace, name).__doc__ or ""), name
    assert [page.name for page in WITH_BLOCKS]
