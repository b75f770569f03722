"""Comparison of vehicles on one terrain: their names, and one grid for all of them."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

from terratool.errors import RequestError
from terratool.field.terrain import Terrain
from terratool.output import is_same_file
from terratool.traversability.fineness import finest_resolution, parts_of
from terratool.traversability.map_files import refuse_full_disk_of_maps
from terratool.traversability.preparing import (
    PreparedRequest,
    chosen_resolution,
    prepare_assessment,
)
from terratool.traversability.request import Request
from terratool.traversability.route.routes import narrow_note
from terratool.traversability.vehicle import Vehicle
from terratool.traversability.vehicle_files import name_of

_ONE_GRID = "one grid for all vehicles"


def names_of(paths: Sequence[str]) -> list[str]:
    """Names of vehicles by their files: the file's name, with the folder where two are alike.

    Raises:
        RequestError: a file is named twice, or two cannot be told apart.
    """
    for number, path in enumerate(paths):
        for other in paths[:number]:
            if path == other or is_same_file(path, other):
                also = "" if path == other else f", also as {other}"
                raise RequestError(f"{path}: is given twice{also}.", "Name each vehicle once.")
    plain = ["stdin" if path == "-" else name_of(path) for path in paths]
    count = Counter(plain)
    names = [
        "/".join(filter(None, (Path(path).parent.name, name))) if count[name] > 1 else name
        for path, name in zip(paths, plain, strict=True)
    ]
    for number, name in enumerate(names):
        if name in names[:number]:
            raise RequestError(
                f"{paths[names.index(name)]} and {paths[number]} would both be called {name}.",
                "Give the files names that differ.",
            )
    return names


def map_path_of(path: str | Path, name: str) -> Path:
    """Path of the map of one of several vehicles: the path asked for, with the vehicle's name."""
    path = Path(path)
    return path.with_name(f"{path.stem}-{name.replace('/', '-')}{path.suffix}")


class PreparedComparison(NamedTuple):
    """Checked requests, one for each vehicle, and sentences on their grids."""

    requests: list[PreparedRequest]
    notes: tuple[str, ...]


def prepare(
    terrain: Terrain,
    vehicles: Sequence[Vehicle],
    request: Request,
    *,
    map_path: str | Path | None = None,
    overwrite: bool = False,
) -> PreparedComparison:
    """Check a request for one vehicle, or for each of several, on one grid if possible.

    Raises:
        RequestError, WriteError, DefinitionError: `prepare_assessment` raises them.
        WriteError: all maps together are too large for the disk.
    """
    terrain = terrain.written_out
    if len(vehicles) == 1:
        (vehicle,) = vehicles
        one = prepare_assessment(terrain, vehicle, request, map_path=map_path, overwrite=overwrite)
        return PreparedComparison([one], ())
    common, notes = _common(terrain, vehicles, request, map_path is not None)
    prepared = [
        prepare_assessment(
            terrain, vehicle, common, overwrite=overwrite,
            map_path=None if map_path is None else map_path_of(map_path, vehicle.name),
        )
        for vehicle in vehicles
    ]  # fmt: skip
    if map_path is not None:
        refuse_full_disk_of_maps([one.extent for one in prepared], Path(map_path))
    return PreparedComparison(prepared, notes)


def _common(
    terrain: Terrain, vehicles: Sequence[Vehicle], request: Request, written: bool
) -> tuple[Request, tuple[str, ...]]:
    """Request with one resolution for all vehicles, and sentences on it.

    The resolution is the finest that a vehicle would have by itself, or the next coarser one that
    all vehicles allow. Where there is none, the request is returned as it is.
    """
    if request.resolution is not None:
        return request, ()
    own = [chosen_resolution(terrain, vehicle, request, written) for vehicle in vehicles]
    finest = {finest_resolution(vehicle): vehicle.name for vehicle in vehicles}
    refused = ""
    for resolution in sorted({*own, *(side for side in finest if side > min(own))}):
        try:
            for vehicle in vehicles:
                parts_of(vehicle, resolution)
        except RequestError as error:
            refused = refused or f"{vehicle.name}: {error.message}"
            continue
        why = f"the finest that {finest.get(resolution)} allows"
        if resolution in own:
            why = f"as {vehicles[own.index(resolution)].name} would have by itself"
        narrow = [
            f"{vehicle.name}: {note}"
            for vehicle in vehicles
            if request.travels and (note := narrow_note(vehicle, resolution))
        ]
        said = (
            f"All vehicles have pixels of {resolution:.4g} m, {why}, so that maps can be compared "
            "pixel by pixel."
        )
        return replace(request, resolution=resolution, why=_ONE_GRID), (said, *narrow)
    return request, (
        f"Each vehicle has a grid of its own, as there is no resolution that all allow. {refused}",
    )
