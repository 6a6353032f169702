"""Command `test`: standard tests of machine tools on the model and on measured readings."""

from collections.abc import Callable, Iterator, MutableMapping
from typing import TYPE_CHECKING, Any

import click

from warpspace.cli.file_options import check_output, force_option, plot_option
from warpspace.cli.options import json_option, parse_point, print_json, scene_argument
from warpspace.cli.tables import Column, print_table, print_text
from warpspace.cli.terminal import echo

if TYPE_CHECKING:
    from pathlib import Path

    from warpspace.bench.options import TestOption
    from warpspace.bench.run import BenchResult
    from warpspace.scene.model import Scene


class TestTable(MutableMapping[str, click.Command]):
    """One command a test, built when it is asked for from the options that the test declares."""

    __test__ = False

    def __init__(self) -> None:
        self._built: dict[str, click.Command] = {}

    def _names(self) -> tuple[str, ...]:
        from warpspace.bench.registry import bench_names

        return bench_names()

    def __getitem__(self, name: str) -> click.Command:
        """Build the command of a test."""
        if name not in self._names():
            raise KeyError(name)
        if name not in self._built:
            self._built[name] = _build(name)
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
    """Print the tests there are."""
    from warpspace.bench.registry import bench_names, find_test

    columns = (
        Column("name", leads=True),
        Column("standard", wraps=True),
        Column("what", wraps=True),
    )
    tests = [find_test(name) for name in bench_names()]
    print_table(columns, [(test.name, test.standard, test.title) for test in tests], indent=0)


def _build(name: str) -> click.Command:
    """Build the command of a test."""
    from warpspace.bench.options import options_of
    from warpspace.bench.registry import find_test

    test = find_test(name)
    options = options_of(test)

    def run(**values: Any) -> None:
        _run(name, **values)

    columns = ",".join(column.name for column in test.columns)
    command: Callable[..., Any] = run
    for decorate in (
        json_option,
        force_option,
        plot_option("figure of the test"),
        click.option(
            "--data", type=click.Path(), metavar="FILE", help=f"Measured readings, CSV: {columns}."
        ),
        *(_click_option(option) for option in reversed(options)),
        scene_argument(),
    ):
        command = decorate(command)
    words = f"{test.title} on SCENE ({test.standard}).\n\n{test.words}"
    return click.command(name=name, help=words, short_help=test.title)(command)


def _click_option(option: "TestOption") -> Callable[..., Any]:
    """Spell an option of a test for click."""
    shown = option.default not in {None, ""} and option.kind != "vector"
    unit = f" [{option.unit}]" if option.unit else ""
    common: dict[str, Any] = {
        "default": option.default, "show_default": shown, "help": option.about + unit
    }  # fmt: skip
    if option.kind == "choice":
        return click.option(option.flag, option.name, type=click.Choice(option.choices), **common)
    if option.kind == "count":
        return click.option(option.flag, option.name, type=int, **common)
    if option.kind == "number":
        return click.option(option.flag, option.name, type=float, **common)
    metavar = {"point": "X=..,Y=..", "vector": "X,Y,Z", "axis": "AXIS"}.get(option.kind, "TEXT")
    return click.option(option.flag, option.name, metavar=metavar, **common)


def _run(
    name: str,
    scene: str,
    data: str | None,
    plot: str | None,
    *,
    force: bool,
    as_json: bool,
    **values: Any,
) -> None:
    """Run a test and print, or draw, what it comes to."""
    from warpspace.bench.registry import find_test
    from warpspace.bench.run import run_test
    from warpspace.scene.library import load_scene

    target = None if plot is None else _check_plot(plot, scene, data, force=force)
    loaded = load_scene(scene)
    test = find_test(name)(**_parse(name, values, loaded))
    result = run_test(loaded, test, data)
    if target is not None:
        from warpspace.outputs.charts.bench import bench_chart
        from warpspace.outputs.charts.paper import write_chart

        write_chart(bench_chart(result), target, overwrite=force)
    for note in result.notes:
        echo(f"warpspace: warning: {note}", err=True, fg="yellow")
    if as_json:
        print_json(result_json(result))
        return
    _print(result)
    if target is not None:
        print_text(f"wrote {target}")


def _check_plot(plot: str, scene: str, data: str | None, *, force: bool) -> "Path":
    """Check where the figure is to be written: over nothing that is read."""
    from pathlib import Path

    from warpspace.exceptions import OutputError
    from warpspace.outputs.charts.paper import CHART_ENDINGS

    target = check_output(plot, CHART_ENDINGS, force=force, scenes=(scene,))
    if data is not None and Path(data).exists() and target.exists() and target.samefile(data):
        raise OutputError(f"{plot}: is read by this command; expected another file")
    return target


def _parse(name: str, values: dict[str, Any], scene: "Scene") -> dict[str, Any]:
    """Read the options that click leaves as texts."""
    from warpspace.bench.options import options_of, read_option
    from warpspace.bench.registry import find_test

    found = dict(values)
    for option in options_of(find_test(name)):
        text = values[option.name]
        if option.kind == "point":
            axes = scene.machine.axes
            found[option.name] = {} if text is None else parse_point(text, axes, option.flag)
        elif option.kind == "vector" and text is not None:
            found[option.name] = read_option(option, text, scene.machine.axes)
        elif option.kind == "axis" and text:
            found[option.name] = text.strip().upper()
    return found


def result_json(result: "BenchResult") -> dict[str, object]:
    """Spell a result: the numbers of what was measured at the top, else those of the model."""
    shown = result.measured or result.model
    found: dict[str, object] = {
        "test": result.test.name,
        "scene": result.scene.name,
        "of": shown.who,
        "place": shown.plan.place,
        **{quantity.key: quantity.value for quantity in shown.outcome.quantities},
        **shown.outcome.details,
    }
    if result.measured is not None:
        found["model"] = {q.key: q.value for q in result.model.outcome.quantities}
        found["rms_difference"] = result.rms_difference
    found["notes"] = list(result.notes)
    return found


def _print(result: "BenchResult") -> None:
    """Print the numbers in a table."""
    print_text(f"{result.test.title} ({result.test.standard}) · {result.scene.title}")
    print_text(f"  {result.model.plan.place} · {result.model.plan.readings} readings")
    rows: dict[str, list[str]] = {}
    for index, run in enumerate(result.runs):
        for quantity in run.outcome.quantities:
            row = rows.setdefault(
                quantity.key, [quantity.name, *["–"] * len(result.runs), quantity.unit]
            )
            row[1 + index] = f"{0.0 if abs(quantity.value) < 5e-4 else quantity.value:.3f}"
    columns = (
        Column("", leads=True, wraps=True),
        *(Column(run.who, is_number=True) for run in result.runs),
        Column("unit"),
    )
    print_table(columns, list(rows.values()), indent=2)
