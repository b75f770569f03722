"""One convention for the words of all commands, held over click's own tree, and guesses at others.

docs/commands.md says it; a command or an option that breaks it is told of here.
"""

from __future__ import annotations

import json
import re
from collections import defaultdict
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import click  # noqa: TID251, the tree of commands is what is tested
import pytest

from terratool.cli import main
from terratool.cli.command import Command
from terratool.cli.options import json_option, output_argument, output_option
from terratool.definition.layout import canonical
from terratool.text.meaning import _MEANT, near_names, spelled_like
from tests.commands import PLATED, ROOT, SAMPLE, call, plated_site, run

PAGE = (ROOT / "docs" / "commands.md").read_text("utf-8")
SILENT = {"completion"}
"""Commands that print a program for a shell, so that there is nothing to say as JSON."""
IN_PLACE = {"add", "deform", "view", "import-primitive"}
"""Commands that do without an output, but take one."""
PLACES = {
    "X Y", "X Y Z", "X0 Y0 X1 Y1", "W S E N", "W H", "COL ROW W H", "X Y Z YAW PITCH ROLL",
    "LOW HIGH", "NX NY", "DX DY",
}  # fmt: skip
MOST_LINES, WIDE = 45, 100

Commands = dict[str, click.Command]


def walked(group: click.Group, before: str = "") -> Iterator[tuple[str, click.Command]]:
    context = click.Context(group)
    for name in group.list_commands(context):
        command = group.get_command(context, name)
        assert command is not None
        if isinstance(command, click.Group):
            yield from walked(command, f"{before}{name} ")
        else:
            yield before + name, command


COMMANDS: Commands = dict(walked(main.cli))


def options_of(command: click.Command) -> list[click.Option]:
    return [one for one in command.params if isinstance(one, click.Option)]


def arguments_of(command: click.Command) -> list[click.Argument]:
    return [one for one in command.params if isinstance(one, click.Argument)]


def long_names(option: click.Option) -> list[str]:
    return [name for name in option.opts if name.startswith("--")]


def wrong_outputs(commands: Commands) -> Iterator[str]:
    """An output is the last argument and -o; where it may be left out, -o alone."""
    for name, command in commands.items():
        arguments = [one.name for one in arguments_of(command)]
        options = {long_names(one)[0]: one for one in options_of(command)}
        named = options.get("--output")
        if "output" in arguments and (arguments[-1] != "output" or named is None):
            yield f"{name}: the output is not the last argument, or not -o, too"
        if ("output" in arguments or name in IN_PLACE) != (named is not None):
            yield f"{name}: -o, but no output, or the other way round"
        if named is not None and (named.opts != ["-o", "--output"] or named.metavar != "OUT"):
            yield f"{name}: another -o"
        for option in options_of(command):
            if option is not named and any(len(word) == 2 for word in option.opts):
                yield f"{name}: a letter for {option.opts}"
        for argument in arguments_of(command):
            if argument.name != "output" and re.search("OUT|DIR$", argument.metavar or ""):
                yield f"{name}: an output of another name, {argument.metavar}"


def wrong_answers(commands: Commands) -> Iterator[str]:
    """--json is everywhere, a flag; --format stands beside it."""
    for name, command in commands.items():
        options = {long_names(one)[0]: one for one in options_of(command)}
        if name not in SILENT and not ("--json" in options and options["--json"].is_flag):
            yield f"{name}: no --json"
        if "--format" in options and options["--format"].metavar != "FORM":
            yield f"{name}: another --format"


_side = re.compile(r"Side of (the |a )?(\w+ )?(pixel|cell)").match


def wrong_words(commands: Commands) -> Iterator[str]:
    """Places are separate words; the same letters stand for the same kinds of numbers."""
    for name, command in commands.items():
        for option in options_of(command):
            called, metavar = long_names(option)[0], option.metavar or ""
            if option.nargs > 1 and metavar not in PLACES | {"M L"}:
                yield f"{name}: {called} {metavar} is no place"
            if option.nargs > 1 and len(metavar.split()) != option.nargs:
                yield f"{name}: {called} has {option.nargs} words and says {metavar}"
            if option.nargs == 1 and re.search(r"[, ](?!…)", metavar):
                yield f"{name}: {called} {metavar} is one word of several"
            for letter, meant in (("E", "--max-error"), ("R", "--resolution")):
                if (metavar == letter) != (called == meant):
                    yield f"{name}: {called} {metavar}, where {letter} is {meant}"
            if _side(option.help or "") and called != "--resolution":
                yield f"{name}: {called} is a side of pixels"
            allowed = called in (
                "--max-error",
                "--height-error",
            )  # of a result, and of what is given
            if re.search("toler|error|accura", called) and not allowed:
                yield f"{name}: {called} is an error"
            if len(long_names(option)) > 1:
                yield f"{name}: {option.opts} is one option of two names"


OWN_MEANINGS = {"--columns": {"new", "query"}}
"""Names that mean one thing in one command, and another in the other."""


def wrong_meanings(commands: Commands) -> Iterator[str]:
    """A name has one number of words and one metavar, and stands in the page once it is shared."""
    uses: dict[str, dict[tuple[Any, ...], set[str]]] = defaultdict(lambda: defaultdict(set))
    for name, command in commands.items():
        for option in options_of(command):
            form = option.nargs, option.metavar, option.is_flag
            uses[long_names(option)[0]][form].add(name.split()[0])
    table = dict(re.findall(r"`(--[\w-]+)(?: ([^`]+))?`", shared_rows()))
    for called, forms in uses.items():
        if OWN_MEANINGS.get(called) == set().union(*forms.values()):
            continue
        if len(forms) > 1:
            yield f"{called}: {dict(forms)}"
        ((_, metavar, _), users), *_ = forms.items()
        if len(users) > 1 and table.pop(called, None) != (metavar or ""):
            yield f"{called}: is shared, and docs/commands.md has another line of it, or none"
    yield from (f"docs/commands.md: {called} is not shared" for called in table)


def shared_rows() -> str:
    """First cells of the table of options of several commands."""
    table = PAGE.split("| option | what it means |")[1].split("\n\n")[0]
    return "\n".join(row.split("|")[1] for row in table.splitlines()[2:])


CHECKS = (wrong_outputs, wrong_answers, wrong_words, wrong_meanings)


@pytest.mark.parametrize("check", CHECKS, ids=lambda check: check.__name__)
def test_all_commands_are_spelled_alike(check: Callable[[Commands], Iterator[str]]) -> None:
    assert list(check(COMMANDS)) == []


def with_option(*words: str, **rest: Any) -> click.Command:
    """A command as it should be, and an option more."""

    @click.command(cls=Command)
    @click.argument("file")
    @output_argument
    @click.option(*words, **rest)
    @json_option()
    def command(**values: Any) -> None:
        pass

    return command


def without_output() -> click.Command:
    """A command that makes a file by an option."""

    @click.command(cls=Command)
    @click.argument("file")
    @output_option("Where it goes.")
    @json_option()
    def command(**values: Any) -> None:
        pass

    return command


def without_json() -> click.Command:
    @click.command(cls=Command)
    @click.argument("file")
    def command(**values: Any) -> None:
        pass

    return command


def with_output_first() -> click.Command:
    @click.command(cls=Command)
    @output_argument
    @click.argument("file")
    @json_option()
    def command(**values: Any) -> None:
        pass

    return command


@pytest.mark.parametrize(
    ("command", "check"),
    [
        (with_option("--grain", metavar="N", type=int), None),
        (without_output(), wrong_outputs),
        (with_output_first(), wrong_outputs),
        (with_option("-r", "--raster", metavar="FILE"), wrong_outputs),
        (without_json(), wrong_answers),
        (with_option("--format", metavar="text|json"), wrong_answers),
        (with_option("--place", metavar="X,Y"), wrong_words),
        (with_option("--place", nargs=2, metavar="XY"), wrong_words),
        (with_option("--place", nargs=2, metavar="LAT LON"), wrong_words),
        (with_option("--tolerance", metavar="T"), wrong_words),
        (with_option("--slack", metavar="E"), wrong_words),
        (with_option("--grain", metavar="G", help="Side of a cell."), wrong_words),
        (with_option("--fine", "--coarse", metavar="G"), wrong_words),
        (with_option("--resolution", metavar="M", help="Side of a pixel."), wrong_words),
        (with_option("--bounds", nargs=2, metavar="X Y"), wrong_meanings),
        (with_option("--seed", metavar="SEED"), wrong_meanings),
        (with_option("--turn", is_flag=True), wrong_meanings),
        (with_option("--levels", metavar="N", type=int), wrong_meanings),  # shared, in no table
    ],
    ids=lambda value: getattr(value, "__name__", None),
)
def test_a_command_that_is_not_is_told_of(
    command: click.Command, check: Callable[[Commands], Iterator[str]] | None
) -> None:
    """Only by the check that is meant; without a fault by none."""
    commands = {**COMMANDS, "new-one": command}
    told = {one for one in CHECKS if list(one(commands))}
    assert told >= ({check} if check else set()) and bool(told) == bool(check)


def test_the_page_has_each_command_as_it_is_called() -> None:
    """Its arguments in their order, before its options."""
    rows = re.findall(r"^\| `terratool ([\w-]+)((?: [^`]*)?)` \|", PAGE, re.MULTILINE)
    assert sorted(name for name, _ in rows) == sorted(main._COMMANDS)
    for name, words in rows:
        if name in ("new", "completion", "query"):  # kinds, a choice, and words without an end
            continue
        said = words.replace("\\", "").split(" --")[0].split()
        usage = call(name, "--help").out.split("\n\n")[0].partition("[OPTIONS]")[2].split()
        assert [word.strip("[]") for word in said] == [
            re.sub(r"[\[\]]", "", word) for word in usage
        ], name


# --- the output ----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "words",
    [("{in}", "{out}"), ("{in}", "-o", "{out}"), ("-o", "{out}", "{in}"), ("-o{out}", "{in}"),
     ("--output={out}", "{in}")],
    ids=" ".join,
)  # fmt: skip
def test_an_output_is_the_last_word_or_behind_o(tmp_path: Any, words: tuple[str, ...]) -> None:
    out = tmp_path / "bundle.json"
    given = [word.replace("{in}", SAMPLE).replace("{out}", str(out)) for word in words]
    assert call("bundle", *given).code == 0
    assert out.exists()


def test_an_output_is_given_once(tmp_path: Any) -> None:
    for words in ((), ("a.json", "-o", "b.json")):
        ran = call("bundle", SAMPLE, *words)
        assert (ran.code, ran.out) == (2, "")
    assert 'as "a.json" and by -o as "b.json"' in ran.err
    assert "Missing argument 'OUT'" in call("bundle", SAMPLE).err


@pytest.mark.parametrize(
    "words", [("a.csv", "b.csv", "m.tif"), ("a.csv", "b.csv", "-o", "m.tif"),
              ("-o", "m.tif", "a.csv", "b.csv")],
    ids=" ".join,
)  # fmt: skip
def test_several_inputs_before_an_output(
    tmp_path: Any, monkeypatch: pytest.MonkeyPatch, words: tuple[str, ...]
) -> None:
    """All that is no output is read: each cloud has one reading, and the map has both."""
    monkeypatch.chdir(tmp_path)
    head = "x,y,z,origin_x,origin_y,origin_z\n"
    (tmp_path / "a.csv").write_text(head + "0.5,0.5,1,0,0,2\n")
    (tmp_path / "b.csv").write_text(head + "3.5,1.5,1,0,0,2\n")
    ran = call("map", *words, "--resolution", 1, "--levels", 1, "--sensor-at", 0, 0, 2)
    assert ran.code == 0, ran.err
    assert ran.out.startswith("m.tif: 2 readings in 2 of 8 cells")


def test_what_is_changed_in_place_may_go_elsewhere(tmp_path: Any) -> None:
    """Without -o the file itself gets the element; with it that stays as it was."""
    site, other = tmp_path / "site.json", tmp_path / "other.json"
    site.write_bytes((ROOT / "samples" / "paper-example.json").read_bytes())
    before = site.read_bytes()
    kind = next(iter(json.loads(before)["elemTypes"]))
    element = ("--type", kind, "--at", 2, 3, "--extent", 1, 0.5)
    assert call("add", site, *element, "-o", other).code == 0
    assert site.read_bytes() == before and other.read_bytes() != before
    assert call("add", site, *element).code == 0
    assert site.read_bytes() == other.read_bytes()


# --- the answer ----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "words", [("validate", SAMPLE), ("diff", SAMPLE, SAMPLE), ("rules", "TT2")], ids=" ".join
)
def test_json_is_short_for_its_format(words: tuple[str, ...]) -> None:
    ran = call(*words, "--json")
    assert ran == call(*words, "--format", "json")
    assert json.loads(ran.out)["format_version"] >= 1
    assert call(*words, "--json", "--format", "text").code == 2


def test_rules_as_json_are_those_of_the_list() -> None:
    """Each with its severity and its manual page."""
    found = json.loads(call("rules", "--json").out)["rules"]
    lines = [f"{one['code']}  {one['severity']:7}  {one['name']}" for one in found]
    assert lines == call("rules").out.splitlines()
    alone = call("rules", found[3]["code"]).out
    assert found[3]["manual"] in alone and found[3]["summary"] in found[3]["manual"]


def test_what_was_added_as_json(tmp_path: Any) -> None:
    """The pointer leads to the element, and what is unusual about it has its place and its rule."""
    site = plated_site(tmp_path)
    words = ("--type", "plate", "--v-scale", 0.5, "--cell", 0, 1)
    found = json.loads(call("add", site, *words, "--json").out)
    assert (found["file"], found["pointer"]) == (str(site), "/elemTree/children/1")
    added = json.loads(site.read_text())["elemTree"]["children"][1]
    assert added == {"cellX": 0, "cellY": 1, "type": "plate", "vScale": 0.5}
    (said,) = found["findings"]
    assert (said["code"], said["severity"]) == ("TT208", "warning")
    line = site.read_text().splitlines()[said["line"] - 1]
    assert '"cellY": 1' in line and 0 < said["column"] <= len(line)


def test_which_files_changed_as_json(tmp_path: Any) -> None:
    """With --check they stay; without it they are those that were written."""
    good, rough = tmp_path / "good.json", tmp_path / "rough.json"
    good.write_text(canonical(json.dumps(PLATED)), encoding="utf-8")
    rough.write_text(json.dumps(PLATED), encoding="utf-8")
    for words, code in ((("--check",), 1), ((), 0)):
        ran = call("format", tmp_path, *words, "--json")
        found = json.loads(ran.out)
        assert (ran.code, found["files"], found["changed"]) == (code, 2, [str(rough)])
        assert (found["broken"], found["failed"]) == (0, 0)
    assert rough.read_bytes() == good.read_bytes()
    assert json.loads(call("format", tmp_path, "--json").out)["changed"] == []
    assert call("format", "-", "--json", stdin="{}").code == 2


def test_a_bundle_a_picture_and_a_page_as_json(tmp_path: Any) -> None:
    """They name the file that there is, and say of it what can be counted there."""
    hall = ROOT / "samples" / "warehouse.json"
    out = tmp_path / "out.json"
    found = json.loads(call("bundle", hall, out, "--json").out)
    assert (found["file"], found["bytes"]) == (str(out), out.stat().st_size)
    used = json.loads(hall.read_text("utf-8"))["use"]
    assert {str(hall.parent / name) for name in used} <= {*found["libraries"]}
    page = tmp_path / "page.html"
    found = json.loads(call("view", SAMPLE, "-o", page, "--no-open", "--json").out)
    assert (found["file"], found["bytes"]) == (str(page), page.stat().st_size)
    assert found["faces"] > 0 and found["routes"] == []
    assert call("view", SAMPLE, "--watch", "--json").code == 2


def test_a_picture_as_json(tmp_path: Any) -> None:
    """Its sides are those of the file."""
    out = tmp_path / "out.png"
    words = ("render", SAMPLE, out, "--pixels", 640, "--profile", 2, 30, 90, 40, "--json")
    ran = call(*words)
    if ran.code == 2 and "matplotlib" in ran.err.lower():
        pytest.skip("Matplotlib is not installed")
    found = json.loads(ran.out)
    header = out.read_bytes()[16:24]  # of a PNG: two whole numbers of four bytes
    assert header == found["width"].to_bytes(4, "big") + found["height"].to_bytes(4, "big")
    assert max(found["width"], found["height"]) == 640 and found["file"] == str(out)


# --- the page of help ----------------------------------------------------------------------------


def page_of(name: str) -> list[str]:
    return run(*name.split(), "--help", COLUMNS=str(WIDE)).out.splitlines()


@pytest.mark.parametrize("name", [name for name in COMMANDS if " " not in name])
def test_help_is_one_page(name: str) -> None:
    """As a terminal of 100 columns and some fifty lines shows it, the common before the rare."""
    lines = page_of(name)
    assert len(lines) <= MOST_LINES and max(map(len, lines)) <= WIDE
    text = "\n".join(lines)
    for option in options_of(COMMANDS[name]):
        for shown in (*option.opts, *option.secondary_opts):
            assert re.search(rf"(?<![\w-]){re.escape(shown)}(?![\w-])", text)
    listed = text.split("\n  Example")[0].splitlines()
    names = [line.split()[0] for line in listed if re.match("  -", line)]
    assert names[-1] == "-h,"
    for rare in ("--library-root", "--wheel-radius"):
        if rare in names:
            behind = names[names.index(rare) + 1 :]
            assert not {"--vehicle", "--resolution", "--max-error", "--bounds"} & set(behind)


@pytest.mark.parametrize(
    "name",
    ["export-dem", "traversability", "import-terrain", "import-primitive", "export-mesh",
     "export-sim", "render", "view"],
)  # fmt: skip
def test_options_stand_in_groups(name: str) -> None:
    """Under headings, none of them over more than eight options or over none."""
    lines = page_of(name)
    heads = [n for n, line in enumerate(lines) if re.match(r"[A-Zmn][^:]*:$", line)]
    assert len(heads) >= 3
    for begin, end in zip(heads, [*heads[1:], len(lines)], strict=True):
        count = sum(line.startswith("  -") for line in lines[begin:end])
        assert 1 <= count <= 8, lines[begin]


def test_examples_are_not_broken_within_words() -> None:
    """A path that is broken at a hyphen cannot be copied."""
    text = "\n".join(page_of("scan"))
    assert "samples/sensors/velodyne-vlp-16.json" in text


# --- what was meant ------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("words", "meant"),
    [
        (("export-dem", "a", "b.tif", "--res", "1"), "--resolution"),
        (("export-dem", "a", "b.tif", "--cell-size", "1"), "--resolution"),
        (("export-dem", "a", "b.tif", "--pixel-size", "1"), "--resolution"),
        (("export-dem", "a", "b.tif", "--resolutoin", "1"), "--resolution"),
        (("export-dem", "a", "--out", "b.tif"), "--output"),
        (("export-dem", "a", "b.tif", "--bbox", "1"), "--bounds"),
        (("export-mesh", "a", "b.obj", "--tolerance", "1"), "--max-error"),
        (("export-mesh", "a", "b.obj", "--error", "1"), "--max-error"),
        (("export-mesh", "a", "b.obj", "--triangles", "1"), "--max-faces"),
        (("import-primitive", "a", "--tolerance", "1"), "--max-error"),
        (("import-primitive", "a", "--place", "1"), "--cell"),
        (("deform", "a", "--tolerance", "1"), "--max-error"),
        (("diff", "a", "b", "--tolerance", "1"), "--min-change"),
        (("map", "a", "b.tif", "--cell", "1"), "--resolution"),
        (("map", "a", "b.tif", "--origin", "1"), "--sensor-at"),
        (("scan", "a", "b.ply", "--path", "c"), "--poses"),
        (("deform", "a", "--path", "c"), "--waypoints"),
        (("render", "a", "b.png", "--size", "1"), "--pixels"),
        (("traversability", "a", "--reachable", "1"), "--from"),
        (("traversability", "a", "--robot", "1"), "--vehicle"),
        (("compare", "a", "b", "--format", "json"), "--json"),
        (("query", SAMPLE, "1", "2", "--format", "json"), "--json"),
        (("query", SAMPLE, "1", "2", "--decimals", "3"), "--digits"),
        (("new", "flat", "a.json", "--force"), "--overwrite"),
        (("new", "flat", "a.json", "--soil", "ice"), "--preset"),
        (("import-terrain", "a.tif", "b.json", "--soil", "sand"), "--preset"),
        (("export-sim", SAMPLE, "o", "--target", "isaac"), "usd"),
        (("export-sim", SAMPLE, "o", "--target", "Isaac_Lab"), "usd"),
        (("export-sim", SAMPLE, "o", "--target", "sdf"), "gazebo"),
        (("export-sim", SAMPLE, "o", "--target", "ignition"), "gazebo"),
        (("export-sim", SAMPLE, "o", "--target", "costmap"), "nav2"),
        (("export-sim", SAMPLE, "o", "--target", "ros"), "nav2 or grid-map"),
        (("export-sim", SAMPLE, "o", "--target", "mjcf"), "mujoco"),
        (("export-dem", "a", "b.tif", "--layer", "elevation"), "height"),
        (("export-dem", "a", "b.tif", "--layer", "gradient"), "slope"),
        (("export-dem", "a", "b.tif", "--layer", "relief"), "hillshade"),
        (("export-dem", "a", "b.gpkg", "--layer", "isolines"), "contours"),
        (("import-terrain", "a.tif", "b.json", "--preset", "sand"), "dry-sand"),
        (("add", "a", "--size", "1"), "--extent"),
        (("render", "a", "b.png", "--3d"), "--perspective"),
        (("check", "a"), "validate"),
        (("lidar", "a"), "scan"),
        (("plot", "a"), "render"),
    ],
    ids=lambda words: " ".join(words) if isinstance(words, tuple) else words,
)
def test_what_was_meant_is_guessed(words: tuple[str, ...], meant: str) -> None:
    """By the sense of a word as well as by its letters."""
    ran = call(*words)
    assert (ran.code, ran.out) == (2, "")
    assert f"Did you mean {meant}" in ran.err, ran.err


@pytest.mark.parametrize(
    ("word", "known", "wanted"),
    [
        ("stairs", ("star", "pyramidStairs", "flat"), "pyramidStairs"),
        ("Stairs", ("star", "pyramid_stairs"), "pyramid_stairs"),
        ("sand", ("sandy-loam", "dry-sand", "san"), "dry-sand"),  # a word of it before a part
        ("stai", ("star", "pyramidStairs"), "pyramidStairs"),
        ("rocks", ("racks", "rock"), "rock"),
        ("ice", ("slice", "nice-ice"), "nice-ice"),
        ("rmap", ("map", "ramp"), "map"),
        ("nogo-fraction", ("go-fraction", "no-go-fraction"), "no-go-fraction"),
        ("to", ("toe", "station"), "toe"),  # too short to be looked for within others
    ],
)
def test_a_name_with_the_word_comes_before_one_of_its_letters(
    word: str, known: tuple[str, ...], wanted: str
) -> None:
    assert spelled_like(word, known)[0] == wanted
    assert spelled_like(word, known[::-1])[0] == wanted


@pytest.mark.parametrize("option", ["-o", "--output", "--out"])
@pytest.mark.parametrize("words", [("query", SAMPLE, "1", "2"), ("info", SAMPLE)])
def test_a_command_without_an_output_says_where_its_answer_goes(
    words: tuple[str, ...], option: str
) -> None:
    ran = call(*words, option, "out.csv")
    assert (ran.code, ran.out) == (2, "")
    assert option in ran.err and "standard output. Write > FILE in place of it." in ran.err


def test_a_number_with_a_comma_is_no_option() -> None:
    assert '"-1,5" is no coordinate' in call("query", SAMPLE, "-1,5", "2").err


def test_what_has_no_meaning_is_not_guessed() -> None:
    ran = call("export-dem", "a", "b.tif", "--frobnicate")
    assert ran.code == 2 and "There is no option --frobnicate." in ran.err
    assert "Did you mean" not in ran.err
    assert near_names("", ["--resolution"]) == []


def test_the_table_of_meanings_has_names_that_there_are() -> None:
    """A name that went leaves no line behind; no word stands for itself."""
    names = {*main._COMMANDS, *LAYERS_AND_TARGETS}
    for command in COMMANDS.values():
        names |= {name[2:] for one in options_of(command) for name in long_names(one)}
    assert {*_MEANT} <= names
    assert not [name for name, words in _MEANT.items() if name in words.split()]


LAYERS_AND_TARGETS = {
    "height", "slope", "surface", "color", "hillshade", "contours", "traversability",
    "usd", "gazebo", "nav2", "mujoco", "pybullet", "chrono", "grid-map",
}  # fmt: skip


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (("info", SAMPLE, "--geojson", "el.geojson"), "standard output. Write > el.geojson"),
        (("info", SAMPLE, "--geojson", "e l.geojson"), "Write > 'e l.geojson' in place of it."),
        (("validate", SAMPLE, "-o", "r.sarif"), "Files are written by --format."),
        (("traversability", SAMPLE, "-o", "r.html"), "Files are written by --report or --format."),
        (("rules", "-o", "r.md"), "standard output. Write > FILE"),
        (("rules", "TT201", "x"), "unexpected extra argument (x)"),
        (("export-dem", SAMPLE, "o.tif", "-tr", 1, 1), "no option -tr. Did you mean --resolution?"),
        (("export-dem", SAMPLE, "o.tif", "--tr", 1), "no option --tr. Did you mean --resolution?"),
        (("export-dem", SAMPLE, "o.tif", "-te", 1), "no option -te. Did you mean --bounds?"),
        (("export-dem", SAMPLE, "o.tif", "-of", "GTiff"), "no option -of. The suffix of the"),
        (("export-dem", SAMPLE, "o.shp", "--layer", "contours"), ".geojson, .json or .gpkg"),
        (("query", SAMPLE, "--points", "p.csv"), 'p.csv:2: "lon,lat" has no columns x and y.'),
        (("traversability", SAMPLE, "--vehicle", "rover"), "mean vehicles/rover.json?"),
        (("traversability", SAMPLE, "--vehicle", "a/rover.json"), "mean vehicles/rover.json?"),
        (("traversability", SAMPLE, "--vehicle", "lorry"), "Check the path"),
        (("info", "a.tif"), "Of a DEM or a mesh terratool import-terrain makes one."),
    ],
    ids=str,
)  # fmt: skip
def test_habits_from_elsewhere_are_answered(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, words: tuple[Any, ...], says: str
) -> None:
    """Those of GIS above all; nothing is written."""
    monkeypatch.chdir(tmp_path)
    Path("p.csv").write_text("# of a survey\nlon,lat\n1,2\n", "utf-8")
    Path("a.tif").write_bytes(b"II*\0" + bytes(200))
    Path("vehicles").mkdir()
    Path("vehicles/rover.json").write_text("{}", "utf-8")
    ran = call(*words)
    assert ran.code in (1, 2, 3) and ran.out == "" and says in ran.err, ran.err
    assert {path.name for path in tmp_path.iterdir()} == {"p.csv", "a.tif", "vehicles"}
