"""Definitions whose rows the workers of Dask write are those of one machine, byte for byte."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from terratool.cluster import local_cluster
from terratool.errors import RequestError
from terratool.importing.terrain import writing
from terratool.importing.terrain.build import import_terrain
from terratool.importing.terrain.request import ImportOptions
from terratool.importing.types import SampledHeights
from tests.clusters import files_in, kill_in_mid_task
from tests.importing.test_terrain import built, rough, sampled, samples


@pytest.fixture(scope="module")
def address() -> Iterator[str]:
    """Scheduler of two workers."""
    with local_cluster(2) as found:
        yield found.scheduler_address


def voided() -> SampledHeights:
    """Rough ground with holes, of several blocks of rows and of columns."""
    heights = rough(150, 330, seed=3)
    heights[20:50, 40:90] = np.nan
    heights[140:, :7] = np.nan
    return samples(heights)


@pytest.mark.nightly
@pytest.mark.parametrize(
    ("source", "name", "options"),
    [
        (sampled(built(1)[1]), "t.json.gz", ImportOptions(0.05)),
        (voided(), "t.json.gz", ImportOptions(0.02, cells="pixels")),
        (voided(), "t.json", ImportOptions(0.02, ("rows",))),
        (voided(), "t.json", ImportOptions(0.02, ("nodal-columns", "hats"))),
    ],
    ids=["structures", "pixels", "rows", "columns"],
)
def test_a_worker_is_killed_in_the_middle_of_a_task(
    address: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, source: SampledHeights,
    name: str, options: ImportOptions,
) -> None:  # fmt: skip
    """A trial of a method, a block of rows, or a piece of text; the report is the same, too."""
    monkeypatch.setattr(writing, "_PIECE", 1 << 13)
    reports = []
    for folder, dask in (("alone", None), ("dask", address)):
        (tmp_path / folder).mkdir()
        if dask:
            kill_in_mid_task(monkeypatch, tmp_path / "log", 4)
        told: list[int] = []
        wanted = replace(options, dask=dask)
        report = import_terrain(source, tmp_path / folder / name, wanted, progress=told.append)
        error = report.error.largest, report.error.rms, report.error.where, report.error.count
        reports.append((error, report.method, report.structures, report.size, told))
    assert files_in(tmp_path / "dask") == files_in(tmp_path / "alone")
    assert list(files_in(tmp_path / "dask")) == [name]
    assert reports[0] == reports[1]
    assert (tmp_path / "log").stat().st_size > 4


@pytest.mark.parametrize("as_", ["grid", None])
def test_dask_is_about_rows(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, as_: None) -> None:
    monkeypatch.setattr("terratool.importing.terrain.request.MOST_AS_ROWS", 100)
    options = ImportOptions(0.1, as_=as_, dask="local")
    with pytest.raises(RequestError, match=r"--dask is about rows.*by --as rows"):
        import_terrain(samples(rough(20, 30, 1)), tmp_path / "t.json", options)
    assert list(tmp_path.iterdir()) == []
