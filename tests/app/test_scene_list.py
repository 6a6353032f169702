"""Scenes to choose from: the server's stay, the opened ones are bounded, titles are unique."""

from dataclasses import replace

from warpspace.app.documents.scene_list import MOST_OPENED, SceneList
from warpspace.scene.library import load_scene

FIRST, SECOND = load_scene("dvf5000_first"), load_scene("dvf5000_second")


def test_opened_scenes_are_bounded_and_the_oldest_goes() -> None:
    scenes = SceneList({FIRST.title: FIRST})
    opened = [replace(SECOND, name=f"upload {n}", title=f"Upload {n}") for n in range(23)]
    dropped = [scenes.add(scene)[1] for scene in opened]
    assert dropped == [""] * MOST_OPENED + ["Upload 0", "Upload 1", "Upload 2"]
    assert list(scenes) == [FIRST.title, *(f"Upload {n}" for n in range(3, 23))]
    assert len(scenes) == MOST_OPENED + 1
    assert scenes.fixed == (FIRST,)
    # one that has left and is shown again (undo) comes back as the newest
    assert scenes.add(opened[0]) == ("Upload 0", "Upload 3")
    assert list(scenes)[-1] == "Upload 0"


def test_titles_are_unique_and_never_words_of_the_page() -> None:
    scenes = SceneList({FIRST.title: FIRST})
    again = replace(FIRST, name="other")
    assert scenes.add(again) == (f"{FIRST.title} (2)", "")
    assert scenes.add(replace(SECOND, title="present errors"))[0] == "present errors (2)"
    assert scenes.add(replace(SECOND, title="", name="nothing"))[0] == "nothing (2)"
    assert scenes[f"{FIRST.title} (2)"] is again


def test_an_equal_scene_needs_no_second_title() -> None:
    scenes = SceneList({FIRST.title: FIRST})
    assert scenes.add(load_scene("dvf5000_first")) == (FIRST.title, "")
    assert len(scenes) == 1
