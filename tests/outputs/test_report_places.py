"""The report says where the error is largest in both coordinates, and what a change is."""

from warpspace.outputs.report.blocks import Table
from warpspace.outputs.report.review import ReportSettings, build_review
from warpspace.outputs.report.sections import places_table, statistics_table
from warpspace.scene.library import load_scene


def test_places_and_changes_of_two_scenes() -> None:
    scenes = (load_scene("dvf5000_first"), load_scene("dvf5000_second"))
    review = build_review(scenes, ReportSettings(grid=11, samples=500))
    places = places_table(review)
    assert isinstance(places, Table)
    assert places.rows[0] == (
        "A", "axes X 275 Y −225 Z −480", "in R x 275 y −225 z −51 mm", "--at X=275,Y=-225,Z=-480",
    )  # fmt: skip
    statistics = statistics_table(review)
    assert isinstance(statistics, Table)
    assert [column.heading for column in statistics.columns][1:] == [
        "A",
        "B",
        "B − A",
        "|E_B − E_A|",
    ]
    # 14.5584 − 30.9465 µm: trapezoidal rule over 11³ nodes
    assert statistics.rows[0] == ("mean, µm", "30.9", "14.6", "−16.4", "25.6")
