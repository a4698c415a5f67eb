"""Equation 2 by search tree against equation 2 as it is written."""

from time import perf_counter

import numpy as np
from harness import Result, benchmark

from graspdb_ingest.contact import signed_gaps
from graspdb_ingest.objects.cloud import ObjectCloud

N_POINTS = 20_000
N_FRAMES = 1200


def sphere_cloud(rng: np.random.Generator) -> ObjectCloud:
    """Return points of a sphere of 40 mm."""
    normals = rng.normal(size=(N_POINTS, 3))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    area = 4 * np.pi * 0.04**2 / N_POINTS
    return ObjectCloud(0.04 * normals, normals, np.full(N_POINTS, area), spacing=0.001)


@benchmark("contact")
def contact() -> Result:
    """Time all gaps of a trial: 20 spheres in 1,200 frames against 20,000 points."""
    rng = np.random.default_rng(0)
    cloud = sphere_cloud(rng)
    centres = rng.uniform(-0.1, 0.1, size=(N_FRAMES, 20, 3))
    radii = np.full(20, 0.008)

    start = perf_counter()
    ours = signed_gaps(centres, radii, cloud)
    ours_seconds = perf_counter() - start

    # As written, every frame costs the same, so a fiftieth of them is enough.
    some = slice(None, None, 50)
    start = perf_counter()
    peer = [np.linalg.norm(cloud.points - centre, axis=1).min() for centre in centres[some].reshape(-1, 3)]
    peer_seconds = 50 * (perf_counter() - start)

    np.testing.assert_allclose(np.reshape(peer, (-1, 20)) - radii, ours.gap[some], rtol=0, atol=1e-15)
    return Result(
        "24,000 gaps to 20,000 points", ours_seconds, peer_seconds, "s", note="peer: equation 2 as written"
    )
