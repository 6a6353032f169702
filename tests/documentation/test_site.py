"""The documentation holds every page, command, tab and example; links and answers are right."""

import ast
import doctest
import re
import runpy
import shlex
import sys
import tomllib
from importlib import import_module
from unittest.mock import MagicMock

import pytest

import warpspace
from doc_pages import DOCS, ROOT, anchors, blocks, entries, links, pages, section
from warpspace.app.panels.page_panels import COMMANDS as KEYS
from warpspace.app.panels.page_panels import build_panels
from warpspace.app.panels.panel import Section
from warpspace.app.state.look import TASKS
from warpspace.cli.main import COMMANDS
from warpspace.kinematics.model import convention_names
from warpspace.machine.curves.registry import curve_kinds
from warpspace.scene.library import load_scene
from warpspace.scene.schema import CONVENTION, POINTS, VIEW

pytestmark = pytest.mark.nightly  # `make docs` runs them, too
WORDS_OF_A_SECTION = 10
EXAMPLES = sorted((ROOT / "examples").glob("*.py"))
WITH_BLOCKS = [page for page in pages() if blocks(page.read_text("utf-8"), "pycon")]
SOURCES = sorted((ROOT / "src").rglob("*.py"))
MODULES = [path for path in SOURCES if ">>> " in path.read_text("utf-8")]


def site_part(name):
    return runpy.run_path(str(DOCS / "_ext" / f"{name}.py"))


def test_the_configuration_loads_and_finds_what_it_names(monkeypatch):
    monkeypatch.setattr(sys, "path", list(sys.path))
    configuration = runpy.run_path(str(DOCS / "conf.py"))
    assert configuration["version"] == warpspace.__version__
    assert all((DOCS / "_static" / name).is_file() for name in configuration["html_css_files"])
    assert all((DOCS / folder).is_dir() for folder in configuration["templates_path"])


def test_the_pythons_that_are_promised_are_those_that_were_tried():
    project = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"]
    named = re.findall(r"Python :: 3\.(\d+)", " ".join(project["classifiers"]))
    assert project["requires-python"] == f">=3.{named[0]},<3.{int(named[-1]) + 1}"
    for name in ("README.md", "docs/tutorial.md", "Makefile", ".ci/check-python.sh"):
        assert f"Python 3.{named[0]} to 3.{named[-1]}" in (ROOT / name).read_text("utf-8"), name
    tried = (DOCS / "site/evidence.md").read_text("utf-8")
    rows = re.findall(r"^\| 3\.(\d+)\.\d+ \| (\w+) \|", tried, re.MULTILINE)
    for which in ("newest", "lowest"):
        assert [minor for minor, one in rows if one == which] == named


def test_the_evidence_names_tests_and_benchmarks_that_exist():
    text = (DOCS / "evidence.md").read_text("utf-8")
    paths = re.findall(r"`(?:pytest|python) (?:-m nightly )?([\w/.]+)", text)
    assert len(paths) > 20
    for path in paths:
        assert (ROOT / path).exists(), path
    assert text.count("234 of 244 agree") == 1
    rows = (DOCS / "thesis_rows.md").read_text("utf-8")
    assert "**234 of 244 agree.**" in rows


def test_every_page_is_in_a_table_of_contents():
    contained = {(DOCS / "index.md").resolve()}
    for page in pages():
        for entry in entries(page):
            entered = [path.resolve() for path in page.parent.glob(f"{entry}.md")]
            coming = "*" in entry or page.parent.joinpath(entry).name == "index"
            assert entered or coming, f"{page.name}: there is no page {entry}"
            contained.update(entered)
    missing = {path.resolve() for path in pages() if DOCS in path.parents} - contained
    assert not missing, (
        f"{sorted(path.name for path in missing)}: in no table of contents; name them in"
        " docs/site/howto.md, explanation.md or evidence.md"
    )


def test_the_reference_has_every_public_name_and_every_room():
    reference = (DOCS / "reference/index.md").read_text("utf-8")
    listed = set(re.findall(r"^   (\w+)$", reference, re.MULTILINE))
    assert {name for name in warpspace.__all__ if name != "__version__"} <= listed
    rooms = {path.parent.name for path in (ROOT / "src/warpspace").glob("*/__init__.py")}
    assert rooms - {"app", "cli"} <= listed, "name the package in docs/reference/index.md"


def test_every_command_has_a_how_to():
    for name in COMMANDS:
        page = DOCS / "commands" / f"{name}.md"
        assert page.is_file(), f"write what a user does with `warpspace {name}`: {page}"
        text = page.read_text("utf-8")
        assert re.search(rf"^# How to .*: `{name}`$", text, re.MULTILINE), name
        assert re.search(rf"^warpspace {name}\b", "".join(blocks(text, "sh")), re.MULTILINE), name
    assert {path.stem for path in (DOCS / "commands").glob("*.md")} == {*COMMANDS, "index"}
    listed = {file for file, _ in links(DOCS / "commands" / "index.md")}
    assert {f"{name}.md" for name in COMMANDS} <= listed


def test_every_task_has_a_how_to_and_a_picture():
    for name, task in TASKS.items():
        text = section(DOCS / "app.md", task)
        assert text is not None, f"docs/app.md has no section {task}: say what a user does there"
        assert f"](images/task_{name}.png)" in text


def test_every_section_of_a_task_has_its_words():
    text = (DOCS / "app.md").read_text("utf-8")
    parts = {one.name: one for one in build_panels(MagicMock())}
    names = [name for names in parts["tasks"].sections.values() for name in names]
    found = [parts[name] for name in names if isinstance(parts.get(name), Section)]
    assert len(found) > len(TASKS)
    for one in found:
        part = re.search(rf"(?ms)^## {TASKS[one.task]}\n(.*?)(?=^## )", text)
        title = re.escape(one.title)
        titled = re.search(rf"(?ms)(?:^### {title}$|\*\*{title}\*\*)(.*)", part[1])
        assert titled, f"docs/app.md, {TASKS[one.task]}, has no {one.title}: say what it does"
        words = re.split(r"(?m)^###|\*\*", titled[1], maxsplit=1)[0].split()
        assert len(words) >= WORDS_OF_A_SECTION, f"docs/app.md, {one.title}: say what it does"


def test_every_command_of_the_page_and_its_key_are_named():
    text = section(DOCS / "app.md", "Keys")
    named = re.split(r"[\s,]+", " ".join(re.findall(r"^\| ([^|]+) \|", text, re.MULTILINE)))
    for one in KEYS:
        if one.keys:
            assert one.key_label in named, one.label
        else:
            assert f"*{one.label}*" in " ".join(text.split())


def command_lines():
    lines = set()
    for page in pages():
        text = page.read_text("utf-8")
        lines.update(map(str.strip, "\n".join(blocks(text, "sh")).splitlines()))
        lines.update(re.findall(r"`(warpspace [a-z][^`]*)`", " ".join(text.split())))
    return sorted(line.strip() for line in lines if line.startswith("warpspace "))


@pytest.mark.parametrize("line", command_lines())
def test_commands_of_the_pages_are_understood(line):
    words = shlex.split(line, comments=True)[1:]
    if words[0].startswith("-") or words[0].isupper():
        return
    assert words[0] in COMMANDS, line
    if "…" in words or all(word.startswith("-") for word in words[1:]):
        return  # a command that is only named
    if re.search(r"\b[A-Z]{2,}\b", " ".join(words[1:])) and "=" not in line:
        return  # a form with placeholders
    # as the program itself calls it: click keeps the first help option that a command is given
    COMMANDS[words[0]].make_context(words[0], words[1:], help_option_names=["-h", "--help"])


@pytest.mark.parametrize("page", pages(), ids=lambda page: page.relative_to(ROOT).as_posix())
def test_links_lead_somewhere(page):
    for file, anchor in links(page):
        target = (page.parent / file).resolve() if file else page
        if file in {"gallery/index", "/gallery/index"}:
            continue
        if target == DOCS / "reference" / "index.md":
            continue
        if target.name in site_part("for_the_site")["COMING"] and not target.exists():
            continue
        assert target.exists(), f"{page.name}: {file}"
        if anchor:
            assert anchor in anchors(target), f"{page.name}: {file}#{anchor}"


@pytest.mark.parametrize("script", EXAMPLES, ids=lambda script: script.stem)
def test_every_example_has_a_title_for_the_gallery(script):
    if script.stem in site_part("gallery_pictures")["TOOLS"]:
        return
    text = ast.get_docstring(ast.parse(script.read_text("utf-8")), clean=False) or ""
    assert re.match(r"\n(.+)\n(=+)\n\n\S", text), (
        f'{script.name}: begin with """, a title, a line of = below it, and a sentence'
    )
    title, line = text.splitlines()[1:3]
    assert len(line) == len(title)


def test_drawings_are_those_of_the_model(tmp_path, monkeypatch):
    monkeypatch.setattr(sys, "path", [str(DOCS), *sys.path])
    module = runpy.run_path(str(DOCS / "drawings.py"), run_name="drawings")
    shown = set(re.findall(r"\(images/model_(\w+)\.svg\)", (DOCS / "model.md").read_text("utf-8")))
    assert shown == set(module["DRAWINGS"])
    assert {p.stem.removeprefix("model_") for p in (DOCS / "images").glob("*.svg")} == shown
    for name in shown:
        drawn = module["draw"](name, tmp_path).read_text("utf-8")
        kept = (DOCS / "images" / f"model_{name}.svg").read_text("utf-8")
        words = [re.findall(r"<text[^>]*>([^<]*)<", text) for text in (drawn, kept)]
        assert words[0] == words[1], f"{name}: run docs/drawings.py"
        assert words[0]


def test_documented_scene_loads_and_names_every_key(tmp_path):
    (text, machine) = blocks((ROOT / "docs/scenes.md").read_text("utf-8"), "toml")
    (tmp_path / "xm60_x.csv").write_text("X,pitch\n-275,0\n275,3.5\n")
    (tmp_path / "mine.toml").write_text(text, encoding="utf-8")
    scene = load_scene(tmp_path / "mine.toml")
    assert scene.errors.amplitude("EBX") == 3.5
    for part in (CONVENTION, POINTS, VIEW):
        for key in part.fields:
            assert re.search(rf"^{key} = ", text, re.MULTILINE), key
    (tmp_path / "own.toml").write_text(machine, encoding="utf-8")
    assert str(load_scene(tmp_path / "own.toml").machine.chain) == "wAXFYZt"


def test_readme_snippet_prints_what_it_says(capsys):
    (snippet,) = blocks((ROOT / "README.md").read_text("utf-8"), "python")
    exec(snippet, {})
    printed = capsys.readouterr().out.split()
    claimed = re.search(r"# ([\d.]+) µm", snippet)
    assert float(printed[0]) == pytest.approx(float(claimed.group(1)), abs=0.005)


def test_readme_names_every_command():
    page = (ROOT / "README.md").read_text("utf-8")
    table = page[page.index("| command") : page.index("Shell completion")]
    assert set(re.findall(r"`([\w-]+)`", re.sub(r"\|[^|]*\|\n", "|\n", table))) == {*COMMANDS}


def test_every_picture_that_is_linked_exists_and_every_other_picture_is_linked():
    linked = {
        (page.parent / target).resolve()
        for page in (ROOT / "README.md", ROOT / "CONVENTIONS.md", *DOCS.glob("*.md"))
        for target in re.findall(r"!\[[^\]]+\]\(([^)]+\.(?:png|webp))\)", page.read_text("utf-8"))
    }
    machines = (ROOT / "assets" / "machines").glob("*/picture.png")
    images = [*DOCS.glob("images/*.png"), *DOCS.glob("images/*.webp")]
    assert linked == {*images, *machines}


def test_pictures_are_small():
    sizes = [path.stat().st_size for path in (ROOT / "docs" / "images").glob("*.png")]
    assert sum(sizes) < 3.5e6
    assert all(film.stat().st_size < 1.5e5 for film in DOCS.glob("images/*.webp"))
    machines = (ROOT / "assets/machines").glob("*/picture.png")
    assert max(path.stat().st_size for path in machines) < 2e5


def test_every_kind_of_curve_and_every_convention_is_documented():
    forms = [f"{{ {form[0]}" for kind in curve_kinds() for form in kind.forms]
    for page in ("docs/scenes.md", "CONVENTIONS.md"):
        text = (ROOT / page).read_text("utf-8")
        for spelling in (*forms, *(f'"{name}"' for name in convention_names())):
            assert spelling in text, (page, spelling)


@pytest.mark.parametrize("page", WITH_BLOCKS, ids=lambda page: page.name)
def test_answers_of_a_page_are_those_of_python(page):
    text = "\n".join(blocks(page.read_text("utf-8"), "pycon"))
    test = doctest.DocTestParser().get_doctest(text, {}, page.name, str(page), 0)
    assert test.examples
    assert doctest.DocTestRunner(verbose=False).run(test).failed == 0


@pytest.mark.parametrize("path", MODULES, ids=lambda path: path.stem)
def test_answers_of_docstrings_are_those_of_python(path):
    name = ".".join(path.relative_to(ROOT / "src").with_suffix("").parts)
    result = doctest.testmod(import_module(name.removesuffix(".__init__")), verbose=False)
    assert (result.attempted > 0, result.failed) == (True, 0)


def test_pages_and_public_verbs_have_examples():
    for name in ("load_scene", "evaluate", "run_test", "calibrate"):
        assert ">>> " in (getattr(warpspace, name).__doc__ or ""), name
    assert WITH_BLOCKS
