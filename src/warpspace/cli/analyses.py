"""Commands made from analyses: options from their fields, output from what their results say."""

from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from pkgutil import resolve_name
from typing import TYPE_CHECKING, Any

import click

from warpspace.analysis.options import Option, options_of
from warpspace.cli.file_arguments import DataFile, check_files, flag_of
from warpspace.cli.sampling_output import MORE
from warpspace.cli.shared_options import (
    SCENES,
    csv_option,
    force_option,
    json_option,
    output_option,
    plot_option,
    print_json,
    scene_argument,
    write_texts,
)
from warpspace.cli.tables import echo, progress, warn
from warpspace.exceptions import OptionError
from warpspace.machine.limits import SWEEP_CASES

if TYPE_CHECKING:
    from warpspace.analysis.blocks import Block
    from warpspace.analysis.description import Analysis, Result
    from warpspace.scene.model import Scene


def command_of(kind: "type[Analysis]") -> click.Command:
    options, run_it = MORE.get(kind.name, ((), None))
    command: Callable[..., None] = _runner(kind, run_it)
    command.__doc__ = kind.explained()
    is_one = kind.scenes == (1, 1)
    argument = scene_argument() if is_one else scene_argument("scenes", nargs=-1, required=True)
    decorators = [argument, *map(_click_option, kind.options())]
    if kind.has_table:
        decorators.append(csv_option)
    if kind.makes_scenes:
        decorators.append(output_option(f"{kind.scene_help}: .toml.", *SCENES, required=False))
    if kind.file_help:
        decorators.append(
            output_option(kind.file_help, *kind.file_endings, required=kind.needs_file)
        )
    if kind.has_chart:
        decorators.append(plot_option(kind.chart_help))
    if kind.has_table or kind.makes_scenes or kind.file_help or kind.has_chart or options:
        decorators.append(force_option)
    for decorate in reversed([*decorators, *options, json_option]):
        command = decorate(command)
    return click.command(name=kind.name)(command)


def _click_option(one: Option) -> Callable[..., Any]:
    if one.positional and one.grammar is not None:
        metavar = one.grammar.metavar if one.required else f"[{one.grammar.metavar}]"
        kind = DataFile() if one.grammar.is_file else str
        return click.argument(one.name, type=kind, nargs=-1, required=one.required, metavar=metavar)
    traits: dict[str, Any] = {"help": one.help}
    if one.kind is bool:
        traits |= {"is_flag": True}
    elif one.grammar is not None:
        traits |= {"metavar": one.grammar.metavar, "multiple": True, "required": one.required}
        traits["type"] = DataFile() if one.grammar.is_file else str
        traits["help"] += " Repeatable." if one.grammar.many or one.grammar.each else ""
    elif one.choices:
        default = None if one.default is None else str(one.default)
        traits |= {"type": click.Choice(one.choices), "default": default}
    else:
        traits |= {"type": one.kind, "required": one.required}
        traits |= {} if one.required else {"default": one.default}
    return click.option(one.flag, one.name, **traits)


def _runner(kind: "type[Analysis]", run_it: Callable[..., Any] | None) -> Callable[..., None]:
    def run(
        *,
        as_json: bool,
        scene: str = "",
        scenes: tuple[str, ...] = (),
        csv_path: str | None = None,
        plot: str | None = None,
        output: str | None = None,
        force: bool = False,
        **values: Any,
    ) -> None:
        from warpspace.field.evaluate import second_order_words

        own = {one.name for one in options_of(kind)}
        names, loaded = load_scenes(scenes or (scene,), kind.scenes)
        asked = read_options(kind, values, loaded[0])
        asked = asked.written(Path(output).stem if output else None)
        warn(*(OptionError(words).said(flag_of) for words in asked.warnings(loaded[0])))
        with progress(kind.doing, total=1.0, silent=as_json) as bar:
            if run_it is None:
                found = asked.run_all(loaded, bar.reach)
            else:
                its_own = {key: values[key] for key in values if key not in own}
                files = {"plot": plot, "output": output, "force": force}
                found = run_it(asked, loaded, bar.reach, names=names, **files, **its_own)
        warn(*found.caveats())
        if left_out := found.second_order:
            warn(*second_order_words(left_out))
        chart, file = plot if kind.has_chart else None, None if run_it else output
        wrote = write_result(found, csv_path, chart, file, force=force)
        if as_json:
            spelled = found.as_json()
            print_json(spelled | ({"files": wrote} if "files" in spelled else {}))
            return
        print_blocks(found.blocks())
        for path in filter(None, (*(wrote or [output]), csv_path, plot)):
            echo(f"wrote {path}")

    return run


def read_options(kind: "type[Analysis]", values: dict[str, Any], scene: "Scene") -> "Analysis":
    given: dict[str, Any] = {}
    for one in options_of(kind):
        value = values[one.name]
        if one.grammar is not None:
            if one.grammar.each:
                given[one.name] = tuple(one.read(text, scene) for text in value) or one.default
                continue
            if len(value) > 1 and not one.grammar.many:
                raise OptionError(f"{{{one.name}}} is given {len(value)} times; expected one")
            value = one.read(",".join(value), scene) if value else one.default
        elif one.enum is not None and value is not None:
            value = one.enum(value)
        given[one.name] = value
    return kind(**given)


def print_blocks(blocks: "Iterable[Block]") -> None:
    """Print sentences and tables; charts are for pages and files."""
    from warpspace.analysis.blocks import Table
    from warpspace.cli.tables import print_table, print_text

    for block in blocks:
        if isinstance(block, str):
            print_text(block)
        elif isinstance(block, Table):
            if block.title:
                print_text(block.title)
            if block.rows:
                print_table(block.shown, block.cells())
            elif block.empty:
                print_text(block.empty)


def write_result(
    found: "Result", csv_path: str | None, plot: str | None, output: str | None, *, force: bool
) -> list[str]:
    """Write all files of a result, or none; return those of its output, the one asked for first."""
    from warpspace.scene.text_files import spell_row

    files: dict[str | Path, str | bytes] = {}
    wrote: list[str] = []
    if output is not None:
        from warpspace.scene.scene_writer import scene_files

        path, changes = Path(output), found.changes()
        output_files = found.output_files(path.suffix.lower())
        if not output_files and changes:
            output_files = scene_files(changes[-1].scene, path.stem)
        if not output_files:
            raise OptionError(f"-o {output}: {found.no_change}, so no scene is written")
        beside = {
            path.with_name(f"{path.stem}{add}"): output_files[add] for add in output_files if add
        }
        check_files(click.get_current_context(), beside)
        files |= beside
        if "" in output_files:  # last, since it names the others
            files[output] = output_files[""]
        wrote = [output] * ("" in output_files) + [str(target) for target in beside]
    if csv_path is not None:
        table = found.file_table()
        rows = () if table is None else table.csv_rows()
        files[csv_path] = "".join(map(spell_row, rows))
    if plot is not None:
        from warpspace.outputs.charts.result_charts import result_chart
        from warpspace.outputs.figure_files import encode_figure

        draw = resolve_name(found.drawn_by) if found.drawn_by else result_chart
        files[plot] = encode_figure(draw(found), Path(plot).suffix.lower().lstrip("."))
    write_texts(files, force=force)
    return wrote


FEW = 32  # scenes that are held in memory together


class Fleet(Sequence["Scene"]):
    """Many scenes, each loaded when it is asked for, so that they need not fit into the memory.

    All are loaded once before the first is given, so that a mistake in the last one is said at
    once and not after hours.
    """

    def __init__(self, names: Sequence[str]) -> None:
        from warpspace.scene.library import load_scene

        self._names, self._load = names, load_scene
        for name in names:
            load_scene(name)

    def __len__(self) -> int:
        return len(self._names)

    def __getitem__(self, index: Any) -> Any:
        return self._load(self._names[int(index)])


def load_scenes(
    names: Sequence[str], expected: tuple[int, int | None]
) -> "tuple[Sequence[str], Sequence[Scene]]":
    """Load what arguments stand for; of any number of scenes a folder stands for those in it."""
    from warpspace.scene.library import load_scene

    least, most = expected
    names = find_scenes(names) if most is None else names
    if not least <= len(names) <= (most or SWEEP_CASES):
        known = f"at most {most or SWEEP_CASES:,}" if len(names) > least else f"at least {least}"
        raise OptionError(f"{len(names):,} scenes; expected {known}")
    return names, [load_scene(name) for name in names] if len(names) <= FEW else Fleet(names)


def find_scenes(names: Sequence[str]) -> list[str]:
    found: list[str] = []
    for name in names:
        if Path(name).is_dir():
            inside = sorted(str(path) for path in Path(name).glob("*.toml"))
            if not inside:
                raise OptionError(f"{name}: a folder without .toml files; expected scenes")
            found += inside
        else:
            found.append(name)
    return found
