"""The gain chart: which errors reach a point most, and what each of them does there now."""

import html
from dataclasses import dataclass

import numpy as np

from warpspace.app.browser.handles import Input
from warpspace.app.evaluation.live_picture import LivePicture
from warpspace.app.evaluation.sensitivities import SHOWN_BARS, Bar, node_coordinates, rank_gains
from warpspace.app.panels import PanelContext
from warpspace.app.state.app_state import AppState
from warpspace.field.evaluate import build_basis
from warpspace.picture.words import spell_place, spell_positions

WORST, MIDDLE = "worst point", "middle of the volume"
BY_GAIN, BY_EFFECT = "gain", "effect of the present errors"


@dataclass(frozen=True, slots=True)
class Ranking:
    """What the chart shows.

    Attributes
    ----------
    bars : tuple of Bar
        Largest first.
    by_effect : bool
        Ranked by what the present errors do, not by gain.
    place, positions : str
        Where it is drawn and where the axes stand, for people.
    error_um : float, µm
        |E| there.
    """

    bars: tuple[Bar, ...]
    by_effect: bool
    place: str
    positions: str
    error_um: float


class GainsPanel:
    """Ranked bars for one point of the volume.

    Parameters
    ----------
    context : PanelContext
    """

    def __init__(self, context: PanelContext) -> None:
        gui = context.gui
        self._context = context
        self._where: Input[str] = Input(
            gui.add_dropdown(
                "Gains at the",
                (WORST, MIDDLE),
                hint="The point whose error the parameters are ranked for.",
            ),
            self._choose,
        )
        self._by: Input[str] = Input(
            gui.add_dropdown(
                "Ranked by",
                (BY_GAIN, BY_EFFECT),
                hint="Gain: how far the point moves per µm or µrad. Effect: how far it is moved.",
            ),
            self._choose,
        )
        self._chart = gui.add_html("")
        self._picture: LivePicture | None = None

    def _choose(self) -> None:
        """Draw anew where only the choice has changed."""
        self._context.act(self._draw)

    def read(self, state: AppState) -> AppState:
        """Nothing of the state is chosen here."""
        return state

    def show(self, picture: LivePicture) -> None:
        """Nothing that must follow at once."""

    def settle(self, picture: LivePicture) -> None:
        """Rank again."""
        self._picture = picture
        self._draw()

    def _draw(self) -> None:
        """Write the chart."""
        if self._picture is not None:
            middle = self._where.handle.value == MIDDLE
            effect = self._by.handle.value == BY_EFFECT
            text = spell_ranking(rank_picture(self._picture, middle=middle, by_effect=effect))
            if text != self._chart.content:
                self._chart.content = text


def rank_picture(picture: LivePicture, *, middle: bool = False, by_effect: bool = False) -> Ranking:
    """Rank the errors for a point of a picture.

    Parameters
    ----------
    picture : LivePicture
    middle : bool, optional
        The middle of the volume instead of its worst point.
    by_effect : bool, optional
        Rank by what the present errors do.

    Returns
    -------
    Ranking
    """
    state, grid = picture.state, picture.grid
    norm = np.broadcast_to(picture.field.norm_um, grid.shape)
    worst = np.unravel_index(int(np.argmax(norm)), grid.shape)
    chosen = tuple(n // 2 for n in grid.shape) if middle else worst
    node = tuple(int(index) for index in chosen)
    at = node_coordinates(grid.coordinates, node, grid.shape)
    scene = state.scene
    basis = build_basis(
        scene.model,
        scene.errors,
        tuple(state.amplitudes),
        at,
        scene.view(state.loop),
        grid.nominal_mm[node],
    )
    bars = rank_gains(scene.model, state.loop, basis, state.active, (), at)
    if by_effect:
        bars = tuple(sorted(bars, key=lambda bar: -round(bar.moved_um, 9)))
    return Ranking(
        bars, by_effect, spell_place(grid.nominal_mm[node]), spell_positions(at), float(norm[node])
    )


def spell_ranking(ranking: Ranking) -> str:
    """Draw ranked bars as HTML."""
    bars = ranking.bars[:SHOWN_BARS]
    values = [bar.moved_um if ranking.by_effect else bar.gain for bar in bars]
    longest = max(values, default=0.0) or 1.0
    head = (
        '<div style="padding:0 12px 12px;font-size:12px;line-height:1.35">'
        f'<div><span data-value="gain at">{html.escape(ranking.place)}</span> · |E| '
        f"<b data-value='gain point'>{ranking.error_um:.2f} µm</b></div>"
        '<div style="opacity:.75;margin-bottom:6px">axes at '
        f"{html.escape(ranking.positions)}</div>"
    )
    rows = "".join(
        _row(bar, value / longest, ranking.by_effect)
        for bar, value in zip(bars, values, strict=True)
    )
    foot = (
        '<div style="opacity:.65;margin-top:6px">Bar: how far the point moves. Right: gain, and'
        " what the present error adds to |E| here.</div></div>"
    )
    return head + rows + foot


def _row(bar: Bar, share: float, by_effect: bool) -> str:
    """Draw one bar with its numbers."""
    row = bar.parameter
    gain = f"{bar.gain:.3f} µm/{row.unit}"
    adds = f"{bar.along_um:+.2f} µm".replace("-", "−") if bar.moved_um >= 0.005 else "–"
    first, second = (adds, gain) if by_effect else (gain, adds)
    return (
        f'<div data-bar="{row.key}" style="margin-bottom:5px"><div style="display:flex;'
        f'justify-content:space-between;gap:8px"><span><b>{row.key}</b> '
        f'<span style="opacity:.7">{html.escape(row.name)}</span></span>'
        f'<span style="font-variant-numeric:tabular-nums;white-space:nowrap">{first}</span></div>'
        '<div style="display:flex;align-items:center;gap:8px"><div style="flex:1">'
        f'<div style="height:5px;border-radius:2px;background:#4a7ab5;width:{100 * share:.1f}%">'
        '</div></div><span style="opacity:.6;'
        'font-size:11px;white-space:nowrap;width:82px;text-align:right">'
        f"{second}</span></div></div>"
    )
