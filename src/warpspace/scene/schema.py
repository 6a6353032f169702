"""The scene format as pydantic models: what each section may hold.

Each section is validated on its own, so that every problem of a file is found in one reading.
"""

from itertools import pairwise
from typing import Annotated, Literal

from pydantic import AfterValidator, BaseModel, ConfigDict, Discriminator, Field, Tag
from pydantic_core import PydanticCustomError

MAX_ERROR = 1e5
"""100 mm in µm and 0.1 rad in µrad: no rigid-body model of small errors holds beyond."""
MAX_LENGTH_MM = 1e5
MAX_EXAGGERATION = 1e7
MAX_POINTS = 100_000
MAX_TRACES = 64
MAX_TEXT = 4000

Finite = Annotated[float, Field(strict=True, allow_inf_nan=False)]
Length = Annotated[Finite, Field(ge=-MAX_LENGTH_MM, le=MAX_LENGTH_MM)]
ErrorValue = Annotated[Finite, Field(ge=-MAX_ERROR, le=MAX_ERROR)]
HalfWidth = Annotated[Finite, Field(ge=0, le=MAX_ERROR)]
Point = tuple[Length, Length, Length]
Text = Annotated[str, Field(strict=True, max_length=MAX_TEXT)]
TableRow = tuple[Finite, ErrorValue]
HarmonicTerm = tuple[Annotated[Finite, Field(ge=0, le=1000)], ErrorValue, Finite]


def _ascending_range(value: tuple[float, float]) -> tuple[float, float]:
    """Refuse a range that is empty or upside down."""
    if not value[0] < value[1]:
        raise PydanticCustomError("empty_range", "expected [lower, upper] with lower < upper")
    return value


def _sorted_rows(rows: list[tuple[float, float]]) -> list[tuple[float, float]]:
    """Refuse table rows whose positions do not ascend."""
    for number, (low, high) in enumerate(pairwise(rows), start=2):
        if not low[0] < high[0]:
            raise PydanticCustomError(
                "unsorted",
                "row {number}: position {high} after {low}; expected ascending positions",
                {"number": number, "low": low[0], "high": high[0]},
            )
    return rows


Span = Annotated[tuple[Length, Length], AfterValidator(_ascending_range)]


class Section(BaseModel):
    """Base of all sections: unknown keys are errors."""

    model_config = ConfigDict(extra="forbid", frozen=True)


class RampSpec(Section):
    """Zero at the lower end of the axis range, the value at the upper one."""

    ramp: ErrorValue


class PolySpec(Section):
    """Polynomial coefficients, lowest power first."""

    poly: Annotated[list[Finite], Field(min_length=1, max_length=16)]


class HarmonicsSpec(Section):
    """Terms n, amplitude, phase in degrees."""

    harmonics: Annotated[list[HarmonicTerm], Field(min_length=1, max_length=64)]


class TableSpec(Section):
    """Measured points, positions ascending."""

    table: Annotated[
        list[TableRow], Field(min_length=1, max_length=MAX_POINTS), AfterValidator(_sorted_rows)
    ]


class CsvSpec(Section):
    """A column of a CSV file; its first column is the axis position."""

    csv: Annotated[str, Field(strict=True, min_length=1, max_length=1024)]
    column: Annotated[str, Field(strict=True, min_length=1, max_length=256)]


FUNCTION_KEYS = ("ramp", "poly", "harmonics", "table", "csv")


def _which_function(value: object) -> str | None:
    """Tell which kind of error function a raw value spells."""
    if isinstance(value, dict):
        return next((key for key in FUNCTION_KEYS if key in value), None)
    return "number"


ErrorSpec = Annotated[
    Annotated[ErrorValue, Tag("number")]
    | Annotated[RampSpec, Tag("ramp")]
    | Annotated[PolySpec, Tag("poly")]
    | Annotated[HarmonicsSpec, Tag("harmonics")]
    | Annotated[TableSpec, Tag("table")]
    | Annotated[CsvSpec, Tag("csv")],
    Discriminator(
        _which_function,
        custom_error_type="error_function",
        custom_error_message="expected a number or one of { ramp = }, { poly = }, { harmonics = },"
        " { table = }, { csv = , column = }",
    ),
]


class MachineSection(Section):
    """A machine, inline in a scene or in a file of its own."""

    title: Text = ""
    description: Text = ""
    chain: Annotated[str, Field(strict=True, max_length=100)]
    offset_mm: dict[str, Point] = {}
    travel: dict[str, Span] = {}
    direction: dict[str, Literal[1, -1]] = {}


class ConventionSection(Section):
    """Where component errors sit."""

    component_errors: Literal["after_motion", "before_motion"] = "after_motion"


class PointsSection(Section):
    """Functional points in the tool and workpiece frame, and the points that are traced."""

    tool: Point = (0.0, 0.0, 0.0)
    workpiece: Point = (0.0, 0.0, 0.0)
    traces: Annotated[list[Point], Field(max_length=MAX_TRACES)] = []


class DefaultTolerances(Section):
    """Half widths per class, µm or µrad."""

    translation: HalfWidth | None = None
    rotation: HalfWidth | None = None
    squareness: HalfWidth | None = None


class ToleranceSpec(Section):
    """Range of one parameter."""

    centre: ErrorValue = 0.0
    half_width: HalfWidth


def _auto_or_number(value: float) -> float:
    """Refuse a display factor of zero."""
    if value <= 0:
        raise PydanticCustomError("exaggeration", 'expected "auto" or a number above 0')
    return value


class ViewSection(Section):
    """How the scene is first shown."""

    exaggeration: Annotated[
        Annotated[Literal["auto"], Tag("word")]
        | Annotated[
            Finite, Field(le=MAX_EXAGGERATION), AfterValidator(_auto_or_number), Tag("number")
        ],
        Discriminator(lambda value: "word" if isinstance(value, str) else "number"),
    ] = "auto"
    reference: Annotated[
        Annotated[Literal["absolute"], Tag("word")] | Annotated[dict[str, Length], Tag("axes")],
        Discriminator(lambda value: "axes" if isinstance(value, dict) else "word"),
    ] = "absolute"


RangeSpec = Annotated[
    Annotated[Length, Tag("number")] | Annotated[Span, Tag("range")],
    Discriminator(lambda value: "range" if isinstance(value, (list, tuple)) else "number"),
]
ToleranceValue = Annotated[
    Annotated[HalfWidth, Tag("number")] | Annotated[ToleranceSpec, Tag("range")],
    Discriminator(lambda value: "range" if isinstance(value, dict) else "number"),
]
TAGS = frozenset({"number", "word", "axes", "range", *FUNCTION_KEYS})
"""Union tags that pydantic puts into error locations and no file contains as such."""
