"""`terratool traversability` on many files: the gate of a repository."""

from __future__ import annotations

import errno
import json
import os
import re
import signal
import subprocess
import threading
from dataclasses import replace
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import jsonschema
import pytest

import terratool
from terratool.errors import RequestError
from terratool.traversability import gate
from terratool.traversability.gate import FileJob, judge_file, judge_files
from terratool.traversability.request import Request
from terratool.traversability.vehicle_files import load_vehicle
from tests.commands import ROOT, call
from tests.strategies import Json

HUSKY = ROOT / "samples" / "vehicles" / "husky-a200.json"
WAY = (1.0, 3.0, 8.0, 3.0)
COARSE = ("--resolution", 0.15)
SCHEMA = jsonschema.Draft202012Validator(terratool.schema("gate"))


def yard(*walls: Json) -> Json:
    """Oblong concrete, 9 × 6, with walls."""
    return {
        "size": [9, 6],
        "surfTypes": {"concrete": {"preset": "concrete"}},
        "elemTypes": {"level": {"x": [0], "x-ignore": ["TT308"]}, "box": {"x": [1]}},
        "elemTree": {"type": "level", "surface": "concrete", "children": list(walls)},
    }


WALL: Json = {"type": "box", "vScale": 0.4, "at": [5, 3], "extent": [0.3, 6]}


@pytest.fixture
def project(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder with an open and a walled yard, and a vehicle; nothing above it has settings."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "sites").mkdir()
    put("sites/open.json", yard())
    put("sites/walled.json", yard(WALL))
    Path("husky.json").write_text(HUSKY.read_text("utf-8"), "utf-8")
    return tmp_path


def put(name: str, value: Any) -> None:
    Path(name).write_text(value if isinstance(value, str) else json.dumps(value), "utf-8")


def gated(*arguments: object) -> dict[str, Any]:
    """What is said as JSON, which is always as its schema has it."""
    ran = call("traversability", *arguments, "--vehicle", "husky.json", *COARSE, "--json")
    found: dict[str, Any] = json.loads(ran.out)
    SCHEMA.validate(found)
    return {**found, "code": ran.code}


@pytest.mark.slow
def test_a_table_has_all_files_in_order(project: Path) -> None:
    ran = call("traversability", "sites", "--vehicle", "husky.json", *COARSE)
    lines = ran.out.splitlines()
    assert ran.code == 0 and ran.err == ""
    assert lines[0].split() == ["verdict", "go", "caution", "no-go", "unknown", "cut", "off",
                                "routes", "file"]  # fmt: skip
    assert lines[1].startswith("go ") and lines[1].endswith("  sites/open.json")
    assert lines[2].startswith("caution ") and lines[2].endswith("  sites/walled.json")
    assert lines[-1] == "2 files checked, no errors, no warnings."


@pytest.mark.slow
def test_results_are_those_of_each_file_by_itself(project: Path) -> None:
    found = gated("sites")
    for one, name in zip(found["files"], ("open", "walled"), strict=True):
        ran = call("traversability", f"sites/{name}.json", "--vehicle", "husky.json", *COARSE,
                   "--json")  # fmt: skip
        alone = json.loads(ran.out)
        (row,) = one["vehicles"]
        assert one["file"] == f"sites/{name}.json"
        assert (row["verdict"], row["sentence"]) == (alone["verdict"], alone["sentence"])
        assert {name: share for name, share in row["fractions"].items() if share} == pytest.approx(
            {name: share for name, share in alone["map"]["fractions"].items() if share}
        )


@pytest.mark.slow
def test_what_fails_is_a_finding_at_the_element_that_bars(project: Path) -> None:
    found = gated("sites", "--route", *WAY, "--fail-on", "go-fraction<0.9")
    assert found["code"] == 1
    assert [(f["file"], f["code"]) for f in found["findings"]] == [
        ("sites/walled.json", "TD103"), ("sites/walled.json", "TD101"),
    ]  # fmt: skip
    held, lost = found["findings"]
    assert held["message"].startswith("go-fraction<0.9: husky: go-fraction is 0.")
    assert held["pointer"] == ""
    assert lost["pointer"] == "/elemTree/children/0"
    assert lost["column"] == 1 + Path("sites/walled.json").read_text("utf-8").index(
        '{"type": "box"'
    )
    assert found["summary"]["invalid"] == 1 and found["summary"]["valid"] == 1


@pytest.mark.slow
def test_the_place_of_a_part_or_a_track_that_bars_is_that_in_the_file(project: Path) -> None:
    """A wall that a part holds is where the part stands; soft ground may be that of a track."""
    across = {"type": "level", "surface": "concrete", "children": [{**WALL, "at": [1, 3]}]}
    put("sites/walled.json", {
        **yard({"at": [5, 3], "extent": [2, 6], "part": "across"}), "parts": {"across": across},
    })  # fmt: skip
    soft = {"concrete": {"preset": "concrete"}, "bog": {"cohesion": 0, "fricAngle": 1}}
    track = {"path": [[5, 0], [5, 6]], "width": 2, "depth": 0.01, "surface": "bog"}
    put("sites/open.json", {**yard(), "surfTypes": soft, "tracks": [track]})
    found = gated("sites", "--route", *WAY)["findings"]
    assert [(finding["file"], finding["pointer"]) for finding in found] == [
        ("sites/open.json", "/tracks/0"), ("sites/walled.json", "/elemTree/children/0"),
    ]  # fmt: skip
    text = Path("sites/open.json").read_text("utf-8")
    assert found[0]["column"] == 1 + text.index('{"path"')


@pytest.mark.nightly
def test_no_file_takes_the_others_along(project: Path) -> None:
    """A broken text, one that refuses what is asked, and one that is not there; 3 outranks 1."""
    put("sites/a-broken.json", '{"size": [9, 6],')
    put("sites/b-wrong.json", {**yard(), "size": 0})
    put("sites/c-small.json", {**yard(), "size": [4, 3]})
    found = gated("sites", "--route", *WAY)
    assert found["code"] == 1
    assert [(f["file"].removeprefix("sites/"), f["code"]) for f in found["findings"]] == [
        ("a-broken.json", "TT101"), ("b-wrong.json", "TT106"), ("c-small.json", "TD104"),
        ("walled.json", "TD101"),
    ]  # fmt: skip
    assert [len(one["vehicles"]) for one in found["files"]] == [0, 0, 0, 1, 1]
    found = gated("sites", "absent.json")
    assert found["code"] == 3 and len(found["findings"]) == 2
    assert [one["file"] for one in found["unreadable"]] == ["absent.json"]
    assert found["files"][3]["vehicles"][0]["verdict"] == "go"


@pytest.mark.slow
def test_folders_may_hold_other_things(project: Path) -> None:
    """Vehicles and libraries are passed over there, and refused where they are named."""
    put("sites/husky.json", Path("husky.json").read_text("utf-8"))
    put("sites/kit.json", {"parts": {"pad": {"type": "box"}}, "elemTypes": {"box": {"x": [1]}}})
    assert [Path(one["file"]).name for one in gated("sites")["files"]] == [
        "open.json", "walled.json",
    ]  # fmt: skip
    found = gated("sites/open.json", "sites/husky.json")
    assert found["code"] == 1
    (finding,) = found["findings"]
    assert finding["code"] == "TD104" and "is a vehicle" in finding["message"]


@pytest.mark.nightly
@pytest.mark.parametrize("form", ["text", "json", "sarif", "github", "junit", "gitlab"])
def test_formats_are_those_of_validate(project: Path, form: str) -> None:
    """On standard output and in files; a file that is such a report may be replaced."""
    asked = ("sites", "--vehicle", "husky.json", *COARSE, "--route", *WAY)
    put(".terratool.toml", f'[traversability]\nformats = ["github", "{form}=out.txt"]\n')
    for _ in range(2):
        ran = call("traversability", *asked)
        assert ran.code == 1 and ran.out.startswith("::error file=sites/walled.json,line=1,")
    text = Path("out.txt").read_text("utf-8")
    assert "TD101" in text and "There is no way" in text
    direct = call("traversability", *asked, "--format", form)
    assert direct.code == 1 and direct.out.endswith(text if form != "text" else text[-20:])
    if form == "junit":
        top = ElementTree.fromstring(text)
        assert [suite.get("failures") for suite in top] == ["0", "1"]
        assert top.get("name") == "terratool traversability"
    if form == "sarif":
        (log,) = json.loads(text)["runs"]
        rules = [rule["id"] for rule in log["tool"]["driver"]["rules"]]
        assert rules[log["results"][0]["ruleIndex"]] == "TD101"


@pytest.mark.slow
def test_settings_stand_for_options(project: Path) -> None:
    """Also of a single file; of patterns the last one counts, and options outrank all."""
    put(
        ".terratool.toml",
        'paths = ["elsewhere"]\n[traversability]\npaths = ["sites"]\nvehicles = ["husky.json"]\n'
        'resolution = 0.15\nfail-on = ["no-go-fraction>0.5"]\n'
        '[traversability.per-file."walled.*"]\nroutes = [[1, 3, 8, 3]]\n'
        '[traversability.per-file."sites/*"]\nfail-on = ["go-fraction<0.9"]\n',
    )
    ran = call("traversability", "--json")
    found = json.loads(ran.out)
    assert ran.code == 1
    assert [one["vehicles"][0]["routes"] for one in found["files"]] == [0, 1]
    assert [finding["code"] for finding in found["findings"]] == ["TD103", "TD101"]
    alone = call("traversability", "sites/walled.json")
    assert alone.code == 1 and alone.out.startswith("no-go: There is no way")
    assert "--fail-on go-fraction<0.9" in alone.err
    other = call("traversability", "sites/walled.json", "--route", 1, 1, 3, 1, "--fail-on", "no-go")
    assert other.code == 0 and other.out.startswith("go: There is a way")


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ('vehicles = ["../husky.json"]', "outside"), ("speed = 3", "speed"),
        ('formats = ["json=../out.json"]', "outside"), ('fail-on = ["no-way"]', "no-way"),
        ("routes = [[1, 2, 3]]", "routes"),
    ],
)  # fmt: skip
def test_settings_that_are_not_taken(project: Path, text: str, why: str) -> None:
    put(".terratool.toml", f'[traversability]\npaths = ["sites"]\n{text}\n')
    ran = call("traversability", *(() if "vehicles" in text else ("--vehicle", "husky.json")))
    assert ran.code == 2 and why in ran.err and ran.out == ""


@pytest.mark.parametrize(
    "more", [("--map", "m.tif"), ("--report", "r.html"), ("--format", "json", "--json")]
)
def test_what_is_of_one_terrain_is_refused(project: Path, more: tuple[str, ...]) -> None:
    ran = call("traversability", "sites", "--vehicle", "husky.json", *more)
    assert ran.code == 2 and more[0] in ran.err
    assert sorted(os.listdir()) == ["husky.json", "sites"]  # noqa: PTH208


@pytest.mark.nightly
@pytest.mark.parametrize("what", ["sites", "sites/walled.json"])
def test_json_is_short_for_its_format(project: Path, what: str) -> None:
    """Of many files as of one; a file that is asked for has the same text."""
    asked = ("traversability", what, "--vehicle", "husky.json", *COARSE)
    ran = call(*asked, "--json")
    assert ran == call(*asked, "--format", "json")
    if what == "sites":
        assert call(*asked, "--format", "json=out.json").code == ran.code
        assert Path("out.json").read_text("utf-8") == ran.out


def test_nothing_to_judge(project: Path) -> None:
    ran = call("traversability", "--vehicle", "husky.json")
    assert ran.code == 2 and "nothing to judge" in ran.err


@pytest.mark.slow
def test_several_vehicles_have_a_row_each(project: Path) -> None:
    put("far.json", Path("husky.json").read_text("utf-8"))
    ran = call("traversability", "sites", "--vehicle", "husky.json", "--vehicle", "far.json",
               *COARSE, "--route", *WAY)  # fmt: skip
    rows = [line.split() for line in ran.out.splitlines()[1:5]]
    assert [row[-2:] for row in rows] == [
        [name, f"sites/{file}.json"] for file in ("open", "walled") for name in ("husky", "far")
    ]
    assert "husky: There is no way" in ran.out and "far: There is no way" in ran.out


@pytest.mark.nightly
def test_results_do_not_depend_on_the_processes(project: Path) -> None:
    for number in range(4):
        put(f"sites/{number}.json", yard({**WALL, "at": [4 + 0.5 * number, 3]}))
    jobs = jobs_of("sites", Request(routes=(WAY,), resolution=0.15))
    one, several = (judge_files(jobs, threads) for threads in (1, 3))
    assert one == several == [judge_file(job) for job in jobs]


def jobs_of(folder: str, request: Request) -> list[FileJob]:
    vehicle = load_vehicle("husky.json")
    return [FileJob(str(path), (vehicle,), request) for path in sorted(Path(folder).iterdir())]


@pytest.fixture
def begun(monkeypatch: pytest.MonkeyPatch) -> list[subprocess.Popen[bytes]]:
    """All processes that judge, in the order in which they begin."""
    found: list[subprocess.Popen[bytes]] = []
    begin = subprocess.Popen

    def watched(*args: Any, **more: Any) -> subprocess.Popen[bytes]:
        found.append(begin(*args, **more))
        return found[-1]

    monkeypatch.setattr(gate.subprocess, "Popen", watched)
    return found


@pytest.mark.slow
def test_no_process_is_left_behind_by_a_stop(
    project: Path, begun: list[subprocess.Popen[bytes]]
) -> None:
    jobs = jobs_of("sites", Request(resolution=0.15)) * 3

    def stop(_: int) -> None:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        judge_files(jobs, 2, stop)
    assert len(begun) == 2 and None not in [process.poll() for process in begun]


def test_no_process_begins_after_a_stop(
    project: Path, begun: list[subprocess.Popen[bytes]]
) -> None:
    """However often a thread asks that has not heard of it yet."""
    process, job = gate._JudgeProcess(), jobs_of("sites", Request(resolution=0.15))[0]
    process.stop()
    assert [process.judge(job) for _ in range(3)] == [None] * 3 and not begun


@pytest.mark.slow
def test_a_process_that_is_stopped_while_it_begins_ends(
    project: Path, monkeypatch: pytest.MonkeyPatch, begun: list[subprocess.Popen[bytes]]
) -> None:
    process, job = gate._JudgeProcess(), jobs_of("sites", Request(resolution=0.15))[0]
    begin, stopping = gate.subprocess.Popen, threading.Thread(target=process.stop)

    def stopped(*args: Any, **more: Any) -> subprocess.Popen[bytes]:
        stopping.start()
        return begin(*args, **more)

    monkeypatch.setattr(gate.subprocess, "Popen", stopped)
    process.judge(job)
    stopping.join()
    assert [one.poll() for one in begun] == [-signal.SIGKILL]


def test_a_process_that_cannot_begin_takes_its_file_alone(
    project: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(*_: Any, **__: Any) -> None:
        raise OSError(errno.EAGAIN, "too many processes")

    monkeypatch.setattr(gate.subprocess, "Popen", refuse)
    found = judge_files(jobs_of("sites", Request(resolution=0.15)), 1)
    for one in found:
        (finding,) = one.findings
        assert finding.code == "TD105"
        assert "no process could be started (too many processes)" in finding.message


@pytest.mark.slow
def test_a_process_that_dies_takes_its_file_alone(
    project: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The next file gets a new process, and what was found before stays."""
    jobs = jobs_of("sites", Request(resolution=0.15))
    jobs = [jobs[0], replace(jobs[0], file="sites/killer.json"), jobs[1]]
    asked = gate._JudgeProcess.judge

    def judge(self: Any, job: FileJob) -> Any:
        if "killer" in job.file:
            os.kill(self._process.pid, signal.SIGKILL)
        return asked(self, job)

    monkeypatch.setattr(gate._JudgeProcess, "judge", judge)
    first, dead, last = judge_files(jobs, 1)
    assert [finding.code for finding in dead.findings] == ["TD105"]
    assert first.rows[0].verdict == "go" and last.rows[0].verdict == "caution"


@pytest.mark.slow
def test_a_fault_of_ours_takes_its_file_alone(project: Path) -> None:
    jobs = jobs_of("sites", Request(resolution=0.15))
    jobs[0] = replace(jobs[0], conditions=("nonsense",))  # which a command refuses before
    wrong, right = judge_files(jobs, 1)
    assert [finding.code for finding in wrong.findings] == ["TD105"]
    assert right.rows and not right.findings


def test_settings_of_a_file(project: Path) -> None:
    from terratool.cli.config import DriveSettings, project_settings

    put(
        ".terratool.toml",
        '[traversability]\nresolution = 1\n[traversability.per-file."a*"]\nresolution = 2\n'
        '[traversability.per-file."sites/*"]\nfrom = [1, 2]\n',
    )
    settings = project_settings(None)
    found = {
        name: (one.resolution, one.start)
        for name in ("a.json", "b.json", "sites/a.json")
        for one in [settings.drive_settings(name, DriveSettings()).settings]
    }
    assert found == {"a.json": (2, None), "b.json": (1, None), "sites/a.json": (2, (1, 2))}
    sources = settings.drive_settings("sites/a.json", DriveSettings(start=(3, 4))).sources
    assert sources == {"resolution": '"a*" in .terratool.toml', "start": ""}
    put(".terratool.toml", "[traversability]\nper-file = 3\n")
    with pytest.raises(RequestError, match=r"toml: traversability.per-file is 3. Give a table"):
        project_settings(None)


@pytest.mark.parametrize(
    ("pattern", "meant"),
    [
        ("site/*", "sites/*"), ("walls.json", "walled.json"), ("sites", "sites/*"),
        ("sites/", "sites/*"), ("sites/waled.json", "sites/walled.json"),
    ],
)  # fmt: skip
def test_a_pattern_without_a_file_does_not_open_the_gate(
    project: Path, pattern: str, meant: str
) -> None:
    """Refused where the settings name all files; said of no file that is looked at by itself."""
    rest = f'[traversability.per-file."{pattern}"]\nroutes = [[1, 3, 8, 3]]\n'
    put(".terratool.toml", f'[traversability]\npaths = ["sites"]\nresolution = 0.3\n{rest}')
    ran = call("traversability", "--vehicle", "husky.json")
    assert ran.code == 2 and ran.out == ""
    assert (
        f'pattern "{pattern}" of [traversability.per-file] matches none of the 2 files' in ran.err
    )
    assert ran.err.endswith(f'Did you mean "{meant}"?\n')
    ran = call("traversability", "sites", "--vehicle", "husky.json")
    assert ran.code == 0 and ran.err == ""


@pytest.mark.slow
def test_conditions_of_settings_on_routes_are_for_files_with_routes(project: Path) -> None:
    """Those of the command line need a route, and a wrong path is told before."""
    put(
        ".terratool.toml",
        '[traversability]\nvehicles = ["husky.json"]\nresolution = 0.3\n'
        'fail-on = ["no-route", "least-margin<2"]\n'
        '[traversability.per-file."walled.json"]\nroutes = [[1, 1, 3, 1]]\n',
    )
    ran = call("traversability", "sites/open.json")
    assert ran.code == 0 and ran.out.startswith("go: ")
    ran = call("traversability", "sites/walled.json")
    assert ran.code == 1 and "--fail-on least-margin<2: husky: least-margin is " in ran.err
    ran = call("traversability", "sites/open.json", "--fail-on", "no-route")
    assert ran.code == 2 and "needs a route" in ran.err
    ran = call("traversability", "absent.json", "--fail-on", "no-route")
    assert ran.code == 3 and ran.err.startswith("terratool: absent.json: ")


@pytest.mark.slow
@pytest.mark.parametrize(("way", "end"), [((5, 3, 8, 3), "start"), ((1, 2, 5, 3), "goal")])
def test_an_end_where_the_vehicle_cannot_stand_is_told_as_alone(
    project: Path, way: tuple[float, ...], end: str
) -> None:
    """In the words of the run over one file, with a place that will do, at the element."""
    alone = call("traversability", "sites/walled.json", "--vehicle", "husky.json", *COARSE,
                 "--route", *way)  # fmt: skip
    told = next(line for line in alone.err.splitlines() if "cannot stand" in line)
    found = gated("sites", "--route", *way)
    (finding,) = found["findings"]
    assert (finding["file"], finding["code"]) == ("sites/walled.json", "TD102")
    assert told == f"terratool: There is no such route. {finding['message']}"
    near = re.search(rf"route's {end}, 5 3, .*It can stand and move at (\S+) (\S+),", told)
    assert near and abs(float(near[1]) - 5) > 0.15 + 0.3
    assert finding["pointer"] == "/elemTree/children/0"
    better = (*map(float, near.groups()), 1, 2)
    found = gated("sites/open.json", "sites/walled.json", "--route", *better)
    assert not any(finding["code"] == "TD102" for finding in found["findings"])


@pytest.mark.slow
def test_an_end_that_is_blocked_leaves_other_routes_as_they_are(project: Path) -> None:
    found = gated("sites", "--route", 1, 3, 5, 3, "--route", *WAY)
    assert [finding["code"] for finding in found["findings"]] == ["TD102", "TD101"]


@pytest.mark.slow
def test_places_of_settings_outside_say_where_they_stand(project: Path) -> None:
    put(
        ".terratool.toml",
        '[traversability]\npaths = ["sites"]\nvehicles = ["husky.json"]\nresolution = 0.3\n'
        'from = [10, 3]\n[traversability.per-file."walled.*"]\nroutes = [[1, 3, 8, 30]]\n',
    )
    first = "The place to start from of [traversability] in .terratool.toml, 10 3, lies outside"
    second = 'The route\'s goal of "walled.*" in .terratool.toml, 8 30, lies outside'
    found = json.loads(call("traversability", "--json").out)["findings"]
    assert [finding["code"] for finding in found] == ["TD104", "TD104"]
    assert found[0]["message"].startswith(first) and found[1]["message"].startswith(second)
    alone = call("traversability", "sites/walled.json")
    assert alone.code == 2 and second in alone.err
    given = call("traversability", "sites/walled.json", "--route", 1, 3, 8, 40)
    assert "The route's goal, 8 40, lies outside" in given.err


def test_codes_can_be_looked_up() -> None:
    """Each of the table of the docs is listed, and explained in more than its name."""
    page = (ROOT / "docs" / "ci.md").read_text("utf-8")
    codes = re.findall(r"^\| (TD\d+) \|", page, re.MULTILINE)
    listed = call("rules", "TD").out.splitlines()
    assert [line.split()[0] for line in listed] == codes == sorted(codes) and len(codes) == 5
    assert call("rules").out.endswith("\n".join([*listed, ""]))
    for code in codes:
        ran = call("rules", code.lower())
        assert ran.code == 0 and ran.out.startswith(f"{code} ") and "\n\nTo mend: " in ran.out


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("route = [[1, 3, 8, 3]]", '"route" is no key).\n  Did you mean routes? There are fail-on, '
         "from, resolution, routes, vehicles."),
        ("paths = []", '"paths" is no key).\n  There are fail-on, from, '),
    ],
)  # fmt: skip
def test_a_wrong_key_is_told_with_its_table(project: Path, text: str, says: str) -> None:
    head = '[traversability.per-file."sites/*"]'
    put(".terratool.toml", f'[traversability.per-file."a*"]\nfrom = [1, 2]\n{head}\n{text}\n')
    ran = call("traversability", "sites", "--vehicle", "husky.json")
    assert ran.code == 2 and f".terratool.toml: {head} has a setting" in ran.err and says in ran.err


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ('strict = "yes"', 'strict is "yes".\n  Give true or false.'),
        ("max-step = -1", "max-step is -1.\n  Give a number from 0 on."),
        ("max-findings = 1.5", "max-findings is 1.5.\n  Give a whole number from 0 on."),
        ("baseline = true", "baseline is true.\n  Give the path of a file, a text."),
        ('paths = "sites"', 'paths is "sites".\n  Give a list of texts, as in ["…"].'),
        ("select = [[1]]", "select[0] is a list.\n  Give a list of texts"),
        ('[per-file-ignores]\n"a" = ["TT2"]\n"b/*" = ["TT1", 3]',
         'per-file-ignores."b/*"[1] is 3.\n  Give a table with a list of codes for each'),
        ("traversability = 5", "traversability is 5.\n  Give a table."),
        ("[traversability]\nroutes = [[1, 1, 3]]",
         "traversability.routes[0] has 3 numbers.\n  Give x0, y0, x1, y1, as in "),
        ("[traversability]\nroutes = [1, 1, 3, 4]", "routes[0] is 1.\n  Give x0, y0, x1, y1, as"),
        ('[traversability]\nfrom = [1, "a"]', 'from[1] is "a".\n  Give x, y, as in [0, 0].'),
        ("[traversability]\nresolution = 2024-01-02", "resolution is 2024-01-02.\n  Give a numb"),
        ('[traversability.per-file."a"]\nroutes = [[1, 1, 3]]',
         'traversability.per-file."a".routes[0] has 3 numbers.'),
        ("[traversability.per-file]\na = 1", 'traversability.per-file."a" is 1.\n  Give a table.'),
        ("[per-file-ignores]\n" + "\n".join(f"a{n} = []" for n in range(1001)),
         "per-file-ignores has 1,001 patterns.\n  Give up to 1,000."),
    ],
)  # fmt: skip
def test_a_wrong_value_of_a_setting_is_told_in_words(project: Path, text: str, says: str) -> None:
    put(".terratool.toml", text + "\n")
    ran = call("validate", "sites")
    assert ran.code == 2 and says in ran.err and ran.err.count(".terratool.toml: ") == 1
    assert "`" not in ran.err


@pytest.mark.parametrize("what", ["sites", "sites/open.json"])
def test_what_settings_ask_for_is_told_with_their_file(project: Path, what: str) -> None:
    """A condition that is none, and a vehicle that is not there; options are told as before."""
    head, asked = "[traversability]", ("--vehicle", "husky.json")
    put(".terratool.toml", f'{head}\nfail-on = ["nogo-fraction>0.3"]\n')
    wrong = 'fail-on "nogo-fraction>0.3": there is no figure "nogo-fraction".'
    ran = call("traversability", what, *asked)
    assert ran.code == 2 and ran.err == (
        f"terratool: {head} in .terratool.toml: {wrong}\n  Did you mean no-go-fraction?\n"
    )
    ran = call("traversability", what, *asked, "--fail-on", "nogo-fraction>0.3")
    assert ran.code == 2 and ran.err.startswith(f"terratool: --{wrong}")
    put(".terratool.toml", f'{head}\nvehicles = ["none.json"]\n')
    ran = call("traversability", what)
    assert ran.code == 3
    assert f"{head} in .terratool.toml: none.json: cannot be read (no such file" in ran.err
    ran = call("traversability", what, "--vehicle", "none.json")
    assert ran.code == 3 and "terratool: none.json: cannot be read" in ran.err


@pytest.mark.slow
def test_tests_of_junit_keep_their_names(project: Path) -> None:
    """By route and condition; a place in the text, which moves, is not in them."""
    asked = ("sites", "--vehicle", "husky.json", *COARSE, "--route", *WAY, "--route", 5, 3, 1, 3,
             "--fail-on", "go-fraction<0.9", "--format", "junit=out.xml")  # fmt: skip
    found = []
    for _ in range(2):
        ran = call("traversability", *asked)
        assert ran.code == 1
        assert ran.out.endswith("2 files checked, 1 failed, 3 errors, no warnings.\n")
        top = ElementTree.parse("out.xml").getroot()
        found.append([case.get("name") for case in top.iter("testcase")])
        put("sites/walled.json", json.dumps(yard(WALL), indent=2))
    assert found[0][0] == "passed" and sorted(found[0]) == sorted(found[1])
    assert set(found[0][1:]) == {
        "TD101 route 1 3 8 3", "TD102 route 5 3 1 3", "TD103 go-fraction<0.9",
    }  # fmt: skip


@pytest.mark.slow
def test_conditions_that_no_file_can_meet_are_refused(project: Path) -> None:
    """On the command line; the same condition is judged where any file has a route."""
    words = ("traversability", "sites", "--vehicle", "husky.json", *COARSE)
    for text in ("route-length>1", "no-route", "reachable-fraction<0.5"):
        ran = call(*words, "--fail-on", text)
        assert (ran.code, ran.out) == (2, "") and f"--fail-on {text} needs a route" in ran.err
    ran = call(*words, "--fail-on", "route-length>1", "--route", *WAY)
    assert ran.code == 1 and ran.out.count("TD103") == ran.out.count("TD101") == 1


@pytest.mark.slow
def test_conditions_of_settings_on_reach_are_for_files_with_a_start(project: Path) -> None:
    put(".terratool.toml", '[traversability]\nfail-on = ["reachable-fraction<0.5"]\n'
        '[traversability.per-file."sites/w*"]\nfrom = [1, 3]\n')  # fmt: skip
    found = gated("sites")
    assert {one["file"] for one in found["findings"]} == {"sites/walled.json"}
    alone = call("traversability", "sites/open.json", "--vehicle", "husky.json", *COARSE)
    assert alone.code == 0, alone.err


@pytest.mark.slow
def test_the_schema_refuses_what_is_never_said(project: Path) -> None:
    """Another key, another class of ground, a verdict that there is not, and what is left out."""
    found = gated("sites", "absent.json", "--route", *WAY)
    del found["code"]
    assert found["findings"] and found["unreadable"] and SCHEMA.is_valid(found)
    row = found["files"][0]["vehicles"][0]
    for changed in (
        row | {"speed": 1}, row | {"verdict": "maybe"}, row | {"fractions": {"go": 1}},
        row | {"routes": -1}, {"vehicle": "husky"},
    ):  # fmt: skip
        found["files"][0]["vehicles"][0] = changed
        assert not SCHEMA.is_valid(found), changed


@pytest.mark.slow
def test_a_file_is_judged_once(project: Path) -> None:
    summary = gated("sites", "sites/walled.json", "sites/walled.json", "--route", *WAY)["summary"]
    assert (summary["files"], summary["valid"], summary["invalid"]) == (2, 1, 1)


@pytest.mark.slow
def test_reports_of_one_command_are_no_terrains_of_the_other(project: Path) -> None:
    put(".terratool.toml", 'paths = ["sites"]\nformats = ["json=sites/check.json"]\n'
        '[traversability]\nvehicles = ["husky.json"]\nresolution = 0.15\n'
        'formats = ["json=sites/gate.json"]\n')  # fmt: skip
    for command in ("traversability", "validate", "traversability", "validate"):
        ran = call(command)
        assert ran.code == 0, (command, ran.out, ran.err)
    assert {path.name for path in Path("sites").iterdir()} == {
        "check.json", "gate.json", "open.json", "walled.json",
    }  # fmt: skip


@pytest.mark.slow
def test_a_finding_shows_only_a_line_that_says_something(project: Path) -> None:
    """None of the file as a whole, and none of a brace; no figure of a way that there is not."""
    asked = ("sites/walled.json", "sites/open.json", "--vehicle", "husky.json", *COARSE, "--route",
             *WAY, "--fail-on", "steepest>-1")  # fmt: skip
    for indent, shown in ((2, 0), (None, 1)):
        put("sites/walled.json", json.dumps(yard(WALL), indent=indent))
        out = call("traversability", *asked).out
        assert out.count(" TD101: ") == out.count(" TD103: ") == 1
        assert len(re.findall(r"^  \d+ \| ", out, re.MULTILINE)) == shown
        assert "steepest>-1: husky: steepest is 0° on the way from (1, 3) to (8, 3), at (" in out
