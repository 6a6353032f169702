"""The ranked gains of one point as bars with numbers, in HTML."""

from warpspace.app.evaluation.sensitivities import SHOWN_BARS, Ranking
from warpspace.app.readouts.html import render


def spell_ranking(ranking: Ranking) -> str:
    """Spell a ranking.

    Parameters
    ----------
    ranking : Ranking

    Returns
    -------
    str
        HTML.
    """
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
