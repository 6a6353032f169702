"""Which standard test is run, with which options, and whether its path is drawn."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace

from warpspace.bench.base import bench_names, find_test

LONGEST = 80  # characters of one option


@dataclass(frozen=True, slots=True)
class BenchLook:
    """The test that is looked at."""

    name: str = ""  # of the test; empty for none
    # its options as somebody typed or chose them; those left out are the test's own choice
    options: Mapping[str, str] = field(default_factory=dict[str, str])
    path: bool = True  # whether its path is drawn

    def pairs(self) -> Iterator[tuple[str, str]]:
        """Spell what differs from no test, for a line of settings."""
        if self.name:
            yield "test", self.name
            yield from ((f"test.{name}", text) for name, text in sorted(self.options.items()))
        if not self.path:
            yield "test.path", "0"

    def with_test(self, name: str) -> "BenchLook":
        """Choose a test, with its own options; what is no test changes nothing."""
        if name == self.name or (name and name not in bench_names()):
            return self
        return replace(self, name=name, options={})

    def with_option(self, option: str, text: str) -> "BenchLook":
        """Set one option as typed; empty for the test's own choice."""
        options = {key: value for key, value in self.options.items() if key != option}
        if text.strip():
            options[option] = text.strip()[:LONGEST]
        return replace(self, options=options)


def option_names() -> frozenset[str]:
    """List the names of the options of all tests."""
    return frozenset(option.name for name in bench_names() for option in find_test(name).settings())
