"""Limits of user input, in one table: files, options, widgets and drawing."""

import sys

# --- the model ------------------------------------------------------------------------------------

# 100 mm in µm and 0.1 rad in µrad: no rigid-body model of small errors holds beyond
MAX_ERROR = 1e5
MAX_LENGTH_MM = 1e5  # of coordinates, offsets, travels (mm or degrees) and phases
MAX_ADJUSTERS = 60
PITCH_MM = (1e-3, 1e3)  # travel per turn of a screw
GANTRY_SPAN_MM = (1.0, MAX_LENGTH_MM)  # between the two guides of a gantry
FULL_TURN_DEG = 360.0  # of the fixed rotation of a frame
MIN_SPAN = 1e-6  # millimetres or degrees: a range narrower than a nanometre is empty
# smallest magnitude beside 0: below it a processor holds fewer digits, and quotients overflow
MIN_NUMBER = sys.float_info.min
MIN_HALF_WIDTH = 1e-6  # µm or µrad: smallest half width of a tolerance beside 0, a picometre
# µm or µrad: largest half width that an allocation gives, and that sliders reach
MAX_HALF_WIDTH = 1000.0
LIMIT_UM = (1e-3, 1e6)  # of |E| that tolerances are allocated for, µm
PROBABILITY = (0.5, 0.9999)  # of conformity with the limit
COST = (1e-6, 1e6)  # of a tolerance, relative to others

# --- error curves ---------------------------------------------------------------------------------

MAX_COEFFICIENTS = 16
MAX_TERMS = 64  # harmonics of one curve
MAX_ORDER = 1000
# points of a table, values of a table over two axes, rows of a CSV file, readings of an error
MAX_POINTS = 100_000
MAX_COVARIANCE = 200  # errors in one covariance
MAX_RUNS = 1000  # runs of one measured error
MAX_CURVE_ROWS = 2000  # rows of a curve that may be edited or pasted in the app
MAX_CURVE_TEXT = 80_000  # their characters
MAX_TYPED_NUMBER = 40  # characters of one typed number
MAX_CSV_COLUMNS = 256
MAX_CSV_LINES = 500_000  # blank ones included
MAX_CSV_LINE = 16_384  # characters of one line

# --- scene files ----------------------------------------------------------------------------------

MAX_SCENE_BYTES = 4 * 1024 * 1024
MAX_PACKED_TEXT = 1_000_000  # bytes of a scene in a link, unpacked
MAX_KEPT_TEXT = 700_000  # characters that a page keeps of its tab, for a restarted server
MAX_CSV_BYTES = 64 * 1024 * 1024
MAX_KEY_PARTS = 8  # parts of one key, dots between them; `tolerances.default.translation` has three
MAX_NESTING = 32  # lists and tables within each other
MAX_KEYS = 50_000  # parts of all keys of a file together
# brackets, commas, dots, quotes and line ends of a file: 150,000 points of tables, read in 2 s
MAX_MARKS = 1_000_000
MAX_TEXT = 4000  # characters of a title or description
MAX_TRACES = 64
MAX_NOTES = 500  # review notes of a scene
MAX_NOTE_TEXT = 2000  # characters of a note, and of a reply
MAX_NOTE_VIEW = 20_000  # characters of what was on the screen, as in a link
MAX_REPLIES = 200  # of one note, and versions of it
MAX_REPLACED = 1000  # earlier versions that an edit of a note names

MAX_TOLERANCES = 1000  # of the features of a part
MAX_REFINED_VERTICES = 30_000  # added to a mesh for its evaluation, or a fourth of it
MAX_FEATURE_TRIANGLES = 300_000  # of a mesh in which features are recognised: a second or two

# --- meshes and robots: counted before anything is built ------------------------------------------

# of one mesh file, each placing of a mesh counted: 2 s to read and to find the edges of
MAX_TRIANGLES = 250_000
MAX_MESH_PARTS = 5_000  # entries of any one list of a GLB file, and primitives, as often as placed
MAX_SOLIDS = 1_000  # of an STL file, those between which there is text
MAX_MESH_DEPTH = 50  # nodes of a GLB file below each other
MAX_MESH_HEADER = {".glb": 12_000_000, ".ply": 65_536}  # bytes before the numbers
MAX_UPLOAD_BYTES = 11 * 2**20  # of one that a page sends, which is a third longer on its way
MAX_PART_TRIANGLES = 2_000_000  # of a workpiece
MAX_LINKS = 2_000  # links of a URDF file
MAX_SHAPES = 500  # shapes of its links
MAX_URDF_ELEMENTS = 50_000
MAX_URDF_TRIANGLES = 1_000_000  # of all shapes together

# --- programs -------------------------------------------------------------------------------------

MAX_PROGRAM_BYTES = 50 * 1024 * 1024
MAX_PATH_POINTS = 5_000_000  # samples of a path
MAX_WORD = 99_999_999  # of a word that names no position, as controls with eight digits have it
MAX_CALLS = 10  # subprograms within each other
MAX_CYCLE = 10_000  # pecks of a hole
MAX_CYCLE_MOVES = 40_000  # of one line: holes times the moves of each
MAX_TURNS = 1_000  # of one arc
MAX_LINE_POINTS = 100_000  # samples of one line

# --- view of a scene ------------------------------------------------------------------------------

EXAGGERATION = (1e-3, 1e6)
RANGE_TOP = (1e-3, 1e6)  # upper end of a colour scale, µm or µrad
GRID_NODES = (2, 101)  # nodes per axis of a computed grid
LIVE_NODES = (3, 31)  # nodes per axis in the app, an odd number
# memory that the responses of an offline page may take while it is built
MAX_PAGE_BYTES = 600 * 1024 * 1024

# --- figures, animations, samples -----------------------------------------------------------------

MIN_FIGURE_PX = (400, 300)  # width and height
MAX_FIGURE_SIDE_PX = 12_000
MAX_FIGURE_AREA_PX = 64_000_000
ANIMATION_FRAMES = (2, 600)
SAMPLES = (1, 1_000_000_000_000)  # machines of a Monte Carlo run
MOST_CONCEPTS = 8  # machines that are set side by side
WORKERS = (1, 100_000)  # tasks of a Monte Carlo run that are worked on at a time
LOCAL_WORKERS = (1, 512)  # processes or threads of this machine
SWEEP_CASES = 1_000_000  # combinations of scenes and half widths in one sweep
REPAIR_COUNT = (1, 12)  # adjustments in one set
# nodes per axis of the grid for adjustments: all responses are in memory at once
REPAIR_NODES = (2, 41)
