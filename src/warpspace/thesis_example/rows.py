"""Comparison of every number printed in the thesis with the computed one."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import groupby
from pathlib import Path
from typing import Any, NamedTuple

from warpspace.analysis.blocks import Block, Column, Table
from warpspace.analysis.commands.gains import Gain, gains_at, gains_max
from warpspace.analysis.loop_parameters import loop_keys
from warpspace.analysis.sampling.cases import Case, SamplingPlan
from warpspace.analysis.sampling.distribution import Distribution, build_draws
from warpspace.analysis.sampling.machine_sampling import SampleStatistics, montecarlo
from warpspace.analysis.statistics import Check, check_errors, measured
from warpspace.field.evaluate import View
from warpspace.kinematics.model import Loop, Model
from warpspace.machine.axes import ErrorKind, parameter
from warpspace.machine.errors import ToleranceSet
from warpspace.scene.library import load_scene
from warpspace.scene.model import Scene
from warpspace.thesis_example import MACHINE, MEASURED_MACHINES, printed_tables


class ThesisCase(NamedTuple):
    """The bundled scenes of its machine that the tables are recomputed from."""

    general: Scene  # within the tolerances of table 4-6
    proposed: Scene  # within those of table 4-7
    first: Scene  # the two machines measured
    second: Scene

    @property
    def model(self) -> Model:
        """The DVF5000, its workpiece point on the top rim of the largest workpiece."""
        return self.general.model

    @property
    def keys(self) -> list[str]:
        return [
            key
            for key in self.model.machine.parameter_keys
            if parameter(key).kind is not ErrorKind.LOCATION
        ]


@dataclass(frozen=True, slots=True)
class Row:
    """One printed number or word, and ours."""

    source: str  # table or figure, and page
    key: str  # what it is: parameter key and column
    printed: float | str
    computed: float | str
    agrees: bool  # at the printed precision: within half of the last printed digit
    unit: str = ""
    digits: int = 0  # decimals that are printed
    note: str = ""  # why not, or what there is to know; empty for most


def _source(table: str) -> str:
    kind, chapter, number = table.split("_")
    entry = printed_tables()[table]
    where = f"p. {entry['page']}" if "page" in entry else f"section {entry['section']}"
    return f"{kind} {chapter}-{number}, {where}"


def _number(
    table: str,
    key: str,
    printed: float,
    computed: float,
    digits: int = 0,
    unit: str = "",
    note: str = "",
) -> Row:
    same = abs(computed - printed) <= 0.5 * 10.0**-digits + 1e-9
    remark = printed_tables()["notes"].get(note, note)
    return Row(_source(table), key, float(printed), computed, same, unit, digits, remark)


def _text(table: str, key: str, printed: str, computed: str, unit: str = "", note: str = "") -> Row:
    return Row(_source(table), key, printed, computed, printed == computed, unit, 0, note)


def _tolerance(centre: float, half_width: float) -> str:
    return f"{centre:g}±{half_width:g}" if centre else f"±{half_width:g}"


def _scene_tolerance(tolerances: ToleranceSet, key: str) -> str:
    tolerance = tolerances.get(key)
    return "none" if tolerance is None else _tolerance(tolerance.centre, tolerance.half_width)


COLUMNS = {"|E|": "norm", "x": "x", "y": "y", "z": "z"}  # of a gain, by heading
STEPPED = {("EBB", "x"), ("EBB", "z"), ("EA0B", "y"), ("EC0B", "y")}


def table_4_1(case: ThesisCase) -> Iterator[Row]:
    """Frame origins."""
    printed = printed_tables()["table_4_1"]
    machine = case.model.machine
    for index, name in enumerate("xyz"):
        for frame, value in zip(printed["frames"], printed[name], strict=True):
            offset = (
                machine.axes[frame].offset_mm if frame in machine.axes else machine.fixed_mm[frame]
            )
            note = {"Cz": "c_offset", "tx": "surplus"}.get(frame + name, "")
            yield _number("table_4_1", f"O_{name}{frame}", value, offset[index], 1, "mm", note)


def table_4_2(case: ThesisCase) -> Iterator[Row]:
    printed = printed_tables()["table_4_2"]
    for axis in "XYZBC":
        parameters = [parameter(key) for key in case.keys if parameter(key).axis == axis]
        constants = sum(row.is_constant for row in parameters)
        counts = {"component": len(parameters) - constants, "constant": constants}
        for (what, ours), count in zip(counts.items(), printed[axis], strict=True):
            yield _number("table_4_2", f"{axis} {what} errors", count, ours)
    yield _number("table_4_2", "all parameters", printed["total"], len(case.keys), note="total")


def tool_gains(model: Model) -> dict[str, Gain]:
    at = printed_tables()["table_4_3"]["at"]
    return {gain.key: gain for gain in gains_at(model, Loop.TOOL, model.machine.parameter_keys, at)}


def workpiece_gains(model: Model) -> dict[str, Gain]:
    """Gains of table 4-4, by key, in the steps of the thesis."""
    printed = printed_tables()["table_4_4"]
    ranges = {axis: (float(printed[axis][0]), float(printed[axis][1])) for axis in "BC"}
    keys = model.machine.parameter_keys
    gains = gains_max(model, Loop.WORKPIECE, keys, ranges, printed["step_deg"])
    return {gain.key: gain for gain in gains}


def gain_rows(table: str, gains: dict[str, Gain]) -> Iterator[Row]:
    for key, values in printed_tables()[table].items():
        if key not in gains:
            continue
        for (column, name), value in zip(COLUMNS.items(), values, strict=True):
            ours = abs(getattr(gains[key], name))
            is_half = abs(abs(ours - value) - 0.005) < 1e-9
            note = "half" if is_half else "step" if (key, column) in STEPPED else ""
            unit = f"µm/{parameter(key).unit}"
            yield _number(table, f"{key} {column}", value, ours, 2, unit, note)


def figure_4_3(gains: dict[str, Gain]) -> Iterator[Row]:
    """Order of the key errors, among the parameters whose gain is amplified by a lever."""
    printed = printed_tables()["figure_4_3"]
    turning = [gain for gain in gains.values() if gain.parameter.is_rotation]
    for column, name in COLUMNS.items():
        sizes = {gain.key: abs(getattr(gain, name)) for gain in turning}
        ours = " ".join(sorted(sizes, key=sizes.__getitem__, reverse=True)[: len(printed[name])])
        yield _text("figure_4_3", f"largest {column}", " ".join(printed[name]), ours)


def table_4_5() -> Iterator[Row]:
    """Probability of a value within k standard deviations."""
    for k, value in enumerate(printed_tables()["table_4_5"]["percent"], start=1):
        ours = 100.0 * math.erf(k / math.sqrt(2.0))
        yield _number("table_4_5", f"within {k} sigma", value, ours, 4, "%")


SAMPLES, SEED = 100_000, 0  # as many as the thesis has


def sampled(case: ThesisCase, name: str, distribution: str) -> SampleStatistics:
    side, _, which = name.partition("_")
    loop, model = Loop(side), case.model
    scene = case.general if which == "general" else case.proposed
    keys = loop_keys(model, loop, model.machine.parameter_keys)
    draws = build_draws(scene.tolerances, keys, Distribution(distribution))
    workspace = case.general.workspace
    return montecarlo(Case(model, draws, workspace, View(loop), SamplingPlan(SAMPLES, SEED)))


def table_4_6(case: ThesisCase) -> Iterator[Row]:
    """General tolerance of the 37 parameters."""
    printed = printed_tables()["table_4_6"]
    for key in case.keys:
        row, ours = parameter(key), _scene_tolerance(case.general.tolerances, key)
        yield _text("table_4_6", key, _tolerance(0.0, printed[row.tolerance_class]), ours, row.unit)


def table_4_7(case: ThesisCase) -> Iterator[Row]:
    """Proposed tolerance of the key errors."""
    for key, values in printed_tables()["table_4_7"].items():
        if isinstance(values, list):
            ours = _scene_tolerance(case.proposed.tolerances, key)
            yield _text("table_4_7", key, _tolerance(*values), ours, parameter(key).unit)


def table_4_8(case: ThesisCase) -> Iterator[Row]:
    """Both tolerances of the groups of key errors, and the predicted volumetric error."""
    printed = printed_tables()["table_4_8"]
    for group in printed["groups"]:
        keys, unit = group["keys"], parameter(group["keys"][0]).unit
        for name, scene in (("general", case.general), ("proposed", case.proposed)):
            ours = " ".join(sorted({_scene_tolerance(scene.tolerances, key) for key in keys}))
            key = f"{' '.join(keys)} {name}"
            yield _text("table_4_8", key, _tolerance(*group[name]), ours, unit)
    notes = printed_tables()["notes"]
    for name, value in printed["predicted"].items():
        statistics = sampled(case, name, "uniform")
        normal = sampled(case, name, "normal").mean_um
        note = (notes["peak"] + notes[name]).format(mode=statistics.mode_um, normal=normal)
        key = f"{name.replace('_', ' loop, ')} tolerance: volumetric error"
        yield _number("table_4_8", key, value, statistics.mean_um, 0, "µm", note)


MARKS = {True: "O", False: "X", None: "–"}  # of table 5-5: passes, fails, no tolerance


def squareness_tables(case: ThesisCase) -> Iterator[Row]:
    for table, scene in (("table_5_3", case.first), ("table_5_4", case.second)):
        checks = _checks(case, scene)
        for key, value in printed_tables()[table].items():
            if key in checks:
                yield _number(table, key, value, checks[key].value, 1, "µrad")
                yield _tolerance_row(case, table, checks[key])


def table_5_5(case: ThesisCase) -> Iterator[Row]:
    """Key errors, their marks, and the volumetric error."""
    printed, notes = printed_tables()["table_5_5"], printed_tables()["notes"]
    for which, name in enumerate(MEASURED_MACHINES):
        scene: Scene = getattr(case, name)
        for key, check in _checks(case, scene).items():
            if which == 0:
                yield _tolerance_row(case, "table_5_5", check)
            value, mark = printed[key][2 * which : 2 * which + 2]
            note = ""
            if key in {"EA0Z", "EB0Z"}:
                note = notes["swapped"].format(table="5-3" if which == 0 else "5-4")
                note += notes["digit"] if value == 13.9 else ""
            label = f"{name} machine {key}"
            yield _number("table_5_5", label, value, check.value, 1, check.unit, note)
            yield _text("table_5_5", f"{label} mark", mark, MARKS[check.passes], note=note)
        mean, label = measured(scene).predicted_nodes.mean_um, f"{name} machine volumetric error"
        yield _number("table_5_5", label, printed["volumetric_um"][which], mean, 0, "µm", "ramp")


def _checks(case: ThesisCase, scene: Scene) -> dict[str, Check]:
    return {check.key: check for check in check_errors(scene.errors, case.proposed.tolerances)}


def _tolerance_row(case: ThesisCase, table: str, check: Check) -> Row:
    printed = _tolerance(*printed_tables()["table_4_7"][check.key])
    ours = _scene_tolerance(case.proposed.tolerances, check.key)
    return _text(table, f"{check.key} tolerance", printed, ours, check.unit)


def thesis() -> tuple[Row, ...]:
    """Set every number printed in tables 4-1 to 4-8 and 5-3 to 5-5 of the thesis beside ours."""
    case = ThesisCase(*(load_scene(f"{MACHINE}_{name}") for name in ThesisCase._fields))
    gains = tool_gains(case.model)
    return (
        *table_4_1(case),
        *table_4_2(case),
        *gain_rows("table_4_3", gains),
        *figure_4_3(gains),
        *gain_rows("table_4_4", workpiece_gains(case.model)),
        *table_4_5(),
        *table_4_6(case),
        *table_4_7(case),
        *table_4_8(case),
        *squareness_tables(case),
        *table_5_5(case),
    )


# Presentation: blocks, a JSON object, a page in Markdown.

TABLE_COLUMNS = (
    Column(leads=True),
    Column("quantity", wraps=True, leads=True),
    Column("printed", "s", wraps=True),
    Column("ours", "s", wraps=True, joins=True),
    Column("unit"),
)


def _by_source(rows: Sequence[Row]) -> dict[str, list[Row]]:
    return {source: list(group) for source, group in groupby(rows, lambda row: row.source)}


def thesis_blocks(rows: Sequence[Row]) -> Iterator[Block]:
    for source, group in _by_source(rows).items():
        cells = [
            (
                "" if row.agrees else "≠",
                row.key,
                format_number(row, row.printed),
                format_number(row, row.computed, extra_digits=1),
                row.unit,
            )
            for row in group
        ]
        agreeing = sum(row.agrees for row in group)
        yield Table(TABLE_COLUMNS, cells, f"{source}: {agreeing} of {len(group)} agree")
        yield ""
    different = [row for row in rows if not row.agrees]
    yield f"{len(rows) - len(different)} of {len(rows)} agree. The others:"
    for row in different:
        printed = format_number(row, row.printed)
        computed = format_number(row, row.computed, extra_digits=1)
        yield f"  {row.source}: {row.key}: printed {printed}, ours {computed} {row.unit}"
        yield f"      {row.note}"


def thesis_json(rows: Sequence[Row]) -> dict[str, Any]:
    keys = ("source", "key", "printed", "computed", "agrees")
    return {
        "rows": [
            {key: getattr(row, key) for key in ((*keys, "note") if row.note else keys)}
            for row in rows
        ]
    }


def markdown_page(rows: Sequence[Row]) -> str:
    from jinja2 import StrictUndefined, Template  # other commands start without it

    text = Path(__file__).with_name("thesis.md.j2").read_text("utf-8")
    page = Template(text, undefined=StrictUndefined, keep_trailing_newline=True)
    return page.render(rows=rows, groups=_by_source(rows), format_number=format_number)


def format_number(row: Row, value: float | str, extra_digits: int = 0) -> str:
    """Format a number of a row with the printed digits, or more."""
    if isinstance(value, str):
        return value
    if value == int(value) and row.digits == 0:
        return f"{value:.0f}"
    return f"{value:.{row.digits + extra_digits}f}"
