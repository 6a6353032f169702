"""The tab "Tests": choose a standard test, see its path in the box and its figure beside it."""

from dataclasses import replace
from typing import Any

from warpspace.analysis.options import Option
from warpspace.app.browser.handles import Input
from warpspace.app.evaluation.cache import Identity
from warpspace.app.evaluation.live_picture import LivePicture
from warpspace.app.panels import PanelContext
from warpspace.app.readouts.bench import bench_html
from warpspace.app.state import edits
from warpspace.app.state.app_state import AppState
from warpspace.bench.base import bench_names, find_test

NONE = "none"
OWN = "as the test chooses"


class TestsPanel:
    """Test, its options, and its figure."""

    __test__ = False

    def __init__(self, context: PanelContext, state: AppState) -> None:
        self._context = context
        gui = context.gui
        self._name: Input[str] = Input(
            gui.add_dropdown(
                "Test",
                (NONE, *bench_names()),
                initial_value=state.bench.name or NONE,
                hint="A standard test, run on the model as it would be on the machine.",
            ),
            context.changed,
        )
        self._path: Input[bool] = Input(
            gui.add_checkbox(
                "Path in the box",
                initial_value=state.bench.path,
                hint="Nominal in grey, actual in colour, with the display factor of the box.",
            ),
            context.changed,
        )
        self._home: Any = gui.add_folder("Set-up", expand_by_default=False, visible=False)
        self._options: dict[str, Input[str]] = {}
        self._parts: list[Any] = []
        self._built: tuple[str, tuple[str, ...]] = ("", ())
        self._figure: Any = gui.add_html(bench_html(None))
        self._written = ""

    def read(self, state: AppState) -> AppState:
        """Take over what a browser has chosen."""
        look = state.bench
        name = self._name.poll()
        if name is not None:
            look = look.with_test("" if name == NONE else name)
            state = edits.with_sight(state, inside=bool(look.name))
        path = self._path.poll()
        if path is not None:
            look = replace(look, path=path)
        for option, bound in self._options.items():
            text = bound.poll()
            if text is not None:
                look = look.with_option(option, "" if text == OWN else text)
        return state if look == state.bench else replace(state, bench=look)

    def concerns(self, picture: LivePicture) -> tuple[object, ...]:
        """Give what the widgets show."""
        return Identity(picture.state.bench), Identity(picture.state.scene.machine)

    def show(self, picture: LivePicture) -> None:
        """Make the widgets show the state."""
        look = picture.state.bench
        self._name.show(look.name or NONE)
        self._path.show(look.path)
        axes = tuple(picture.state.scene.machine.axes)
        if self._built != (look.name, axes):
            self._build(look.name, axes)
        for option, bound in self._options.items():
            empty = OWN if hasattr(bound.handle, "options") else ""
            bound.show(look.options.get(option, empty))

    def _build(self, name: str, axes: tuple[str, ...]) -> None:
        for part in self._parts:
            part.remove()
        self._built = (name, axes)
        self._parts, self._options = [], {}
        self._home.visible = bool(name)
        if not name:
            return
        with self._home:
            for option in find_test(name).settings():
                handle = self._add(option, axes)
                self._parts.append(handle)
                self._options[option.name] = Input(handle, self._context.changed)

    def _add(self, option: Option, axes: tuple[str, ...]) -> Any:
        gui = self._context.gui
        label = f"{option.label} [{option.unit}]" if option.unit else option.label
        typed = option.grammar.metavar if option.grammar else "a number"
        known = axes if typed == "AXIS" else option.choices
        if known:
            return gui.add_dropdown(label, (OWN, *known), hint=f"{option.about}.")
        example = {"X=..,Y=..": "X=0,B=30", "X,Y,Z": "100,0,50"}.get(typed, typed)
        own = f" {option.default_words} where empty." if option.default_words else ""
        return gui.add_text(
            label, initial_value="", hint=f"{option.about}. Typed as {example}.{own}"
        )

    def settle(self, picture: LivePicture) -> None:
        """Draw the figure."""
        written = bench_html(picture.bench)
        if written != self._written:
            self._written = written
            self._figure.content = written
