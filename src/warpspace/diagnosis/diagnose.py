"""Diagnosis: the causes that explain readings and symptoms, and the checks that separate them."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np

from warpspace.analysis.blocks import Block, Column, Table
from warpspace.analysis.description import NO_JSON, Analysis, ProgressCallback, Result
from warpspace.analysis.options import Files, Grammar, option, typed_word
from warpspace.bench.base import BenchTest, find_test
from warpspace.bench.plan import simulate
from warpspace.bench.placing import PLANES
from warpspace.calibration.readings import Readings
from warpspace.calibration.registry import read_readings
from warpspace.calibration.solve import MeasurementModel
from warpspace.diagnosis.causes import (
    CauseKind,
    ErrorVariables,
    build_causes,
    half_width_of,
    titles,
)
from warpspace.diagnosis.evidence import CauseModel, Posterior
from warpspace.diagnosis.information import InformativeTest, plan_candidates, rank_tests
from warpspace.diagnosis.observations import (
    MAX_SYMPTOMS,
    SYMPTOM_SHARE,
    observe,
    observe_symptoms,
    read_symptom,
)
from warpspace.exceptions import OptionError, SceneError, WarpspaceError
from warpspace.machine.limits import MAX_SCENE_BYTES
from warpspace.resources import assets_dir
from warpspace.scene.model import Scene, evaluate
from warpspace.scene.text_files import parse_toml, read_text
from warpspace.units import MM_PER_UM, Array

MAX_NEXT = 10
EXPLAINED, LISTED = 3, 0.01  # groups that are explained; probability of a group that is listed
MAX_GROUP = 3  # members above which readings are said to reveal little
MIN_GAINED_BITS = 0.1
EFFECT_NODES = 5
NOT_GEOMETRIC = "not_geometric"


@dataclass(frozen=True, kw_only=True)
class Diagnose(Analysis):
    """Rank the causes of readings and symptoms of SCENE.

    All errors are within the tolerances of SCENE, except one or two. Reversal, servo mismatch, the
    temperature of the scales and readings that are not geometric compete with them. Causes that the
    readings do not separate form a group. Reports for each its probability, the machine element,
    its effects, the remedy, and the test that confirms it; and the checks with the largest expected
    information per minute of work. The errors of SCENE are not used.
    """

    name = "diagnose"
    task = "measure"
    doing = "diagnosing"
    has_table = True
    data: Files = option((), "CSV file of readings, or the name of a bundled one")
    kinds: Annotated[tuple[str, ...], Grammar("KIND", typed_word, each=True)] = option(
        (),
        "points, tracker, sphere, sphere-tcp, lengths, or a test with its options such as"
        " circular:plane=XZ:radius=150. Once for all files, or once for each",
        flag="--kind",
        unset="recognised from the columns of each file",
    )
    frame: Literal["machine", "workpiece"] | None = option(
        None, "Frame of error vectors whose columns do not name it", unset="workpiece"
    )
    symptoms: Annotated[tuple[str, ...], Grammar("TEXT", typed_word, each=True)] = option(
        (),
        "Symptom in words: circle of 100 mm oval by 30 µm at 45°, same in both directions; plate of"
        " 300 x 200 mm: diagonals differ by 0.2 mm; taper 0.03 on 300 along X across Y; step of 20"
        " µm where Y reverses",
        flag="--symptom",
        label="Symptoms",
    )
    noise_um: float = option(
        1.0,
        "Standard uncertainty of readings without a column u_um, with all that repeats only once",
        unit="µm",
        low=1e-3,
        high=1e3,
    )
    next_count: int = option(3, "Checks that are proposed", flag="--next", low=1, high=MAX_NEXT)

    def run(self, scene: Scene, watch: ProgressCallback, /) -> "Diagnosis":
        kinds = self.kinds if len(self.kinds) > 1 else (self.kinds or (None,)) * len(self.data)
        if len(kinds) != len(self.data):
            raise OptionError(
                f"{len(kinds)} values of {{kinds}} for {len(self.data)} files; expected 1 or"
                f" {len(self.data)}"
            )
        sets = [
            read_readings(name, scene, kind, self.frame)
            for name, kind in zip(self.data, kinds, strict=True)
        ]
        return self.diagnose_readings(scene, sets, watch)

    def diagnose_readings(
        self, scene: Scene, sets: Sequence[Readings], watch: ProgressCallback
    ) -> "Diagnosis":
        """Rank the causes of readings, and of the symptoms."""
        if not sets and not self.symptoms:
            raise OptionError(
                "no readings and no symptoms; expected {data} FILE or {symptoms} TEXT"
            )
        if len(self.symptoms) > MAX_SYMPTOMS:
            raise OptionError(
                f"{{symptoms}}: {len(self.symptoms)}; expected at most {MAX_SYMPTOMS}"
            )
        variables = ErrorVariables(scene)
        causes = build_causes(variables)
        symptoms = [read_symptom(text, scene) for text in self.symptoms]
        observations = observe_symptoms(variables, symptoms) if symptoms else None
        noise_mm = self.noise_um * MM_PER_UM
        if sets:
            labelled = [replace(readings, source=Path(readings.source).name) for readings in sets]
            model = MeasurementModel.of(scene, labelled, partial(watch, 0.0))
            seen = observe(variables, model, noise_mm)
            observations = seen if observations is None else seen.joined(observations)
        assert observations is not None  # noqa: S101 - for the type checker
        watch(0.2)
        model = CauseModel(causes, observations)
        posterior = model.infer()
        groups, others = model.group(posterior)
        watch(0.4)
        planned = plan_candidates(variables, noise_mm, lambda share: watch(0.4 + 0.3 * share))
        tests = rank_tests(model, posterior, planned, lambda share: watch(0.7 + 0.2 * share))
        explained = _Explanations(scene, variables, model, posterior, tests, load_remedies())
        entries = [explained.explain(group, rank) for rank, group in enumerate(groups)]
        if others:
            entries.append(replace(explained.explain(others, len(groups)), is_rest=True))
        watch(1.0)
        zero = [key for key in variables.keys if not half_width_of(scene, key)]
        return Diagnosis(
            scene=scene,
            causes=tuple(entries),
            not_geometric=sum(posterior.not_geometric.values()),
            within_tolerance=posterior.within,
            next=tuple(ProposedTest.of(test, test.bits) for test in tests[: self.next_count]),
            files=tuple(Path(readings.source).name for readings in sets),
            readings=len(observations.deviations),
            considered=len(causes),
            disturbed=posterior.not_geometric,
            gained_bits=model.gained_bits(posterior),
            remedy_not_geometric=explained.remedies[NOT_GEOMETRIC],
            notes=(
                *(note for readings in sets for note in readings.notes),
                *(f"“{symptom.text}”: {symptom.assumed}" for symptom in symptoms),
                *_assumptions(sets, symptoms, self.noise_um, zero),
            ),
        )


def _assumptions(
    sets: Sequence[Readings], symptoms: Sequence[object], noise_um: float, zero: Sequence[str]
) -> Iterator[str]:
    if any(readings.sigma_mm is None for readings in sets):
        yield f"standard uncertainty of a reading: {noise_um:g} µm (--noise)"
    if symptoms:
        yield f"standard uncertainty of a symptom: {SYMPTOM_SHARE:.0%} of its amount"
    if zero:
        yield f"{', '.join(zero)}: tolerance of zero, no causes"


@dataclass(frozen=True)
class ProposedTest:
    """A test with its expected information."""

    test: str
    options: Mapping[str, Any]
    information_bits: float
    minutes: float

    @classmethod
    def of(cls, test: InformativeTest, bits: float) -> "ProposedTest":
        return cls(test.name, test.options(), bits, test.minutes)


@dataclass(frozen=True)
class CauseGroup:
    """Causes that the readings do not separate."""

    causes: tuple[str, ...]  # the likeliest: one or two
    probability: float  # of the group
    group: tuple[tuple[str, ...], ...]  # the others
    element: str
    effect: str
    confirm: ProposedTest | None
    remedy: str
    title: str = field(metadata=NO_JSON)
    is_rest: bool = field(default=False, metadata=NO_JSON)  # causes below 0.1 %

    @property
    def members(self) -> int:
        """Number of its single causes."""
        return sum(len(causes) == 1 for causes in (self.causes, *self.group))


@dataclass(frozen=True, kw_only=True)
class Diagnosis(Result):
    """Causes by probability, and the checks that separate them."""

    scene: Scene = field(metadata=NO_JSON)
    causes: tuple[CauseGroup, ...]  # the likeliest first; those below 0.1 % are the last
    not_geometric: float
    within_tolerance: float
    next: tuple[ProposedTest, ...]
    files: tuple[str, ...] = field(metadata=NO_JSON)
    readings: int = field(metadata=NO_JSON)
    considered: int = field(metadata=NO_JSON)
    disturbed: Mapping[str, float] = field(metadata=NO_JSON)
    gained_bits: float = field(metadata=NO_JSON)
    remedy_not_geometric: str = field(metadata=NO_JSON)
    notes: tuple[str, ...] = field(default=(), metadata=NO_JSON)

    def blocks(self) -> Iterator[Block]:
        sources = ", ".join(self.files) or "symptoms"
        yield f"{self.scene.title} · {sources} · {self.considered} causes considered"
        rows: list[tuple[Any, ...]] = []
        for entry in self.causes:
            alike = entry.members - 1
            text = f"{entry.title}{f' or {alike} more' if alike > 0 else ''}"
            if entry.is_rest:
                text = f"{len(entry.group) + 1} others, each below 0.1 %"
            if entry.probability >= LISTED:
                rows.append((text, 100.0 * entry.probability, entry.element * (not entry.is_rest)))
        where = max(self.disturbed, key=lambda name: self.disturbed[name], default="")
        rows.append(("not geometric", 100.0 * self.not_geometric, where))
        rows.append(("all errors within tolerance", 100.0 * self.within_tolerance, ""))
        yield Table(
            (
                Column("cause", leads=True, wraps=True, key="cause"),
                Column("probability", ".1f", "%", key="probability_percent"),
                Column("element", wraps=True, key="element"),
            ),
            rows,
            title="Causes",
        )
        for entry in self.causes[:EXPLAINED]:
            if entry.probability < LISTED or entry.is_rest:
                continue
            yield f"{entry.title}: {100.0 * entry.probability:.0f} %"
            alone = [" and ".join(causes) for causes in entry.group if len(causes) == 1]
            if alone:
                yield f"  not separated from {', '.join(alone)}"
            if entry.effect:
                yield f"  effects: {entry.effect}"
            if entry.confirm is not None:
                yield f"  confirm: {entry.confirm.test}, {entry.confirm.minutes:.0f} min"
            yield f"  remedy: {entry.remedy}"
        if self.not_geometric >= LISTED:
            yield f"not geometric: {self.remedy_not_geometric}"
        yield Table(
            (
                Column("check", wraps=True, leads=True),
                Column("information", ".2f", "bits"),
                Column("time", ".0f", "min"),
            ),
            [(step.test, step.information_bits, step.minutes) for step in self.next],
            title="Next checks, by information per minute",
            empty="  No check separates the causes further.",
        )

    def caveats(self) -> Iterator[str]:
        yield from super().caveats()
        yield from self.notes
        first = max(self.causes, key=lambda entry: entry.probability, default=None)
        if self.gained_bits < MIN_GAINED_BITS:
            yield "these readings do not reveal a cause: the probabilities are those assumed before"
        elif first is not None and (first.members > MAX_GROUP or first.is_rest):
            yield (
                f"these readings do not separate {first.members} causes; run one of the next checks"
                " before an adjustment"
            )


@dataclass(frozen=True)
class _Explanations:
    """Element, effects, confirmation and remedy of causes."""

    scene: Scene
    variables: ErrorVariables
    model: CauseModel
    posterior: Posterior
    tests: Sequence[InformativeTest]
    remedies: Mapping[str, str]

    def explain(self, group: Sequence[tuple[int, ...]], rank: int) -> CauseGroup:
        causes = [[self.model.causes[at] for at in members] for members in group]
        names = [tuple(cause.name for cause in members) for members in causes]
        probability = sum(self.posterior.causes[members] for members in group)
        is_explained = rank < EXPLAINED and probability >= LISTED
        kinds = dict.fromkeys(cause.kind for cause in causes[0])
        return CauseGroup(
            causes=names[0],
            probability=probability,
            group=tuple(names[1:]),
            element="; ".join(cause.element for cause in causes[0]),
            effect=self._describe_effect(group[0]) if is_explained else "",
            confirm=self._confirm(group) if is_explained else None,
            remedy=" ".join(self.remedies[kind.value] for kind in kinds),
            title=titles(causes[0]),
        )

    def _confirm(self, group: Sequence[tuple[int, ...]]) -> ProposedTest | None:
        gains = [(test.bits_by_cause.get(group[0], 0.0), test) for test in self.tests]
        useful = [(bits, test) for bits, test in gains if bits > 0.0]
        if not useful:
            return None
        bits, test = max(useful, key=lambda row: row[0] / row[1].minutes)
        return ProposedTest.of(test, bits)

    def _describe_effect(self, members: tuple[int, ...]) -> str:
        """Describe the largest effects of the fitted causes alone: volume, circles."""
        values = self.model.fitted_values(members, self.posterior)
        errors = self.variables.errors(values)
        names = titles([self.model.causes[at] for at in members])
        if not list(errors):
            return ""
        machine = replace(self.scene, errors=errors, reference=None)
        volume = evaluate(machine, grid=EFFECT_NODES, placed=False)
        largest_um = float(np.linalg.norm(volume.error_um, axis=-1).max())
        parts = [f"{names} alone up to {largest_um:.1f} µm in the volume"]
        for plane in PLANES:
            deviation_um = _circular_deviation(machine, plane)
            if deviation_um is not None and deviation_um >= 1.0:
                parts.append(f"a circle {plane} out of round by {deviation_um:.1f} µm")
        return ", ".join(parts)


def _circular_deviation(machine: Scene, plane: str) -> float | None:
    ranges = machine.workspace.ranges
    if not {*plane} <= set(ranges):
        return None
    radius_mm = 0.4 * min(ranges[axis][1] - ranges[axis][0] for axis in plane)
    kind: type[BenchTest] = find_test("circular")
    options: dict[str, Any] = {"plane": plane, "radius_mm": radius_mm, "points": 36}
    try:
        test = kind(**options)
        plan = test.plan(machine)
        readings: Array = simulate(machine, plan, exact=False)
        return float(test.evaluate(plan, readings)["circular_deviation_um"])
    except WarpspaceError:  # the machine cannot run this circle
        return None


def load_remedies() -> dict[str, str]:
    """Read the table of remedies: text and source of each class of causes."""
    path = assets_dir() / "remedies.toml"
    document = parse_toml(read_text(path, MAX_SCENE_BYTES), str(path))
    expected = [*(kind.value for kind in CauseKind), NOT_GEOMETRIC]
    remedies: dict[str, str] = {}
    problems: list[str] = []
    for name in expected:
        row = document.get(name)
        if isinstance(row, dict) and {"remedy", "source"} <= row.keys():
            remedies[name] = f"{row['remedy']} ({row['source']})"
        else:
            problems.append(f"{name}: expected remedy and source")
    if problems:
        raise SceneError(str(path), problems)
    return remedies
