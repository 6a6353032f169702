"""The bar at the top and its windows: scenes, files, report, commands and keys."""

import random
from dataclasses import replace

import pytest
from PIL import Image

from app.parts import Alone, wait
from warpspace.app.browser import actions as do
from warpspace.app.documents.output_services import Services
from warpspace.app.documents.scene_file import SceneList, open_link
from warpspace.app.documents.transfers import unpack
from warpspace.app.panels import page_panels
from warpspace.app.panels.file_dialogs import FilesDialog, ReportDialog
from warpspace.app.state.app_state import start_state
from warpspace.app.state.tree import put
from warpspace.resources import scenes_dir
from warpspace.scene.library import load_scene, scene_names
from warpspace.scene.notes import Note

FIRST, SECOND = load_scene("dvf5000_first"), load_scene("dvf5000_second")
STATE = start_state(FIRST, nodes=5)
HOSTILE = "<img src=x onerror=alert(1)>.csv"


def test_undo_is_there_when_there_is_something_to_undo_and_says_what():
    bar = Alone(page_panels.TopPanel, STATE)
    assert 'data-do="undo"' not in bar.html
    bar.store.apply(lambda state: state.with_amplitude("EAX", 7.0))
    assert "Undo: roll of X (Ctrl+Z)" in bar.html
    bar.store.undo()
    assert 'data-do="redo"' in bar.html
    assert 'data-do="undo"' not in bar.html


def test_scenes_are_chosen_by_title_and_escaped():
    hostile = replace(FIRST, name="other", title=HOSTILE, description=HOSTILE)
    scenes = SceneList({scene.title: scene for scene in (FIRST, SECOND, hostile)})
    window = Alone(page_panels.ScenesDialog, STATE, scenes=scenes)
    assert "<img src=x" not in window.html
    assert window.html.count('aria-current="true"') == 1
    assert window.do(do.Input.CHOOSE_SCENE("nothing of that name")).scene is FIRST
    assert window.do(do.Input.CHOOSE_SCENE(SECOND.title)).scene is SECOND


def test_every_bundled_scene_has_a_small_picture_and_a_sentence():
    pictures = sorted((scenes_dir() / "thumbnails").iterdir())
    assert [path.name for path in pictures] == [f"{name}.webp" for name in sorted(scene_names())]
    for path in pictures:
        assert path.stat().st_size <= 6000
        with Image.open(path) as picture:
            assert (picture.format, picture.size) == ("WEBP", (160, 120))
    scenes = SceneList({name: load_scene(name) for name in scene_names()})
    window = Alone(page_panels.ScenesDialog, STATE, scenes=scenes)
    assert window.html.count('src="data:image/webp;base64,') == len(scenes)
    assert "…" not in window.html
    opened, _ = scenes.add(replace(FIRST, title="own"))  # another scene under a bundled name
    assert opened == "own"
    assert window.html.count('src="data:image/webp;base64,') == len(scenes) - 1


def test_every_key_is_there_once_and_none_without_ctrl_changes_the_model():
    keys = [key for one in page_panels.COMMANDS for key in one.keys]
    assert len(keys) == len(set(keys)) == len(page_panels.key_actions())
    for command in page_panels.COMMANDS:
        windows = [Alone(page_panels.PagePanel, STATE)]
        windows = [window for window in windows if window.part.handles(command.action)]
        for window in windows if command.keys and "ctrl" not in command.keys[0] else ():
            window.part.context.store.apply(lambda state: state.with_amplitude("EAX", 7.0))
            before = replace(window.store.state, exaggeration=None).resulting_scene()
            after = window.do(command.action)
            assert replace(after, exaggeration=None).resulting_scene() == before, command.label


def help_dialog():
    context = Alone(page_panels.PagePanel, STATE).context
    panels = page_panels.build_panels(context)
    sections = [panel for panel in panels if isinstance(panel, page_panels.Section)]
    return Alone(page_panels.HelpDialog, STATE, sections)


def test_commands_are_found_by_words_and_enter_runs_the_first():
    window = help_dialog()
    window.store.apply(lambda state: put(state, "page.command", "zero err"))
    assert window.html.count("run_command") == 1
    window.do(do.Input.RUN_FIRST_COMMAND("zero err"))
    assert window.sent == [do.Signal.ZERO_ERRORS]
    window.do(do.Input.RUN_COMMAND(HOSTILE))
    window.do(do.Input.RUN_FIRST_COMMAND())
    assert len(window.sent) == 1


@pytest.mark.parametrize(
    ("query", "action"),
    [
        ("compare", do.Signal.OPEN_COMPARISON),
        ("circular", do.Input.CHOOSE_TEST("circular")),
        ("ball bar", do.Input.CHOOSE_TEST("circular")),
        ("toleranc", do.OpenSection("design", "allocate")),
        ("import", do.OpenSection("measure", "import")),
        ("adjust", do.OpenSection("improve", "adjust")),
        ("gains", do.OpenSection("understand", "gains")),
    ],
)
def test_sections_and_tests_are_found_by_the_words_of_users(query, action):
    window = help_dialog()
    window.do(do.Input.RUN_FIRST_COMMAND(query))
    assert window.sent == [action]


def test_a_search_without_a_match_says_so():
    window = help_dialog()
    window.store.apply(lambda state: put(state, "page.command", "<b>flux"))
    assert "No command matches “&lt;b&gt;flux”." in window.html


def test_a_section_is_opened_in_its_task():
    page = Alone(page_panels.PagePanel, put(STATE, "page.window", "help"))
    page.do(do.OpenSection("design", "concepts"))
    look = page.store.state.page
    assert (look.task, look.window) == ("design", "")
    assert "concepts" in look.open
    page.do(do.OpenSection(HOSTILE, HOSTILE))
    assert page.store.state.page.task == "design"


def test_a_link_says_what_it_holds_and_asks_before_it_holds_the_token():
    window = Alone(FilesDialog, STATE.with_amplitude("EAX", 7.0))
    window.do(do.Share())
    (name, _, token, words) = window.called[-1]
    assert (name, token) == ("share", None)
    assert "1 changed error" in words
    asking = Alone(FilesDialog, STATE, services=Services(token="secret"))
    assert asking.do(do.Share()).page.window == "files"
    assert asking.called == []
    asking.do(do.Share("with_token"))
    assert asking.called[-1][2] == "secret"
    assert "Copy link with token" in asking.html
    assert "secret" not in asking.html


def test_a_link_that_notes_make_too_large_leaves_them_out_and_says_so():
    texts = random.Random(1).choices("abcdefghijklmnopqrstuvwxyz0123456789", k=8000)
    notes = [Note(id=f"n{at}", text="".join(texts[at : at + 2000])) for at in range(0, 8000, 2000)]
    for count, expected in ((1, 1), (4, 0)):
        window = Alone(FilesDialog, replace(STATE, review=tuple(notes[:count])))
        window.do(do.Share())
        opened, _ = open_link(unpack(window.called[-1][1]), None)
        assert opened.review == tuple(notes[:expected])
        assert ["Notes not included" in one[0] for one in window.said] == [True] * (1 - expected)
        assert len(window.store.state.review) == count


def test_files_that_a_page_refuses_or_invents_are_said_or_left():
    window = Alone(FilesDialog, STATE)
    window.do(do.Upload("files", HOSTILE, 1, "²"))
    assert "was not received completely" in window.said[-1][1]
    window.do(do.Upload("files", HOSTILE, 10**9, ""))
    assert "expected a scene file of at most" in window.said[-1][1]
    window.do(do.Input.EXPORT("../../etc/passwd"))
    window.do(do.Input.FOLLOW_LINK("no link"))
    assert window.saved == []
    assert "cannot be read" in window.said[-1][1]


def test_the_bar_has_an_animation_written_with_its_progress():
    asked = []
    write = Services(draw_animation=lambda *about: asked.append(about[:-1]) or b"RIFF")
    window = Alone(FilesDialog, STATE, services=write)
    state = window.do(do.SaveAnimation("rotation"))
    wait(window.part)
    assert ([about[1:] for about in asked], state.page.window) == ([("rotation", ".webp")], "files")
    ((name, content),) = window.saved
    assert name.endswith("_rotation.webp")
    assert content == b"RIFF"
    # a story is that of the review, not of the step that is shown
    window.context.story_state = window.context.store.state.zeroed()
    window.do(do.SaveAnimation("story", ".mp4"))
    wait(window.part)
    assert asked[-1][0].state.amplitudes == window.context.store.state.amplitudes
    assert window.saved[-1][0].endswith("_story.mp4")


def test_the_report_has_author_questions_and_every_result_under_a_name_of_its_own():
    asked, done = [], (b"%PDF", ())
    write = Services(write_report=lambda _, *about: asked.append(about) or done)
    window = Alone(ReportDialog, STATE, services=write)
    window.context.report_results[:] = [("Gains", 1), ("Gains", 2), (HOSTILE, 3)]
    page = replace(STATE.page, author=HOSTILE, questions="one\n\n two ")
    window.store.apply(lambda state: replace(state, page=page))
    assert "<img" not in window.html
    window.do(do.RemoveFromReport(2))
    window.do(do.RemoveFromReport(7))
    assert asked == []
    window.do(do.WriteReport(".pdf"))
    wait(window.part)
    ((author, questions, results, *_),) = asked
    assert (author, questions) == (HOSTILE, ("one", "two"))
    assert list(results) == ["Gains", "Gains (2)"]
    assert window.saved == [("dvf5000_first_report.pdf", b"%PDF")]


@pytest.mark.parametrize("is_current", [True, False])
def test_a_scene_is_saved_with_a_warning_where_its_file_has_changed(is_current):
    services = Services(is_current=lambda _: is_current)
    window = Alone(FilesDialog, STATE, services=services)
    window.do(do.Signal.SAVE_SCENE)
    assert len(window.saved) == 1
    assert ["changed on the server" in one[0] for one in window.said] == [True] * (not is_current)
