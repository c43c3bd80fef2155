"""Groups of options of the verbs, each option described once: loads, methods, motions, readings, parts, states."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal, TypedDict, TypeVar, dataclass_transform

from cyclopts import Parameter, Token

from geometry.design import BadInput
from geometry.loads import Magnet, Waveform
from studies.inputs.study_input import IN_STATES, LOAD, LOADS, load_help
from studies.inputs.user_input import AccuracyName
from studies.quantities import choice

if TYPE_CHECKING:
    from fem.accuracy import Accuracy

_T = TypeVar("_T")
FieldLevel = Literal["exact", "paper", "paper-printed", "dipole"]
LawName = Literal["neo-hookean", "mooney-rivlin", "yeoh", "ogden"]
Model = Literal["auto", "axisymmetric", "harmonic", "half", "full"]


def _whole(type_: object, tokens: Sequence[Token]) -> int:
    """Convert a text to an int without rounding; the default converter of cyclopts would turn 2.5 into 2."""
    if not re.fullmatch(r"[+-]?[0-9]+", tokens[0].value.strip()):
        raise BadInput(f"{tokens[0].keyword} must be a whole number; got {tokens[0].value}")
    return int(tokens[0].value)


Whole = Annotated[int, Parameter(converter=_whole, n_tokens=1)]


# Options of several groups or verbs: kind and help stand here only, a default with the group or verb.


def _of_load(name: str, default: str = "") -> Parameter:
    return Parameter(help=load_help(name, default))


def _fields_of_load(*left_out: str, friction: Parameter) -> Any:
    """Return the options for the fields of a load, but some: a dict of those that are given, angles in degrees."""
    helps = {name: _of_load(name) for name in IN_STATES if name not in left_out} | {"friction": friction}
    words = {name for name in helps if LOADS[name].metadata["names"]}
    kinds = {name: Annotated[float | str if name in words else float, text] for name, text in helps.items()}
    typed: Any = TypedDict
    return Annotated[typed("Fields", kinds, total=False), Parameter(name="*")]


Depth = Annotated[float, _of_load("depth")]
Shear = Annotated[float, _of_load("shear")]
ShearY = Annotated[float, _of_load("shear_y")]
STICKS = _of_load("friction", "default: none for a press, stick for a shear")
Friction = Annotated[float | str, STICKS]
if TYPE_CHECKING:
    LoadFields = dict[str, Any]
    VibratingFields = dict[str, Any]
else:
    LoadFields = _fields_of_load("depth", friction=STICKS)
    VibratingFields = _fields_of_load(
        "depth",
        "imperfection",
        friction=Parameter(
            help="stick (the default): the contact area is glued to the plate; none: the plate slides, and moves "
            "along z only; a Coulomb coefficient, from first touch on: the points in touch stick to the plate that "
            "vibrates."
        ),
    )
Body = Annotated[Magnet, Parameter(help="Rigid body, or ignored (the whole beam is silicone).")]
ACCURACY = "Accuracy of mesh and harmonics"
Level = Annotated[AccuracyName, Parameter(help=f"{ACCURACY}.")]
Tolerance = Annotated[
    str,
    Parameter(
        help="Largest relative error, such as 1% or 0.01: choose the cheapest model whose errors in "
        "`magtip validate errors trade` meet it, and a finer one where its own estimates do not, instead of "
        "--accuracy."
    ),
]
StoreFile = Annotated[
    Path,
    Parameter(
        help="File that keeps all solved states; default: the user's, or the one that the environment variable "
        "MAGTIP_STORE names."
    ),
]
FieldModel = Annotated[
    FieldLevel,
    Parameter(
        help="Model of the field: exact; paper, its equation (3); paper-printed, the same with its misprint; dipole."
    ),
]
_SOURCES = (
    "surrogate (of the finite elements, with intervals), fem (finite elements, solved or from the store), or "
    "formulas: finite, magnet, tip, column, paper"
)
LoadSource = Annotated[
    str,
    Parameter(
        help=f"Source of tilt and load: {_SOURCES}; default: the first of surrogate, fem, finite and paper that "
        "covers the design."
    ),
]
TiltSource = Annotated[
    str, Parameter(help=f"Source of the tilt: {_SOURCES}; default: none, so that the magnet does not tilt.")
]
Responses = Annotated[
    Path,
    Parameter(
        help="File of states printed by `magtip solve --json` (or `analytic --json`), one per line, for tilt and "
        "load instead of a --level."
    ),
]
States = Annotated[
    Path,
    Parameter(
        help="File of states printed by `magtip solve --json`, for the mechanics; default: some 40 states of the "
        "design, which are solved the first time and stay in the store."
    ),
]
Rejecting = Annotated[
    bool,
    Parameter(
        help="Take a uniform ambient field for three more unknowns, so that it does not count as a force; needs "
        "three chips of three axes or more, an array two a beam (in firmware three)."
    ),
]
Untilted = Annotated[bool, Parameter(help="Assume that the magnet does not tilt.")]
Mode = Annotated[
    Literal["component", "magnitude"],
    Parameter(help="Reading of an element: component B.n, or magnitude |B| as in the paper."),
]
Tolerances = Annotated[list[str], Parameter(name="--tolerance")]
ForceNoise = Annotated[
    float,
    Parameter(help="Standard deviation of a measured force, N; default: half a percent of the largest one."),
]
Temperature = Annotated[
    float,
    Parameter(
        help="Temperature of the readings, C, for a --calibration whose bench had temperatures; default: that beside "
        "the readings, or unknown, which widens the intervals."
    ),
]
Calibration = Annotated[
    Path,
    Parameter(
        help="calibration.json of `magtip calibrate`: take the made sensor that it describes, with 90 % intervals."
    ),
]
ASKED = Parameter(help=choice())
AXIS = Parameter(
    help="Values NAME=a,b,c or NAME=lin:START:STOP:COUNT or NAME=log:START:STOP:COUNT of a field of the design (D, "
    f"L, E, nu, law, ...), of the load ({', '.join(LOAD)}) or of magnet; lengths also over the diameter, as L/D and "
    "depth/D; repeatable."
)


@dataclass_transform(kw_only_default=True, frozen_default=True)
def _options(group: type[_T]) -> type[_T]:
    return Parameter(name="*")(dataclass(frozen=True, slots=True, kw_only=True)(group))


@_options
class Motion:
    """Motion of the plate or of the grip, and the contact."""

    depth: Depth | None = None
    depths: str | None = None
    """Several depths of a press, d1,d2,d3, mm."""
    force: float | None = None
    """Normal force of a press, N, instead of its depth, which is searched for."""
    forces: str | None = None
    """Several normal forces of a press, f1,f2,f3, N."""
    shear_force: float | None = None
    """Force along x, N, to which the plate shears the tip after the press to --force, while it holds that normal
    force by its depth."""
    shear_force_y: float | None = None
    """The same along y, N."""
    steps: Whole | None = None
    """Number of equal steps of the depth, or of the shear (at full depth) if there is one; or of the forces in their
    place; default: 1."""
    load: LoadFields = field(default_factory=dict)


@_options
class Pose:
    """Pose of the magnet."""

    shift: str = "0,0,0"
    """Displacement x,y,z of the magnet's centre, mm; z is negative towards the base."""
    tilt: str = "0,0"
    """Rotation vector rx,ry of the magnet about its centre, rad: positive ry tilts its axis towards x, positive rx
    towards -y (a state has rx = -tilt_y and ry = tilt)."""


@_options
class Elements:
    """Finite elements: what the magnet is, how accurate they are, and where their answers are kept."""

    magnet: Body = "rigid"
    accuracy: Level = "standard"
    store: StoreFile | None = None

    @property
    def level(self) -> Accuracy:
        """The accuracy."""
        from fem.accuracy import level

        return level(self.accuracy)


@_options
class Wanted:
    """The accuracy that is wanted, or the tolerance that chooses one."""

    accuracy: Annotated[AccuracyName | None, Parameter(help=f"{ACCURACY}; default: standard.")] = None
    tolerance: Tolerance | None = None

    @property
    def name(self) -> AccuracyName:
        """The name of the accuracy, or of its default."""
        return self.accuracy or "standard"


@_options
class Method:
    """Model, mesh and accuracy of the finite elements."""

    magnet: Body = "rigid"
    model: Model = "auto"
    """Finite-element model; auto takes the smallest one that can carry the load."""
    harmonics: Whole | None = None
    """Number of harmonics of model harmonic, 0 to 12 (a shear needs 1 or more); default: that of the accuracy."""
    mesh: Path | None = None
    """File with a tetrahedral mesh of this design, whole or the half at y >= 0, in a format of meshio (.vtu, .msh,
    .inp, ...), with regions named silicone and magnet; errors are then not estimated."""
    wanted: Wanted = Wanted()
    store: StoreFile | None = None


@_options
class SourceOfLoad:
    """From what tilt and load follow."""

    level: LoadSource | None = None
    responses: Responses | None = None


@_options
class Basis:
    """Poses and readings on which a layout of Hall elements is evaluated."""

    source: SourceOfLoad = SourceOfLoad()
    ignore_tilt: Untilted = False
    mode: Mode = "component"
    clearance: float = 0.0
    """Least distance between an element and the moved magnet or the beam's wall, mm."""
    reject_ambient: Rejecting = False


@_options
class Selection:
    """States of the store, all of them by default."""

    store: StoreFile | None = None
    where: list[str] | None = None
    """Filter by a field, NAME=VALUE, NAME=a,b or NAME=low:high; repeatable. Fields are model, magnet, law, nu,
    L_over_D, accuracy, friction, depth_over_D, status and the other columns of an export."""
    since: str | None = None
    """Only states that were added at this date or time (UTC) or later, such as 2026-11-05."""
    before: str | None = None
    """Only states that were added before this date or time (UTC)."""
    failed: bool = False
    """Only states whose solve failed; with --transient those too."""
    transient: bool = False
    """Only states whose process died or ran out of memory."""
    older_physics: bool = False
    """Only states of physics versions that this version of magtip no longer uses."""
    damaged: bool = False
    """Only states whose content, position or answer is damaged."""


@_options
class Vibration:
    """State at rest of a sensor, and the frequencies at which it vibrates."""

    depth: Annotated[float | None, _of_load("depth", "default: 1")] = None
    load: VibratingFields = field(default_factory=dict)
    frequencies: str = "1:1000"
    """Lowest and highest frequency, LOW:HIGH, Hz."""
    count: Whole = 200
    """Number of frequencies in the table, spaced evenly on a logarithmic scale; resonances are added to them."""
    elements: Elements = Elements()
    extrapolate: bool = False
    """Allow frequencies for which the silicone's branches do not speak, and mark the results."""


@_options
class Cycle:
    """Motion of the plate in time."""

    depth: Depth = 1.0
    speed: float | None = None
    """Mean speed of the plate, mm/s; give this or --frequency."""
    frequency: float | None = None
    """Cycles per second, without the holds, Hz."""
    waveform: Waveform = "triangle"
    """Motion of the plate: triangle (constant speed) or sine."""
    cycles: Whole = 3
    """Number of cycles."""
    hold: float = 0.0
    """Rest of the plate at each end of the stroke, s."""
    shear: float = 0.0
    """After the press, shear the tip along x between plus and minus this, mm; the depth stays."""
    friction: Friction | None = None
    gap: float | None = None
    """Find the constant loss factor with which the last loop has this gap at mid-stroke, percent of full scale (the
    paper measured less than 10)."""
    elements: Elements = Elements()
    calibration: Calibration | None = None
    tolerance: float = 1e-3
    """Permitted error of the force from the time steps, over the largest force; at least 1e-7."""
    extrapolate: bool = False
    """Allow frequencies and holds for which the silicone's branches do not speak, and mark the results."""


@_options
class Reading:
    """How the elements read."""

    level: FieldModel = "exact"
    mode: Mode = "component"
    ambient: str = "0,0,0"
    """Uniform ambient field Bx,By,Bz, T."""
    seed: Whole | None = None
    """Seed of one random sample of the elements' noise; default: no noise."""


@_options
class Decoding:
    """What is decoded, and by which mechanics."""

    readings: str | None = None
    """Readings a,b,c in the order S1,S2,S3 (of a chip: -z,x,y), V or T as --units says."""
    file: Path | None = None
    """CSV file with the columns `S1_V,S2_V,S3_V` (or `S1_T` and so on), of a chip `chip_-z_T,chip_x_T,chip_y_T`,
    decoded row by row as a stream. With a column `time_s`, forces are those of a silicone that relaxes, and rows
    that repeat, are missing or jump are marked; without it they are those of slow loading."""
    zero: str | None = None
    """Times FROM,TO of the file, s, in which the sensor is at rest: the mean of these readings is taken for those at
    rest. One time TO means from the first row on."""
    units: Literal["T", "V"] | None = None
    """Unit of the readings: V (output) or T (flux density B.n); default: the unit of the elements' output."""
    source: SourceOfLoad = SourceOfLoad()
    ignore_tilt: Untilted = False
    tolerances: Tolerances | None = None
    """NAME=VALUE: largest deviation of a built sensor, as in `sensitivity`, such as hall_gain=1 (percent). A force
    that these tolerances may cause at rest has the status uncalibrated."""
    calibration: Calibration | None = None
    temperature: Temperature | None = None
    reject_ambient: Rejecting = False


@_options
class Disturbing:
    """What surrounds the sensor; each list has its usual ones, at distances in proportion to the sensor."""

    ambient: float = 50.0
    """Strength of a uniform field of any direction, uT; the earth's is 25 to 65."""
    gradient: float = 1.0
    """Gradient of a field that is 0 in the middle of the elements, any direction, uT/mm: 1 is that of a source whose
    field is 50 uT at 150 mm."""
    iron: list[str] | None = None
    """A large piece of iron with a flat face: below=DISTANCE from the base plane, beside=DISTANCE from the axis, or
    front=DISTANCE from the tip, mm; front=0 is the object that the tip presses. Repeatable."""
    ball: list[str] | None = None
    """DIAMETER,X,Y,Z of an iron ball, mm; repeatable."""
    rod: list[str] | None = None
    """DIAMETER,LENGTH,X,Y,Z,AX,AY,AZ of an iron rod, as a slender spheroid: its middle, mm, and the direction of its
    axis, such as 3,50,16,0,7,0,1,0; repeatable."""
    neighbour: list[str] | None = None
    """X,Y of the axis of a second sensor of this design beside it, mm; repeatable."""
    jaw: list[float] | None = None
    """Distance of the tips of two such sensors that face each other in a gripper, at rest, mm; repeatable."""
    motor: list[str] | None = None
    """MOMENT,X,Y,Z of a motor or another magnet, A m2 and mm; repeatable. None by default."""
    permeability: float = 1000.0
    """Relative permeability of iron: about 1000 for mild steel; above 100 it hardly matters."""
    warming: float = 10.0
    """Change of the temperature, K."""
    null_drift: float | None = None
    """Largest drift of an element's null to either side, uT/K; default: unknown, since no data sheet of the
    catalogue states it."""
    reject_ambient: Rejecting = False
    source: SourceOfLoad = SourceOfLoad()


@_options
class Arraying:
    """The array, where it is another one than that of the design's [array]."""

    rows: Whole | None = None
    """Number of rows of beams, 1 to 16; default: 3."""
    columns: Whole | None = None
    """Number of beams in a row, 1 to 16; default: 3."""
    pitch: float | None = None
    """Distance of neighbouring axes, along rows and columns, mm; default: 2 D."""
    polarity: str | None = None
    """up: all magnets alike (default); checkerboard: every other one reversed; rows: every other row reversed; or a
    list of up and down, row by row, such as up,down,down,up."""
    error: float = 1.0
    """Error of the force, percent of the range, for which the smallest pitch is found."""
    reject_ambient: Rejecting = False
    source: SourceOfLoad = SourceOfLoad()


@_options
class Calibrating:
    """What is known of a made sensor and its test stand."""

    responses: States | None = None
    columns: Annotated[list[str] | None, Parameter(name="--column")] = None
    """NAME=HEAD: the column that holds a reading or a force under another name, such as `S1=X0 [uT]`; a minus before
    the head reverses its numbers, such as `chip_x=-Y0 [uT]`; repeatable."""
    force_sign: Literal[1, -1] = 1
    """Factor on all forces: -1 where the file counts compression as negative."""
    force_noise: ForceNoise | None = None
    free: list[str] | None = None
    """Unknown whose prior is ten times as wide; repeatable."""
    fix: list[str] | None = None
    """NAME=VALUE: unknown that is not estimated, such as remanence=1; repeatable."""
    tolerances: Tolerances | None = None
    """NAME=VALUE: largest deviation of a built sensor, as in `sensitivity`, which gives the priors; repeatable."""
    decoder: Literal["model", "regression"] = "model"
    """What calibration.json holds: the model of the made sensor, or a ridge regression of forces on readings, linear
    or quadratic, whichever decodes held-out rows better; it knows no pose, and only the range of the bench."""
    scan: bool = False
    """The one file is a scan of the bare magnet, without silicone, over the design's 3-axis chip: positions x_mm,
    y_mm, z_mm of the stage and Bx_mT, By_mT, Bz_mT. Its polarisation, place and tilts are fitted."""


@_options
class Planning:
    """How many presses are planned, for which stand, and how it is simulated."""

    presses: Whole = 12
    """Number of presses of the plan."""
    responses: States | None = None
    tolerances: Tolerances | None = None
    """NAME=VALUE: largest deviation of a built sensor, as in `sensitivity`; repeatable."""
    force_noise: ForceNoise | None = None
    simulate: bool = False
    """Draw a made sensor within its tolerances, press it by finite elements, and write bench.csv, what the stand
    measures, and recording.csv, a slow press and shear over time with the true forces."""
    seed: Whole = 5
    """Of the drawn sensor and of all noise."""
    reading_noise: float | None = None
    """Standard deviation of a reading, V, of a chip T; default: that of the design or of the data sheet."""
    stand_zero: float = 0.1
    """Depth that the stand shows at first touch, mm."""
    stand_compliance: float = 0.004
    """How much the stand gives way, mm/N."""
    accuracy: Level = "quick"


@_options
class Streaming:
    """Where readings come from, how a frame of them is laid out, and by what they are decoded."""

    port: str
    """Serial port (/dev/ttyACM0), named pipe, - for standard input, or a file that is replayed at its own pace: a
    table (CSV) with time_s and the elements' columns, or with --rate or --clock frames as a device sent them."""
    frames: Literal["lines", "lines-xyzt", "anyskin", "aa"] = "lines"
    """Layout of a frame: lines of numbers in the order of the elements (or --axes); lines-xyzt, x, y, z in uT and the
    temperature of each chip; anyskin, the binary frames of AnySkin and ReSkin; aa, 0xAA and three counts of 16 bits
    for each chip."""
    units: str | None = None
    """Unit of the numbers of lines: V or mV, of a chip T, mT, uT or G; default: that of the elements' output."""
    chips: str | None = None
    """Which chips of a frame are this design's, counted from 1, such as 3 or 1,2,4; default: the first ones."""
    frame_chips: Whole | None = None
    """Number of chips in a frame; default: as many as --chips needs."""
    axes: str | None = None
    """Axes of the chip that lie along x, y and z of the sensor, such as y,-x,z; default: x,y,z. With it, lines hold
    x, y, z of each chip, and not the elements' readings."""
    lsb: str | None = None
    """Flux density of a count of aa, uT, along x and y, and along z; default: 0.15,0.242, an MLX90393 at gain 7."""
    clock: Literal["s", "ms", "us"] | None = None
    """Unit of the device's time, with which each line then begins; default: times are those of arrival, and not known
    where rows do not arrive as they were measured, such as from a recording in a pipe."""
    rate: float | None = None
    """Frames each second, Hz, of a file of frames without the device's time."""
    baud: Whole = 115200
    """Speed of a serial port, bits per second."""
    speed: float = 1.0
    """Pace of a replay: 2 for twice as fast, 0 without waiting."""
    rest: Annotated[float, Parameter(name="--zero")] = 0.0
    """Time at the start, s, in which nothing touches the sensor: its readings are taken for those at rest. On a
    terminal, z and Enter take those of the last half second."""
    source: SourceOfLoad = SourceOfLoad()
    calibration: Calibration | None = None
    temperature: Temperature | None = None
    reject_ambient: Rejecting = False


@_options
class Exporting:
    """Which decoder is exported, and how large it may be."""

    flash: str = "64k"
    """Largest size of decoder and tables on a Cortex-M4F, bytes or 64k; a smaller one makes the tables coarser, and
    the result and the header say what this costs."""
    source: SourceOfLoad = SourceOfLoad()
    tolerances: Tolerances | None = None
    """NAME=VALUE: largest deviation of a built sensor, as in `decode`, for the status uncalibrated; repeatable."""
    calibration: Calibration | None = None
    reject_ambient: Rejecting = False


@_options
class LayoutParts:
    """Parts of a study of a layout beside its map."""

    search: bool = False
    """Search for better layouts over f, l0 and c (of a chip: l0 and chip_x), ranked by their share of unusable
    poses, then by their worst noise of the pose, or with --reject-ambient of the force; takes a minute."""
    ranges: Annotated[list[str] | None, Parameter(name="--range")] = None
    """Range of the search, NAME=LOW,HIGH, mm, or NAME=VALUE to keep a value; repeatable."""
    count: Whole | None = None
    """Number of layouts that the search lists, 1 to 16; default: 10."""
    claim: bool = False
    """Test the paper's claim that readings are unique, over c, for |B| and for B.n; takes a minute."""
    force_range: str | None = None
    """Range of loads NORMAL,TANGENTIAL, N: report the force resolution along x, y and z from 0 to these limits,
    where it is worst, and what saturates. The fields hall_noise to hall_average set the noise."""


@_options
class Fabrication:
    """How the parts are made."""

    process: Literal["fdm", "sla"] | None = None
    """Printing with filament (fdm) or resin (sla); it sets the defaults of fits and walls; default: that of the
    design file, or fdm."""
    mold: list[str] | None = None
    """Setting of the mould, KEY=VALUE, such as shrink=0.01, columns=3, split=1 or marks=1 (letters); repeatable."""
    base: list[str] | None = None
    """Setting of the base: square or round, or KEY=VALUE, such as outer=16, recess=0.4, screw=0 or marks=1 (grooves
    at +x and +y); repeatable."""
    axis: list[str] | None = None
    """Values NAME=a,b,c of D, L, f (mm) or E (MPa): one folder for each combination, without picture; repeatable."""
    tolerance: float | None = None
    """Largest distance of the STL's facets from the surface, mm; default: D/2000."""
    silicone: str | None = None
    """Name of a silicone of the shipped catalogue, such as "Sylgard 184", whose mix and cure the recipe then states;
    default: that of the design; without one the recipe refers to the data sheet."""


@_options
class Sweep:
    """What varies in a sweep, and what is computed."""

    axis: Annotated[list[str] | None, AXIS] = None
    load: list[str] | None = None
    """Field of the load that does not vary, NAME=VALUE, such as shear=1 or friction=0.5; repeatable."""
    design: str | None = None
    """Design to vary, a preset or a TOML file; default: paper."""
    depth: float | None = None
    """Depth of the press if depth is not an axis, mm."""
    magnet: Magnet | None = None
    """Rigid body, or ignored (the whole beam is silicone); default: rigid."""
    wanted: Wanted = Wanted()
    quantities: Annotated[str | None, ASKED] = None


@_options
class Solves:
    """Where states are solved and kept."""

    store: StoreFile | None = None
    workers: Whole | None = None
    """Number of processes that solve; default: one for each core, or none if all solves take only seconds."""
    scheduler: str | None = None
    """Address of a Dask scheduler, such as tcp://127.0.0.1:8786, whose workers solve."""


@_options
class Sampling:
    """Models, and sizes, of the methods of a study of tolerances."""

    model: str = "surrogate"
    """Model of sobol and montecarlo: surrogate, or a level of the formulas (paper, column, tip, magnet, finite)."""
    accuracy: AccuracyName = "standard"
    """Accuracy of the finite elements of morris."""
    count: Whole = 1024
    """Number of base points of sobol, a power of 2; each needs a point more for every input, and one more."""
    trajectories: Whole = 10
    """Number of trajectories of morris; each has a solve for every input, and one more."""
    sensors: Whole = 1000
    """Number of made sensors of montecarlo."""
    seed: Whole = 0
    """Seed of all random numbers, 0 or more."""


@_options
class Sensitivity:
    """Inputs and methods of a study of tolerances."""

    vary: list[str] | None = None
    """Range of an input, NAME=low:high, of a field of the design, depth or shear; repeatable. Default: E, nu,
    remanence and size of the magnet within their tolerances. Methods sobol and morris use it."""
    depth: Depth
    shear: float = 0.0
    """Displacement of the plate along x after the press, with the tip stuck to it, mm."""
    methods: str = "sobol,montecarlo"
    """Any of sobol, morris and montecarlo, separated by commas."""
    tolerances: Tolerances | None = None
    """Tolerance of a made sensor, NAME=VALUE, such as E=5 (percent) or magnet_x=0.1 (mm); repeatable."""
    sampling: Sampling = Sampling()
    solves: Solves = Solves()


@_options
class Sizing:
    """Effort of a sizing, and what it writes."""

    export: bool = False
    """Write mould and casting recipe of the best variant too."""
    population: Whole = 768
    """Number of candidates in a generation of the search."""
    generations: Whole = 50
    """Number of generations."""
    points: Whole = 12
    """Largest number of points of the front that are solved; of more points, those far apart are taken."""
    sensors: Whole = 1000
    """Number of made sensors from which the yield of the best variant follows."""
    accuracy: Level = "standard"
    store: StoreFile | None = None
    workers: Whole | None = None
    """Number of processes that solve; default: one for each core."""
    calibration: Path | None = None
    """calibration.json of `magtip calibrate` of a made sensor: if the best variant is its design (winner.toml), the
    yield after calibration takes its posterior in place of that of twelve planned presses."""
