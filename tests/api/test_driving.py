"""Ruts of a drive and maps of scans, against the commands and figures worked out by hand."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rasterio.transform import Affine

import terratool
from terratool.sensing.map_files import read_map
from tests.commands import ROOT, call

VEHICLE: dict[str, Any] = {
    "mass": 400, "gravity": 10, "clearance": 0.3, "track": 1, "wheelbase": 1,
    "axles": [{"x": 0.5}, {"x": -0.5}], "cog": {"x": 0, "height": 0.3},
    "wheels": {"radius": 0.3, "width": 0.2, "kind": "rigid"},
}  # fmt: skip
LIDAR = ROOT / "samples/sensors/velodyne-vlp-16.json"
SITE: dict[str, Any] = {
    "size": [14, 8],
    "origin": [100, 50],
    "surfTypes": {"soil": {"sinkage": 0.02, "fricAngle": 30}, "packed": {}},
    "elemTypes": {"slope": {"x": [0, 1]}, "box": {"x": [1]}},
    "elemTree": {
        "type": "slope", "vScale": 0.7, "surface": "soil", "cells": [14, 8],
        "children": [{"cellX": 10, "cellY": 1, "span": [2, 1], "type": "box", "vScale": 1}],
    },
}  # fmt: skip
WAY = [(103.0, 55.0), (110.0, 55.0)]
POSE = (103.0, 55.0, 0.0, 0.0, 0.0, 0.0)


@pytest.fixture
def file(tmp_path: Path) -> Path:
    """A site with the vehicle and the way beside it."""
    (tmp_path / "vehicle.json").write_text(json.dumps(VEHICLE), "utf-8")
    (tmp_path / "way.csv").write_text("\n".join(f"{x},{y}" for x, y in WAY), "utf-8")
    path = tmp_path / "site.json"
    path.write_text(json.dumps(SITE), "utf-8")
    return path


# --- ruts -----------------------------------------------------------------------------------------


def test_a_drive_leaves_ruts_in_a_terrain_of_its_own(file: Path) -> None:
    """A quarter of 4 kN on 0.02 m/kN; two wheels behind each other press n^(1/a) deeper."""
    terrain = terratool.load(file)
    driven = terrain.deform(file.parent / "vehicle.json", WAY, multipass=2, surface="packed")
    assert isinstance(driven, terratool.Terrain) and driven.name == "site.json"
    assert (terrain.tracks, driven.tracks) == (0, 4)
    depth = 0.02 * 1.0 * 2**0.5
    x = np.array([105.0, 106.5, 108.0])
    for side in (54.5, 55.5):
        lower = terrain.height(x, side) - driven.height(x, side)
        assert lower == pytest.approx(np.full(3, depth), rel=1e-4)
        assert set(driven.surface(x, side)) == {"packed"}
    for beside in (55.0, 53.5, 56.5):
        assert np.array_equal(terrain.height(x, beside), driven.height(x, beside))
    further = driven.deform(file.parent / "vehicle.json", np.array(WAY), multipass=2,
                            surface="packed", passes=3)  # fmt: skip
    assert further.tracks == 4  # the same ones, driven along four times by two wheels
    lower = terrain.height(106.5, 54.5) - further.height(106.5, 54.5)
    assert lower == pytest.approx(0.02 * 1.0 * 8**0.5, rel=1e-4)


def test_ruts_are_written_as_the_command_writes_them(file: Path, tmp_path: Path) -> None:
    vehicle, way = tmp_path / "vehicle.json", tmp_path / "way.csv"
    words = ["--vehicle", vehicle, "--waypoints", way, "--passes", 3, "--max-error", 0.05]
    (tmp_path / "sub").mkdir()
    told = json.loads(call("deform", file, *words, "-o", tmp_path / "sub/a.json", "--json").out)
    terrain = terratool.load(file)
    report = terrain.deform(vehicle, way, tmp_path / "sub/b.json", passes=3, max_error=0.05)
    assert (tmp_path / "sub/a.json").read_bytes() == (tmp_path / "sub/b.json").read_bytes()
    assert (report.added, report.length) == (told["tracks"], told["length"])
    assert terratool.load(tmp_path / "sub/b.json").height(106.5, 54.5) == pytest.approx(
        terrain.deform(vehicle, way, passes=3).height(106.5, 54.5), abs=1e-12
    )
    for output in (tmp_path / "sub/b.json", file):
        with pytest.raises(terratool.WriteError, match="overwrite=True"):
            terrain.deform(vehicle, way, output)
    assert json.loads(file.read_text("utf-8")) == SITE


def test_what_a_drive_reads_is_not_overwritten(file: Path) -> None:
    """But the terrain itself; the command says the same. Other names are those of definitions."""
    terrain = terratool.load(file)
    vehicle = file.with_name("vehicle.json")
    way = file.with_name("way.csv").rename(file.with_name("way.json"))
    for output in (vehicle, way):
        before = output.read_bytes()
        words = ["--vehicle", vehicle, "--waypoints", way, "-o", output, "--overwrite"]
        told = call("deform", file, *words).err
        with pytest.raises(terratool.WriteError, match="is read, too, as") as error:
            terrain.deform(vehicle, way, output, overwrite=True)
        assert error.value.message in told and output.read_bytes() == before
    with pytest.raises(terratool.RequestError, match="is no name of a definition"):
        terrain.deform(vehicle, WAY, file.with_name("driven.jsn"))
    assert not file.with_name("driven.jsn").exists()
    terrain.deform(vehicle, WAY, file, overwrite=True)
    assert terratool.load(file).tracks == 4


def test_libraries_are_found_after_a_drive(file: Path, tmp_path: Path) -> None:
    (tmp_path / "kit").mkdir()
    kit = {"elemTypes": {"slope": SITE["elemTypes"]["slope"]}}
    (tmp_path / "kit/kit.json").write_text(json.dumps(kit), "utf-8")
    (tmp_path / "sites").mkdir()
    uses = {**SITE, "use": ["../kit/kit.json"], "elemTypes": {"box": {"x": [1]}}}
    site = tmp_path / "sites/uses.json"
    site.write_text(json.dumps(uses), "utf-8")
    terrain = terratool.load(site, tmp_path)
    plain = terratool.load(file).deform(tmp_path / "vehicle.json", WAY)
    driven = terrain.deform(tmp_path / "vehicle.json", WAY)
    assert driven.height(106.5, 54.5) == plain.height(106.5, 54.5)
    terrain.deform(tmp_path / "vehicle.json", WAY, tmp_path / "moved.json")
    assert json.loads((tmp_path / "moved.json").read_text("utf-8"))["use"] == ["kit/kit.json"]


@pytest.mark.parametrize(
    ("options", "says"),
    [
        ({"passes": 0}, "The path is to be driven 0 times. Give a whole number from 1"),
        ({"multipass": 0.5}, "The exponent of passes is 0.5. Give a finite number from 1 on."),
        ({"max_error": 0.0}, "The largest error is 0. Give a finite length above 0."),
        ({"surface": "mud"}, 'There is no surface "mud" for the ruts.'),
        ({"waypoints": [(0, 0), (1, 1)]}, "A point of the path"),
        ({"waypoints": [(1, 2)]}, "Give two or more rows of x and y, or of x, y and z."),
    ],
)
def test_a_drive_that_makes_no_sense_is_refused(
    file: Path, options: dict[str, Any], says: str
) -> None:
    terrain = terratool.load(file)
    with pytest.raises(terratool.RequestError) as error:
        terrain.deform(**{"vehicle": file.parent / "vehicle.json", "waypoints": WAY, **options})
    assert says in str(error.value)


# --- maps -----------------------------------------------------------------------------------------


def test_a_map_is_that_of_the_command(file: Path, tmp_path: Path) -> None:
    terrain = terratool.load(file)
    scans = [tmp_path / "first.npz", tmp_path / "second.npz"]
    for number, scan in enumerate(scans):
        terrain.write_scan(scan, LIDAR, (POSE[0] + number, *POSE[1:]), on_ground=1.2, seed=number)
    bounds = (101.0, 51.0, 113.0, 57.0)
    words = ["--resolution", 0.25, "--levels", 2, "--bounds", *bounds, "--sigma", 0.03]
    assert call("map", *scans, tmp_path / "a.tif", *words).code == 0
    options: dict[str, Any] = {"resolution": 0.25, "levels": 2, "bounds": bounds, "sigma": 0.03}
    made = terratool.map_scans(scans, tmp_path / "b.tif", **options)
    for level in ("", ".level-1"):
        assert (tmp_path / f"a{level}.tif").read_bytes() == (
            tmp_path / f"b{level}.tif"
        ).read_bytes()
    again = terratool.map_scans(scans, **options)
    assert again.points == made.points > 1000
    written = read_map(tmp_path / "a.level-1.tif").level
    assert np.array_equal(again.level(1).elevation, written.elevation, equal_nan=True)
    # a scan by itself is a list of one
    assert terratool.map_scans(str(scans[0]), **options).points < made.points


def test_a_map_in_memory_is_as_good_as_its_file(file: Path, tmp_path: Path) -> None:
    terrain = terratool.load(file)
    terrain.write_scan(tmp_path / "cloud.npz", LIDAR, POSE, on_ground=1.2, seed=3)
    made = terratool.map_scans(tmp_path / "cloud.npz", tmp_path / "map.tif", resolution=0.5)
    for level, name in enumerate(("map.tif", "map.level-1.tif")):
        own, read = terrain.compare(made, level=level), terrain.compare(tmp_path / name)
        assert own.errors == read.errors and own.coverage == read.coverage
        assert own.surfaces == read.surfaces and own.distances == read.distances
        assert 0 < own.coverage < 1 and own.errors.rmse > 0
    told = json.loads(call("compare", tmp_path / "map.tif", file, "--json").out)
    assert terrain.compare(made).errors.rmse == told["rmse"]
    with pytest.raises(terratool.RequestError, match=r"^The map has no level 3\. Give one from 0"):
        terrain.compare(made, level=3)


def test_heights_of_ones_own_are_compared_where_they_lie(file: Path) -> None:
    """Raised by a quarter of a metre, but for one cell; a mirrored array is far off."""
    terrain = terratool.load(file)
    dem = terrain.to_dem(resolution=1, dtype="float64", layers=["surface", "height"])
    exact = terrain.compare(dem)
    assert (exact.coverage, exact.errors.cells) == (1.0, 14 * 8)
    assert exact.errors.worst == pytest.approx(0.0, abs=1e-12)
    raised = dem.heights + 0.25
    raised[1, 12] += 2.0  # row 1 from the north, column 12 from the west
    found = terrain.compare(raised, transform=dem.transform)
    assert found.errors.bias == pytest.approx(0.25 + 2 / (14 * 8))
    assert found.worst is not None
    assert (found.worst.x, found.worst.y) == (112.5, 56.5)
    assert terrain.compare(dem.heights[:, ::-1], transform=dem.transform).errors.worst > 0.5
    oblong = Affine(1.0, 0.0, 100.0, 0.0, -2.0, 66.0)
    with pytest.raises(terratool.RequestError, match=r"^The pixels of the array are 1 by 2\. "):
        terrain.compare(dem.heights, transform=oblong)
    with pytest.raises(terratool.RequestError, match="The array has no place in the world"):
        terrain.compare(dem.heights)


def test_a_transform_is_refused_where_the_map_has_its_own(file: Path, tmp_path: Path) -> None:
    terrain = terratool.load(file)
    dem, map_file, cloud = terrain.to_dem(), tmp_path / "map.tif", tmp_path / "cloud.npz"
    terrain.write_dem(map_file, resolution=1)
    terrain.write_scan(cloud, LIDAR, POSE, on_ground=1.2)
    made = terratool.map_scans(cloud, resolution=0.5)
    for given, what in ((map_file, "a file is named"), (made, "a map of map_scans is given")):
        terrain.compare(given)
        with pytest.raises(terratool.RequestError) as error:
            terrain.compare(given, transform=dem.transform)
        assert str(error.value) == f"A transform is about arrays, but {what}. Leave it out."


def test_errors_of_a_map_are_drawn_as_the_command_draws_them(file: Path, tmp_path: Path) -> None:
    pytest.importorskip("matplotlib")
    terrain = terratool.load(file)
    terrain.write_dem(tmp_path / "dem.tif", resolution=0.5, losses=False)
    assert call("compare", tmp_path / "dem.tif", file, "--picture", tmp_path / "a.png").code == 0
    terrain.compare(tmp_path / "dem.tif", picture=tmp_path / "b.png")
    assert (tmp_path / "a.png").read_bytes() == (tmp_path / "b.png").read_bytes()
    with pytest.raises(terratool.WriteError, match="overwrite=True"):
        terrain.compare(tmp_path / "dem.tif", picture=tmp_path / "b.png")


@pytest.mark.parametrize(
    ("options", "says"),
    [
        ({}, "Nothing says how large cells are. Give resolution."),
        ({"resolution": 0.0}, "A cell has a side of 0 m."),
        ({"resolution": 1, "levels": 0}, "A map of 0 levels is none."),
        ({"resolution": 1, "sigma": -1}, "The standard deviation of ranges is -1 m."),
        ({"resolution": 1, "sigma": 1, "sensor": LIDAR}, "Both sigma and sensor say how far"),
        ({"resolution": 1, "bag": "b"}, "bag is about files, but none is named. Give output."),
        ({"resolution": 1, "output": "cloud.csv"}, "cloud.csv: is read, too."),
        ({"resolution": 1, "output": "map.png"}, "map.png: a map is a GeoTIFF."),
        ({"resolution": 1, "bounds": (10, 10, 11, 11)}, "No reading lies within the bounds."),
    ],
)
def test_a_map_that_makes_no_sense_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, options: dict[str, Any], says: str
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("cloud.csv").write_text("x,y,z\n2,3,4\n2.5,3,4\n", "utf-8")
    with pytest.raises(terratool.TerratoolError) as error:
        terratool.map_scans("cloud.csv", **options)
    assert says in str(error.value)
    assert [one.name for one in tmp_path.iterdir()] == ["cloud.csv"]
