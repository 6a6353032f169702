"""Solo and mute: which parameters take part while one listens to a few of them."""

from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace


@dataclass(frozen=True, slots=True)
class Exclusions:
    """Parameters that do not take part, and those that alone do.

    Attributes
    ----------
    muted : frozenset of str
        Keys that do not take part.
    soloed : frozenset of str
        Where there are any, only these take part; a muted one among them still does not.
    """

    muted: frozenset[str] = frozenset()
    soloed: frozenset[str] = frozenset()

    def __bool__(self) -> bool:
        """Whether anything is silenced."""
        return bool(self.muted or self.soloed)

    def active(self, key: str) -> bool:
        """Tell whether a parameter takes part."""
        return key not in self.muted and (not self.soloed or key in self.soloed)

    def effective(self, amplitudes: Mapping[str, float]) -> Mapping[str, float]:
        """Give the amplitudes that count, µm or µrad: zero for what does not take part."""
        if not self:
            return amplitudes
        return {key: value if self.active(key) else 0.0 for key, value in amplitudes.items()}

    def with_muted(self, key: str, muted: bool) -> "Exclusions":
        """Exclude one parameter, or include it again."""
        return replace(self, muted=_with(self.muted, key, muted))

    def with_soloed(self, key: str, soloed: bool) -> "Exclusions":
        """Add one parameter to those that alone take part, or take it away."""
        return replace(self, soloed=_with(self.soloed, key, soloed))

    def within(self, keys: Collection[str]) -> "Exclusions":
        """Keep what concerns the parameters of a machine."""
        return Exclusions(self.muted & frozenset(keys), self.soloed & frozenset(keys))


def _with(keys: frozenset[str], key: str, on: bool) -> frozenset[str]:
    """Give a set with or without a key."""
    return keys | {key} if on else keys - {key}
