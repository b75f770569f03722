"""Reading of a patch of heights for a primitive; walls of a mesh become steps of its curves."""

from __future__ import annotations

from dataclasses import replace

from terratool.importing.meshes import read_triangles
from terratool.importing.primitive.build import PrimitiveRequest, read_samples
from terratool.importing.sampling import sample, steps
from terratool.importing.sources import check_options, kind_of, open_source
from terratool.importing.types import SampledHeights, SourceOptions

_MOST_STEPS = 64
"""Most steps of a curve; a mesh with more walls all across is one of bars, not of steps."""


def read_patch(
    source: str, options: SourceOptions, wanted: PrimitiveRequest
) -> tuple[SampledHeights, PrimitiveRequest]:
    """Read a patch of heights; the request comes back with the walls of a mesh as steps.

    Args:
        source: name of a raster, a mesh or a cloud of points.
        options: options about the source.
        wanted: request for primitives.

    Raises:
        ReadError: the source cannot be read, or has no heights.
        RequestError: an option does not fit the source.
    """
    if kind_of(source, options) != "mesh" or wanted.fit_turn:
        with open_source(source, options) as heights:
            return read_samples(heights), wanted
    check_options(source, options)
    triangles = read_triangles(source, options.up, options.scale)
    samples = sample(triangles, options.resolution, options.bounds, name=source)
    x_steps, y_steps = (tuple(each.tolist()) for each in steps(triangles, samples.grid.bounds))
    if len(x_steps) + len(y_steps) > _MOST_STEPS:
        return samples, wanted
    return samples, replace(wanted, x_steps=x_steps, y_steps=y_steps)
