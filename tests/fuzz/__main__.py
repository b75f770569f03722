"""Try cases by the million, and say what of it failed.

The table at the end is that of SECURITY.md. What failed is made small and kept in a folder; mend
it, and move it to tests/fuzz/corpus/TARGET/, whose files are tests.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import os
import sys
from importlib import import_module
from pathlib import Path

from tests.fuzz import archives, clouds, files, lines, texts
from tests.fuzz.harness import KINDS, Case, Fault, Tally, Target, alone, run

_MODULES = (texts, files, clouds, lines, archives)
TARGETS = {target.name: target for module in _MODULES for target in module.TARGETS}
CORPUS = Path(__file__).parent / "corpus"


def main() -> int:
    """Parse, run, print; 1 if a case failed."""
    parser = argparse.ArgumentParser(prog="python -m tests.fuzz", description=__doc__)
    parser.add_argument("targets", nargs="*", metavar="TARGET", help=f"{', '.join(TARGETS)}; all")
    parser.add_argument("--cases", type=int, help="of each target; as many as of a full run")
    parser.add_argument("--share", type=float, default=1.0, help="of a full run, such as 0.01")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--minutes", type=float, default=1e6, help="for each target, at most")
    parser.add_argument("--processes", type=int, default=os.cpu_count() or 1)
    parser.add_argument("--keep", type=Path, default=Path("out/fuzz"), help="folder of what failed")
    parser.add_argument("--corpus", action="store_true", help="try the corpus alone; JSON")
    wanted = parser.parse_args()
    if wanted.corpus:
        print(json.dumps(corpus()))
        return 0
    for module in ("export_dem", "export_mesh", "validate", "info", "format_", "traversability"):
        import_module(f"terratool.cli.{module}")  # once, and not in every worker
    for module in ("raster.mosaic", "mesh.tiles", "traversability.assess", "importing.meshes"):
        import_module(f"terratool.{module}")
    tallies = {}
    for name in wanted.targets or TARGETS:
        target = TARGETS[name]
        count = wanted.cases or max(1, round(target.count * wanted.share))
        tally = run(target, count, wanted.seed, 60 * wanted.minutes, wanted.processes)
        tallies[name] = tally
        for fault in tally.faults.values():
            show(target, fault, wanted.keep)
        said = ", ".join(f"{number:,} {word}" for word, number in tally.outcomes.most_common())
        print(f"{name}: {tally.cases:,} cases in {tally.seconds:.0f} s: {said}", flush=True)
    print(table(tallies))
    return int(any(tally.faults for tally in tallies.values()))


def show(target: Target, fault: Fault, folder: Path) -> None:
    """Keep a case that failed, and say what is wrong with it."""
    digest = hashlib.sha256(fault.case.data).hexdigest()[:8]
    path = folder / target.name / f"{fault.kind}-{digest}{fault.case.suffix}"
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(fault.case.data)
    print(f"{path}: {fault.kind} {fault.where}\n{fault.detail}", flush=True)


def table(tallies: dict[str, Tally]) -> str:
    """What came of all, in Markdown."""
    heads = ("", "cases", "tracebacks", "over 2 s", "over 500 MB", "crashes", "stray output")
    lines = ["| " + " | ".join(heads) + " |", "|---|" + "---:|" * (len(heads) - 1)]
    for name, tally in tallies.items():
        counts = (f"{number:,}" for number in (tally.cases, *(tally.counts[k] for k in KINDS)))
        lines.append("| " + " | ".join([name, *counts]) + " |")
    return "\n".join(lines)


def corpus() -> dict[str, str]:
    """What is wrong with each case that once failed: kind and details, or nothing."""
    found = {}
    for path in sorted(CORPUS.glob("*/*")):
        suffix = path.name[path.name.index(".") :]
        fault = alone(TARGETS[path.parent.name], Case(suffix, path.read_bytes()))
        said = f"{fault.kind} {fault.where}\n{fault.detail}" if fault else ""
        found[f"{path.parent.name}/{path.name}"] = said
    return found


if __name__ == "__main__":
    sys.exit(main())
