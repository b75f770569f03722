"""Robot terrains from a small JSON text. Written by `make stubs`."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Literal, overload

import mujoco
import trimesh
from matplotlib.figure import Figure
from numpy.typing import ArrayLike
from pxr import Usd
from rasterio.crs import CRS
from rasterio.transform import Affine

from terratool._version import __version__ as __version__
from terratool.api.importing import AnyHeights
from terratool.api.mapping import AnyMap
from terratool.api.reports import ShownComparison, ShownDifference, ShownReport
from terratool.api.showing import ShownTerrain
from terratool.api.sources import AnyDefinition
from terratool.api.terrain import AnyPose, AnyVehicle
from terratool.api.training import curriculum_of as curriculum
from terratool.definition.crs import CrsValue
from terratool.definition.findings import Bounds, Finding
from terratool.definition.keys import Kind
from terratool.definition.model import Definition as ModelDefinition
from terratool.definition.reader import Checked
from terratool.definition.schemas import schema as schema
from terratool.errors import DefinitionError as DefinitionError
from terratool.errors import MissedError as MissedError
from terratool.errors import ReadError as ReadError
from terratool.errors import RequestError as RequestError
from terratool.errors import StoreysWarning as StoreysWarning
from terratool.errors import TerratoolError as TerratoolError
from terratool.errors import WriteError as WriteError
from terratool.importing.primitive.build import Combine, ImportedPrimitive
from terratool.importing.terrain.methods import Method
from terratool.importing.terrain.request import ImportReport
from terratool.mesh.origin import Origin
from terratool.mesh.request import AnyMeshReport
from terratool.raster.dem import AnyDemReport, DemArrays
from terratool.sensing.comparison import MapComparison
from terratool.sensing.export import ScanReport
from terratool.sensing.lines import Face
from terratool.sensing.map_request import Place
from terratool.sensing.readings import Frame
from terratool.sensing.robot_map import RobotMap
from terratool.sensing.sensor import Sensor as Sensor
from terratool.sensing.sensor import load_sensor as load_sensor
from terratool.simulators.export import SimulatorReport
from terratool.simulators.options import Collisions
from terratool.traversability.request import Point, RouteLine
from terratool.traversability.route.graph import Preference
from terratool.traversability.ruts import Deformed
from terratool.traversability.vehicle import Vehicle as Vehicle
from terratool.traversability.vehicle_files import load_vehicle as load_vehicle
from terratool.viewing.options import Contours, Line, RenderReport
from terratool.viewing.terrain_page import TerrainPage

__all__ = [
    "Definition",
    "DefinitionError",
    "Element",
    "MissedError",
    "ReadError",
    "RequestError",
    "Sensor",
    "StoreysWarning",
    "Terrain",
    "TerratoolError",
    "Vehicle",
    "WriteError",
    "check",
    "curriculum",
    "import_primitive",
    "import_terrain",
    "load",
    "load_sensor",
    "load_vehicle",
    "map_scans",
    "new",
    "schema",
]

def load(
    definition: AnyDefinition,
    library_roots: str | Path | Sequence[str | Path] = (),
    *,
    roughness: bool = True,
) -> Terrain:
    """Read, check and compile a definition."""

class Terrain(ShownTerrain):
    """A compiled terrain: it answers at points, writes files, draws and judges."""

    def __init__(
        self,
        definition: ModelDefinition | Checked,
        *,
        roughness: bool = True,
        share_above: float = 65536,
        library_roots: tuple[str, ...] = (),
    ) -> None:
        """Compile a valid definition, or one that was checked; `load` reads and checks first."""

    @property
    def name(self) -> str:
        """Name of the definition's file without its folder; empty where it came from no file."""

    @property
    def text(self) -> str:
        """Text of the definition, JSON."""

    @property
    def document(self) -> dict[str, Any]:
        """Members of the definition, as its text has them."""

    def to_dem(
        self,
        *,
        layers: Sequence[str] = ("height",),
        dtype: str = "float32",
        threads: int | None = None,
        resolution: float | None = None,
        bounds: Bounds | None = None,
    ) -> DemArrays:
        """Heights and other layers at the centres of pixels, as arrays with their place."""

    def write_dem(
        self,
        path: str | Path | None = None,
        *,
        layers: Sequence[str] = ("height",),
        dtype: str = "float32",
        compress: str | None = None,
        max_error: float | None = None,
        nodata: float | None = None,
        overviews: bool | None = None,
        overwrite: bool = False,
        losses: bool = True,
        threads: int | None = None,
        resolution: float | None = None,
        bounds: Bounds | None = None,
        cog: bool = False,
        tiles: str | Path | None = None,
        tile_size: int | None = None,
        dask: str | None = None,
        interval: float | None = None,
    ) -> AnyDemReport:
        """Write the terrain as a raster or as contours, as `terratool export-dem` does."""

    def to_mesh(
        self,
        *,
        origin: Origin = "world",
        max_error: float | None = None,
        max_faces: int | None = None,
        bounds: Bounds | None = None,
        solid: bool = False,
        base: float | None = None,
    ) -> trimesh.Trimesh:
        """Mesh of the terrain with upright walls, in memory, in coordinates of the world."""

    def write_mesh(
        self,
        path: str | Path,
        *,
        overwrite: bool = False,
        max_error: float | None = None,
        max_faces: int | None = None,
        bounds: Bounds | None = None,
        solid: bool = False,
        base: float | None = None,
        origin: Origin = "local",
        normals: bool = True,
        tile_faces: int | None = None,
        dask: str | None = None,
        elevation_grid: bool = False,
        resolution: float | None = None,
    ) -> AnyMeshReport:
        """Write the terrain as a mesh, as `terratool export-mesh` does."""

    def export_sim(
        self,
        folder: str | Path,
        target: str | Sequence[str],
        *,
        overwrite: bool = False,
        max_error: float = 0.002,
        origin: Origin = "local",
        friction: float = 0.7,
        collision: Collisions = "auto",
        max_geoms: int = 2000,
        max_seconds: float = 60.0,
        flex: bool = False,
        heightmap: bool = False,
        per_surface: bool = False,
        vehicle: str | Path | None = None,
        max_slope: float = 20.0,
        max_step: float = 0.1,
        resolution: float | None = None,
        dask: str | None = None,
    ) -> tuple[SimulatorReport, ...]:
        """Write the terrain for simulators, as `terratool export-sim` does."""

    def to_mjspec(
        self,
        *,
        origin: Origin = "world",
        max_error: float = 0.002,
        friction: float = 0.7,
        collision: Collisions = "auto",
        max_geoms: int = 2000,
        max_seconds: float = 60.0,
        flex: bool = False,
    ) -> mujoco.MjSpec:
        """Return what `export_sim` writes for MuJoCo as a `mujoco.MjSpec`, without any file."""

    def to_usd_stage(
        self,
        *,
        origin: Origin = "world",
        max_error: float = 0.002,
        friction: float = 0.7,
        per_surface: bool = False,
    ) -> Usd.Stage:
        """Stage of USD in memory, with what `export_sim` writes for the target "usd"."""

    @overload
    def render(
        self,
        path: None = None,
        *,
        layer: str = "surface",
        vehicle: str | Path | None = None,
        bounds: Bounds | None = None,
        contours: Contours = None,
        cut: float | None = None,
        grid: bool = False,
        profile: Line | None = None,
        perspective: bool = False,
        azimuth: float = 215.0,
        elevation: float = 35.0,
        max_error: float | None = None,
        exaggeration: float | None = None,
        title: str | None = None,
        legend: bool = True,
        bare: bool = False,
        pixels: int = 1600,
        dpi: float = 150.0,
    ) -> Figure:
        """Draw the terrain, as `terratool render` does: a plan, a section or a perspective."""

    @overload
    def render(
        self,
        path: str | Path,
        *,
        overwrite: bool = False,
        layer: str = "surface",
        vehicle: str | Path | None = None,
        bounds: Bounds | None = None,
        contours: Contours = None,
        cut: float | None = None,
        grid: bool = False,
        profile: Line | None = None,
        perspective: bool = False,
        azimuth: float = 215.0,
        elevation: float = 35.0,
        max_error: float | None = None,
        exaggeration: float | None = None,
        title: str | None = None,
        legend: bool = True,
        bare: bool = False,
        pixels: int = 1600,
        dpi: float = 150.0,
    ) -> RenderReport:
        """Draw the terrain, as `terratool render` does: a plan, a section or a perspective."""

    def view(
        self,
        path: str | Path | None = None,
        *,
        vehicle: AnyVehicle | None = None,
        routes: Line | Sequence[Line] = (),
        height: int = 600,
        overwrite: bool = False,
        max_error: float | None = None,
        max_faces: int | None = None,
    ) -> TerrainPage:
        """Page on which the terrain can be turned and asked, as `terratool view` makes it."""

    def traversability(
        self,
        vehicle: AnyVehicle | Sequence[AnyVehicle],
        *,
        routes: RouteLine | Sequence[RouteLine] = (),
        waypoints: ArrayLike | str | Path | Sequence[ArrayLike | str | Path] = (),
        keep_out: str | Path | Sequence[str | Path] = (),
        model: Literal["slip", "paper"] = "slip",
        margin: bool = False,
        report: str | Path | Sequence[str | Path] = (),
        map: str | Path | None = None,
        overwrite: bool = False,
        returns: bool = False,
        start: Point | None = None,
        prefer: Preference = "time",
        alternatives: int = 0,
        resolution: float | None = None,
        bounds: Bounds | None = None,
        headings: int | None = None,
        mapped: bool = True,
        threads: int | None = None,
        dask: str | None = None,
        samples: int = 256,
        seed: int = 0,
        height_error: tuple[float, float] | None = None,
        routes_of: str = "",
        start_of: str = "",
    ) -> ShownReport | ShownComparison:
        """Say where a vehicle can drive, where not, and why, as `terratool traversability` does."""

    @overload
    def deform(
        self,
        vehicle: AnyVehicle,
        waypoints: ArrayLike | str | Path,
        output: None = None,
        *,
        overwrite: bool = False,
        passes: int = 1,
        surface: str | None = None,
        multipass: float | None = None,
        max_error: float | None = None,
    ) -> Terrain:
        """Drive a vehicle along a path, and leave the ruts of its wheels, as `terratool deform`."""

    @overload
    def deform(
        self,
        vehicle: AnyVehicle,
        waypoints: ArrayLike | str | Path,
        output: str | Path,
        *,
        overwrite: bool = False,
        passes: int = 1,
        surface: str | None = None,
        multipass: float | None = None,
        max_error: float | None = None,
    ) -> Deformed:
        """Drive a vehicle along a path, and leave the ruts of its wheels, as `terratool deform`."""

    def scan(
        self,
        sensor: Sensor | str | Path,
        pose: AnyPose | None = None,
        *,
        poses: str | Path | None = None,
        on_ground: float | None = None,
        follow_slope: bool = False,
        seed: int | None = None,
    ) -> list[Frame]:
        """Read the terrain with a lidar, a camera or a sonar; the frames, with points in the world."""

    def write_scan(
        self,
        output: str | Path,
        sensor: Sensor | str | Path,
        pose: AnyPose | None = None,
        *,
        poses: str | Path | None = None,
        frame: Literal["world", "sensor"] = "world",
        misses: bool = False,
        intensity_max: float = 1.0,
        overwrite: bool = False,
        on_ground: float | None = None,
        follow_slope: bool = False,
        seed: int | None = None,
    ) -> ScanReport:
        """Write what a sensor reads into a file, as `terratool scan` does."""

    def compare(
        self,
        map: AnyMap,
        *,
        level: int = 0,
        transform: Affine | Sequence[float] | None = None,
        against: Face | None = None,
        picture: str | Path | None = None,
        overwrite: bool = False,
    ) -> MapComparison:
        """Say how good a map of the terrain is, as `terratool compare` does."""

    def diff(
        self,
        other: Terrain | AnyDefinition,
        *,
        vehicles: AnyVehicle | Sequence[AnyVehicle] = (),
        map: str | Path | None = None,
        picture: str | Path | None = None,
        overwrite: bool = False,
        min_change: float = 0.001,
        bounds: Bounds | None = None,
        resolution: float | None = None,
    ) -> ShownDifference:
        """Say what differs from here to another terrain, the new one, as `terratool diff` does."""

@overload
def new(
    kind: Literal["flat"],
    *,
    size: tuple[float, float] | None = ...,
    preset: Literal[
        "dry-sand",
        "lete-sand",
        "sandy-loam-11",
        "sandy-loam-15",
        "sandy-loam-23",
        "upland-sandy-loam",
        "clayey-soil-38",
        "clayey-soil-55",
        "lean-clay-22",
        "heavy-clay-25",
        "snow-us",
        "snow-sweden",
        "lunar-nominal",
        "concrete",
        "asphalt-wet",
        "gravel",
        "earth-road",
        "earth-road-wet",
        "grass-wet",
        "snow-packed",
        "ice",
    ]
    | None = ...,
) -> str:
    """Level ground, to put things on."""

@overload
def new(
    kind: Literal["ramp"],
    *,
    size: tuple[float, float] | None = ...,
    slope: float | None = ...,
    rise: float | None = ...,
    width: float | None = ...,
    platform: float | None = ...,
    preset: Literal[
        "dry-sand",
        "lete-sand",
        "sandy-loam-11",
        "sandy-loam-15",
        "sandy-loam-23",
        "upland-sandy-loam",
        "clayey-soil-38",
        "clayey-soil-55",
        "lean-clay-22",
        "heavy-clay-25",
        "snow-us",
        "snow-sweden",
        "lunar-nominal",
        "concrete",
        "asphalt-wet",
        "gravel",
        "earth-road",
        "earth-road-wet",
        "grass-wet",
        "snow-packed",
        "ice",
    ]
    | None = ...,
) -> str:
    """A ramp up to a level top and down again, with upright sides."""

@overload
def new(
    kind: Literal["stairs"],
    *,
    size: tuple[float, float] | None = ...,
    rise: float | None = ...,
    run: float | None = ...,
    steps: int | None = ...,
    width: float | None = ...,
    landing: float | None = ...,
    preset: Literal[
        "dry-sand",
        "lete-sand",
        "sandy-loam-11",
        "sandy-loam-15",
        "sandy-loam-23",
        "upland-sandy-loam",
        "clayey-soil-38",
        "clayey-soil-55",
        "lean-clay-22",
        "heavy-clay-25",
        "snow-us",
        "snow-sweden",
        "lunar-nominal",
        "concrete",
        "asphalt-wet",
        "gravel",
        "earth-road",
        "earth-road-wet",
        "grass-wet",
        "snow-packed",
        "ice",
    ]
    | None = ...,
) -> str:
    """A flight of steps with true risers up to a landing, and one down."""

@overload
def new(
    kind: Literal["rough"],
    *,
    size: tuple[float, float] | None = ...,
    seed: int | None = ...,
    height_range: tuple[float, float] | None = ...,
    height_step: float | None = ...,
    spacing: float | None = ...,
    rms: float | None = ...,
    correlation: float | None = ...,
    preset: Literal[
        "dry-sand",
        "lete-sand",
        "sandy-loam-11",
        "sandy-loam-15",
        "sandy-loam-23",
        "upland-sandy-loam",
        "clayey-soil-38",
        "clayey-soil-55",
        "lean-clay-22",
        "heavy-clay-25",
        "snow-us",
        "snow-sweden",
        "lunar-nominal",
        "concrete",
        "asphalt-wet",
        "gravel",
        "earth-road",
        "earth-road-wet",
        "grass-wet",
        "snow-packed",
        "ice",
    ]
    | None = ...,
) -> str:
    """Random heights on a grid, as in Isaac Lab's random_uniform_terrain."""

@overload
def new(
    kind: Literal["craters"],
    *,
    size: tuple[float, float] | None = ...,
    seed: int | None = ...,
    count: int | None = ...,
    largest: float | None = ...,
    smallest: float | None = ...,
    fresh: float | None = ...,
    rocks: int | None = ...,
    preset: Literal[
        "dry-sand",
        "lete-sand",
        "sandy-loam-11",
        "sandy-loam-15",
        "sandy-loam-23",
        "upland-sandy-loam",
        "clayey-soil-38",
        "clayey-soil-55",
        "lean-clay-22",
        "heavy-clay-25",
        "snow-us",
        "snow-sweden",
        "lunar-nominal",
        "concrete",
        "asphalt-wet",
        "gravel",
        "earth-road",
        "earth-road-wet",
        "grass-wet",
        "snow-packed",
        "ice",
    ]
    | None = ...,
) -> str:
    """Craters of the Moon, fresh and worn, with rocks."""

@overload
def new(
    kind: Literal["warehouse"],
    *,
    size: tuple[float, float] | None = ...,
    seed: int | None = ...,
    aisle: float | None = ...,
    height: float | None = ...,
) -> str:
    """A hall with racks, aisles, a gate and pallets."""

@overload
def new(
    kind: Literal["dunes"],
    *,
    size: tuple[float, float] | None = ...,
    seed: int | None = ...,
    count: int | None = ...,
    height: float | None = ...,
) -> str:
    """Barchans: dunes with horns and slip faces of 33 degrees."""

@overload
def new(
    kind: Literal["course"],
    *,
    style: Literal["isaac-lab", "legged-gym"] | None = ...,
    seed: int | None = ...,
    rows: int | None = ...,
    columns: int | None = ...,
    tile: tuple[float, float] | None = ...,
    border: float | None = ...,
) -> str:
    """Training tiles of Isaac Lab or legged_gym, with the origin of each."""

class Definition:
    """A definition that is written in Python, and says what a text says and nothing else."""

    def __init__(
        self,
        size: Any = None,
        *,
        descr: str | None = None,
        use: str | Sequence[str] | None = None,
        origin: Sequence[float] | None = None,
        crs: Any | None = None,
        x_ignore: str | Sequence[str] | None = None,
        x_why: str | None = None,
    ) -> None:
        """Begin a definition of a terrain."""

    @property
    def document(self) -> dict[str, Any]:
        """Members of the definition as the text has them, a copy."""

    @property
    def text(self) -> str:
        """Text of the definition in the canonical layout, as `terratool format` has it."""

    def surface(
        self,
        name: str,
        *,
        descr: str | None = None,
        preset: str | None = None,
        cohesion: float | Sequence[float] | None = None,
        fric_angle: float | Sequence[float] | None = None,
        sinkage: float | Sequence[float] | None = None,
        color: Sequence[int] | None = None,
        sonar_refl: float | None = None,
        shear_modulus: float | Sequence[float] | None = None,
        rolling_resistance: float | Sequence[float] | None = None,
        unit_weight: float | None = None,
        void: bool | None = None,
        roughness: Mapping[str, Any] | None = None,
        x_ignore: str | Sequence[str] | None = None,
        x_why: str | None = None,
    ) -> str:
        """Add a surface, and return its name."""

    def primitive(
        self,
        name: str,
        *,
        descr: str | None = None,
        x: str | Sequence[Any] | None = None,
        y: str | Sequence[Any] | None = None,
        combine: str | None = None,
        registration: str | None = None,
        grid: Sequence[Sequence[float | None]] | Mapping[str, Any] | None = None,
        x_ignore: str | Sequence[str] | None = None,
        x_why: str | None = None,
    ) -> str:
        """Add a primitive, and return its name."""

    def part(
        self,
        name: str,
        type: str | None = None,
        *,
        cell: Sequence[int] | None = None,
        cell_x: int | None = None,
        cell_y: int | None = None,
        span: Sequence[int] | None = None,
        at: Sequence[float] | None = None,
        extent: float | Sequence[float] | None = None,
        repeat: Mapping[str, Any] | None = None,
        scatter: Mapping[str, Any] | None = None,
        descr: str | None = None,
        part: str | None = None,
        surface: str | None = None,
        surface_grid: Mapping[str, Any] | None = None,
        deck: Mapping[str, Any] | None = None,
        bore: Mapping[str, Any] | None = None,
        v_scale: float | None = None,
        v_offset: float | None = None,
        turn_deg: float | None = None,
        cells: int | Sequence[int] | None = None,
        x_ignore: str | Sequence[str] | None = None,
        x_why: str | None = None,
    ) -> Element:
        """Add a part, an element with all that is added to it, for elements to stand for."""

    def track(
        self,
        *,
        descr: str | None = None,
        path: Sequence[Sequence[float]] | None = None,
        width: float | None = None,
        load: float | None = None,
        depth: float | Mapping[str, float] | None = None,
        passes: int | None = None,
        multipass: float | None = None,
        surface: str | None = None,
        x_ignore: str | Sequence[str] | None = None,
        x_why: str | None = None,
    ) -> None:
        """Add the rut of a wheel."""

    def root(
        self,
        type: str | None = None,
        *,
        repeat: Mapping[str, Any] | None = None,
        scatter: Mapping[str, Any] | None = None,
        descr: str | None = None,
        part: str | None = None,
        surface: str | None = None,
        surface_grid: Mapping[str, Any] | None = None,
        deck: Mapping[str, Any] | None = None,
        bore: Mapping[str, Any] | None = None,
        v_scale: float | None = None,
        v_offset: float | None = None,
        turn_deg: float | None = None,
        cells: int | Sequence[int] | None = None,
        x_ignore: str | Sequence[str] | None = None,
        x_why: str | None = None,
    ) -> Element:
        """Say what covers the whole terrain, and return it; `add` puts elements onto it."""

    def add(
        self,
        type: str | None = None,
        *,
        cell: Sequence[int] | None = None,
        cell_x: int | None = None,
        cell_y: int | None = None,
        span: Sequence[int] | None = None,
        at: Sequence[float] | None = None,
        extent: float | Sequence[float] | None = None,
        repeat: Mapping[str, Any] | None = None,
        scatter: Mapping[str, Any] | None = None,
        descr: str | None = None,
        part: str | None = None,
        surface: str | None = None,
        surface_grid: Mapping[str, Any] | None = None,
        deck: Mapping[str, Any] | None = None,
        bore: Mapping[str, Any] | None = None,
        v_scale: float | None = None,
        v_offset: float | None = None,
        turn_deg: float | None = None,
        cells: int | Sequence[int] | None = None,
        x_ignore: str | Sequence[str] | None = None,
        x_why: str | None = None,
    ) -> Element:
        """Add an element to the root, and return it, so that others can be added to it."""

    def validate(
        self,
    ) -> tuple[Finding, ...]:
        """Findings of the reader on the text, errors and warnings; empty if it is clean."""

    def compile(
        self,
        *,
        roughness: bool = True,
    ) -> Terrain:
        """Compile the terrain."""

    def save(
        self,
        path: str | Path,
        overwrite: bool = False,
    ) -> Path:
        """Write the text into a file in the canonical layout, and return its path."""

class Element:
    """An element of a definition; `add` puts another one into its cell, `remove` takes it out."""

    def __init__(
        self,
        members: dict[str, Any],
        holder: dict[str, Any],
        key: str,
        around: Any = None,
    ) -> None:
        """Wrap the members of an element, which stay those of the definition."""

    def add(
        self,
        type: str | None = None,
        *,
        cell: Sequence[int] | None = None,
        cell_x: int | None = None,
        cell_y: int | None = None,
        span: Sequence[int] | None = None,
        at: Sequence[float] | None = None,
        extent: float | Sequence[float] | None = None,
        repeat: Mapping[str, Any] | None = None,
        scatter: Mapping[str, Any] | None = None,
        descr: str | None = None,
        part: str | None = None,
        surface: str | None = None,
        surface_grid: Mapping[str, Any] | None = None,
        deck: Mapping[str, Any] | None = None,
        bore: Mapping[str, Any] | None = None,
        v_scale: float | None = None,
        v_offset: float | None = None,
        turn_deg: float | None = None,
        cells: int | Sequence[int] | None = None,
        x_ignore: str | Sequence[str] | None = None,
        x_why: str | None = None,
    ) -> Element:
        """Add an element to the cell of this one, and return it."""

    def remove(
        self,
    ) -> None:
        """Take the element out of the definition, with all that stands in its cells."""

def check(
    definition: AnyDefinition,
    library_roots: str | Path | Sequence[str | Path] = (),
    *,
    kind: Kind | None = "terrain",
    warnings: bool = True,
    max_step: float | None = None,
    limit: int = 1000,
    select: tuple[str, ...] = (),
    ignore: tuple[str, ...] = (),
) -> Checked:
    """Check a definition, as `terratool validate` does; `findings` of the result say what is wrong."""

@overload
def import_terrain(
    source: AnyHeights,
    output: None = None,
    *,
    transform: Affine | Sequence[float] | None = None,
    max_error: float | None = None,
    methods: Sequence[str | Method] = (),
    fill: bool = False,
    structures: bool | None = None,
    walls: bool = False,
    surfaces: str | None = None,
    allow_vrt: bool = False,
    allow_remote: bool = False,
    cells: Literal["half-pixels", "pixels"] = "half-pixels",
    surface: str | None = None,
    preset: str | None = None,
    as_: Literal["rows", "grid"] | None = None,
    link: bool = False,
    dask: str | None = None,
    decks: bool = True,
    bounds: Bounds | None = None,
    window: tuple[int, int, int, int] | None = None,
    band: int | None = None,
    crs: CrsValue | CRS | None = None,
    nodata: float | None = None,
    size: tuple[float, float] | None = None,
    height_range: tuple[float, float] | None = None,
    encoding: Literal["terrarium", "mapbox"] | None = None,
    source_units: Literal["m", "cm", "ft", "us-ft"] | None = None,
    units: Literal["m"] | None = None,
    source_crs: CrsValue | CRS | None = None,
    resolution: float | None = None,
    up: str | None = None,
    scale: float = 1.0,
    heights: Literal["mean", "highest", "lowest"] | None = None,
    ground: bool = False,
) -> Terrain:
    """Make a definition of a DEM or a mesh, as `terratool import-terrain` does."""

@overload
def import_terrain(
    source: AnyHeights,
    output: str | Path,
    *,
    transform: Affine | Sequence[float] | None = None,
    overwrite: bool = False,
    max_error: float | None = None,
    methods: Sequence[str | Method] = (),
    fill: bool = False,
    structures: bool | None = None,
    walls: bool = False,
    surfaces: str | None = None,
    allow_vrt: bool = False,
    allow_remote: bool = False,
    cells: Literal["half-pixels", "pixels"] = "half-pixels",
    surface: str | None = None,
    preset: str | None = None,
    as_: Literal["rows", "grid"] | None = None,
    link: bool = False,
    dask: str | None = None,
    decks: bool = True,
    bounds: Bounds | None = None,
    window: tuple[int, int, int, int] | None = None,
    band: int | None = None,
    crs: CrsValue | CRS | None = None,
    nodata: float | None = None,
    size: tuple[float, float] | None = None,
    height_range: tuple[float, float] | None = None,
    encoding: Literal["terrarium", "mapbox"] | None = None,
    source_units: Literal["m", "cm", "ft", "us-ft"] | None = None,
    units: Literal["m"] | None = None,
    source_crs: CrsValue | CRS | None = None,
    resolution: float | None = None,
    up: str | None = None,
    scale: float = 1.0,
    heights: Literal["mean", "highest", "lowest"] | None = None,
    ground: bool = False,
) -> ImportReport:
    """Make a definition of a DEM or a mesh, as `terratool import-terrain` does."""

def import_primitive(
    source: AnyHeights,
    name: str,
    *,
    transform: Affine | Sequence[float] | None = None,
    into: str | Path | None = None,
    output: str | Path | None = None,
    cell: tuple[int, int] | None = None,
    span: tuple[int, int] | None = None,
    parent: str = "/elemTree",
    overwrite: bool = False,
    values: int | None = None,
    fit_turn: bool = False,
    terms: int = 1,
    recognise: bool = False,
    max_error: float | None = None,
    combine: Combine = "product",
    bounds: Bounds | None = None,
    window: tuple[int, int, int, int] | None = None,
    band: int | None = None,
    crs: CrsValue | CRS | None = None,
    nodata: float | None = None,
    size: tuple[float, float] | None = None,
    height_range: tuple[float, float] | None = None,
    encoding: Literal["terrarium", "mapbox"] | None = None,
    source_units: Literal["m", "cm", "ft", "us-ft"] | None = None,
    units: Literal["m"] | None = None,
    source_crs: CrsValue | CRS | None = None,
    resolution: float | None = None,
    up: str | None = None,
    scale: float = 1.0,
    allow_vrt: bool = False,
    allow_remote: bool = False,
    heights: Literal["mean", "highest", "lowest"] | None = None,
    ground: bool = False,
) -> ImportedPrimitive:
    """Make a primitive of a patch of heights, as `terratool import-primitive` does."""

def map_scans(
    scans: str | Path | Sequence[str | Path],
    output: str | Path | None = None,
    *,
    resolution: float,
    levels: int = 3,
    storeys: int | None = None,
    gap: float | None = None,
    bounds: Bounds | None = None,
    sensor_at: Place | None = None,
    sigma: float | None = None,
    sensor: Sensor | str | Path | None = None,
    crs: str | None = None,
    bag: str | Path | None = None,
    overwrite: bool = False,
) -> RobotMap:
    """Fuse scans into the map that a robot would have made of them, as `terratool map` does."""
