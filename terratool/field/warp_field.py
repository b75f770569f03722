"""A compiled field for NVIDIA Warp: heights, normals, surfaces and friction under many robots.

This module makes the arrays on the device and launches the kernel; `terratool.field.warp_kernels`
has the descent.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import contextmanager
from importlib import import_module
from importlib.util import find_spec
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from terratool.errors import RequestError
from terratool.extras import install_command
from terratool.field.friction import frictions_of
from terratool.field.host_field import HostField
from terratool.field.records import IN_CELLS, SAMPLES, FieldArrays, TrackArrays

if TYPE_CHECKING:
    import warp as wp

    from terratool.field.storeys import Storeys
    from terratool.field.types import TerrainField

_LARGEST = 2**31 - 1
"""Largest table index on devices, an int32."""
_EACH = 1024
"""Points per thread on a CPU, where each thread copies all arguments first."""
_ROOMS = (32, 256, 2048)
"""Numbers of grids that may wait in a descent; the kernel with the least that suffices is compiled.
"""
_SHEETS = (0, 8, 64)
"""Numbers of sheets of storeys; no more than a lattice has bits for, and chosen likewise."""


class WarpSample(NamedTuple):
    """Ground at points; arrays in the points' shape.

    Attributes:
        height: (…) float32, above the origin's height; NaN outside and in the void.
        normal: (…) vec3f, upward unit normals, on an edge of its east and north side; NaN outside
            and in the void.
        surface: (…) int32, index into `surfaces`; -1 for none.
        friction: (…) float32, coefficient of friction, tan φ; NaN without ground.
    """

    height: wp.array[Any]
    normal: wp.array[Any]
    surface: wp.array[Any]
    friction: wp.array[Any]


class WarpField:
    """A terrain on a device, for arrays of Warp.

    On a CPU `height`, `sample` and `launch` use the terrain's own kernels, which are faster there
    than Warp's and give the same results.

    Attributes:
        surfaces: names of the surfaces, in the order of their indices.
        origin: world position of the zero of points and heights.
        device: Warp device.
        asks_terrain: whether the terrain's own kernels are used rather than Warp's.
        field: array of the struct `terratool.field.warp_kernels.DeviceField`, for your own kernels:
            one for the ground, and two for each sheet of storeys.
        ground_at: Warp function for your own kernels: `ground_at(field, x, y)`, world coordinates
            in float64, returns a `terratool.field.warp_kernels.DeviceGround`, the highest.
        ground_below: Warp function likewise: `ground_below(field, x, y, z)`, the highest that is
            not above `z`.
    """

    device: wp.Device

    def __init__(
        self,
        terrain: TerrainField,
        device: str | None = None,
        *,
        origin: ArrayLike = (0.0, 0.0, 0.0),
        default_friction: float = math.nan,
    ) -> None:
        """Bring a terrain to a device; see `Terrain.to_warp`."""
        wp = require_package("warp", "NVIDIA Warp", "warp")
        with _quiet(wp):
            wp.init()
        try:
            self.device = wp.get_device(device)
        except (ValueError, RuntimeError) as error:
            raise RequestError(
                f"Warp has no device {device!r} here.",
                f"Take {' or '.join(str(known) for known in wp.get_devices())}.",
            ) from error
        from terratool.field.warp_kernels import DeviceField, compile_kernels

        self.surfaces, self.origin = terrain.surfaces, check_origin(origin)
        friction = frictions_of(terrain, default_friction)
        self.asks_terrain = not self.device.is_cuda
        self._host = HostField(terrain, self.origin, friction)
        terrain = terrain.written_out
        storeys = terrain.storeys
        sheets = () if storeys is None else storeys.sheets
        plain = [terrain.arrays, *(f.arrays for sheet in sheets for f in (sheet.top, sheet.face))]
        pending = max(arrays.pending for arrays in plain)
        room = next((room for room in _ROOMS if room >= pending), None)
        if room is None:
            raise RequestError(
                f"Up to {pending} elements with children lie near one point of the terrain, "
                f"and the kernels of Warp have room for {_ROOMS[-1]}.",
                "Ask terrain.height, or have fewer elements with children overlap.",
            )
        count = next((count for count in _SHEETS if count >= len(sheets)), None)
        if count is None:
            raise RequestError(
                f"Up to {len(sheets)} decks and bores overlap in plan, and the kernels of Warp "
                f"have room for {_SHEETS[-1]}.",
                "Ask terrain.height, or have fewer of them overlap.",
            )
        self._structs = [_struct_of(one, self.origin, friction, self.device) for one in plain]
        if storeys is not None:
            _add_storeys(_Maker(self.device), self._structs, storeys)
        self.field = wp.array(self._structs, dtype=DeviceField, device=self.device)
        self.ground_at, self.ground_below, self._kernel = compile_kernels(room, count)

    def height(self, points: wp.array[Any], *, below: bool = False) -> wp.array[Any]:
        """Heights at points, (…) float32 above the origin's; NaN outside and in the void.

        They are those of the highest tops.

        Args:
            points: (…) vec2f or vec2d on the device, from the origin; with `below` vec3f or vec3d.
            below: whether the highest top not above each point is wanted; NaN where there is none.

        Raises:
            RequestError: the points have another type or device.
        """
        import warp as wp

        points = self._check_points(points, below)
        height = wp.empty(points.shape, dtype=wp.float32, device=self.device)
        self.launch(points.flatten(), height.flatten())
        return height

    def sample(self, points: wp.array[Any], *, below: bool = False) -> WarpSample:
        """Height, normal, surface and friction at points.

        Args:
            points: (…) vec2f or vec2d on the device, from the origin; with `below` vec3f or vec3d.
            below: whether the highest top not above each point is wanted.

        Raises:
            RequestError: the points have another type or device.
        """
        import warp as wp

        points = self._check_points(points, below)
        types = wp.float32, wp.vec3f, wp.int32, wp.float32
        out = WarpSample(*(wp.empty(points.shape, dtype=t, device=self.device) for t in types))
        self.launch(points.flatten(), *(array.flatten() for array in out))
        return out

    def launch(
        self,
        points: wp.array[Any],
        height: wp.array[Any],
        normal: wp.array[Any] | None = None,
        surface: wp.array[Any] | None = None,
        friction: wp.array[Any] | None = None,
        *,
        stream: wp.Stream | None = None,
    ) -> None:
        """Write height, normal, surface and friction at points into given arrays.

        Args:
            points: (n,) vec2f or vec2d on the device, from the origin; vec3f or vec3d for the
                highest tops not above them. All arrays are contiguous.
            height: (n,) float32.
            normal: (n,) vec3f; None to leave it out.
            surface: (n,) int32; None to leave it out.
            friction: (n,) float32; None to leave it out.
            stream: CUDA stream; None for the device's own.
        """
        import warp as wp

        if self.asks_terrain:
            at = points.numpy()
            if normal is surface is friction is None:
                height.assign(self._host.height(at))
                return
            for array, found in zip(
                (height, normal, surface, friction), self._host.sample(at), strict=True
            ):
                if array is not None:
                    array.assign(found)
            return
        each = 1 if self.device.is_cuda else _EACH
        is_double = points.dtype in (wp.vec2d, wp.vec3d)
        numbers = points.view(wp.float64 if is_double else wp.float32)
        given = [None, numbers] if is_double else [numbers, None]
        with _quiet(wp):
            wp.launch(
                self._kernel,
                dim=-(-points.size // each),
                inputs=[self.field, each, *given],
                outputs=[height, normal, surface, friction],
                device=None if stream else self.device,
                stream=stream,
                record_tape=False,
            )

    def _check_points(self, points: wp.array[Any], below: bool) -> wp.array[Any]:
        import warp as wp

        known = _point_types(wp)[2:] if below else _point_types(wp)[:2]
        if points.dtype not in known:
            single, double = (kind.__name__ for kind in known)
            raise RequestError(
                f"The points are an array of {points.dtype.__name__}.",
                f"Give {single} or {double}{' with `below`' * below}.",
            )
        if points.device != self.device:
            raise RequestError(
                f"The points are on {points.device}, the terrain is on {self.device}.",
                "Bring the one to the other.",
            )
        return points if points.is_contiguous else points.contiguous()


def _point_types(wp: Any) -> tuple[Any, ...]:
    """Types of points: on the plane in float32 and float64, and in space."""
    return wp.vec2f, wp.vec2d, wp.vec3f, wp.vec3d


def require_package(module: str, package: str, extra: str) -> Any:
    """Import a package that an extra installs.

    Raises:
        RequestError: the package is not installed.
    """
    if find_spec(module) is None:
        raise RequestError(f"{package} is not installed.", f"Run {install_command(extra)}")
    return import_module(module)


def check_origin(origin: ArrayLike) -> tuple[float, float, float]:
    """Return an origin as three numbers.

    Raises:
        RequestError: the origin is not three finite numbers.
    """
    numbers = np.asarray(origin, np.float64)
    if numbers.shape != (3,) or not np.isfinite(numbers).all():
        raise RequestError(f"The origin is {origin!r}.", "Give three finite numbers: x, y and z.")
    x, y, z = numbers.tolist()
    return x, y, z


@contextmanager
def _quiet(wp: Any) -> Iterator[None]:
    """Silence Warp's log but for warnings and errors."""
    before = wp.config.log_level
    wp.config.log_level = max(before, wp.LOG_WARNING)
    try:
        yield
    finally:
        wp.config.log_level = before


class _Maker(NamedTuple):
    """Maker of arrays on a device."""

    device: wp.Device

    def array(self, values: NDArray[Any], dtype: Any) -> Any:
        """Return an array of scalars or vectors on the device; integers become int32."""
        import warp as wp

        if dtype == wp.int32:
            values = values.astype(np.int32)
        return wp.array(np.ascontiguousarray(values), dtype=dtype, device=self.device)

    def structs(
        self, struct: Any, records: NDArray[Any], same: str = "", **others: NDArray[Any]
    ) -> Any:
        """Return an array of structs, members taken from records (`same`) and from other arrays."""
        columns = {name: records[name] for name in same.split()} | others
        values = np.zeros(len(next(iter(columns.values()))), struct.numpy_dtype())
        for name, column in columns.items():
            values[name] = column
        return self.array(values, struct)


def _struct_of(
    arrays: FieldArrays,
    origin: tuple[float, float, float],
    friction: NDArray[np.float32],
    device: wp.Device,
) -> Any:
    """Return the struct of the kernels, its arrays on a device.

    Raises:
        RequestError: a table has more entries than a device can index, or a raster is too large.
    """
    import warp as wp

    from terratool.field.warp_kernels import DeviceField, DeviceRelief

    curves, tracks = arrays.curves, arrays.tracks
    curves.mapped.refuse_blocks("Devices")
    indexed = arrays.elements, arrays.offsets, arrays.entries, tracks.entries
    pieces = curves.pieces.size + 4 * curves.samples.size
    heights = curves.heights.size + curves.mapped.count
    most = max(heights, pieces, *(array.size for array in indexed))
    if most > _LARGEST:
        raise RequestError(
            f"The terrain has tables of {most} entries, and devices count to {_LARGEST}.",
            "Take a part of it.",
        )
    make, field = _Maker(device), DeviceField()
    field.bounds, field.origin = wp.vec4d(*arrays.bounds), wp.vec3d(*origin)
    _add_elements(make, field, arrays)
    _add_grids(make, field, arrays)
    _add_primitives(make, field, arrays)
    _add_tracks(make, field, tracks)
    field.reliefs = make.structs(DeviceRelief, arrays.reliefs, "per scale key")
    field.friction = make.array(friction, wp.float32)
    return field


def _add_elements(make: _Maker, field: Any, arrays: FieldArrays) -> None:
    from terratool.field.warp_kernels import DeviceElement, DevicePlace, DevicePose

    elements, poses, places = arrays.elements, arrays.poses, arrays.places
    cells = elements["cell"].astype(np.int64)
    is_free = poses["free"][elements["pose"]] != 0
    field.elements = make.structs(
        DeviceElement,
        elements,
        "scale offset pose kind grid",
        cell_x=cells[:, 0],
        cell_y=cells[:, 1],
        place=np.where(is_free, cells[:, 0] + (cells[:, 1] << 16), -1),
    )
    sides = poses["cells"]
    field.poses = make.structs(
        DevicePose, poses, "size cos sin_v sin_u turned", cells_x=sides[:, 0], cells_y=sides[:, 1]
    )
    rests = arrays.rests
    field.places = make.structs(
        DevicePlace, places, "at extent", at_rest=rests["at"], extent_rest=rests["extent"]
    )


def _add_grids(make: _Maker, field: Any, arrays: FieldArrays) -> None:
    import warp as wp

    from terratool.field.warp_kernels import DeviceAxis, DeviceBins, DeviceGrid

    grids, bins = arrays.grids, arrays.free_bins
    in_cells = grids["standing"] == IN_CELLS
    field.axes = make.structs(
        DeviceAxis,
        grids,
        per=grids["per"].ravel(),
        clear=grids["clear"].ravel(),
        count=grids["count"].ravel(),
        near=grids["near"].ravel(),
        corner=grids["corner"][..., 0].ravel(),
        rest=grids["corner"][..., 1].ravel(),
        pitch=grids["pitch"][..., 0].ravel(),
        pitch_rest=grids["pitch"][..., 1].ravel(),
        zero=grids["zero"].ravel(),
    )
    field.grids = make.structs(
        DeviceGrid,
        grids,
        "table row listed local more",
        shift_x=grids["shift"][:, 0],
        shift_y=grids["shift"][:, 1],
        leaves=np.where(in_cells, grids["leaves"], 0),
        bins=np.where(in_cells, -1, grids["free"].astype(np.int64)),
    )
    field.bins = make.structs(DeviceBins, bins, "corner per slack", last=bins["shape"] - 1.0)
    field.offsets = make.array(arrays.offsets, wp.int32)
    field.entries = make.array(arrays.entries, wp.int32)


def _all_pieces(arrays: FieldArrays) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Return coefficients of all pieces, samples among them, (n, 4), and the first of each curve.

    The latter is (kinds, 2).
    """
    curves, firsts = arrays.curves, arrays.kinds["pieces"][..., 0].astype(np.int64)
    stored = curves.pieces.reshape(-1, 4)
    sampled = firsts >= SAMPLES
    if not sampled.any():
        return stored, firsts
    firsts[sampled] += len(stored) - SAMPLES
    lines = curves.coefficients(SAMPLES, len(curves.samples) - 1)
    rows = np.concatenate([stored, lines, [[curves.samples[-1], 0.0, 0.0, 0.0]]])
    ends = firsts[sampled] + arrays.kinds["pieces"][..., 1][sampled] + 1
    rows[ends, 1] = rows[ends - 1, 1]  # at t = 1 a curve has the slope before
    return rows, firsts


def _add_primitives(make: _Maker, field: Any, arrays: FieldArrays) -> None:
    import warp as wp

    from terratool.field.warp_kernels import DeviceClasses, DeviceCurve, DeviceKind, DeviceRaster

    kinds, curves = arrays.kinds, arrays.curves
    rows, firsts = _all_pieces(arrays)
    field.kinds = make.structs(DeviceKind, kinds, "surface combine is_void special raster classes")
    field.curves = make.structs(
        DeviceCurve,
        kinds,
        count=kinds["count"].ravel(),
        first=firsts.ravel(),
        last=kinds["pieces"][..., 1].ravel(),
        knot=kinds["knots"][..., 0].ravel(),
        bin=kinds["knots"][..., 1].ravel(),
        knotted=kinds["knotted"].ravel(),
    )
    field.pieces = make.array(rows, wp.vec4d)
    field.knots = make.array(curves.knots, wp.float64)
    field.rests = make.array(curves.rests, wp.float64)
    field.curve_bins = make.array(curves.bins, wp.int32)
    rasters, first = curves.rasters, curves.rasters["first"].copy()
    heights: list[NDArray[np.floating[Any]]] = [curves.heights]
    end = curves.heights.size
    for file in range(len(curves.mapped.sources)):
        heights.append(curves.mapped.numbers(file).ravel())
        first[rasters["file"] == file] = end
        end += heights[-1].size
    field.rasters = make.structs(
        DeviceRaster,
        rasters,
        "pixel voids",
        first=first,
        columns=rasters["count"][:, 0],
        rows=rasters["count"][:, 1],
    )
    field.heights = make.array(np.concatenate(heights, dtype=np.float64), wp.float64)
    classes = arrays.classes
    field.classes = make.structs(DeviceClasses, classes.grids, "raster first count")
    field.class_numbers = make.array(classes.numbers, wp.float64)
    field.class_surfaces = make.array(classes.surfaces, wp.int32)
    field.class_voids = make.array(classes.voids, wp.int32)


def _add_tracks(make: _Maker, field: Any, tracks: TrackArrays) -> None:
    import warp as wp

    from terratool.field.warp_kernels import DeviceSegment, DeviceTrack

    segments = tracks.segments
    field.tracks = make.structs(
        DeviceTrack,
        tracks.passes,
        passes=tracks.passes,
        power=tracks.power,
        surface=tracks.surface,
        law=tracks.law,
    )
    field.segments = make.structs(
        DeviceSegment,
        segments,
        "square reach_square z end_z track",
        start=np.column_stack([segments["x"], segments["y"]]),
        end=np.column_stack([segments["end_x"], segments["end_y"]]),
        way=np.column_stack([segments["dx"], segments["dy"]]),
    )
    field.depths = make.array(tracks.depths, wp.float64)
    field.track_frame, field.track_shape = wp.vec4d(*tracks.frame), wp.vec2i(*tracks.shape)
    field.track_masks = make.array(tracks.masks, wp.uint64)
    field.track_offsets = make.array(tracks.offsets, wp.int32)
    field.track_entries = make.array(tracks.entries, wp.int32)


def _add_storeys(make: _Maker, fields: list[Any], storeys: Storeys) -> None:
    """Add storeys to the fields of the ground, and of the tops and other faces of each sheet."""
    import warp as wp

    from terratool.field.warp_kernels import DeviceKind

    ground, lattice = fields[0], storeys.lattice
    ground.gaps = make.array(storeys.table.gaps, wp.float64)
    ground.bores = make.array(np.array([sheet.is_bore for sheet in storeys.sheets]), wp.int32)
    ground.lattice_frame = wp.vec4d(*lattice.frame)
    ground.lattice = make.array(lattice.cells, wp.uint64)
    for sheet, tops, faces in zip(storeys.sheets, fields[1::2], fields[2::2], strict=True):
        tops.storeys = make.array(sheet.storeys, wp.int32)
        faces.storeys = make.array(sheet.faced, wp.int32)
        kinds = tops.kinds.numpy()
        kinds["surface"][kinds["surface"] == sheet.bare] = -1
        tops.kinds = make.array(kinds, DeviceKind)
