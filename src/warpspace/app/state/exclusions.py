"""Which errors take part: those that were excluded do not, or only the chosen ones do."""

from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace


@dataclass(frozen=True, slots=True)
class Exclusions:
    """Parameters that do not take part, and those that alone do.

    Attributes
    ----------
    excluded : frozenset of str
        Keys that do not take part.
    only : frozenset of str
        Where there are any, only these take part; an excluded one among them still does not.
    """

    excluded: frozenset[str] = frozenset()
    only: frozenset[str] = frozenset()

    def __bool__(self) -> bool:
        """Whether anything is left out."""
        return bool(self.excluded or self.only)

    def active(self, key: str) -> bool:
        """Tell whether a parameter takes part."""
        return key not in self.excluded and (not self.only or key in self.only)

    def effective(self, amplitudes: Mapping[str, float]) -> Mapping[str, float]:
        """Give the amplitudes that count, µm or µrad: zero for what does not take part."""
        if not self:
            return amplitudes
        return {key: value if self.active(key) else 0.0 for key, value in amplitudes.items()}

    def with_excluded(self, key: str, excluded: bool) -> "Exclusions":
        """Exclude one parameter, or include it again."""
        return replace(self, excluded=_with(self.excluded, key, excluded))

    def with_only(self, key: str, only: bool) -> "Exclusions":
        """Add one parameter to those that alone take part, or take it away."""
        return replace(self, only=_with(self.only, key, only))

    def within(self, keys: Collection[str]) -> "Exclusions":
        """Keep what concerns the parameters of a machine."""
        return Exclusions(self.excluded & frozenset(keys), self.only & frozenset(keys))


def _with(keys: frozenset[str], key: str, on: bool) -> frozenset[str]:
    """Give a set with or without a key."""
    return keys | {key} if on else keys - {key}
