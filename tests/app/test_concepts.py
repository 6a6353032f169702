"""Machines side by side in the app: the numbers of the command, what is chosen, what is refused."""

import base64
import io
import json
import threading
from dataclasses import replace

import numpy as np
import pytest
from click.testing import CliRunner
from markupsafe import Markup
from PIL import Image

from app.wire import OPEN, Wire, dial
from warpspace.app.documents.services import ConceptRequest, Services
from warpspace.app.evaluation.concepts import Answer, answer, ask
from warpspace.app.evaluation.machine_edits.updates import with_word
from warpspace.app.readouts.concepts import ConceptRow, concepts_html, cut_strip
from warpspace.app.server.viewer import Viewer
from warpspace.app.state import edits
from warpspace.app.state.app_state import start_state
from warpspace.app.state.concept_choice import LIMIT_UM, Chosen, ConceptChoice
from warpspace.cli.commands.concepts import concepts
from warpspace.exceptions import SceneError
from warpspace.machine.tolerances import ToleranceSet
from warpspace.scene.library import load_scene

NAMES = ("dvf5000_first", "machine_trunnion_ac", "machine_scara")
FIRST, *OTHERS = (load_scene(name) for name in NAMES)
START = start_state(FIRST)
CHOICE = ConceptChoice(
    (ConceptChoice().machines[0], *(Chosen(scene.title, scene) for scene in OTHERS)), limit_um=45.0
)


def found(choice: ConceptChoice = CHOICE, state=START) -> Answer:
    known = answer(ask(state, choice), threading.Event(), lambda _: None)
    assert known is not None
    return known


@pytest.fixture(scope="module")
def compared() -> Answer:
    return found()


def command(*options: str) -> dict:
    result = CliRunner().invoke(concepts, [*NAMES, "--limit-um", "45", "--json", *options])
    assert result.exit_code == 0, result.output
    return json.loads(result.stdout)


def numbers(one: Answer) -> list[dict]:
    return [
        {
            "mean_um": concept.sampled.mean_um,
            "p95_um": concept.sampled.p95_um,
            "max_um": concept.sampled.max_um,
            "probability": concept.sampled.probability.probability,
            "errors": [(row.key, row.share) for row in concept.leading],
        }
        for concept in one.concepts
    ]


@pytest.mark.parametrize(
    ("changes", "options"),
    [
        ({}, ()),
        (
            {"own_tolerances": True, "loop": "tool", "over": "max"},
            ("--own-tolerances", "--loop", "tool", "--over", "max"),
        ),
    ],
    ids=["as opened", "other settings"],
)
def test_the_numbers_are_those_of_the_command(changes, options) -> None:
    expected = [
        {
            **{name: one[name] for name in ("mean_um", "p95_um", "max_um", "probability")},
            "errors": [(row["key"], row["share"]) for row in one["errors"]],
        }
        for one in command(*options)["concepts"]
    ]
    assert numbers(found(replace(CHOICE, **changes))) == expected


def test_the_page_shows_numbers_errors_and_buttons(compared: Answer) -> None:
    rows = [
        ConceptRow(chosen.title, chosen.scene is not None, concept)
        for chosen, concept in zip(CHOICE.machines, compared.concepts, strict=True)
    ]
    rows.append(ConceptRow("<script>", opens=True))
    html = concepts_html(rows, compared, "", lambda word: Markup(f'data-word="{word}"'))
    for letter, concept in zip("ABC", compared.concepts, strict=True):
        assert f'data-concept="{letter} mean">{concept.sampled.mean_um:.2f}<' in html
        assert f'data-concept="{letter} P95">{concept.sampled.p95_um:.2f}<' in html
        for row in concept.leading:
            assert f"<b>{row.key}</b> {100 * row.share:.0f} %" in html
    assert 'data-word="open 0"' not in html  # what is steered is open already
    assert 'data-word="open 1"' in html
    assert 'data-word="remove 3"' in html
    assert "not compared yet" in html
    assert "<script>" not in html


def test_an_answer_holds_until_what_it_depends_on_changes(compared: Answer) -> None:
    def holds(state=START, choice: ConceptChoice = CHOICE) -> bool:
        return compared.question.covers(ask(state, choice))

    assert holds()
    assert holds(START.with_amplitude("EAX", 30.0))
    assert holds(choice=CHOICE.toggled(CHOICE.machines[2]))
    assert not holds(choice=CHOICE.toggled(CHOICE.machines[0]))  # other tolerances for all
    assert not holds(choice=CHOICE.with_limit(46.0))
    assert not holds(choice=replace(CHOICE, loop="tool"))
    assert not holds(edits.with_scaled_tolerances(START, ["EXX"], 2.0))
    assert not holds(with_word(START, "offset X 2 150"))
    assert not holds(choice=CHOICE.toggled(Chosen("", load_scene("machine_printer_3d"))))


def test_choices_are_clamped() -> None:
    choice = ConceptChoice()
    assert choice.with_limit(float("nan")) == choice
    assert choice.with_limit(-1.0).limit_um == LIMIT_UM.low
    assert choice.with_limit(float("inf")).limit_um == LIMIT_UM.high
    assert choice.with_words("", "everywhere\0", "<b>") == choice
    for number in range(20):
        choice = choice.toggled(Chosen("", replace(FIRST, title=str(number))))
    assert len(choice.machines) == 8
    for chosen in choice.machines:
        choice = choice.toggled(chosen)
    assert choice.machines == ()


def test_missing_tolerances_are_said_and_a_comparison_can_be_cancelled() -> None:
    state = replace(START, tolerances=ToleranceSet({"translation": 10.0}))
    with pytest.raises(SceneError, match=r"tolerances\.default has no rotation"):
        found(state=state)
    cancelled = threading.Event()
    cancelled.set()
    assert answer(ask(START, CHOICE), cancelled, lambda _: None) is None


def test_a_strip_is_cut_into_pictures_of_one_scale() -> None:
    strip = np.full((300, 80, 3), 255, np.uint8)
    strip[40:60, 30:50] = (200, 0, 0)
    strip[110:190, 5:75] = (0, 0, 200)
    buffer = io.BytesIO()
    Image.fromarray(strip).save(buffer, "PNG")
    pictures = cut_strip(buffer.getvalue(), 3)
    assert all(picture.startswith("data:image/png;base64,") for picture in pictures)
    sizes = []
    for picture in pictures[:2]:
        with Image.open(io.BytesIO(base64.b64decode(picture.partition(",")[2]))) as one:
            sizes.append(one.size)
    assert sizes == [(80, 32), (80, 92)]


def test_a_page_compares_and_takes_only_known_words() -> None:
    asked: list[ConceptRequest] = []

    def draw(request: ConceptRequest, _: threading.Event) -> bytes:
        asked.append(request)
        assert request.strip_px is not None
        width, height = request.strip_px
        buffer = io.BytesIO()
        Image.new("RGB", (width, height * len(request.scenes))).save(buffer, "PNG")
        return buffer.getvalue()

    services = Services(draw_concepts=draw)
    with Viewer(FIRST, services=services) as viewer, dial(viewer) as socket:
        wire = Wire(socket)
        assert wire.read_until(lambda: OPEN in wire.scripts, seconds=30.0)
        (session,) = viewer.sessions
        (panel,) = [p for p in session.display.panels if type(p).__name__ == "ConceptsPanel"]
        act = session.context.act
        for word in ("open 0", "open 9", "remove -1", "choose 1", "remove ", "x" * 100, "remove ²"):
            act(lambda word=word: panel._do(word))
        act(panel._compare)  # one machine alone is refused
        act(lambda: panel._window.toggle(panel._choice))
        act(lambda: panel._do("choose 1"))
        act(lambda: panel._do("choose 2"))
        act(lambda: panel._do("choose 99999"))
        act(panel._compare)
        assert wire.read_until(lambda: bool(panel._pictures), seconds=60.0)
        assert len(panel._pictures) == len(panel._choice.machines) == 3
        assert asked[0].scenes[0].machine.name == "dvf5000"
        opened = panel._choice.machines[1].scene
        act(lambda: panel._do("open 1"))
        assert wire.read_until(lambda: session.state.origin is opened)
        assert len(session.context.store.history.past) == 1
