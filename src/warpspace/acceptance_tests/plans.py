"""Plans of acceptance tests: tests of the bench with limits."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, cast

from warpspace.bench.base import BenchTest, bench_names, find_test
from warpspace.exceptions import OptionError, SceneError, UnknownNameError, WarpspaceError
from warpspace.machine.limits import MAX_ERROR, MAX_SCENE_BYTES
from warpspace.resources import assets_dir
from warpspace.scene.model import Scene
from warpspace.scene.text_files import parse_toml, read_text, spell_value

MAX_TESTS = 200
MAX_MINUTES = 1e5
UNITS = {"um_per_m": "µm/m", "um": "µm", "urad": "µrad"}


@dataclass(frozen=True)
class PlannedTest:
    """A test with the limit of one of its quantities."""

    test: BenchTest
    options: Mapping[str, Any]  # as in the plan
    limit: float
    unit: str  # of the limit, as in its name: "um", "urad" or "um_per_m"
    quantity: str = ""  # key of the quantity; empty for the usual one of the test
    minutes: float | None = None

    @property
    def name(self) -> str:
        """Name of the test and its options, for lists; counts are omitted."""
        units = {setting.name: setting.unit for setting in self.test.settings()}
        parts = (
            f"{_text(value)} {units[key]}".rstrip()
            for key, value in self.options.items()
            if units[key] or not isinstance(value, int)
        )
        return " ".join([self.test.name, *parts])


def plan_names() -> tuple[str, ...]:
    return tuple(path.stem for path in sorted((assets_dir() / "acceptance").glob("*.toml")))


def default_plan(scene: Scene) -> str:
    """Return the bundled plan for the rotary axes of a machine."""
    rotary = "".join(axis.name for axis in scene.machine.axes.values() if not axis.is_linear)
    name = f"iso_5_axes_{''.join(sorted(rotary)).lower()}" if rotary else "iso_3_axes"
    return name if name in plan_names() else "iso_3_axes"


def load_plan(name: str, scene: Scene) -> tuple[PlannedTest, ...]:
    """Read a plan: a file, a bundled one by name, or the text of one; raise SceneError."""
    if "\n" in name:
        return parse_plan(name, "plan", scene)
    path = Path(name)
    if path.suffix != ".toml":
        if name not in plan_names():
            raise UnknownNameError("plan", name, plan_names())
        path = assets_dir() / "acceptance" / f"{name}.toml"
    return parse_plan(read_text(path, MAX_SCENE_BYTES), str(path), scene)


def parse_plan(text: str, source: str, scene: Scene) -> tuple[PlannedTest, ...]:
    document = parse_toml(text, source)
    entries = document.pop("acceptance", None)
    document.pop("title", None)
    problems = [f"{key}: unknown; expected title and [[acceptance]]" for key in document]
    tests: list[PlannedTest] = []
    if not isinstance(entries, list) or not 0 < len(entries) <= MAX_TESTS:
        problems.append(f"acceptance: expected 1 to {MAX_TESTS} tests [[acceptance]]")
        entries = []
    for number, table in enumerate(entries, start=1):
        try:
            tests.append(_read_test(table, scene))
        except WarpspaceError as error:
            problems.append(f"acceptance[{number}]: {error}")
    if problems:
        raise SceneError(source, problems)
    return tuple(tests)


def _read_test(table: object, scene: Scene) -> PlannedTest:
    if not isinstance(table, dict):
        raise OptionError(f"{spell_value(table)}; expected a table")
    fields = dict(table)
    name = fields.pop("test", None)
    if not isinstance(name, str) or name not in bench_names():
        raise UnknownNameError("test", str(name), bench_names())
    kind = find_test(name)
    limits = [key for key in fields if key.partition("_")[0] == "limit"]
    unit = limits[0].partition("_")[2] if len(limits) == 1 else ""
    if unit not in UNITS:
        stated = f"{limits[0]}: has no unit it could be read in; " if limits else ""
        raise OptionError(f"{name}: {stated}expected one limit, limit_um or limit_urad")
    limit = _positive(fields.pop(limits[0]), f"{name}: limit_{unit}", MAX_ERROR)
    minutes = fields.pop("minutes", None)
    if minutes is not None:
        minutes = _positive(minutes, f"{name}: minutes", MAX_MINUTES)
    quantity = fields.pop("quantity", "")
    settings = {setting.name: setting for setting in kind.settings()}
    options: dict[str, Any] = {}
    for key, raw in fields.items():
        if key not in settings:
            raise UnknownNameError(f"option of {name}", key, settings)
        options[key] = settings[key].read(_text(raw), scene)
    return PlannedTest(kind(**options), fields, limit, unit, str(quantity), minutes)


def _positive(raw: object, name: str, largest: float) -> float:
    if isinstance(raw, int | float) and not isinstance(raw, bool) and 0.0 < raw <= largest:
        return float(raw)
    raise OptionError(f"{name}: {spell_value(raw)}; expected above 0, at most {largest:g}")


def _text(raw: Any) -> str:
    """Spell a value of TOML as on the command line."""
    if isinstance(raw, Mapping):
        pairs = cast("Mapping[str, Any]", raw).items()
        return ",".join(f"{key}={_text(part)}" for key, part in pairs)
    parts = cast("list[Any]", raw) if isinstance(raw, list) else [raw]
    return ",".join(str(part).removesuffix(".0") for part in parts)
