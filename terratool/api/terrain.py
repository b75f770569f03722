"""Terrains as Python users have them: what each command does is a verb, with the same options."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, overload

import msgspec
import numpy as np
from numpy.typing import ArrayLike, NDArray
from rasterio.transform import Affine

from terratool.api.mapping import AnyMap, any_map
from terratool.api.options import fill, listed, public, takes
from terratool.api.reports import (
    ShownComparison,
    ShownDifference,
    ShownReport,
    shown_difference,
    shown_report,
)
from terratool.api.showing import ShownTerrain
from terratool.api.sources import UNNAMED, AnyDefinition, checked_source, roots_of, source_of
from terratool.api.values import shown
from terratool.api.verbs import INTERNAL, missing
from terratool.definition.grid_files import as_written
from terratool.definition.model import Definition
from terratool.definition.reader import Checked
from terratool.errors import RequestError
from terratool.field.terrain import SHARE_ABOVE
from terratool.field.types import real_numbers
from terratool.mesh.export import MeshOptions
from terratool.mesh.origin import Origin
from terratool.mesh.request import AnyMeshReport, MeshRequest, write_mesh_files
from terratool.output import is_same_file
from terratool.raster.dem import (
    AnyDemReport,
    DemArrays,
    DemOptions,
    GridChoice,
    dem_arrays,
    write_dem,
)
from terratool.raster.dem import refuse_idle as refuse_idle_contours
from terratool.sensing.comparison import MapComparison, compare
from terratool.sensing.export import ScanOutput, ScanReport, export_scan
from terratool.sensing.lines import Face
from terratool.sensing.poses import Poses, one_pose, read_poses
from terratool.sensing.readings import Frame
from terratool.sensing.scan import Scan, ScanOptions
from terratool.sensing.sensor import Sensor, load_sensor
from terratool.simulators.export import SimulatorReport, plan_export, scene_of
from terratool.simulators.options import SceneOptions
from terratool.simulators.options import refuse_idle as refuse_idle_targets
from terratool.simulators.targets import choose_targets, refuse_uninstalled
from terratool.text.source import Source, refuse_name
from terratool.traversability.compare import names_of, prepare
from terratool.traversability.request import Request, RouteLine
from terratool.traversability.route.waypoints import read_waypoints
from terratool.traversability.ruts import (
    Deformed,
    DeformOptions,
    check_path,
    deform,
    refuse_output,
    with_tracks,
    write_deformed,
)
from terratool.traversability.vehicle import Vehicle
from terratool.traversability.vehicle_files import load_vehicle
from terratool.viewing.diff.compare import DiffOptions, diff
from terratool.viewing.diff.sides import DiffSide
from terratool.viewing.diff.writing import GroundFiles
from terratool.viewing.differences import refuse_picture
from terratool.viewing.mesh import PageOptions
from terratool.viewing.options import Line, RenderOptions, RenderReport, refuse_idle
from terratool.viewing.places import Site
from terratool.viewing.terrain_page import (
    HEIGHT,
    TerrainPage,
    check_page,
    terrain_page,
    terrain_scene,
)

if TYPE_CHECKING:
    import mujoco
    import trimesh
    from matplotlib.figure import Figure
    from pxr import Usd

AnyVehicle = Vehicle | str | Path
"""A vehicle, or the path of its file."""
AnyPose = Sequence[float] | ArrayLike | Poses
"""Position x, y, z and yaw, pitch, roll in degrees; several as rows of an array, or as poses."""


@public("Terrain")
class UserTerrain(ShownTerrain):
    """A compiled terrain: it answers at points, writes files, draws and judges.

    All queries take x and y in world units, as numbers or arrays that broadcast together, and
    return the broadcast shape. Outside of the terrain the height is NaN and everything else None.
    Verbs have the options of the commands that do the same, by the same names with _ in place of -.
    """

    def __init__(
        self,
        definition: Definition | Checked,
        *,
        roughness: bool = True,
        share_above: float = SHARE_ABOVE,
        library_roots: tuple[str, ...] = (),
    ) -> None:
        """Compile a valid definition, or one that was checked; `load` reads and checks first.

        Args:
            definition: a valid definition, or the result of a check.
            roughness: whether rough surfaces have their relief.
            share_above: number of elements above which parts and copies are shared rather than
                written out; it changes no result.
            library_roots: further folders under which the libraries of the text may lie.

        Raises:
            DefinitionError: the checked definition has errors.
            RequestError: the definition comes to too many elements.
        """
        super().__init__(definition, roughness=roughness, share_above=share_above)
        self.library_roots = library_roots
        if isinstance(definition, Checked) and definition.document is not None:
            self.source = definition.document.source
        else:
            assert isinstance(definition, Definition)
            self.source = Source(UNNAMED, msgspec.json.encode(as_written(definition)))

    def __dir__(self) -> list[str]:
        return [name for name in super().__dir__() if name not in INTERNAL]

    if not TYPE_CHECKING:  # or a type checker would find every name

        def __getattr__(self, name: str) -> None:
            raise missing(name, self)

    @property
    def name(self) -> str:
        """Name of the definition's file without its folder; empty where it came from no file."""
        return "" if self.source.name == UNNAMED else Path(self.source.name).name

    @property
    def text(self) -> str:
        """Text of the definition, JSON."""
        return self.source.data.decode("utf-8")

    @property
    def document(self) -> dict[str, Any]:
        """Members of the definition, as its text has them."""
        found: dict[str, Any] = msgspec.json.decode(self.source.data)
        return found

    def _checked(self) -> Checked:
        """The definition, read and checked once more: it takes much memory."""
        return checked_source(self.source, self.library_roots)

    # --- rasters and meshes -----------------------------------------------------------------------

    @takes(DemOptions, only=("resolution", "bounds", "layers", "dtype", "threads"))
    def to_dem(self, **options: Any) -> DemArrays:
        """Heights and other layers at the centres of pixels, as arrays with their place.

        NumPy takes the result for the array of its heights, or of its only layer. It has the
        `transform` and the `crs`; `to_xarray()` gives a `xarray.DataArray`.

        Args:
            **options: options of `DemOptions`, by name.

        Raises:
            RequestError: an option makes no sense for the terrain.
            DefinitionError: the CRS of the terrain is unknown.
        """
        wanted = fill(DemOptions, options)
        choice = GridChoice.of(self, wanted.resolution, wanted.bounds)
        return dem_arrays(self, choice, wanted)

    @takes(DemOptions)
    def write_dem(self, path: str | Path | None = None, **options: Any) -> AnyDemReport:
        """Write the terrain as a raster or as contours, as `terratool export-dem` does.

        Args:
            path: file to write, whose suffix names the format; only a mosaic goes without.
            **options: options of `DemOptions`, by name.

        Raises:
            RequestError: options make no sense, alone, together or with the format.
            WriteError: a file exists, cannot be written or does not fit on the disk.
            DefinitionError: the CRS of the terrain is unknown.
        """
        wanted = fill(DemOptions, options)
        refuse_idle_contours(options.keys(), wanted.layers)
        output = wanted.output_of(path)
        choice = GridChoice.of(self, wanted.resolution, wanted.bounds)
        return write_dem(self, choice, output, wanted)

    @takes(MeshOptions, without=("origin", "normals"))
    def to_mesh(self, *, origin: Origin = "world", **options: Any) -> trimesh.Trimesh:
        """Mesh of the terrain with upright walls, in memory, in coordinates of the world.

        Vertices are float64, in units of the terrain. Faces have the colours of their surfaces.
        `face_attributes` has "surface", int32, the index of each face's surface in
        `metadata["surfaces"]` or -1, and "wall", whether it stands upright. `metadata["origin"]` is
        the world position of the mesh's zero.

        Args:
            origin: zero of the coordinates: "world", "local" for the south-west corner of what is
                meshed, "center" for its middle, or a point of the world.
            **options: options of `MeshOptions`, by name.

        Raises:
            RequestError: there is no ground, or an option makes no sense.
        """
        from terratool.mesh.as_trimesh import trimesh_of

        return trimesh_of(self, fill(MeshOptions, options, origin=origin))

    @takes(MeshRequest)
    def write_mesh(
        self, path: str | Path, *, overwrite: bool = False, **options: Any
    ) -> AnyMeshReport:
        """Write the terrain as a mesh, as `terratool export-mesh` does.

        Coordinates count from the south-west corner of what is written, as those of the command do:
        `origin="world"` has those of the world. The report's `origin` says where the zero is.

        Args:
            path: file to write, whose suffix names the format.
            overwrite: whether files may exist.
            **options: options of `MeshRequest`, by name.

        Raises:
            RequestError: there is no ground, an option makes no sense, or the format cannot hold
                the mesh.
            WriteError: a file exists, or cannot be written.
        """
        request = fill(MeshRequest, options)
        terrain = self if request.has_storeys else self.ground_only()
        return write_mesh_files(terrain, path, request, overwrite=overwrite)

    @takes(SceneOptions)
    def export_sim(
        self, folder: str | Path, target: str | Sequence[str], *, overwrite: bool = False,
        **options: Any,
    ) -> tuple[SimulatorReport, ...]:  # fmt: skip
        """Write the terrain for simulators, as `terratool export-sim` does.

        Args:
            folder: parent of the simulators' folders; a missing one is made.
            target: name of a simulator, or names of several; "all" is every one.
            overwrite: whether folders of an earlier export are written again.
            **options: options of `SceneOptions`, by name.

        Raises:
            RequestError: a target is unknown or not installed, or an option makes no sense.
            ReadError, DefinitionError: the vehicle's file cannot be read, or has errors.
            WriteError: a folder is there already, holds something else, or cannot be written.
        """
        targets = listed(target)
        wanted = fill(SceneOptions, options)
        source = self.source.name if Path(self.source.name).is_file() else None
        refuse_idle_targets(options.keys(), list(choose_targets(targets)))
        plan = plan_export(folder, targets, wanted, source=source, overwrite=overwrite)
        return plan.write(self)

    @takes(
        SceneOptions,
        only=("max_error", "friction", "max_geoms", "max_seconds", "collision", "flex"),
    )
    def to_mjspec(self, *, origin: Origin = "world", **options: Any) -> mujoco.MjSpec:
        """Return what `export_sim` writes for MuJoCo as a `mujoco.MjSpec`, without any file.

        A robot's spec attaches it: `robot.attach(spec, prefix="ground/",
        frame=robot.worldbody.add_frame())`. Geoms are called as those of the files.

        Args:
            origin: zero of the spec: that of the world, the south-west corner, the middle, or a
                point of the world.
            **options: options of `SceneOptions`, by name.

        Raises:
            RequestError: MuJoCo is not installed, an option makes no sense, or there is no ground.
        """
        from terratool.simulators.mujoco import mjspec

        wanted = replace(fill(SceneOptions, options), origin=origin)
        return mjspec(scene_of(self, self.name, wanted))

    @takes(SceneOptions, only=("max_error", "friction", "per_surface"))
    def to_usd_stage(self, *, origin: Origin = "world", **options: Any) -> Usd.Stage:
        """Stage of USD in memory, with what `export_sim` writes for the target "usd".

        Points are near 0, and the root places them in the world, or where `origin` has it.

        Args:
            origin: zero of the stage: that of the world, the south-west corner, the middle, or a
                point of the world.
            **options: options of `SceneOptions`, by name.

        Raises:
            RequestError: there is no ground, an option makes no sense, or usd-core is missing.
        """
        from terratool.simulators.usd import stage_of

        refuse_uninstalled(choose_targets(("usd",)))
        wanted = replace(fill(SceneOptions, options), origin=origin)
        return stage_of(scene_of(self, self.name, wanted))

    # --- pictures and pages -----------------------------------------------------------------------

    @overload
    def render(self, path: None = None, **options: Any) -> Figure: ...
    @overload
    def render(
        self, path: str | Path, *, overwrite: bool = False, **options: Any
    ) -> RenderReport: ...
    @takes(RenderOptions)
    def render(
        self, path: str | Path | None = None, *, overwrite: bool = False, **options: Any
    ) -> RenderReport | Figure:
        """Draw the terrain, as `terratool render` does: a plan, a section or a perspective.

        Args:
            path: picture to write, a .png, .svg or .pdf; None for a figure of Matplotlib.
            overwrite: whether the picture may exist already.
            **options: options of `RenderOptions`, by name.

        Raises:
            RequestError: an option makes no sense for the terrain, or Matplotlib is missing.
            ReadError, DefinitionError: the vehicle cannot be read, or has errors.
            WriteError: the file exists and is not to be overwritten, or cannot be written.
        """
        from terratool.viewing.render import figure_of, render

        wanted = fill(RenderOptions, options)
        refuse_idle(options.keys(), wanted.perspective)
        terrain = self if wanted.has_storeys else self.ground_only()
        if path is None:
            return figure_of(terrain, wanted)
        return render(terrain, path, wanted, overwrite=overwrite)

    @takes(PageOptions, without=("live",))
    def view(
        self,
        path: str | Path | None = None,
        *,
        vehicle: AnyVehicle | None = None,
        routes: Line | Sequence[Line] = (),
        height: int = HEIGHT,
        overwrite: bool = False,
        **options: Any,
    ) -> TerrainPage:
        """Page on which the terrain can be turned and asked, as `terratool view` makes it.

        A notebook shows the page where it is the value of a cell.

        Args:
            path: file to write the page into, a .html; None for no file.
            vehicle: vehicle whose verdicts the page has; None for none.
            routes: x and y of the start and of the goal of each way of the vehicle, or of a single
                one.
            height: height of the page within a notebook, pixels.
            overwrite: whether the file may exist already.
            **options: options of `PageOptions`, by name.

        Raises:
            RequestError: there is no ground, or an option makes no sense.
            ReadError, DefinitionError: the vehicle's file cannot be read, or has errors.
            WriteError: the file exists and is not to be overwritten, or cannot be written.
        """
        wanted = fill(PageOptions, options)
        wanted.check()
        if path is not None:
            check_page(path, overwrite)
        driven = None if vehicle is None else _vehicle(vehicle)
        site = Site(self.written_out, self._checked())
        scene = terrain_scene(site, wanted, driven, _lines(routes))
        page = terrain_page(self.name or self.descr or "terrain", scene, height)
        if path is not None:
            page.write(path, overwrite)
        return page

    # --- vehicles and sensors ---------------------------------------------------------------------

    @takes(Request, without=("why", "routes", "waypoints", "keep_out"))
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
        map: str | Path | None = None,  # noqa: A002 -- the option's name
        overwrite: bool = False,
        **options: Any,
    ) -> ShownReport | ShownComparison:
        """Say where a vehicle can drive, where not, and why, as `terratool traversability` does.

        Args:
            vehicle: vehicle, or path of its file; several are compared.
            routes: x and y of the start and of the goal of each way that is looked for, or of
                a single one; x, y and z of ends on storeys.
            waypoints: for each way that is checked, or for a single one, its points, (n, 2), or the
                path of their file.
            keep_out: GeoJSON files of zones that nothing of the vehicle may enter.
            model: how wheel and soil are computed: with slip, or what the paper says.
            margin: whether the error band of climbs on soft soil is kept in reserve.
            report: paths of reports to write: .json, .md, .html, .geojson or .svg.
            map: path of a .tif for the map; None for no map.
            overwrite: whether files may exist.
            **options: options of `Request`, by name.

        Raises:
            RequestError: a place lies outside of the terrain, or an option makes no sense.
            ReadError, DefinitionError: a file cannot be read, or has errors.
            WriteError: a file exists already, or cannot be written.
        """
        from terratool.traversability.report.writing import JudgementFiles, assess_all
        from terratool.traversability.route.zones import read_keep_out
        from terratool.traversability.soil import on_the_safe_side

        vehicles = [each.by_model(model) for each in _vehicles(vehicle)]
        if margin:
            vehicles = [on_the_safe_side(each) for each in vehicles]
        if not vehicles:
            raise RequestError("No vehicle is given.", "Give one, or several to compare them.")
        files = JudgementFiles(listed(report), map, overwrite)
        zones = tuple(zone for path in listed(keep_out) for zone in read_keep_out(path))
        places = {"routes": _lines(routes), "waypoints": _ways(waypoints), "keep_out": zones}
        request = fill(Request, options, **places)
        planned = prepare(self, vehicles, request, map_path=map, overwrite=overwrite)
        return shown_report(assess_all(planned, self.name, files))

    @overload
    def deform(
        self, vehicle: AnyVehicle, waypoints: ArrayLike | str | Path, output: None = None, *,
        overwrite: bool = False, **options: Any,
    ) -> UserTerrain: ...  # fmt: skip
    @overload
    def deform(
        self, vehicle: AnyVehicle, waypoints: ArrayLike | str | Path, output: str | Path, *,
        overwrite: bool = False, **options: Any,
    ) -> Deformed: ...  # fmt: skip
    @takes(DeformOptions)
    def deform(
        self,
        vehicle: AnyVehicle,
        waypoints: ArrayLike | str | Path,
        output: str | Path | None = None,
        *,
        overwrite: bool = False,
        **options: Any,
    ) -> UserTerrain | Deformed:
        """Drive a vehicle along a path, and leave the ruts of its wheels, as `terratool deform`.

        Args:
            vehicle: vehicle, or path of its file.
            waypoints: points that its middle drives along, (n, 2), or (n, 3) with heights of floors
                where it is on storeys; or the path of their file.
            output: file to write, compressed if it ends in .gz; None gives the terrain with the
                ruts itself.
            overwrite: whether the file may exist already.
            **options: options of `DeformOptions`, by name.

        Raises:
            RequestError: the path is too short, leaves the terrain or its ground, or lies on a
                surface without a sinkage; an option makes no sense; or the name of the file is that
                of no definition.
            MissedError: a wheel would sink by its radius or more.
            ReadError, DefinitionError: a file cannot be read, or has errors.
            WriteError: the file exists, is the vehicle's or that of the waypoints, or cannot be
                written.
        """
        wanted = fill(DeformOptions, options)
        if output is not None:
            if not is_same_file(output, self.source.name):
                refuse_name(output)
            refuse_output(output, (vehicle, waypoints), overwrite)
        way = _points(waypoints)
        check_path(way, self.bounds)
        deformed = deform(self._checked(), _vehicle(vehicle), way, wanted)
        if output is not None:
            write_deformed(self.source, output, deformed, overwrite, self.library_roots)
            return deformed
        driven = with_tracks(self.source, deformed, self.source.name)
        checked = checked_source(driven, self.library_roots)
        return UserTerrain(checked, roughness=self.is_rough, library_roots=self.library_roots)

    @takes(ScanOptions)
    def scan(
        self,
        sensor: Sensor | str | Path,
        pose: AnyPose | None = None,
        *,
        poses: str | Path | None = None,
        **options: Any,
    ) -> list[Frame]:
        """Read the terrain with a lidar, a camera or a sonar; the frames, with points in the world.

        Args:
            sensor: sensor, or path of its file.
            pose: x, y, z, and yaw, pitch, roll in degrees; rows of these for several.
            poses: path of a CSV file with poses, in place of `pose`.
            **options: options of `ScanOptions`, by name.

        Raises:
            RequestError: a pose is outside of the terrain or below the ground, or an option makes
                no sense.
            ReadError, DefinitionError: a file cannot be read, or has errors.
        """
        scan = _scan(sensor, pose, poses, fill(ScanOptions, options))
        return list(scan.check_poses(self).read(self))

    @takes(ScanOptions)
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
        **options: Any,
    ) -> ScanReport:
        """Write what a sensor reads into a file, as `terratool scan` does.

        Args:
            output: file to write, whose suffix names the format.
            sensor: sensor, or path of its file.
            pose: x, y, z, and yaw, pitch, roll in degrees; rows of these for several.
            poses: path of a CSV file with poses, in place of `pose`.
            frame: axes that points are in.
            misses: whether rays without a reading are kept.
            intensity_max: intensity of white that is met squarely; 255 for many readers.
            overwrite: whether files may exist.
            **options: options of `ScanOptions`, by name.

        Raises:
            RequestError: the format does not hold the scan, a pose is outside of the terrain or
                below the ground, or an option makes no sense.
            ReadError, DefinitionError: a file cannot be read, or has errors.
            WriteError: the file exists or cannot be written.
        """
        scan = _scan(sensor, pose, poses, fill(ScanOptions, options))
        wanted = ScanOutput(Path(output), frame == "world", misses, overwrite, intensity_max)
        return export_scan(self, scan, wanted)

    @takes()
    def compare(
        self,
        map: AnyMap,  # noqa: A002 -- the command's word
        *,
        level: int = 0,
        transform: Affine | Sequence[float] | None = None,
        against: Face | None = None,
        picture: str | Path | None = None,
        overwrite: bool = False,
    ) -> MapComparison:
        """Say how good a map of the terrain is, as `terratool compare` does.

        The height of the terrain in a cell is that at its middle; in coarser cells the mean of
        those at the middles of the finest ones.

        Args:
            map: map of `terratool.map_scans`, path of one or of another raster of heights, or an
                array, row 0 in the north.
            level: level of a map of `map_scans`, 0 for the finest.
            transform: affine transform of an array, as rasterio has it: from column and row of a
                pixel's corner to world x and y.
            against: what heights are held against among decks and bores: the highest `top`, the
                `ground` below all, or the `nearest` face; what suits the map if None.
            picture: path of a .png that shows where the map is too high or too low; None for none.
            overwrite: whether the picture may exist already.

        Raises:
            RequestError: the map misses the terrain, has another reference system, or is too fine;
                or a transform stands beside what is no array.
            ReadError: the file cannot be read.
            WriteError: the picture exists already, or cannot be written.
        """
        if picture is not None:
            refuse_picture(picture, overwrite)
        compared = compare(any_map(map, level, transform), self, face=against)
        if picture is not None:
            from terratool.viewing.map_errors import write_picture

            write_picture(compared, self, picture, overwrite=overwrite)
        return compared

    # --- other terrains ---------------------------------------------------------------------------

    @takes(DiffOptions, without=("everywhere", "vehicles"))
    def diff(
        self,
        other: UserTerrain | AnyDefinition,
        *,
        vehicles: AnyVehicle | Sequence[AnyVehicle] = (),
        map: str | Path | None = None,  # noqa: A002 -- the option's name
        picture: str | Path | None = None,
        overwrite: bool = False,
        **options: Any,
    ) -> ShownDifference:
        """Say what differs from here to another terrain, the new one, as `terratool diff` does.

        Args:
            other: the new terrain, or its definition in any form that `load` takes.
            vehicles: vehicles whose verdicts are compared.
            map: path of a .tif with new less old heights; None for none.
            picture: path of a .png of what was cut and filled; None for none.
            overwrite: whether files may exist.
            **options: options of `DiffOptions`, by name.

        Raises:
            ReadError, DefinitionError: a definition or vehicle cannot be read, or has errors.
            RequestError: bounds or resolution make no grid, a vehicle cannot be asked there, or
                there is no ground to be shown.
            WriteError: a file exists, or cannot be written.
        """
        files = GroundFiles(map, picture, overwrite)
        files.check()
        wanted = fill(DiffOptions, options, vehicles=tuple(_vehicles(vehicles)))
        new = other if isinstance(other, UserTerrain) else load(other)
        for one in (self, new) if wanted.vehicles else ():
            one.ground_only()
        before, after = DiffSide(self._checked(), self), DiffSide(new._checked(), new)
        compared = diff(before, after, wanted)
        found = shown_difference(compared.difference)
        files.write(replace(compared, difference=found), wanted)
        return found


@takes()
def load(
    definition: AnyDefinition,
    library_roots: str | Path | Sequence[str | Path] = (),
    *,
    roughness: bool = True,
) -> UserTerrain:
    """Read, check and compile a definition.

    Args:
        definition: path of a file, JSON as text or bytes, a dictionary, a `Definition`, or a
            terrain, whose text is read once more. A text that begins with a brace is JSON.
        library_roots: further folders under which the libraries that it uses may lie.
        roughness: whether rough surfaces have their relief.

    Raises:
        ReadError: the file cannot be read.
        DefinitionError: the definition is no valid terrain; the findings say why.
    """
    roots = roots_of(definition, listed(library_roots))
    checked = checked_source(source_of(definition), roots)
    return UserTerrain(checked, roughness=roughness, library_roots=roots)


def _vehicle(vehicle: AnyVehicle) -> Vehicle:
    """Vehicle itself, or that of a file."""
    return vehicle if isinstance(vehicle, Vehicle) else load_vehicle(vehicle)


def _vehicles(vehicle: AnyVehicle | Sequence[AnyVehicle]) -> list[Vehicle]:
    """One vehicle, or several by different names, those of their files where they have some.

    Raises:
        RequestError: a vehicle is given twice, or two cannot be told apart.
    """
    given = [vehicle] if isinstance(vehicle, AnyVehicle) else list(vehicle)
    vehicles = list(map(_vehicle, given))
    if len(vehicles) < 2:
        return vehicles
    labels = [one.name if isinstance(one, Vehicle) else str(one) for one in given]
    return [
        replace(vehicle, name=name)
        for vehicle, name in zip(vehicles, names_of(labels), strict=True)
    ]


def _lines(routes: Any) -> tuple[Any, ...]:
    """Starts and goals of ways; numbers alone are one way."""
    return (routes,) if routes and isinstance(routes[0], float) else routes


def _ways(waypoints: Any) -> tuple[Any, ...]:
    """Points of each way, where rows of x and y are one way."""
    points = _numbers(waypoints)
    is_one = points is not None and points.ndim == 2 and points.shape[1] == 2
    several = isinstance(waypoints, str | Path | Sequence | np.ndarray) and not is_one
    return tuple(map(_points, listed(waypoints) if several else [waypoints]))


def _points(way: Any) -> Any:
    """Points of a way, (n, 2) or (n, 3) float64, or those of a file."""
    if isinstance(way, str | Path):
        return read_waypoints(way)
    points = _numbers(way)
    if points is None or points.ndim != 2 or points.shape[1] not in (2, 3) or len(points) < 2:
        raise RequestError(
            f"Waypoints are {_form(way)}.", "Give two or more rows of x and y, or of x, y and z."
        )
    return points


def _scan(
    sensor: Sensor | str | Path,
    pose: AnyPose | None,
    poses: str | Path | None,
    options: ScanOptions,
) -> Scan:
    """Scan of a sensor from its poses.

    Raises:
        RequestError: there is no pose, there are two kinds of them, or a number makes no sense.
    """
    if (pose is None) == (poses is None):
        raise RequestError(
            "Nothing says where the sensor is."
            if pose is None
            else "Both --pose and --poses say where the sensor is.",
            "Give pose=(x, y, z, yaw, pitch, roll), or the path of a file.",
        )
    where = _poses(pose) if poses is None else read_poses(poses)
    return Scan(sensor if isinstance(sensor, Sensor) else load_sensor(sensor), where, options)


def _poses(pose: Any) -> Poses:
    """Poses of numbers."""
    if isinstance(pose, Poses):
        return pose
    rows = _numbers(pose)
    rows = None if rows is None else np.atleast_2d(rows)
    if rows is None or rows.ndim != 2 or rows.shape[1] != 6 or not len(rows):
        raise RequestError(
            f"The pose is {_form(pose)}.",
            "Give six numbers, x, y, z, yaw, pitch, roll, or rows of them.",
        )
    return Poses.join([one_pose(tuple(row)) for row in rows.tolist()])


def _numbers(value: Any) -> NDArray[np.float64] | None:
    """Array of numbers; None where the value holds something else."""
    try:
        return real_numbers(np.asarray(value))
    except (TypeError, ValueError, OverflowError):
        return None


def _form(value: Any) -> str:
    """Value in words, where it is no array of the wanted shape."""
    numbers = _numbers(value)
    return shown(value) if numbers is None else f"an array of shape {numbers.shape}"
