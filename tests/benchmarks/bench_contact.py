"""Contact against equation 2 as it is written, in processor time, which other programs disturb least."""

from collections.abc import Callable
from time import process_time

import numpy as np
import trimesh
from harness import Result, benchmark

from graspdb_ingest.contact import signed_gaps
from graspdb_ingest.hand import HandDimensions, build_hand
from graspdb_ingest.objects.cloud import ObjectCloud
from graspdb_ingest.objects.distance import ObjectDistance
from graspdb_ingest.objects.mesh import Surface
from graspdb_ingest.surface import SURFACES, HandPoints, key_points
from graspdb_ingest.surface.touch import pose_hand
from graspdb_schemas.vocabulary import Side

N_POINTS = 20_000
N_FRAMES = 1200
LIVE_FRAMES = 200


def seconds(work: Callable[[], object], repeats: int) -> float:
    """Return the least processor time of some repeats [s]."""
    least = float("inf")
    for _ in range(repeats):
        start = process_time()
        work()
        least = min(least, process_time() - start)
    return least


def sphere_cloud(rng: np.random.Generator) -> ObjectCloud:
    """Return points of a sphere of 40 mm."""
    normals = rng.normal(size=(N_POINTS, 3))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    area = 4 * np.pi * 0.04**2 / N_POINTS
    return ObjectCloud(0.04 * normals, normals, np.full(N_POINTS, area), spacing=0.001)


@benchmark("contact")
def contact() -> list[Result]:
    """Time all gaps of a trial: 20 spheres in 1,200 frames against 20,000 points, and of one live frame."""
    rng = np.random.default_rng(0)
    cloud = sphere_cloud(rng)
    centres = rng.uniform(-0.1, 0.1, size=(N_FRAMES, 20, 3))
    radii = np.full(20, 0.008)
    ours = signed_gaps(centres, radii, cloud)
    ours_seconds = seconds(lambda: signed_gaps(centres, radii, cloud), 7)

    # As written, every frame costs the same, so a fiftieth of them is enough.
    some = slice(None, None, 50)

    def as_written() -> list[tuple[float, int]]:
        found = []
        for centre in centres[some].reshape(-1, 3):
            distance = np.linalg.norm(cloud.points - centre, axis=1)
            nearest = int(distance.argmin())
            found.append((float(distance[nearest]), nearest))
        return found

    distance, nearest = (np.reshape(column, (-1, 20)) for column in zip(*as_written(), strict=True))
    np.testing.assert_array_equal(distance - radii, ours.gap[some])
    np.testing.assert_array_equal(nearest, ours.nearest[some])
    peer_seconds = 50 * seconds(as_written, 3)
    frames = centres[:LIVE_FRAMES]
    live = seconds(lambda: [signed_gaps(frame, radii, cloud) for frame in frames], 5) / LIVE_FRAMES
    return [
        Result(
            "24,000 gaps to 20,000 points",
            ours_seconds,
            peer_seconds,
            "s",
            note="peer: equation 2 as written in numpy; equal to the last bit and index; bar: 100 times",
        ),
        Result(
            "one live frame: 20 gaps to 20,000 points",
            1000 * live,
            1000 * peer_seconds / N_FRAMES,
            "ms",
            note="bar: 0.5 ms",
        ),
    ]


@benchmark("hand surfaces")
def hand_surfaces() -> list[Result]:
    """Time exact gaps of each surface of a hand to a mesh, for a trial of 1,200 frames."""
    mesh = trimesh.creation.torus(0.05, 0.015, major_sections=128, minor_sections=64)
    faces = np.array(mesh.faces, dtype=np.int64)
    extents = np.array([0.13, 0.13, 0.03])
    surface = Surface(np.array(mesh.vertices), faces, None, float(mesh.area), None, extents, True, "", ())
    target = ObjectDistance(surface, sphere_cloud(np.random.default_rng(0)))
    hand = build_hand(HandDimensions(0.19, 0.085), Side.RIGHT, {})
    sites = hand.forward(hand.neutral()).sites
    points = key_points(hand.palm(hand.neutral())[0], sites) - sites.mean(axis=0)
    way = np.linspace(0.04, 0.2, N_FRAMES)[:, None, None] * [0, 0, 1.0]
    posed = HandPoints(points + way, hand.radii, Side.RIGHT)
    first = HandPoints(points[None] + way[:1], hand.radii, Side.RIGHT)
    results = []
    for name in SURFACES:
        pose_hand(first, name, target)
        trial = seconds(lambda name=name: pose_hand(posed, name, target), 2)  # type: ignore[misc]
        live = seconds(lambda name=name: pose_hand(first, name, target), 20)  # type: ignore[misc]
        note = f"to {len(faces):,} faces, exact; a frame by itself: {1000 * live:.2f} ms"
        results.append(Result(f"1,200 frames, {name} to a mesh", trial, None, "s", note=note))
    return results
