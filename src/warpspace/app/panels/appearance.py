"""More of the view tab: surface, slices, colour range, what is written on the map, camera."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from warpspace.app.browser.handles import Handle, Input
from warpspace.app.evaluation.cache import Identity
from warpspace.app.evaluation.live_picture import LivePicture
from warpspace.app.panels import PanelContext
from warpspace.app.readouts.places import slices_html
from warpspace.app.state.app_state import AppState
from warpspace.app.state.look import RANGES, SURFACES, slice_positions, slice_spans
from warpspace.app.viewport.named_views import VIEWS
from warpspace.field.grid import PLANES
from warpspace.picture.model import Slice
from warpspace.scene.model import Scene

QUANTITY_NAMES = {
    "position": "position error [µm]",
    "orientation": "tool-orientation error [µrad]",
}
VIEW_NAMES = {"iso": "Iso", "front": "Front", "right": "Right", "top": "Top"}
SWITCHES = {
    "isolines": ("Isolines", "Lines of equal value at the numbers of the colour bar."),
    "arrows": ("Corner arrows", "Displacement of the eight corners, with its length."),
    "worst": ("Worst point", "Where the coloured value is largest."),
    "bars": ("Scale bars", "Two lengths in the picture: geometry in mm, error in µm."),
}


class CameraPanel:
    """Named views and the lens."""

    def __init__(self, context: PanelContext, _state: AppState) -> None:
        keys = {name: key for key, name in VIEW_NAMES.items()}
        assert set(keys.values()) == set(VIEWS)  # noqa: S101 - names and views belong together
        buttons = context.gui.add_button_group(
            "Camera",
            tuple(keys),
            hint="Look from the operator's side, the front, the right, above.",
        )

        def look_from(event: Any) -> None:
            view = keys[event.target.value]
            context.act(lambda: context.fit_view(view))

        buttons.on_click(look_from)
        self._context = context
        self._lens: Input[bool] = Input(
            context.gui.add_checkbox(
                "Orthographic (telephoto)",
                initial_value=False,
                hint="From far away with a narrow lens: parallel edges stay parallel.",
            ),
            context.changed,
        )

    def read(self, state: AppState) -> AppState:
        """Pass a change of the lens on; it is no part of the state."""
        on = self._lens.poll()
        if on is not None:
            self._context.act(lambda: self._context.fit_view(lens=on))
        return state

    def show(self, picture: LivePicture) -> None:
        """Nothing follows the picture."""


class AppearancePanel:
    """What is drawn of the field."""

    def __init__(self, context: PanelContext, state: AppState) -> None:
        self._context = context
        self._surface = self._names(
            "Show as", SURFACES, state.look.surface, "How the volume is drawn."
        )
        self._home: Any = context.gui.add_folder(None)
        self._scene: Scene | None = None
        self._folder: Any = None
        self._slices: dict[str, Input[float]] = {}
        self._quantity = self._names(
            "Quantity", QUANTITY_NAMES, state.look.quantity, "Which error the colours mean."
        )
        self._range = self._names(
            "Colour range",
            RANGES,
            state.look.range_mode,
            "auto: round ends for what is shown. fixed: the number below. shared: one range for"
            " all components, for now and for the scene as opened.",
        )
        self._top: Input[float] = Input(
            context.gui.add_number(
                "Range ends at [µm or µrad]",
                initial_value=state.look.range_top,
                min=0.001,
                max=1e6,
                hint="End of a fixed range; signed components run from minus to plus.",
            ),
            context.changed,
        )
        self._switches: dict[str, Input[bool]] = {
            name: Input(
                context.gui.add_checkbox(text, initial_value=getattr(state.look, name), hint=hint),
                context.changed,
            )
            for name, (text, hint) in SWITCHES.items()
        }
        self._build(state)

    def _names(
        self, label: str, names: Mapping[str, str], value: str, hint: str
    ) -> tuple[Input[str], Mapping[str, str]]:
        handle = self._context.gui.add_dropdown(
            label, tuple(names.values()), initial_value=names[value], hint=hint
        )
        return Input(handle, self._context.changed), names

    def _build(self, state: AppState) -> None:
        if self._folder is not None:
            self._folder.remove()
        self._scene = state.scene
        positions = slice_positions(state.scene, state.look, state.machine)
        with self._home:
            self._folder = self._context.gui.add_folder("Slices", visible=False)
        with self._folder:
            self._follow: Input[bool] = Input(
                self._context.gui.add_checkbox(
                    "Through the tool point",
                    initial_value=state.look.follow,
                    hint="The slices go where the machine's X, Y and Z stand.",
                ),
                self._context.changed,
            )
            self._slices = {
                axis: Input(
                    self._context.gui.add_slider(
                        f"Slice {PLANES[axis]} at {axis} [mm]",
                        min=span.low,
                        max=span.high,
                        step=span.step,
                        initial_value=positions[axis],
                        hint=f"Where the {PLANES[axis]} plane is cut.",
                    ),
                    self._context.changed,
                )
                for axis, span in slice_spans(state.scene).items()
            }
            self._places = Handle(self._context.gui.add_html(""))

    def read(self, state: AppState) -> AppState:
        """Take over what a browser has chosen."""
        look = state.look
        for field, (bound, names) in (
            ("surface", self._surface),
            ("quantity", self._quantity),
            ("range_mode", self._range),
        ):
            text = bound.poll()
            if text is not None:
                keys = {shown: key for key, shown in names.items()}
                look = look.with_choice(**{field: keys.get(text, "")})
        top, follow = self._top.poll(), self._follow.poll()
        if top is not None:
            look = look.with_top(top)
        if follow is not None:
            look = look.switched(follow=follow)
        spans = slice_spans(state.scene)
        for axis, bound in self._slices.items():
            position = bound.poll()
            if position is not None and axis in spans:
                look = look.with_slice(axis, position, spans[axis]).switched(follow=False)
        for name, bound in self._switches.items():
            on = bound.poll()
            if on is not None:
                look = look.switched(**{name: on})
        return state if look is state.look else replace(state, look=look)

    def concerns(self, picture: LivePicture) -> tuple[object, ...]:
        """Give what the widgets show."""
        state = picture.state
        return (
            Identity(state.scene),
            Identity(state.look),
            Identity(state.machine),
            picture.scale.high,
        )

    def show(self, picture: LivePicture) -> None:
        """Make the widgets show the state."""
        state, look = picture.state, picture.state.look
        if self._scene is None or state.scene.workspace != self._scene.workspace:
            self._build(state)
        self._folder.visible = look.surface == "slices" and bool(self._slices)
        for (bound, names), key in (
            (self._surface, look.surface),
            (self._quantity, look.quantity),
            (self._range, look.range_mode),
        ):
            bound.show(names[key])
        self._top.show(look.range_top if look.range_mode == "fixed" else picture.scale.high)
        self._follow.show(look.follow)
        for axis, position in slice_positions(state.scene, look, state.machine).items():
            if axis in self._slices:
                self._slices[axis].show(position)
        self._places.put(
            content=slices_html([one for one in picture.slices if isinstance(one, Slice)])
        )
        for name, bound in self._switches.items():
            bound.show(getattr(look, name))
