"""Rays down on a mesh, in NVIDIA Warp, as a user would write it."""

import warp as wp

wp.config.log_level = wp.LOG_WARNING


@wp.kernel
def cast(
    mesh: wp.uint64,
    top: wp.float32,
    points: wp.array(dtype=wp.vec2f),
    out: wp.array(dtype=wp.float32),
):
    """Heights where rays from `top` down meet the mesh first; NaN where they do not."""
    n = wp.tid()
    start = wp.vec3f(points[n][0], points[n][1], top)
    query = wp.mesh_query_ray(mesh, start, wp.vec3f(0.0, 0.0, -1.0), 1.0e6)
    out[n] = wp.nan
    if query.result:
        out[n] = top - query.t
