"""A compiled field for NVIDIA Warp: heights, normals, surfaces and friction under many robots.

`terratool.field.warp_kernels` has the descent; here its arrays are made and its kernel is launched.
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
from terratool.field.friction import friction_of
from terratool.field.records import IN_CELLS, FieldArrays

if TYPE_CHECKING:
    import warp as wp

    from terratool.field.terrain import Terrain

_LARGEST = 2**31 - 1
"""Devices index by int32."""
_EACH = 1024
"""So many points a thread takes on a CPU, as each copies the struct of the field first."""
_ROOMS = (32, 256, 2048)
"""So many grids may wait in a descent; the kernel is compiled for each that is wanted."""


class WarpSample(NamedTuple):
    """What is at points; arrays in the points' shape.

    Attributes:
        height: (…) float32, from the origin's; NaN outside and in the void.
        normal: (…) vec3f, upward unit normals, of the east and north side on an edge; NaN likewise.
        surface: (…) int32, index into `surfaces`; -1 for none.
        friction: (…) float32, its coefficient, tan φ; NaN where there is no ground.
    """

    height: wp.array[Any]
    normal: wp.array[Any]
    surface: wp.array[Any]
    friction: wp.array[Any]


class WarpField:
    """A terrain on a device, for arrays of Warp.

    Attributes:
        surfaces: names of the surfaces, in the order of their indices.
        origin: world position of the zero of points and heights.
        device: of Warp.
        field: (1,) of the struct `terratool.field.warp_kernels.Field`, for kernels of your own.
        ground_at: the function of Warp for them: `ground_at(field, x, y)`, world coordinates in
            float64, gives a `terratool.field.warp_kernels.Ground`.
    """

    device: wp.Device

    def __init__(
        self,
        terrain: Terrain,
        device: str | None = None,
        *,
        origin: ArrayLike = (0.0, 0.0, 0.0),
        default_friction: float = math.nan,
    ) -> None:
        """Bring a terrain to a device; see `Terrain.to_warp`."""
        wp = required("warp", "NVIDIA Warp", "warp")
        with _quiet(wp):
            wp.init()
        try:
            self.device = wp.get_device(device)
        except (ValueError, RuntimeError) as error:
            raise RequestError(
                f"Warp has no device {device!r} here.",
                f"Take {' or '.join(str(known) for known in wp.get_devices())}.",
            ) from error
        from terratool.field.warp_kernels import Field, compiled

        arrays = terrain.written_out.arrays
        room = next((room for room in _ROOMS if room >= arrays.pending), None)
        if room is None:
            raise RequestError(
                f"Up to {arrays.pending} elements with children lie near one point of the terrain, "
                f"and the kernels of Warp have room for {_ROOMS[-1]}.",
                "Ask terrain.height, or have fewer elements with children overlap.",
            )
        self.surfaces, self.origin = terrain.surfaces, checked_origin(origin)
        friction = friction_of(terrain, default_friction)
        self._struct = _struct_of(arrays, self.origin, friction, self.device)
        self.field = wp.array([self._struct], dtype=Field, device=self.device)
        self.ground_at, self._kernel = compiled(room)

    def height(self, points: wp.array[Any]) -> wp.array[Any]:
        """Heights at points, (…) float32 from the origin's; NaN outside and in the void.

        Args:
            points: (…) vec2f or vec2d on the device, from the origin.

        Raises:
            RequestError: they are not.
        """
        import warp as wp

        points = self._checked(points)
        height = wp.empty(points.shape, dtype=wp.float32, device=self.device)
        self.launch(points.flatten(), height.flatten())
        return height

    def sample(self, points: wp.array[Any]) -> WarpSample:
        """Height, normal, surface and friction at points.

        Args:
            points: (…) vec2f or vec2d on the device, from the origin.

        Raises:
            RequestError: they are not.
        """
        import warp as wp

        points = self._checked(points)
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
        """The same into arrays that are there, and may be part of a graph of CUDA.

        Args:
            points: (n,) vec2f or vec2d on the device, from the origin; contiguous, as all others.
            height: (n,) float32.
            normal: (n,) vec3f; what is None is not written.
            surface: (n,) int32.
            friction: (n,) float32.
            stream: of CUDA; None for that of the device.
        """
        import warp as wp

        each = 1 if self.device.is_cuda else _EACH
        both = (None, points) if points.dtype == wp.vec2d else (points, None)
        with _quiet(wp):
            wp.launch(
                self._kernel,
                dim=-(-points.size // each),
                inputs=[self.field, each, *both],
                outputs=[height, normal, surface, friction],
                device=None if stream else self.device,
                stream=stream,
                record_tape=False,
            )

    def _checked(self, points: wp.array[Any]) -> wp.array[Any]:
        import warp as wp

        if points.dtype not in (wp.vec2f, wp.vec2d):
            raise RequestError(
                f"The points are an array of {points.dtype.__name__}.", "Give vec2f or vec2d."
            )
        if points.device != self.device:
            raise RequestError(
                f"The points are on {points.device}, the terrain is on {self.device}.",
                "Bring the one to the other.",
            )
        return points if points.is_contiguous else points.contiguous()


def required(module: str, package: str, extra: str) -> Any:
    """A package that an extra brings.

    Raises:
        RequestError: it is not installed.
    """
    if find_spec(module) is None:
        raise RequestError(
            f"{package} is not installed.", f"Install it by: pip install 'terratool[{extra}]'"
        )
    return import_module(module)


def checked_origin(origin: ArrayLike) -> tuple[float, float, float]:
    """An origin as numbers.

    Raises:
        RequestError: it is not three finite numbers.
    """
    numbers = np.asarray(origin, np.float64)
    if numbers.shape != (3,) or not np.isfinite(numbers).all():
        raise RequestError(f"The origin is {origin!r}.", "Give three finite numbers: x, y and z.")
    x, y, z = numbers.tolist()
    return x, y, z


@contextmanager
def _quiet(wp: Any) -> Iterator[None]:
    """Warp says what goes wrong, but not what it does."""
    before = wp.config.log_level
    wp.config.log_level = max(before, wp.LOG_WARNING)
    try:
        yield
    finally:
        wp.config.log_level = before


def _struct_of(
    arrays: FieldArrays,
    origin: tuple[float, float, float],
    friction: NDArray[np.float32],
    device: wp.Device,
) -> Any:
    """The struct of the kernels, its arrays on a device."""
    import warp as wp

    from terratool.field import warp_kernels as kernels

    curves, tracks = arrays.curves, arrays.tracks
    indexed = arrays.offsets, arrays.entries, curves.pieces, tracks.entries, arrays.elements
    most = max(array.size for array in indexed)
    if most > _LARGEST:
        raise RequestError(
            f"The terrain has {most} entries, more than the {_LARGEST} that a device can index.",
            "Take a part of it.",
        )

    def array(values: NDArray[Any], dtype: Any) -> Any:
        return wp.array(np.ascontiguousarray(values), dtype=dtype, device=device)

    def records(struct: Any, count: int, /, **columns: NDArray[Any]) -> Any:
        values = np.zeros(count, struct.numpy_dtype())
        for name, column in columns.items():
            values[name] = column
        return array(values, struct)

    field = kernels.Field()
    field.bounds, field.origin = wp.vec4d(*arrays.bounds), wp.vec3d(*origin)
    elements = arrays.elements
    is_free = arrays.poses["free"][elements["pose"]] != 0
    halves = elements["cell"].astype(np.int64)
    field.elements = records(
        kernels.Element,
        len(elements),
        **{name: elements[name] for name in ("scale", "offset", "pose", "kind", "grid")},
        cell_x=halves[:, 0],
        cell_y=halves[:, 1],
        place=np.where(is_free, halves[:, 0] + (halves[:, 1] << 16), -1),
    )
    grids = arrays.grids
    field.axes = records(
        kernels.Axis,
        2 * len(grids),
        **{name: grids[name].ravel() for name in ("per", "clear", "count", "near")},
        corner=grids["corner"][..., 0].ravel(),
        rest=grids["corner"][..., 1].ravel(),
        pitch=grids["pitch"][..., 0].ravel(),
        pitch_rest=grids["pitch"][..., 1].ravel(),
    )
    field.grids = records(
        kernels.Grid,
        len(grids),
        **{name: grids[name] for name in ("table", "row", "listed", "local", "more")},
        shift_x=grids["shift"][:, 0],
        shift_y=grids["shift"][:, 1],
        leaves=np.where(grids["standing"] == IN_CELLS, grids["leaves"], 0),
        bins=np.where(grids["standing"] != IN_CELLS, grids["free"].astype(np.int64), -1),
    )
    bins = arrays.free_bins
    field.bins = records(
        kernels.Bins,
        len(bins),
        **{name: bins[name] for name in ("corner", "per", "slack")},
        last=bins["shape"] - 1.0,
    )
    field.offsets = array(arrays.offsets.astype(np.int32), wp.int32)
    field.entries = array(arrays.entries.astype(np.int32), wp.int32)
    poses = arrays.poses
    field.poses = records(
        kernels.Pose,
        len(poses),
        **{name: poses[name] for name in ("size", "cos", "sin_v", "sin_u", "turned")},
        cells_x=poses["cells"][:, 0],
        cells_y=poses["cells"][:, 1],
    )
    places = arrays.places
    field.places = records(
        kernels.Place,
        len(places),
        at=places["at"],
        extent=places["extent"],
        pitch=_leading(places["extent"]),
    )
    kinds = arrays.kinds
    field.kinds = records(
        kernels.Kind,
        len(kinds),
        **{name: kinds[name] for name in ("surface", "combine", "is_void", "special")},
    )
    field.curves = records(
        kernels.Curve,
        2 * len(kinds),
        count=kinds["count"].ravel(),
        first=kinds["pieces"][..., 0].ravel(),
        last=kinds["pieces"][..., 1].ravel(),
        knot=kinds["knots"][..., 0].ravel(),
        bin=kinds["knots"][..., 1].ravel(),
        knotted=kinds["knotted"].ravel(),
    )
    field.pieces = array(curves.pieces.reshape(-1, 4), wp.vec4d)
    field.knots = array(curves.knots, wp.float64)
    field.curve_bins = array(curves.bins.astype(np.int32), wp.int32)
    field.tracks = records(
        kernels.Track,
        len(tracks.passes),
        **{name: getattr(tracks, name) for name in ("passes", "power", "surface", "law")},
    )
    segments = tracks.segments
    field.segments = records(
        kernels.Segment,
        len(segments),
        start=np.column_stack([segments["x"], segments["y"]]),
        end=np.column_stack([segments["end_x"], segments["end_y"]]),
        way=np.column_stack([segments["dx"], segments["dy"]]),
        **{name: segments[name] for name in ("square", "reach_square", "track")},
    )
    field.depths = array(tracks.depths, wp.float64)
    field.track_frame, field.track_shape = wp.vec4d(*tracks.frame), wp.vec2i(*tracks.shape)
    field.track_masks = array(tracks.masks, wp.uint64)
    field.track_offsets = array(tracks.offsets.astype(np.int32), wp.int32)
    field.track_entries = array(tracks.entries.astype(np.int32), wp.int32)
    reliefs = arrays.reliefs
    field.reliefs = records(
        kernels.Relief, len(reliefs), **{name: reliefs[name] for name in ("per", "scale", "key")}
    )
    field.friction = array(friction, wp.float32)
    return field


def _leading(sides: NDArray[np.float64]) -> NDArray[np.float64]:
    """The leading 36 bits of each number, as `split` of the kernels has them."""
    mantissa, exponent = np.frexp(sides)
    leading: NDArray[np.float64] = np.ldexp(np.floor(mantissa * 2.0**36), exponent - 36)
    return leading
