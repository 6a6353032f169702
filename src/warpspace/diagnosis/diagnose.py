"""Diagnosis: the likeliest causes of readings and symptoms, and the checks that separate them."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cache, partial, reduce
from pathlib import Path
from typing import Annotated, Any, ClassVar

import numpy as np

from warpspace.analysis.blocks import Block, Column, Table
from warpspace.analysis.description import NO_JSON, Analysis, ProgressCallback, Result
from warpspace.analysis.options import Files, Grammar, Kinds, option, place_words, typed_word
from warpspace.calibration.next_best import candidates
from warpspace.calibration.part_reports import couple_parts
from warpspace.calibration.readings import Readings
from warpspace.calibration.registry import pair_kinds, read_readings
from warpspace.diagnosis.causes import CauseSet
from warpspace.diagnosis.evidence import (
    PRIOR_NOT_GEOMETRIC,
    PRIOR_SYMPTOM_WRONG,
    RARE,
    Causes,
    Diagnostics,
    Observations,
    Posterior,
)
from warpspace.diagnosis.information import ProposedTest, rank_tests
from warpspace.diagnosis.symptoms import SYMPTOM_SHARE, check_symptoms, observe, read_symptom
from warpspace.exceptions import OptionError
from warpspace.machine.axes import parameter
from warpspace.machine.limits import MAX_SCENE_BYTES
from warpspace.parts.workpiece import REPORT_PLACE_HELP, Place, place_part
from warpspace.resources import assets_dir
from warpspace.scene.model import Scene
from warpspace.scene.text_files import parse_toml, read_text
from warpspace.units import MM_PER_UM

MAX_NEXT, MAX_SETS = 10, 12  # checks; files and symptoms, each
EXPLAINED, LISTED = 3, 0.01  # causes that are explained, and probability of one that is listed
LEAST_UM = 0.1  # effect that is stated
NAMED = 8  # causes of a group that are named
NEGLIGIBLE = 1e-6  # reading per half-width, in standard uncertainties
MANY = 3  # causes of a group that readings should separate before an adjustment
MIN_GAIN_BITS = 0.1  # information of readings that reveal a cause


@dataclass(frozen=True, kw_only=True)
class Diagnose(Analysis):
    """Rank the causes of readings and symptoms of SCENE.

    All errors are within the tolerances of SCENE, except one or two. Reversals, servo mismatches,
    warm scales and readings that are not geometric compete with them. Causes that the readings do
    not separate form a group. Reports the machine element, the effect and the remedy of each cause,
    the test that confirms it, and the checks with the largest expected information per minute. The
    errors of SCENE are not used.
    """

    name = "diagnose"
    task = "measure"
    doing = "diagnosing"
    has_table = True
    data: Files = option((), "CSV file of readings, or the name of a bundled one")
    kinds: Kinds = option(
        (),
        "Kind of the readings, as in calibrate: points, lengths, circular:plane=XZ:radius=150, …"
        " Once for all files, or once for each",
        flag="--kind",
        unset="recognised from the columns of each file",
    )
    symptoms: Annotated[tuple[str, ...], Grammar("TEXT", typed_word, each=True)] = option(
        (),
        "Symptom in words: circle of 100 mm oval by 30 µm at 45°, same in both directions; plate of"
        " 300 x 200 mm: diagonals differ by 0.2 mm; taper 0.03 on 300 along X across Y; step of"
        " 20 µm where Y reverses",
        flag="--symptom",
    )
    place: Place = option(None, REPORT_PLACE_HELP, unset="that of the scene")
    noise_um: float = option(
        1.0,
        "Standard uncertainty of a reading without a column u_um",
        unit="µm",
        low=1e-3,
        high=1e3,
    )
    next_count: int = option(3, "Checks that are proposed", flag="--next", low=1, high=MAX_NEXT)

    def run(self, scene: Scene, watch: ProgressCallback, /) -> "Diagnosis":
        placed = place_part(scene, self.place)
        pairs = zip(self.data, pair_kinds(self.data, self.kinds), strict=True)
        sets = [read_readings(name, placed, kind) for name, kind in pairs]
        return self.diagnose(sets, scene, watch)

    def diagnose(
        self, sets: Sequence[Readings], scene: Scene, watch: ProgressCallback
    ) -> "Diagnosis":
        """Rank the causes of readings and of the symptoms."""
        if not sets and not self.symptoms:
            raise OptionError("no readings, no symptoms; expected {data} FILE or {symptoms} TEXT")
        for name, count in (("data", len(sets)), ("symptoms", len(self.symptoms))):
            if count > MAX_SETS:
                raise OptionError(f"{count} values of {{{name}}}; expected at most {MAX_SETS}")
        causes, noise_mm = CauseSet(scene), self.noise_um * MM_PER_UM
        symptoms = [read_symptom(text, scene) for text in self.symptoms]
        parts = [symptom.observe(causes) for symptom in symptoms]
        if parts:
            check_symptoms(reduce(Observations.joined, parts))
        if sets:
            coupled = couple_parts(sets)
            named = [replace(readings, source=Path(readings.source).name) for readings in coupled]
            parts.append(observe(causes, named, noise_mm, partial(watch, 0.0)))
        prior = PRIOR_NOT_GEOMETRIC if sets else PRIOR_SYMPTOM_WRONG
        observations = reduce(Observations.joined, parts)
        diagnostics = Diagnostics(causes.causes, observations, prior, partial(watch, 0.2))
        posterior = diagnostics.infer()
        groups, rare = diagnostics.group(posterior)
        checks = [
            (check, observe(causes, [check.readings], noise_mm, partial(watch, 0.5)))
            for check in candidates(scene)
        ]
        tests = rank_tests(diagnostics, posterior, checks, lambda share: watch(0.6 + 0.4 * share))
        explanations = Explanations(causes, diagnostics, posterior, tests)
        entries = [explanations.explain(group, number) for number, group in enumerate(groups)]
        if rare:
            summary = f"{len(rare)} others, each below {RARE:.1%}"
            entries.append(replace(explanations.explain(rare, EXPLAINED), summary=summary))
        notes = [f"“{symptom.text}”: {symptom.assumed}" for symptom in symptoms]
        if symptoms:
            notes.append(f"standard uncertainty of a symptom: {SYMPTOM_SHARE:.0%} of its amount")
        if any(readings.sigma_mm is None for readings in sets):
            notes.append(f"standard uncertainty of a reading: {self.noise_um:g} µm")
        zero = [key for key in causes.curves.keys if not causes.half_width(key)]
        notes += [f"{', '.join(zero)}: tolerance 0, no causes"] if zero else []
        return Diagnosis(
            title=scene.title,
            sources=tuple(dict.fromkeys(observations.sets)),
            causes=tuple(entries),
            not_geometric=sum(posterior.disturbed.values()),
            within_tolerance=posterior.within,
            next=tuple(tests[: self.next_count]),
            disturbed=max(posterior.disturbed, key=posterior.disturbed.__getitem__),
            gained_bits=diagnostics.gained_bits(posterior),
            notes=(*(note for readings in sets for note in readings.notes), *notes),
        )


@dataclass(frozen=True)
class CauseGroup:
    """Causes that the readings do not separate."""

    causes: tuple[str, ...]  # the likeliest: one or two out of tolerance
    probability: float  # of the group
    group: tuple[tuple[str, ...], ...]  # the others
    element: str
    effect: str
    confirm: ProposedTest | None
    remedy: str
    title: str = field(metadata=NO_JSON)
    summary: str = field(default="", metadata=NO_JSON)  # of causes that are not listed by name
    # of the element: one, or both that a joint connects; none of an artefact
    axes: tuple[str, ...] = field(default=(), metadata=NO_JSON)

    @property
    def single_causes(self) -> list[str]:
        """The other causes that explain the readings alone."""
        return [causes[0] for causes in self.group if len(causes) == 1]

    def with_count(self, text: str) -> str:
        """Append the number of other causes that are not separated from the likeliest one."""
        count = len(self.single_causes)
        return text + f" or {count} more" * (count > 0)

    @property
    def element_words(self) -> str:
        return self.with_count(self.element)


@dataclass(frozen=True, kw_only=True)
class Diagnosis(Result):
    """Causes by probability, and the checks that separate them."""

    json_keys: ClassVar[tuple[str, ...]] = (
        "causes", "not_geometric", "within_tolerance", "next",
    )  # fmt: skip
    title: str
    sources: tuple[str, ...]  # files and symptoms
    causes: tuple[CauseGroup, ...]  # the likeliest first; last those below 0.1 %
    not_geometric: float
    within_tolerance: float
    next: tuple[ProposedTest, ...]
    disturbed: str  # likeliest disturbed file
    gained_bits: float
    notes: tuple[str, ...]

    @property
    def likeliest(self) -> CauseGroup | None:
        """The first cause, if the readings reveal it and no other explanation is likelier."""
        first = self.causes[0]
        is_hidden = first.summary or self.gained_bits < MIN_GAIN_BITS
        competing = max(self.not_geometric, self.within_tolerance)
        return None if is_hidden or first.probability < competing else first

    def blocks(self) -> Iterator[Block]:
        yield f"{self.title} · {'; '.join(self.sources)}"
        rows: list[tuple[str, float, str]] = []
        for entry in self.causes:
            element = "" if entry.summary else entry.element
            if entry.probability >= LISTED:
                name = entry.summary or entry.with_count(entry.title)
                rows.append((name, 100.0 * entry.probability, element))
        rows.append(("not geometric", 100.0 * self.not_geometric, self.disturbed))
        rows.append(("all errors within tolerance", 100.0 * self.within_tolerance, ""))
        yield Table(
            (
                Column("cause", leads=True, wraps=True, key="cause"),
                Column("probability", ".1f", "%", key="probability_percent"),
                Column("element", wraps=True, key="element"),
            ),
            rows,
        )
        for entry in self.causes[:EXPLAINED]:
            if entry.summary or entry.probability < LISTED:
                continue
            yield f"{entry.title}: {100.0 * entry.probability:.0f} %"
            if entry.single_causes:
                names = ", ".join(entry.single_causes[:NAMED])
                unnamed = len(entry.single_causes) - NAMED
                ending = f" and {unnamed} more" if unnamed > 0 else ""
                yield f"  not separated from {names}{ending}"
            if entry.effect:
                yield f"  effect: {entry.effect}"
            if entry.confirm is not None:
                yield f"  confirm: {entry.confirm.test}, {entry.confirm.minutes:.0f} min"
            yield f"  remedy: {entry.remedy}"
        if self.not_geometric >= LISTED:
            yield f"not geometric: {load_remedies()['not geometric'][1]}"
        yield Table(
            (
                Column("next check", wraps=True, leads=True),
                Column("information", ".2f", "bits"),
                Column("time", ".0f", "min"),
            ),
            [(test.test, test.information_bits, test.minutes) for test in self.next],
            empty="No check separates the causes further.",
        )
        yield from (f"  {note}" for note in self.notes)

    def caveats(self) -> Iterator[str]:
        yield from super().caveats()
        first = max(self.causes, key=lambda entry: entry.probability)
        count = len(first.single_causes) + 1
        if self.gained_bits < MIN_GAIN_BITS:
            yield "the readings reveal no cause: the probabilities are those before the readings"
        elif count > MANY:
            yield f"the readings do not separate {count} causes; run a check before an adjustment"


@dataclass(frozen=True)
class Explanations:
    """Element, effect, confirmation and remedy of causes."""

    set: CauseSet
    diagnostics: Diagnostics
    posterior: Posterior
    tests: Sequence[ProposedTest]

    def explain(self, group: Sequence[Causes], number: int) -> CauseGroup:
        causes = [[self.set.causes[at] for at in members] for members in group]
        names = [tuple(cause.name for cause in members) for members in causes]
        probability = sum(self.posterior.causes[members] for members in group)
        is_explained = number < EXPLAINED and probability >= LISTED
        remedies = [self._find_remedy(name) for name in names[0]]
        rows = self.diagnostics.likeliest(group[0], self.posterior).rows
        is_seen = np.any(np.abs(self.diagnostics.normal.columns[:, rows]) > NEGLIGIBLE)
        return CauseGroup(
            causes=names[0],
            probability=probability,
            group=tuple(names[1:]),
            element="; ".join(element for element, _ in remedies),
            effect=self._describe_effect(group[0]) if is_explained else "",
            confirm=self._find_test(group[0]) if is_explained else None,
            remedy=" ".join(dict.fromkeys(remedy for _, remedy in remedies)),
            title=" and ".join(cause.title for cause in causes[0]),
            summary="" if is_seen else f"{len(group)} without effect on these readings",
            axes=tuple(dict.fromkeys(axis for name in names[0] for axis in self._find_axes(name))),
        )

    def _find_remedy(self, name: str) -> tuple[str, str]:
        """Find the element that has a cause, and its remedy."""
        remedies = load_remedies()
        if " " in name:
            element, remedy = next(row for start, row in remedies.items() if name.startswith(start))
            return element.format(axis=name.rpartition(" ")[2]), remedy
        row = parameter(name)
        element, remedy = remedies[row.name.partition(" of ")[0]]
        place = element.format(axis=row.axis, carrier=self._find_carrier(row.axis))
        return f"{place}: {row.name}", remedy

    def _find_carrier(self, axis: str) -> str:
        chain = self.set.scene.machine.chain
        branch = chain.tool if axis in chain.tool else chain.workpiece
        return ("bed", *branch)[branch.index(axis)]

    def _find_axes(self, name: str) -> list[str]:
        """Find the axes of the element that has a cause: two if it is a joint."""
        axes = [name.rpartition(" ")[2]] if " " in name else [parameter(name).axis]
        if " " not in name and parameter(name).is_constant:
            axes.append(self._find_carrier(*axes))
        return [axis for axis in axes if axis in self.set.scene.machine.axes]

    def _find_test(self, causes: Causes) -> ProposedTest | None:
        """Find the test with the most information per minute on whether these are the causes."""
        rates = [test.bits_by_causes.get(causes, 0.0) / test.minutes for test in self.tests]
        return self.tests[int(np.argmax(rates))] if rates and max(rates) > 0.0 else None

    def _describe_effect(self, members: Causes) -> str:
        hypothesis = self.diagnostics.likeliest(members, self.posterior)
        centre, _ = hypothesis.moments(self.diagnostics.normal, self.posterior.mean)
        curves = self.set.curves
        values = self.set.basis[:, hypothesis.rows] @ centre
        error_um = curves.gains @ values[: len(curves.variables)]
        at = int(np.argmax(np.linalg.norm(error_um, axis=1)))
        largest_um = float(np.linalg.norm(error_um[at]))
        if largest_um < LEAST_UM:
            return ""
        axes, positions = self.set.scene.workspace.volume_axes, curves.positions_of(at)
        place = place_words({axis: q for axis, q in positions.items() if axis in axes})
        return f"up to {largest_um:.1f} µm in the volume, at {place}"


@cache
def load_remedies() -> Mapping[str, tuple[str, str]]:
    """Read element and remedy of each class of causes, with the source."""
    path = assets_dir() / "remedies.toml"
    rows: dict[str, Any] = dict(parse_toml(read_text(path, MAX_SCENE_BYTES), str(path)))
    return {
        name: (row["element"], f"{row['remedy']} ({row['source']})") for name, row in rows.items()
    }
