"""Which standard test is run, with which options, and whether its path is drawn."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace

from warpspace.app.state.leaf import Leaf, described, said
from warpspace.bench.base import bench_names, find_test

LONGEST = 80  # characters of one option
OWN = "as the test chooses"


@dataclass(frozen=True, slots=True)
class BenchLook:
    """The test that is looked at."""

    name: str = described(
        "",
        "Test",
        choices=lambda _: {"": "none", **{name: name for name in bench_names()}},
        linked="test",
        hint="A standard test, run on the model as it would be on the machine.",
    )
    # as somebody typed or chose them; those left out are the test's own choice
    options: Mapping[str, str] = field(
        default_factory=dict[str, str], metadata=said("Options of the test")
    )
    path: bool = described(
        True,
        "Path in the box",
        linked="test.path",
        hint="Nominal in grey, actual in colour, with the display factor of the box.",
    )

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


def option_leaves(look: BenchLook, axes: Sequence[str]) -> Iterator[Leaf]:
    """Describe the options of the chosen test on a machine; empty is the test's own choice."""
    for option in find_test(look.name).settings() if look.name else ():
        typed = option.grammar.metavar if option.grammar else "a number"
        known = tuple(axes) if typed == "AXIS" else option.choices
        words = {one: option.words.get(one, one) for one in known}
        example = {"X=..,Y=..": "X=0,B=30", "X,Y,Z": "100,0,50"}.get(typed, typed)
        own = f" {option.default_words} where empty." if option.default_words else ""
        yield Leaf(
            f"bench.options.{option.name}",
            option.label,
            "choice" if known else "text",
            {"": OWN, **words} if known else {},
            unit=option.unit,
            hint=f"{option.about}." if known else f"{option.about}. Typed as {example}.{own}",
            linked=f"test.{option.name}",
            longest=LONGEST,
        )
