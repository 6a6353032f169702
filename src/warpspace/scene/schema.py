"""The scene format as pydantic models: what each section may hold.

Each section is validated on its own, so that every problem of a file is found in one reading.
"""

from typing import Annotated, Literal

from pydantic import (
    AfterValidator,
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Discriminator,
    Field,
    Tag,
)
from pydantic_core import PydanticCustomError

from warpspace.kinematics.conventions.registry import convention_names
from warpspace.kinematics.conversion.squareness import SquarenessSign
from warpspace.machine.body_source import MESH_UNITS, TOOL_SHAPES
from warpspace.machine.curves.table import MAX_FILE_NAME
from warpspace.machine.limits import (
    EXAGGERATION,
    FULL_TURN_DEG,
    GANTRY_SPAN_MM,
    MAX_ERROR,
    MAX_LENGTH_MM,
    MAX_TEXT,
    MAX_TRACES,
    MIN_HALF_WIDTH,
    MIN_NUMBER,
    MIN_SPAN,
)
from warpspace.machine.travel import TravelDirection


def _entries(spelling: str) -> BeforeValidator:
    """Refuse a list that has not as many entries as its spelling, for instance "[x, y, z]"."""
    count = spelling.count(",") + 1

    def check(value: object) -> object:
        if not isinstance(value, list | tuple) or len(value) != count:
            raise PydanticCustomError("entries", "expected {spelling}", {"spelling": spelling})
        return value

    return BeforeValidator(check)


def _registered_convention(value: object) -> object:
    """Refuse what is no name of a convention."""
    if value not in convention_names():
        names = [f'"{name}"' for name in convention_names()]
        expected = " or ".join([", ".join(names[:-1]), names[-1]])
        raise PydanticCustomError("convention", "expected {names}", {"names": expected})
    return value


def _whole_number(value: object) -> object:
    """Refuse what only equals 1 or -1."""
    if type(value) is not int:
        raise PydanticCustomError("direction", "expected 1 or -1")
    return value


def _at_least(smallest: float) -> AfterValidator:
    """Refuse magnitudes so small that they are neither 0 nor of any use."""

    def check(value: float) -> float:
        if 0.0 < abs(value) < smallest:
            raise PydanticCustomError(
                "too_small", "expected 0, or at least {least}", {"least": f"{smallest:.3g}"}
            )
        return value

    return AfterValidator(check)


def _drawable(value: float) -> float:
    """Refuse display factors that nothing can be drawn with."""
    low, high = EXAGGERATION
    if value > high:
        raise PydanticCustomError("large", "expected at most {high}", {"high": f"{high:,.0f}"})
    if value < low:
        raise PydanticCustomError("small", "expected at least {low}", {"low": f"{low:g}"})
    return value


Number = Annotated[float, Field(strict=True, allow_inf_nan=False)]
Finite = Annotated[Number, _at_least(MIN_NUMBER)]
Length = Annotated[Finite, Field(ge=-MAX_LENGTH_MM, le=MAX_LENGTH_MM)]
Angle = Annotated[Finite, Field(ge=-FULL_TURN_DEG, le=FULL_TURN_DEG)]
ErrorValue = Annotated[Finite, Field(ge=-MAX_ERROR, le=MAX_ERROR)]
HalfWidth = Annotated[Finite, Field(ge=0, le=MAX_ERROR), _at_least(MIN_HALF_WIDTH)]
Point = Annotated[tuple[Length, Length, Length], _entries("[x, y, z]")]
Turn = Annotated[tuple[Angle, Angle, Angle], _entries("[x, y, z]")]
Text = Annotated[str, Field(strict=True, max_length=MAX_TEXT)]


def _ascending_range(value: tuple[float, float]) -> tuple[float, float]:
    """Refuse a range that is empty or upside down."""
    if value[1] - value[0] < MIN_SPAN:
        raise PydanticCustomError("empty_range", "expected [lower, upper] with lower < upper")
    return value


Span = Annotated[
    tuple[Length, Length], _entries("[lower, upper]"), AfterValidator(_ascending_range)
]


ConventionName = Annotated[str, BeforeValidator(_registered_convention)]


class Section(BaseModel):
    """Base of all sections: unknown keys are errors."""

    model_config = ConfigDict(extra="forbid", frozen=True)


class GantrySection(Section):
    """An axis on two guides."""

    span_mm: Annotated[Finite, Field(ge=GANTRY_SPAN_MM[0], le=GANTRY_SPAN_MM[1])]
    across: Literal["x", "y", "z"] | None = None


class MachineSection(Section):
    """A machine, inline in a scene or in a file of its own."""

    title: Text = ""
    description: Text = ""
    source: Text = ""
    chain: Annotated[str, Field(strict=True, max_length=100)]
    offset_mm: dict[str, Point] = {}
    rotation_deg: dict[str, Turn] = {}
    travel: dict[str, Span] = {}
    direction: dict[str, Annotated[Literal[1, -1], BeforeValidator(_whole_number)]] = {}
    gantry: dict[str, GantrySection] = {}
    bodies: dict[str, object] = {}


def _one_of(names: tuple[str, ...]) -> BeforeValidator:
    """Refuse what is none of some names."""

    def check(value: object) -> object:
        if value not in names:
            expected = ", ".join(f'"{name}"' for name in names)
            raise PydanticCustomError("one_of", "expected one of {names}", {"names": expected})
        return value

    return BeforeValidator(check)


class BodySection(Section):
    """The body of one frame: a mesh with its unit and its place, or the shape of a tool."""

    file: Annotated[str, Field(strict=True, max_length=MAX_FILE_NAME)] = ""
    unit: Annotated[str, _one_of(MESH_UNITS)] | None = None
    offset_mm: Point = (0.0, 0.0, 0.0)
    rotation_deg: Turn = (0.0, 0.0, 0.0)
    shape: Annotated[str, _one_of(TOOL_SHAPES)] = ""


class ConventionSection(Section):
    """Where component errors sit, and whether the reference axis itself may be out of direction."""

    component_errors: Annotated[
        Annotated[ConventionName, Tag("word")] | Annotated[dict[str, ConventionName], Tag("table")],
        Discriminator(lambda value: "table" if isinstance(value, dict) else "word"),
    ] = "after_motion"
    reference_axis: Literal["fixed", "free"] = "fixed"
    direction: Annotated[str, _one_of(tuple(TravelDirection))] = TravelDirection.MEAN.value
    squareness: Annotated[str, _one_of(tuple(SquarenessSign))] = SquarenessSign.RIGHT_HAND.value
    measuring_line_mm: dict[str, Point] = {}


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


class ViewSection(Section):
    """How the scene is first shown."""

    exaggeration: Annotated[
        Annotated[Literal["auto"], Tag("word")]
        | Annotated[Number, Field(gt=0), AfterValidator(_drawable), Tag("number")],
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
TAG_AT = {"range": 0, "tolerance": 0, "view": 1, "convention": 1}
"""Which part of a pydantic location is the tag of a union and no key, per kind of value."""
ALTERNATIVES = {
    "range": "a number or [lower, upper]",
    "tolerance": "a half width or { centre = , half_width = }",
    "exaggeration": '"auto" or a number above 0',
    "reference": '"absolute" or axis coordinates, for instance { X = 0, Y = 0, Z = -280 }',
}
"""All that a union takes, per kind of value or field of a section."""
