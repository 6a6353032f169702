"""Messages of refused options on the page: labels of the page, and nothing of the command line."""

import html
import re

import pytest

from app.parts import lone_part
from warpspace.analysis.registry import entries, find_analysis
from warpspace.app.documents.output_services import CancelledError
from warpspace.app.panels.analysis_panel import AnalysisPanel
from warpspace.app.panels.page_panels import PANELS
from warpspace.app.panels.upload_panels import Import, ImportPanel
from warpspace.app.state.app_state import start_state
from warpspace.app.state.form_values import read_form
from warpspace.app.state.tree import put
from warpspace.bench.base import bench_names, find_test
from warpspace.exceptions import WarpspaceError
from warpspace.formats.source import source_of_text
from warpspace.scene.library import load_scene

COMMAND_LINE = re.compile(r"(?<![-\w])--[a-z]|\{[a-z_]+\}|`?warpspace (import|test|field|[a-z]+ )")
BAD = ("?", "nan", "-1", "1e99", "EXX=?", "X=1e9 Q=1", "0", "none", "X=0,1")
SCENES = ("dvf5000_first", "dvf5000_general")


def stop(_share: float) -> None:
    raise CancelledError("far enough")


def messages(name: str, scene_name: str) -> list[str]:
    """Refuse every option of a section with every bad text; return what the section shows."""
    part = lone_part(PANELS.get(name, AnalysisPanel), name)
    state = put(start_state(load_scene(scene_name)), "specification.limit_um", "50")
    shown = [html.unescape(str(part.options_html(state)))]
    scenes = part.scenes(state)
    for option in part.shown_options(state):
        for text in BAD:
            try:
                values = {**part.values(state), option.name: text}
                part.build_analysis(state, values, scenes[0]).run_all(scenes, stop)
            except CancelledError:
                continue
            except WarpspaceError as error:
                part._fail(error)
                shown.append(part.problem[1])
    return shown


@pytest.mark.parametrize("name", [entry.name for entry in entries()])
def test_no_section_shows_words_of_the_command_line(name: str) -> None:
    shown = [text for scene in SCENES for text in messages(name, scene)]
    assert [text for text in shown if COMMAND_LINE.search(text)] == []


def test_bad_options_are_refused_by_their_labels() -> None:
    assert any(text.startswith("“Loop” '?'; ") for text in messages("gains", "dvf5000_first"))


def test_no_standard_test_is_described_by_words_of_the_command_line() -> None:
    kinds = [find_test(name) for name in bench_names()]
    texts = [*(kind.description for kind in kinds)]
    texts += [option.about for kind in kinds for option in kind.options()]
    assert [text for text in texts if COMMAND_LINE.search(text)] == []


def test_several_values_of_an_option_are_separated_by_blanks() -> None:
    kind = find_analysis("montecarlo")
    values = {"tolerance": "EXX=5,10 EYY=1"}
    assert read_form(kind, kind.options(), values, load_scene("dvf5000_first")).tolerance == (
        ("EXX", (5.0, 10.0)), ("EYY", (1.0,)),
    )  # fmt: skip


@pytest.mark.parametrize(
    ("name", "content", "words"),
    [
        ("a.csv", "position_mm,deviation_um\n0,1\n9,2\n", "expected “Axis” X"),
        ("a.csv", "one,two\n1,2\n", "(“Format” selects it)"),
    ],
)
def test_an_import_names_its_options_as_the_section_does(name, content, words) -> None:
    part, scene = lone_part(ImportPanel), load_scene("dvf5000_first")
    with pytest.raises(WarpspaceError) as refused:
        Import(sources=(source_of_text(content, name),)).run(scene, stop)
    part._fail(refused.value)
    assert words in part.problem[1]
    assert not COMMAND_LINE.search(part.problem[1])
