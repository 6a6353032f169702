"""A hypothesis strategy for scene files: any chain, any axes standing still, any errors."""

from hypothesis import reject
from hypothesis import strategies as st

from chains import chains
from warpspace.exceptions import SceneError
from warpspace.machine.axes import is_linear, parameter
from warpspace.machine.definition import Chain, build_machine
from warpspace.scene.library import parse_scene
from warpspace.scene.model import Scene

HALF_TRAVEL = st.sampled_from([1e-3, 0.5, 40.0, 275.0, 3000.0])
PLACES = st.sampled_from([-300.0, -0.25, 0.0, 12.5, 1000.0])
POINTS = st.lists(PLACES, min_size=3, max_size=3)
HALF_TURN = st.sampled_from([0.0, 0.0, 0.5, 90.0])
ALONG = dict(zip("XYZUVW", "XYZXYZ", strict=True))
MOVES = st.sampled_from([True, True, False])
SIZES = st.sampled_from([-8000.0, -12.5, -1e-6, 0.0, 3.0, 40.0])


@st.composite
def scenes(draw: st.DrawFn, *, everything: bool = False) -> Scene:
    text = draw(scene_texts(everything=everything))
    try:
        return parse_scene(text, "random")
    except SceneError:
        reject()


@st.composite
def scene_texts(draw: st.DrawFn, *, everything: bool = False) -> str:
    chain = draw(chains())
    offsets = {frame: draw(POINTS) for frame in chain.axes if draw(st.booleans())}
    directions = {axis: -1 for axis in chain.axes if draw(st.booleans())}
    parts = ['title = "random"', "[machine]", f'chain = "{chain}"']
    parts += ["[machine.offset_mm]", *_rows(offsets), "[machine.direction]", *_rows(directions)]
    linear = [axis for axis in chain.axes if is_linear(axis)]
    guided = [axis for axis in linear if everything and draw(st.booleans())]
    parts += ["[machine.gantry]", *(f"{axis} = {{ span_mm = 1800 }}" for axis in guided)]
    middles = {axis: draw(PLACES) for axis in chain.axes}
    ranges: dict[str, object] = {}
    for axis in chain.axes:
        half = draw(HALF_TRAVEL) if is_linear(axis) and draw(MOVES) else 0.0
        if everything and not is_linear(axis):
            half = draw(HALF_TURN)
        at = middles[axis]
        ranges[axis] = [at - half, at + half] if half else at
    traced = draw(st.lists(POINTS, max_size=2))
    points = {"tool": draw(POINTS), "workpiece": draw(POINTS), "traces": traced}
    parts += ["[workspace]", *_rows(ranges), "[points_mm]", *_rows(points)]
    errors = {key: draw(curves(key, chain)) for key in draw(_some_keys(chain))}
    guides = "{ guides = [{ ramp = 4 }, { table = [[-300, 0.0], [300, 9.0]] }] }"
    errors |= {f"E{ALONG[axis[0]]}{axis}": guides for axis in guided}
    parts += ["[errors]", *_rows(errors)]
    if draw(st.booleans()):
        widths = "{ translation = 10, rotation = 20, squareness = 25 }"
        parts += ["[tolerances]", f"default = {widths}"]
    if draw(st.booleans()):
        parts += ["[view]", f"reference = {{ {', '.join(_rows(middles))} }}"]
    return "\n".join(parts)


def curves(key: str, chain: Chain) -> st.SearchStrategy[str]:
    if parameter(key).is_constant:
        return SIZES.map(str)
    plain = _plain_curves(key)
    pairs = st.tuples(plain, plain)
    forms = [plain, pairs.map(lambda two: f"{{ forward = {two[0]}, backward = {two[1]} }}")]
    own = parameter(key).axis
    if others := [axis for axis in chain.axes if axis != own]:
        values = st.tuples(st.sampled_from(others), SIZES, SIZES)
        forms.append(values.map(lambda given: _surface(own, *given)))
    return st.one_of(*forms)


def _surface(own: str, other: str, low: float, high: float) -> str:
    return (
        f'{{ table2 = {{ axes = ["{own}", "{other}"], {own} = [-100, 80], {other} = [-50, 0, 90],'
        f" values = [[0.0, {low}, 1.0], [{high}, 2.0, -3.0]] }} }}"
    )


def _plain_curves(key: str) -> st.SearchStrategy[str]:
    constant = SIZES.map(str)
    forms = [
        SIZES.map(lambda value: f"{{ ramp = {value} }}"),
        SIZES.map(lambda value: f"{{ poly = [{value}, 0.001] }}"),
        SIZES.map(lambda value: f"{{ table = [[-100, 0.0], [80, {value}]] }}"),
    ]
    if not is_linear(parameter(key).axis):
        forms.append(SIZES.map(lambda value: f"{{ harmonics = [[2, {abs(value)}, 30.0]] }}"))
    return st.one_of(constant, *forms)


def _some_keys(chain: Chain) -> st.SearchStrategy[list[str]]:
    keys = build_machine(chain).allowed_keys
    return st.lists(st.sampled_from(keys), max_size=5, unique=True)


def _rows(table: dict[str, object]) -> list[str]:
    return [f"{key} = {value}" for key, value in table.items()]
