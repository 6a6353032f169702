"""The scenes a tab can choose from: the server's own, and the newest that were opened in it."""

from collections.abc import Iterator, Mapping

from warpspace.app.state.comparison import NOBODY, PRESENT
from warpspace.scene.model import Scene

MOST_OPENED = 20


class SceneList(Mapping[str, Scene]):
    """Scenes by the title shown, each title once.

    Parameters
    ----------
    scenes : mapping of str to Scene
        Those the server offers to every tab; they stay.
    """

    def __init__(self, scenes: Mapping[str, Scene]) -> None:
        self._fixed = dict(scenes)
        self._opened: dict[str, Scene] = {}

    def __getitem__(self, title: str) -> Scene:
        return self._fixed[title] if title in self._fixed else self._opened[title]

    def __iter__(self) -> Iterator[str]:
        yield from self._fixed
        yield from self._opened

    def __len__(self) -> int:
        return len(self._fixed) + len(self._opened)

    @property
    def fixed(self) -> tuple[Scene, ...]:
        """Scenes that whoever opens a link on this server has as well."""
        return tuple(self._fixed.values())

    def add(self, scene: Scene) -> tuple[str, str]:
        """Take in a scene that was opened from a file or a link.

        Parameters
        ----------
        scene : Scene
            One that is equal to one that is here needs no title of its own.

        Returns
        -------
        tuple of (str, str)
            Its title, and the title of the oldest one where that had to go (empty for none).
        """
        for title, known in self.items():
            if known is scene or known == scene:
                return title, ""
        title = self._free_title(scene)
        self._opened[title] = scene
        dropped = ""
        if len(self._opened) > MOST_OPENED:
            dropped = next(iter(self._opened))
            del self._opened[dropped]
        return title, dropped

    def _free_title(self, scene: Scene) -> str:
        """Give a scene a title that nothing else in a list of scenes has."""
        own = scene.title or scene.name
        title, number = own, 2
        while title in self or title in (PRESENT, NOBODY):
            title = f"{own} ({number})"
            number += 1
        return title


def dropped_words(title: str) -> str:
    """Say that a scene has left the list."""
    return f"The newest {MOST_OPENED} opened scenes are kept; {title} left the list."
