"""Options of verbs: those of the commands, by the same names, in sentences of Python."""

from __future__ import annotations

import inspect
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import terratool
from terratool.api.options import NamedOption, options_of, spoken
from terratool.cli.main import _COMMANDS, cli
from terratool.errors import RequestError
from terratool.importing.types import SourceOptions
from terratool.raster.dem import DemOptions
from tests.commands import ROOT, SAMPLE

HUSKY = ROOT / "samples/vehicles/husky-a200.json"

VERBS: dict[str, tuple[str, dict[str, str]]] = {
    "write_dem": ("export-dem", {"output": "path"}),
    "write_mesh": ("export-mesh", {"output": "path", "no_normals": "normals"}),
    "export_sim": ("export-sim", {"targets": "target", "output": "folder"}),
    "render": ("render", {"output": "path", "no_legend": "legend"}),
    "traversability": ("traversability", {"reports": "report", "map_": "map"}),
    "write_scan": ("scan", {"sensor_file": "sensor", "poses": "pose", "path_file": "poses"}),
    "diff": ("diff", {"map_": "map"}),
    "deform": ("deform", {}),
    "map_scans": ("map", {"sensor_file": "sensor"}),
    "compare": ("compare", {"map_": "map"}),
    "import_terrain": ("import-terrain", {}),
    "import_primitive": ("import-primitive", {}),
}
"""Commands that do what a verb does, and names of parameters that click cannot have."""
SHELL = {
    "file", "files", "as_json", "library_root", "no_roughness", "help",
    "output_by_name", "origin_at",  # other spellings of an argument and of an option
    "wheel_radius", "wheel_width", "load", "grouser_height", "tyre_pressure", "contact_length",
    "torque", "max_slip",  # a Vehicle in Python
    "conditions", "exit_code", "max_rmse", "min_coverage",  # exit codes
    "config_file", "formats", "max_changes", "called", "git", "difftool",  # texts and git
    "local",  # a sum with terrain.bounds
}  # fmt: skip
"""Parameters of commands that are about files, shells and exit codes, or stand in a record."""


def verb(name: str) -> Any:
    return getattr(terratool.Terrain, name, None) or getattr(terratool, name)


@pytest.mark.parametrize("name", VERBS)
def test_a_verb_takes_what_its_command_takes(name: str) -> None:
    """By the name of the option, with _ in place of -."""
    command, otherwise = VERBS[name]
    assert command in _COMMANDS
    found = cli.get_command(None, command)  # type: ignore[arg-type]
    asked = {otherwise.get(str(one.name), str(one.name)) for one in found.params}  # type: ignore[union-attr]
    wanted = asked - (SHELL - set(otherwise.values()))
    assert wanted - set(inspect.signature(verb(name)).parameters) == set()


@pytest.mark.parametrize(
    "name", [*VERBS, "to_dem", "to_mesh", "to_mjspec", "view", "scan", "load", "check"]
)
def test_each_option_is_explained(name: str) -> None:
    function = verb(name)
    doc = inspect.getdoc(function) or ""
    for one in inspect.signature(function).parameters:
        assert one == "self" or f"\n    {one}: " in doc, one
    assert "**options" not in doc


def test_options_are_read_off_the_record() -> None:
    """With those of its bases, and a meaning for each."""
    options = options_of(DemOptions)
    assert options["dtype"].default == "float32" and options["tiles"].default is None
    assert options["threads"].annotation == "int | None"
    assert options["cog"].descr == "whether the file is a cloud-optimised GeoTIFF."
    assert all(one.descr for one in options.values())
    assert options_of(SourceOptions)["scale"].default == 1.0


def test_an_unknown_option_is_refused_with_the_nearest() -> None:
    terrain = terratool.load(SAMPLE)
    with pytest.raises(RequestError) as error:
        terrain.to_dem(resolutoin=1)
    assert str(error.value) == "to_dem takes no 'resolutoin'. Did you mean resolution?"
    with pytest.raises(
        RequestError, match="There is layers, dtype, threads, resolution and bounds"
    ):
        terrain.to_dem(xyz=1)


KNOWN = {
    "solid": NamedOption("solid", "bool", False, "", ""),
    "overviews": NamedOption("overviews", "bool | None", None, "", ""),
    "bounds": NamedOption("bounds", "Bounds | None", None, "", ""),
    "routes": NamedOption("routes", "Sequence[Line]", (), "", ""),
    "start": NamedOption("start", "Point | None", None, "", ""),
    "target": NamedOption("target", "str", "", "", ""),
    "max_error": NamedOption("max_error", "float", 1.0, "", ""),
}


@pytest.mark.parametrize(
    ("said", "wanted"),
    [
        ("Add --solid.", "Add solid=True."),
        ("Leave out --no-overviews or --cog.", "Leave out overviews=False or --cog."),
        ("Give --max-error from 5 to 90.", "Give max_error from 5 to 90."),
        ("Add --route X0 Y0 X1 Y1 or --bounds W S E N.", "Add routes=… or bounds=…."),
        ("Add --target mujoco, or --solid.", 'Add target="mujoco", or solid=True.'),
        ("It needs --from X Y.", "It needs start=…."),
        ("a--solid.json: is a file.", "a--solid.json: is a file."),
    ],
)
def test_errors_name_options_as_python_does(said: str, wanted: str) -> None:
    assert spoken(said, KNOWN) == wanted


@pytest.mark.parametrize(
    ("call", "wanted"),
    [
        (lambda t, p: t.write_mesh(p / "a.stl", base=3.0),
         "There is a base, but no solid is asked for. Add solid=True."),
        (lambda t, p: t.render(azimuth=4.0),
         "azimuth is about perspectives. Add perspective=True, or leave out azimuth."),
        (lambda t, p: t.export_sim(p, "nav2", max_geoms=3),
         "max_geoms is about mujoco, but the target is nav2. Leave it out, or add "
         'target="mujoco".'),
        (lambda t, p: t.write_dem(p / "a.tif", tile_size=512),
         "tile_size is about tiles, but a single file is asked for. Add tiles=…."),
        (lambda t, p: t.write_dem(p / "a.tif", interval=2),
         'interval is about contours. Add layers=["contours"].'),
        (lambda t, p: t.write_dem(p / "a.gpkg", layers=["contours"], threads=2),
         "threads is about rasters. Leave out threads."),
        (lambda t, p: t.write_mesh(p / "a.wrl", elevation_grid=True, origin=(0, 0, 1)),
         "origin is about a mesh, but a grid of heights is asked for. Leave out origin or "
         "elevation_grid=True."),
        (lambda t, p: t.write_mesh(p / "a.wrl", origin="centre"),
         "origin is 'centre'. Did you mean center?"),
        (lambda t, p: t.write_dem(), "No file is named. Name one, or a folder by tiles=…."),
        (lambda t, p: t.scan(p, (0, 0, 0, 0, 0, 0), poses=p),
         "Both pose and poses say where the sensor is. Give pose=(x, y, z, yaw, pitch, roll), or "
         "the path of a file."),
        (lambda t, p: t.view(routes=[(0, 0, 1, 1)]), "A route needs a vehicle. Add vehicle."),
        (lambda t, p: t.traversability("v.json", waypoints=[[1, 2, 3]]),
         "cannot be read"),
    ],
)  # fmt: skip
def test_what_makes_no_sense_is_said_in_words_of_python(
    call: Any, wanted: str, tmp_path: Any
) -> None:
    with pytest.raises(terratool.TerratoolError) as error:
        call(terratool.load(SAMPLE), tmp_path)
    assert wanted in str(error.value)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("call", "wanted"),
    [
        (lambda t: t.to_dem(layers="slop", resolution=4), "no layer 'slop'. Did you mean slope?"),
        (lambda t: t.to_dem(layers=["hight"], resolution=4), "'hight'. Did you mean height?"),
        (lambda t: t.to_dem(layers="xyz", resolution=4), "The layers are height, surface, slope"),
        (lambda t: t.to_dem(dtype="float3", resolution=4), "Did you mean float32?"),
        (lambda t: t.render(layer="slop"), "no layer 'slop'. Did you mean slope?"),
        (lambda t: t.export_sim("none", "mujoko"), "Did you mean mujoco?"),
        (lambda t: t.traversability(HUSKY, prefer="engery"), "Did you mean energy?"),
        (lambda t: t.traversability(HUSKY, model="slipp"), "Did you mean slip?"),
        (lambda t: t.traversability(HUSKY, waypoints="none.csv"), "none.csv: cannot be read"),
        (lambda t: t.traversability(HUSKY, report="no.pdf"), "no.pdf"),
    ],
)  # fmt: skip
def test_a_wrong_word_is_refused_with_the_nearest(call: Any, wanted: str) -> None:
    with pytest.raises(terratool.TerratoolError) as error:
        call(terratool.load(SAMPLE))
    assert wanted in str(error.value)


def test_a_word_by_itself_is_a_list_of_one(tmp_path: Path) -> None:
    """Where a list of words or paths is wanted: it is never taken letter by letter."""
    for name, text in {
        "own/kit.json": '{"elemTypes": {"ramp": {"x": [0, 1]}}}',
        "site/site.json": '{"size": 2, "use": ["../own/kit.json"], '
        '"elemTree": {"type": "ramp", "vScale": 3}}',
    }.items():
        (tmp_path / name).parent.mkdir()
        (tmp_path / name).write_text(text)
    terrain = terratool.load(tmp_path / "site/site.json", str(tmp_path / "own"))
    assert terrain.height(1.0, 1.0) == pytest.approx(1.5, abs=1e-12)
    # a slope of 3 in 2
    slope = np.degrees(np.arctan(1.5))
    for layers in ("slope", ["slope"], ("slope",), np.array(["slope"])):
        dem = terrain.to_dem(layers=layers, resolution=0.5)
        assert list(dem.bands) == ["slope"]
        assert dem["slope"][1, 2] == pytest.approx(slope, abs=1e-3)
    flat = {"size": 3, "elemTypes": {"b": {"x": [0]}}, "elemTree": {"type": "b"}}
    codes = [one.code for one in terratool.check(flat).findings]
    assert codes == ["TT308"]
    assert terratool.check(flat, ignore="TT3").findings == ()
    assert [one.code for one in terratool.check(flat, select="TT3").findings] == codes
    definition = terratool.Definition(size=2, use="kit.json")
    definition.root("ramp", x_ignore="TT308")
    document = definition.document
    assert document["use"] == ["kit.json"] and document["elemTree"]["x-ignore"] == ["TT308"]


def test_a_file_that_is_there_is_kept(tmp_path: Any) -> None:
    path = tmp_path / "a.glb"
    path.write_text("mine")
    with pytest.raises(terratool.WriteError, match="overwrite=True"):
        terratool.load(SAMPLE).write_mesh(path)
    assert path.read_text() == "mine"
