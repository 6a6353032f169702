"""Command `test`: standard tests of machine tools on the model and on measured readings."""

from collections.abc import Iterator, MutableMapping

import click

from warpspace.analysis.blocks import Column
from warpspace.cli.guard import guarded
from warpspace.cli.tables import print_table


class TestTable(MutableMapping[str, click.Command]):
    """One command a test, built when it is asked for from the options that the test declares."""

    __test__ = False

    def __init__(self) -> None:
        self._built: dict[str, click.Command] = {}

    def _names(self) -> tuple[str, ...]:
        from warpspace.bench.base import bench_names

        return bench_names()

    def __getitem__(self, name: str) -> click.Command:
        """Build the command of a test."""
        from warpspace.bench.base import FORMER

        if name not in self._names() and name not in FORMER:
            raise KeyError(name)
        if name not in self._built:
            from warpspace.bench.base import find_test
            from warpspace.cli.analyses import command_of

            test = find_test(name)
            self._built[name] = guarded(command_of(test))
            self._built[name].short_help = test.title
        return self._built[name]

    def __setitem__(self, name: str, command: click.Command) -> None:
        """Put a command in place of the one that would be built."""
        self._built[name] = command

    def __delitem__(self, name: str) -> None:
        """Take such a command away again."""
        del self._built[name]

    def __iter__(self) -> Iterator[str]:
        """Go through the names of all tests."""
        return iter(self._names())

    def __len__(self) -> int:
        """Count the tests."""
        return len(self._names())


@click.group(name="test", commands=TestTable(), invoke_without_command=True)
@click.option("--list", "listing", is_flag=True, help="List the tests: name, standard, what it is.")
@click.pass_context
def test_(context: click.Context, *, listing: bool) -> None:
    """Run a standard test of machine tools on SCENE.

    Each test prints its standard's numbers and draws its customary figure; with --data measured
    readings are evaluated by the same formulas and drawn over the model's. Readings come from the
    exact chain, along the path that the test has on the machine. `warpspace test NAME --help` has
    the options of a test.
    """
    if context.invoked_subcommand is None:
        if not listing:
            raise click.UsageError(
                "Missing argument 'NAME'; `warpspace test --list` has the names."
            )
        _list()


def _list() -> None:
    from warpspace.bench.base import bench_names, find_test

    columns = (
        Column("name", leads=True),
        Column("standard", wraps=True),
        Column("what", wraps=True),
    )
    tests = [find_test(name) for name in bench_names()]
    print_table(columns, [(test.name, test.standard, test.title) for test in tests], indent=0)
