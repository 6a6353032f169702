"""Commands of analyses: options from their fields, output from the blocks of their results."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from pkgutil import resolve_name
from typing import TYPE_CHECKING, Any

import click

from warpspace.analysis.options import Option, options_of
from warpspace.cli.file_arguments import DataFile, InputFile, check_files, flag_of
from warpspace.cli.sampling_output import EXTRA_OPTIONS
from warpspace.cli.shared_options import (
    SCENES,
    csv_option,
    force_option,
    json_option,
    output_option,
    plot_option,
    print_json,
    scene_argument,
    warn_second_order,
    write_texts,
)
from warpspace.cli.tables import echo, print_table, print_text, progress, warn
from warpspace.exceptions import OptionError
from warpspace.machine.limits import SWEEP_CASES
from warpspace.scene.text_files import spell_row

if TYPE_CHECKING:
    from warpspace.analysis.blocks import Block
    from warpspace.analysis.description import Analysis, Result
    from warpspace.scene.model import Scene


def command_of(kind: "type[Analysis]") -> click.Command:
    options, run_analysis = EXTRA_OPTIONS.get(kind.name, ((), None))
    command: Callable[..., None] = _runner(kind, run_analysis)
    command.__doc__ = kind.explained()
    takes_one_scene = kind.scenes == (1, 1)
    argument = (
        scene_argument() if takes_one_scene else scene_argument("scenes", nargs=-1, required=True)
    )
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


def _click_option(option: Option) -> Callable[..., Any]:
    if option.positional and option.grammar is not None:
        metavar = option.grammar.metavar if option.required else f"[{option.grammar.metavar}]"
        kind = DataFile() if option.grammar.is_file else str
        return click.argument(
            option.name, type=kind, nargs=-1, required=option.required, metavar=metavar
        )
    traits: dict[str, Any] = {"help": option.help}
    if option.kind is bool:
        traits |= {"is_flag": True}
    elif option.grammar is not None:
        traits |= {"metavar": option.grammar.metavar, "multiple": True, "required": option.required}
        traits["type"] = DataFile() if option.grammar.is_file else str
        traits["type"] = InputFile() if option.grammar.is_extended else traits["type"]
        traits["help"] += " Repeatable." if option.grammar.many or option.grammar.each else ""
    elif option.choices:
        default = None if option.default is None else str(option.default)
        traits |= {"type": click.Choice(option.choices), "default": default}
    else:
        traits |= {"type": option.kind, "required": option.required}
        traits |= {} if option.required else {"default": option.default}
    return click.option(option.flag, option.name, **traits)


def _runner(kind: "type[Analysis]", run_analysis: Callable[..., Any] | None) -> Callable[..., None]:
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
        option_names = {one.name for one in options_of(kind)}
        names, loaded = load_scenes(scenes or (scene,), kind.scenes)
        analysis = read_options(kind, values, loaded[0])
        analysis = analysis.for_output(Path(output).stem if output else None)
        warn(
            *(OptionError(warning).with_names(flag_of) for warning in analysis.warnings(loaded[0]))
        )
        with progress(kind.doing, total=1.0, silent=as_json) as bar:
            if run_analysis is None:
                result = analysis.run_all(loaded, bar.reach)
            else:
                extra_options = {key: values[key] for key in values if key not in option_names}
                files = {"plot": plot, "output": output, "force": force}
                result = run_analysis(
                    analysis, loaded, bar.reach, names=names, **files, **extra_options
                )
        warn(*result.caveats())
        if result.second_order:
            warn_second_order(result.second_order)
        chart, file = plot if kind.has_chart else None, None if run_analysis else output
        logs = result.updated_files()
        written_files = write_result(result, csv_path, chart, file, logs, force=force)
        if as_json:
            document = result.as_json()
            print_json(document | ({"files": written_files} if "files" in document else {}))
            return
        print_blocks(result.blocks())
        for path in filter(None, (*(written_files or [output]), csv_path, plot, *logs)):
            echo(f"wrote {path}")

    return run


def read_options(kind: "type[Analysis]", values: dict[str, Any], scene: "Scene") -> "Analysis":
    arguments: dict[str, Any] = {}
    for option in options_of(kind):
        value = values[option.name]
        if option.grammar is not None:
            if option.grammar.each:
                arguments[option.name] = (
                    tuple(option.read(text, scene) for text in value) or option.default
                )
                continue
            if len(value) > 1 and not option.grammar.many:
                raise OptionError(f"{{{option.name}}} occurs {len(value)} times; expected one")
            value = option.read(",".join(value), scene) if value else option.default
        elif option.enum is not None and value is not None:
            value = option.enum(value)
        arguments[option.name] = value
    return kind(**arguments)


def print_blocks(blocks: "Iterable[Block]") -> None:
    """Print sentences and tables; charts are for pages and files."""
    from warpspace.analysis.blocks import Table

    for block in blocks:
        if isinstance(block, str):
            print_text(block)
        elif isinstance(block, Table):
            if block.title:
                print_text(block.title)
            if block.rows:
                print_table(block.visible_columns, block.cells(rounded=False))
            elif block.empty:
                print_text(block.empty)


def write_result(
    result: "Result",
    csv_path: str | None,
    plot: str | None,
    output: str | None,
    logs: Mapping[str, str],
    *,
    force: bool,
) -> list[str]:
    """Write all files of a result, or none, then logs; return those of -o, the one named first."""
    files: dict[str | Path, str | bytes] = {**result.named_files()}
    written_files: list[str] = []
    if output is not None:
        from warpspace.scene.scene_writer import scene_files

        path, changes = Path(output), result.changes()
        output_files = result.output_files(path.suffix.lower())
        if not output_files and changes:
            output_files = scene_files(changes[-1].scene, path.stem)
        if not output_files:
            raise OptionError(f"-o {output}: {result.no_change}, so no scene is written")
        companions = {
            path.with_name(f"{path.stem}{add}"): output_files[add] for add in output_files if add
        }
        check_files(click.get_current_context(), companions)
        files |= companions
        if "" in output_files:  # last, since it names the others
            files[output] = output_files[""]
        written_files = [output] * ("" in output_files) + [str(target) for target in companions]
    if csv_path is not None:
        table = result.file_table()
        rows = () if table is None else table.csv_rows()
        files[csv_path] = "".join(map(spell_row, rows))
    if plot is not None:
        from warpspace.outputs.charts.result_charts import result_chart
        from warpspace.outputs.figure_files import encode_figure

        draw = resolve_name(result.drawn_by) if result.drawn_by else result_chart
        files[plot] = encode_figure(draw(result), Path(plot).suffix.lower().lstrip("."))
    write_texts(files, force=force)
    write_texts({**logs}, force=True)
    return written_files


MAX_LOADED = 32  # scenes kept in memory at a time


class Fleet(Sequence["Scene"]):
    """Scenes that are loaded when accessed, since all together may not fit into memory.

    Each is loaded once at the start, so that an invalid scene is reported immediately.
    """

    def __init__(self, names: Sequence[str], load: "Callable[[str], Scene]") -> None:
        self._names, self._load = names, load
        for name in names:
            load(name)

    def __len__(self) -> int:
        return len(self._names)

    def __getitem__(self, index: Any) -> Any:
        return self._load(self._names[int(index)])


def load_scenes(
    names: Sequence[str], expected: tuple[int, int | None]
) -> "tuple[Sequence[str], Sequence[Scene]]":
    """Load the scenes of the arguments; a folder stands for its scenes if any number is allowed."""
    from warpspace.scene.library import load_scene

    minimum, maximum = expected
    names = find_scenes(names) if maximum is None else names
    if not minimum <= len(names) <= (maximum or SWEEP_CASES):
        bound = (
            f"at most {maximum or SWEEP_CASES:,}" if len(names) > minimum else f"at least {minimum}"
        )
        raise OptionError(f"{len(names):,} scenes; expected {bound}")
    if len(names) > MAX_LOADED:
        return names, Fleet(names, load_scene)
    return names, [load_scene(name) for name in names]


def find_scenes(names: Sequence[str]) -> list[str]:
    scene_paths: list[str] = []
    for name in names:
        if Path(name).is_dir():
            toml_files = sorted(str(path) for path in Path(name).glob("*.toml"))
            if not toml_files:
                raise OptionError(f"{name}: a folder without .toml files; expected scenes")
            scene_paths += toml_files
        else:
            scene_paths.append(name)
    return scene_paths
