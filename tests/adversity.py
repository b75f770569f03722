"""Every writer where things go wrong: no space, no permission, nobody listening, two at a time.

`python -m tests.adversity` runs the commands of `tests.kills` under each condition. A command may
fail there, in a sentence and without a traceback; what it writes is whole, as it was before, or
not there, and nothing else is left. It needs Linux, as its namespaces give a disk of 2 MB, a
folder that even root cannot write, and a net of its own in which everything that is sent is heard.
"""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
import tempfile
from collections import Counter
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from pathlib import Path
from typing import NamedTuple

from terratool.output import PART
from tests.commands import COMMAND, ENVIRONMENT, ROOT
from tests.kills import Bench, Job, bench, contents, jobs, put

HEARD = Path(__file__).parent / "listener.py"


class Condition(NamedTuple):
    """What goes wrong.

    Attributes:
        name: in words.
        shell: runs the command, "$@", in its folder, $0.
        environment: all that is set; that of other tests, if None.
        must: whether the command has to succeed.
        known: whether what it leaves has to be as ever if it does.
    """

    name: str
    shell: str
    environment: dict[str, str] | None = None
    must: bool = False


_BARE = {"PATH": os.environ["PATH"], "PYTHONPATH": str(ROOT)}
_MOUNT = 'cp -r "$0" "$0.before" && mount -t tmpfs -o size=2m none "$0" && cp -r "$0.before/." "$0"'
_OUT = 'umount -l "$0" 2>/dev/null; exit $code'
_KEEP = 'code=$?; rm -f "$0/fill"; rm -rf "$0.after"; cp -r "$0" "$0.after"; ' + _OUT
CONDITIONS = (
    Condition("disk of 2 MB", f'{_MOUNT} && cd "$0"; "$@"; {_KEEP}'),
    Condition(
        "full disk",
        f'{_MOUNT} && cd "$0"; dd if=/dev/zero of=fill bs=4k 2>/dev/null; "$@"; {_KEEP}',
    ),
    Condition("read-only folder", f'{_MOUNT} && mount -o remount,ro "$0" && cd "$0"; "$@"; {_KEEP}'),
    Condition("closed stdout", 'cd "$0"; "$@" >&-', must=True),
    Condition("full stdout", 'cd "$0"; "$@" >/dev/full'),
    Condition("closed stdin and stderr", 'cd "$0"; "$@" <&- 2>&-', must=True),
    Condition("no HOME", 'cd "$0"; "$@"', _BARE, must=True),
    Condition("LANG=C", 'cd "$0"; "$@"', {**_BARE, "LC_ALL": "C", "PYTHONUTF8": "0"}, must=True),
    Condition("two at a time", 'cd "$0"; "$@" & "$@"; one=$?; wait $!; exit $((one > $? ? one : $?))'),
)  # fmt: skip


def words_of(job: Job) -> list[str]:
    placed = [str(ROOT / word) if word.startswith("samples/") else word for word in job.words]
    return [*COMMAND, *(word.replace("@", "") for word in placed)]


def tried(one: Bench, condition: Condition, folder: Path) -> list[str]:
    """What is wrong with a job under a condition."""
    before = one.inputs if condition.name != "LANG=C" else one.old
    put(folder, before)
    namespace = ["unshare", "-rm"] if "mount" in condition.shell else []
    done = subprocess.run(
        [*namespace, "sh", "-c", condition.shell, str(folder), *words_of(one.job)],
        env=condition.environment or ENVIRONMENT, stdin=subprocess.DEVNULL,
        stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, check=False, timeout=120,
    )  # fmt: skip
    told = done.stderr.decode("utf-8", "replace")
    after = folder.with_name(f"{folder.name}.after")
    found = contents(after if after.exists() else folder)
    good = done.returncode in ((0, 1) if condition.must else (0, 1, 2, 3))
    wrong = [] if good else [f"ends with {done.returncode}: {told[-300:]}"]
    wrong += [f"a traceback: {told[-300:]}"] if "Traceback" in told else []
    if done.returncode == 3 and condition.name != "full stdout" and "terratool: " not in told:
        wrong.append(f"fails without a sentence: {told[-300:]}")
    wrong += [f"{name} is left" for name in found if PART in name]
    torn = (name for name, data in found.items() if PART not in name
            and data not in (before.get(name), one.new.get(name)))  # fmt: skip
    wrong += [f"{name} is neither old nor new" for name in torn]
    wrong += [f"{name} is gone" for name in before if name not in found and name in one.new]
    for end in ("", ".before", ".after"):
        shutil.rmtree(f"{folder}{end}", ignore_errors=True)
    return wrong


# --- names ---------------------------------------------------------------------------------------

NAMES = {
    "spaces": b" a b ",
    "a line feed": b"a\nb",
    "no UTF-8": b"a\xff\xfeb",
    "a hyphen first": b"-a",
    "an accent": "é\u0301".encode(),
    "255 bytes": b"a" * 250,
}


def named(one: Bench, name: bytes, folder: Path) -> list[str]:
    """What is wrong with a job whose files have a name of these bytes, in such a folder."""
    place = os.fsencode(folder) + b"/" + name
    put(folder, {})
    os.mkdir(place)  # noqa: PTH102, a path of bytes
    own = {word.replace("@", "").encode() for word in one.job.words if word.startswith("@")}

    def renamed(word: bytes) -> bytes:
        return b"./" + name + word[word.rindex(b".") :] if word in own and b"." in word else word

    if len({renamed(word) for word in own}) < len(own):
        return []  # two of its files would be one
    for file, data in one.inputs.items():
        with open(place + b"/" + renamed(file.encode()), "wb") as out:
            out.write(data)
    done = subprocess.run(
        [renamed(word.encode()) for word in words_of(one.job)],
        cwd=place, env=ENVIRONMENT, stdin=subprocess.DEVNULL, capture_output=True, check=False,
        timeout=120,
    )  # fmt: skip
    told = done.stderr.decode("utf-8", "replace")
    wrong = [f"a traceback: {told[-300:]}"] if "Traceback" in told else []
    if done.returncode not in (0, 1, 2, 3) or (done.returncode > 1 and not told):
        wrong.append(f"ends with {done.returncode}: {told[-300:]}")
    left = [entry for entry in os.listdir(place) if entry.startswith(PART.encode())]  # noqa: PTH208
    shutil.rmtree(folder, ignore_errors=True)
    return wrong + [f"{entry!r} is left" for entry in left]


# --- the net -------------------------------------------------------------------------------------


def connections(folder: Path) -> tuple[int, int, list[str]]:
    """Commands on files that name addresses, in a net where all is heard: how many, and how often.

    Returns:
        The commands, the connections and questions for names that were heard, and what is wrong.
    """
    done = subprocess.run(
        ["unshare", "-rnm", sys.executable, HEARD, folder],
        cwd=ROOT, env=ENVIRONMENT, capture_output=True, text=True, check=False, timeout=600,
    )  # fmt: skip
    found = re.fullmatch(r"(\d+) commands, (\d+) connections\n", done.stdout)
    if found is None:
        return 0, 0, [f"the listener says {done.stdout + done.stderr}"]
    heard = int(found[2])
    return int(found[1]), heard, [f"{heard} connections: {done.stderr}"] if heard else []


def main() -> int:
    """Try all, print a table; 1 if something went wrong that must not."""
    runs: Counter[str] = Counter()
    faults: dict[str, list[str]] = {}
    with (
        tempfile.TemporaryDirectory(prefix="terratool-adversity-") as name,
        ThreadPoolExecutor(os.cpu_count()) as pool,
    ):
        base = Path(name)
        benches = list(pool.map(lambda job: bench(job, base / job.name), jobs()))
        work: list[tuple[str, Bench, Callable[[Path], list[str]]]] = []
        for one in benches:
            work += [(c.name, one, partial(tried, one, c)) for c in CONDITIONS]
            work += [
                (f"names with {key}", one, partial(named, one, name)) for key, name in NAMES.items()
            ]

        def did(index: int) -> list[str]:
            return work[index][2](base / f"run {index}")

        for (what, one, _), wrong in zip(work, pool.map(did, range(len(work))), strict=True):
            runs[what] += 1
            faults.setdefault(what, []).extend(f"{one.job.name}, {what}: {w}" for w in wrong)
        (base / "net").mkdir()
        count, heard, wrong = connections(base / "net")
    runs["addresses in files"], faults["addresses in files"] = count, wrong
    for line in (fault for listed in faults.values() for fault in listed):
        print(line)
    print("| condition | commands | faults |\n|---|---:|---:|")
    for what, number in runs.items():
        print(f"| {what} | {number:,} | {len(faults[what]):,} |")
    print(f"{heard} connections")
    return int(any(faults.values()))


if __name__ == "__main__":
    sys.exit(main())
