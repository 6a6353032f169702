"""The gain chart: which errors reach a point most, and what each of them does there now."""

from warpspace.app.browser.handles import Input
from warpspace.app.evaluation.live_picture import LivePicture
from warpspace.app.evaluation.sensitivities import SHOWN_BARS, Ranking, rank_picture
from warpspace.app.panels import PanelContext
from warpspace.app.readouts.html import render
from warpspace.app.state.app_state import AppState

# --- The ranked gains of one point as bars with numbers, in HTML ----------------------------------


def spell_ranking(ranking: Ranking) -> str:
    """Spell a ranking."""
    bars = ranking.bars[:SHOWN_BARS]
    lengths = [bar.moved_um if ranking.by_effect else bar.gain for bar in bars]
    longest = max(lengths, default=0.0) or 1.0
    return render(
        "gains",
        at=ranking.at,
        point_mm=ranking.point_mm,
        error_um=ranking.error_um,
        by_effect=ranking.by_effect,
        bars=[(bar, length / longest) for bar, length in zip(bars, lengths, strict=True)],
    )


WORST, MIDDLE = "worst point", "middle of the volume"
BY_GAIN, BY_EFFECT = "gain", "effect of the present errors"


class SensitivitiesPanel:
    """Ranked bars for one point of the volume."""

    def __init__(self, context: PanelContext, _state: AppState) -> None:
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
        if self._picture is not None:
            middle = self._where.handle.value == MIDDLE
            effect = self._by.handle.value == BY_EFFECT
            text = spell_ranking(rank_picture(self._picture, middle=middle, by_effect=effect))
            if text != self._chart.content:
                self._chart.content = text
