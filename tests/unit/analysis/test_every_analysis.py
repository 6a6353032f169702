"""What holds for every analysis: command, JSON, options, hostile text, a stop."""

import json
import re
import subprocess
import sys
from dataclasses import dataclass, fields, replace
from importlib.util import find_spec
from pathlib import Path
from typing import Annotated

import click
import pytest
from click.testing import CliRunner

from warpspace import load_scene
from warpspace.analysis import Analysis, Quantity, Result, option, register, unregister
from warpspace.analysis.blocks import (
    Bars,
    Column,
    Histogram,
    Lines,
    Panel,
    Series,
    Table,
    blocks_html,
    table_html,
)
from warpspace.analysis.description import ExpandedUncertainty, ignore_progress, to_json
from warpspace.analysis.options import options_of
from warpspace.analysis.registry import TASKS, entries, first_line
from warpspace.analysis.uncertainty.propagation import plus_minus, scene_uncertainty
from warpspace.cli.analyses import command_of, print_blocks
from warpspace.cli.file_arguments import guarded
from warpspace.exceptions import OptionError, WarpspaceError

SCENES = ("dvf5000_first", "teach_squareness", "machine_printer_3d")
EVERY = pytest.mark.parametrize("entry", entries(), ids=lambda entry: entry.name)
PARTS = Path(__file__).parents[1] / "parts"
CONTOUR, PLATE = str(PARTS / "contour.ngc"), str(PARTS / "plate.stl")
NEEDED = {
    "acceptance": ("dvf5000_general", {"knots": 2}, ["--knots", "2"]),
    "convert": (
        "dvf5000_first",
        {"wishes": ("component_errors=before_motion",)},
        ["--to", "component_errors=before_motion", "-o", "converted.toml"],
    ),
    "compensate": (
        "dvf5000_first",
        {"sweep": (3,), "formats": ("marlin",)},
        ["--sweep", "3", "--format", "marlin"],
    ),
    "allocate": ("dvf5000_general", {"limit_um": 60.0}, ["--limit", "60"]),
    "conformance": ("dvf5000_first", {"limit_um": 40.0}, ["--limit", "40"]),
    "calibrate": ("fork_head_bc", {"data": ("tcp_on.csv",)}, ["--data", "tcp_on.csv"]),
    "diagnose": (
        "dvf5000_general",
        {"symptoms": ("step of 60 µm where Y reverses",)},
        ["--symptom", "step of 60 µm where Y reverses"],
    ),
    "clamp": ("dvf5000_first", {"file": PLATE, "place": (0, 0, 50)}, [PLATE, "--place", "0,0,50"]),
    "part": (
        "dvf5000_first",
        {"measured": "plate_1.txt", "u95_um": 6.0},
        ["--measured", "plate_1.txt", "--u95", "6"],
    ),
    "program": ("dvf5000_first", {"file": CONTOUR, "length_mm": 80.0}, [CONTOUR, "--length", "80"]),
}
"""Scene, options and what is typed, of analyses that answer nothing without."""
HEAVY = ("scipy", "rich", "matplotlib", "viser", "pyvista")


class StoppedError(Exception):
    """What a page raises that nobody waits for any more."""


def small(kind):
    few = {one.name: 5 for one in options_of(kind) if one.name in ("nodes", "grid")}
    return kind(**few, **(NEEDED[kind.name][1] if kind.name in NEEDED else {}))


def scene_of(name, scene="dvf5000_first"):
    return load_scene(NEEDED[name][0] if name in NEEDED else scene)


@EVERY
def test_the_list_says_what_the_analysis_says(entry):
    kind = entry.load()
    assert (kind.name, kind.task, first_line(kind)) == (entry.name, entry.task, entry.sentence)
    assert entry.task in TASKS
    assert entry.sentence.endswith(".")


@EVERY
def test_every_option_has_help_and_a_range_it_keeps(entry):
    kind = entry.load()
    others = {one.name for one in fields(kind)} - {one.name for one in options_of(kind)}
    assert others <= {
        "stem",
        "mesh",
        "tolerances",
        "text",
        "report",
    }  # names and what is read already
    for one in options_of(kind):
        assert one.about.rstrip(".") == one.about != "", one.name
        assert one.flag.startswith("--")
        for beyond in (one.low, one.high):
            if beyond is not None and one.kind in (int, float):
                wrong = beyond - 1 if beyond == one.low else beyond + 1
                with pytest.raises(OptionError, match=f"{one.name}.*expected"):
                    kind(**{one.name: one.kind(wrong)})
        if one.kind is float:
            with pytest.raises(OptionError, match="expected"):
                kind(**{one.name: float("nan")})


def test_errors_have_two_decimals_in_tables_of_commands_and_one_on_pages():
    heads = Column("|E|", ".2f", "µm"), Column("B − A", "+.2f", "µrad"), Column("share", ".2f", "%")
    table = Table(heads, [(36.05, -0.26, 12.34), (0.04, 1.0, 0.04)])
    assert table.cells(rounded=False) == [["36.05", "-0.26", "12.34"], ["0.04", "+1.00", "0.04"]]
    assert table.cells() == [["36.0", "-0.3", "12.34"], ["0.0", "+1.0", "0.04"]]
    assert '<td class="number">36.0</td>' in table_html(table)
    bars = Bars(
        "",
        "",
        ["a"],
        (Panel("|E|", (Series([36.05]),), "µm"), Panel("share", (Series([36.05]),), "%")),
    )
    assert [*re.findall(r">([0-9.]+)</div>", blocks_html([bars]))] == ["36.0", "36.05"]
    assert [*map(plus_minus, (3.417, 0.0341, 0.0, None))] == ["± 3.4", "± 0.034", "± 0.0", "± ?"]


@EVERY
@pytest.mark.parametrize("scene", SCENES)
def test_text_page_and_json_say_the_result(entry, scene, capsys):
    kind = entry.load()
    loaded = scene_of(entry.name, scene)
    result = small(kind).run(loaded, ignore_progress)
    spelled = result.as_json()
    if type(result).json_fields is Result.json_fields and type(result).as_json is Result.as_json:
        base = {entry.name for entry in fields(Result)}
        own = [entry.name for entry in fields(result) if entry.name not in base]
        keys = [key for key in result.json_keys or own if key != "expanded_uncertainty"]
        keys += ["second_order_um"] * bool(result.second_order)
        assert [key for key in spelled if not key.startswith("u95_")] == keys
    assert json.loads(json.dumps(spelled, allow_nan=False)) == to_json(spelled)
    print_blocks(result.blocks())
    text = capsys.readouterr().out
    assert max(map(len, text.splitlines())) <= 80
    sentences = [block for block in result.blocks() if isinstance(block, str)]
    unrounded = [text for text in sentences if re.search(r"\d\.\d\d µ(m|rad)\b(?!/)", text)]
    assert not unrounded or entry.name == "calibrate"  # it states the scatter of readings
    page = result._repr_html_()
    for table in result.blocks_of(Table):
        for cells, output in ((table.cells(rounded=False), text), (table.cells(), page)):
            for cell in filter(None, cells[0] if table.rows else ()):
                assert cell.split()[0] in output
    assert kind.has_chart == any(map(result.blocks_of, (Bars, Lines, Histogram)))
    assert kind.has_table == (result.file_table() is not None)
    assert bool(kind.makes_scenes) >= bool(result.changes())


@EVERY
def test_the_command_prints_one_json_object(entry, tmp_path, monkeypatch):
    kind = entry.load()
    asked = small(kind)
    few = [[one.flag, "5"] for one in options_of(kind) if one.name in ("nodes", "grid")]
    scene, _, typed = NEEDED.get(entry.name, ("dvf5000_first", {}, []))
    arguments = [scene, "--json", *typed, *(word for pair in few for word in pair)]
    monkeypatch.chdir(tmp_path)
    said = CliRunner().invoke(command_of(entry.load()), arguments)
    assert said.exit_code == 0, said.output
    assert json.loads(said.output) == asked.run(load_scene(scene), ignore_progress).as_json()


@EVERY
def test_what_a_user_calls_a_scene_is_text(entry):
    scene = scene_of(entry.name)
    hostile = replace(scene, title="<script>alert(1)</script>")
    page = small(entry.load()).run(hostile, ignore_progress)._repr_html_()
    assert "<script" not in page


@EVERY
def test_a_stop_is_heeded(entry):
    shares: list[float] = []

    def stop(share):
        shares.append(share)
        raise StoppedError

    try:
        small(entry.load()).run(scene_of(entry.name), stop)
    except StoppedError:
        assert 0.0 <= shares[0] <= 1.0


@EVERY
def test_no_package_hides_the_function_of_an_analysis(entry):
    assert find_spec(f"warpspace.{entry.name.replace('-', '_')}") is None


def test_importing_every_analysis_imports_nothing_heavy():
    places = [entry.place.partition(":")[0] for entry in entries()]
    code = f"import sys, {', '.join(places)}; print(*(m for m in {HEAVY} if m in sys.modules))"
    said = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert said.stdout.split() == []


@dataclass(frozen=True, kw_only=True)
class EvenResult(Result):
    """A result without `json_keys`."""

    sum_mm: Annotated[float, Quantity("Sum", "mm")]

    def blocks(self):
        yield f"sum {self.sum_mm:g} mm"
        yield Table((Column("sum", ".1f", "mm", key="sum_mm"),), [(self.sum_mm,)])


@dataclass(frozen=True, kw_only=True)
class Even(Analysis):
    """Add the travel of SCENE up."""

    name = "even"
    task = "machine"
    has_table = True
    height_mm: float | None = option(None, "What is added", unit="mm", unset="nothing", high=9.0)

    def run(self, scene, _watch, /):
        total = sum(high - low for low, high in (a.travel for a in scene.machine.axes.values()))
        uncertainty = scene_uncertainty(scene)
        return EvenResult(sum_mm=total + (self.height_mm or 0.0), uncertainty=uncertainty)


@dataclass(frozen=True)
class Bore:
    """A record with keys, not in the order of its fields, and with an expanded uncertainty."""

    json_keys = ("radius_um", "expanded_uncertainty", "place")
    place: str
    radius_um: float
    expanded_uncertainty: ExpandedUncertainty[float]
    keys: tuple[str, ...] = ("no", "keys", "of", "JSON")


def test_expanded_uncertainties_follow_the_other_keys():
    bore = Bore("left", 3.0, ExpandedUncertainty(u95_radius_um=0.5))
    assert [*to_json(bore).items()] == [
        ("radius_um", 3.0), ("place", "left"), ("u95_radius_um", 0.5),
    ]  # fmt: skip


def test_an_option_is_described_once():
    (height,) = options_of(Even)
    assert (height.flag, height.label, height.kind) == ("--height", "Height", float)
    with pytest.raises(TypeError, match="wide"):
        option(1, "Something", wide=True)


def test_an_analysis_of_ones_own_is_a_command_like_any_other(tmp_path):
    register(Even)
    try:
        with pytest.raises(OptionError, match="already registered"):
            register(Even)
        (entry,) = (one for one in entries() if one.name == "even")
        command = guarded(command_of(entry.load()))
        run = CliRunner().invoke
        assert "--height FLOAT" in run(command, ["--help"]).output
        target, source = tmp_path / "sum.csv", tmp_path / "uncertain.toml"
        said = run(command, ["teach_squareness", "--height", "2", "--csv", str(target)])
        assert said.exit_code == 0, said.output
        assert target.read_text("utf-8").splitlines()[0] == "sum_mm"
        errors = "[errors]\nEC0Y = 5.0\n[uncertainty]\nEC0Y = 1.0\n"
        source.write_text(f'title = "x"\nmachine = "dvf5000"\n{errors}', "utf-8")
        assert scene_uncertainty(load_scene(source)) is not None
        assert [*json.loads(run(command, [str(source), "--json"]).output)] == ["sum_mm"]
        with pytest.raises(WarpspaceError, match=r"--height 10 mm; expected at most 9 mm"):
            run(command, ["teach_squareness", "--height", "10"], catch_exceptions=False)
        assert isinstance(command, click.Command)
    finally:
        unregister("even")
