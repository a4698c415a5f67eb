"""``rerun``: recordings for the Rerun viewer, one file a hand and trial, to be looked at frame by frame."""

import re
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from graspdb.export.items import Episode
from graspdb.export.registry import Feature, Format, Part, Writer, Written, export_format
from graspdb.view import palette
from graspdb.view.motion import PALM, array_of
from graspdb.view.scene import CAPSULE_SHARE, SEGMENTS_DRAWN, WRIST, Floats, Scene
from graspdb_ingest.rigid import fit_rigid, transform_points
from graspdb_schemas.vocabulary import N_SITES, SITES

if TYPE_CHECKING:
    from rerun import RecordingStream

_GAPS: Final = "SELECT gap FROM frames WHERE trial = $trial AND side = $side ORDER BY frame"
_TIME: Final = "time"


@export_format(
    Format(
        "rerun",
        "Recordings for the Rerun viewer, one file a hand and trial",
        items="episodes",
        library="rerun",
        extra="rerun",
    )
)
class RerunWriter(Writer[Episode]):
    """Writes a file an episode."""

    def write(self, part: Part[Episode]) -> Written:
        """Write the recordings of a part."""
        from graspdb.view.reading import SceneReader

        reader = SceneReader(self.database)
        episodes = frames = 0
        for number, episode in enumerate(part.items, part.first):
            scenes = [reader.scene(key, motion=False) for key in episode.grasps]
            self._write_episode(number, episode, scenes)
            episodes += 1
            frames += episode.n_frames
        return Written(part.split, {"episodes": episodes, "frames": frames})

    def features(self) -> Sequence[Feature]:
        """Return what the files hold, by the path of its entity."""
        return [
            Feature("world/object", "Transform3D", "(T,)", "m", "pose of the object"),
            Feature("world/object/surface", "Mesh3D", "(n,)", "m", "its surface, the feature in green"),
            Feature("world/object/<grasp>/hull", "Mesh3D", "(n,)", "m", "hand enclosing space"),
            Feature("world/object/<grasp>/contacts", "Arrows3D", "(k,)", "m", "contact points and normals"),
            Feature("world/hand/sites", "Points3D", "(T, 20)", "m", "spheres, those that touch in red"),
            Feature("world/hand/segments", "LineStrips3D", "(T,)", "m", "segments of the hand"),
            Feature("gap/<site>", "Scalars", "(T,)", "m", "signed distance of each sphere to the object"),
            Feature("grip_aperture", "Scalars", "(T,)", "m", "distance of thumb tip to index tip"),
        ]

    def _write_episode(self, number: int, episode: Episode, scenes: list[Scene]) -> None:
        import rerun

        name = re.sub(r"[^\w.-]+", "_", episode.key)[-80:]
        # The same episode gives the same identifier, so that a viewer knows it again.
        recording = rerun.RecordingStream("graspdb", recording_id=episode.key, send_properties=False)
        recording.save(self.folder / f"{number:05}_{name}.rrd")
        recording.send_recording_name(episode.key)
        recording.log("world", rerun.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
        for scene in scenes:
            _log_grasp(recording, scene)
        if scenes:
            _log_surface(recording, scenes)
            _log_hand(recording, episode, scenes[0])
        _log_object(recording, episode)
        _log_numbers(recording, episode, self._gaps(episode))
        recording.flush()
        recording.disconnect()

    def _gaps(self, episode: Episode) -> Floats:
        rows = self.database.sql(_GAPS, trial=episode.trial, side=episode.side).table
        return array_of(rows["gap"].to_pylist(), (N_SITES,))


def _log_surface(recording: "RecordingStream", scenes: list[Scene]) -> None:
    """Log the object once, with the features of all its grasps."""
    import rerun

    surface = scenes[0].surface
    colours = np.tile(_bytes(palette.OBJECT), (len(surface.points), 1))
    for scene in scenes:
        colours[scene.feature] = _bytes(palette.FEATURE)
    mesh = rerun.Mesh3D(
        vertex_positions=surface.points,
        triangle_indices=surface.faces,
        vertex_normals=surface.normals,
        vertex_colors=colours,
    )
    recording.log("world/object/surface", mesh, static=True)


def _log_grasp(recording: "RecordingStream", scene: Scene) -> None:
    import rerun

    grasp = scene.grasp
    entity = f"world/object/grasp_{grasp.id.rpartition('/')[2]}"
    if len(grasp.hull_faces):
        hull = rerun.Mesh3D(
            vertex_positions=grasp.hull_vertices,
            triangle_indices=grasp.hull_faces,
            albedo_factor=[*_bytes(palette.HULL), 70],
        )
        recording.log(f"{entity}/hull", hull, static=True)
    known = np.isfinite(np.hstack([grasp.contact_points, grasp.contact_normals])).all(axis=1)
    if known.any():
        arrows = rerun.Arrows3D(
            origins=grasp.contact_points[known],
            vectors=0.018 * grasp.contact_normals[known],
            radii=0.0008,
            colors=_bytes(palette.CONTACT),
            labels=[grasp.contact_sites[i] for i in np.flatnonzero(known)],
            show_labels=False,
        )
        recording.log(f"{entity}/contacts", arrows, static=True)


def _log_object(recording: "RecordingStream", episode: Episode) -> None:
    """Log the object's pose where it is known."""
    import rerun

    known = np.isfinite(np.hstack([episode.object_position, episode.object_quaternion])).all(axis=1)
    if known.any():
        poses = rerun.Transform3D.columns(
            translation=episode.object_position[known],
            # Rerun's quaternions end with w.
            quaternion=np.roll(episode.object_quaternion[known], -1, axis=1),
        )
        times = [rerun.TimeColumn(_TIME, duration=episode.time[known])]
        recording.send_columns("world/object", times, poses)


def _log_hand(recording: "RecordingStream", episode: Episode, scene: Scene) -> None:
    """Log spheres and segments, frame by frame; nothing is there in frames in which they are not known."""
    import rerun

    nodes = np.concatenate([episode.sites, _wrists(episode, scene)[:, None]], axis=1)
    segments = [s for s in SEGMENTS_DRAWN if s.start <= WRIST and s.end <= WRIST]
    ends = [[s.start, s.end] for s in segments]
    radii = [CAPSULE_SHARE * scene.radii[pair].mean() for pair in ends]
    plain, red = _bytes(palette.HAND), _bytes(palette.TOUCHING)
    for time, places, touching in zip(episode.time, nodes, episode.touching, strict=True):
        recording.set_time(_TIME, duration=float(time))
        known = np.isfinite(places[:N_SITES]).all(axis=1)
        points = rerun.Points3D(
            places[:N_SITES][known],
            radii=scene.radii[:N_SITES][known],
            colors=np.where(touching[known, None] == 1, red, plain),
            labels=[site for site, is_known in zip(SITES, known, strict=True) if is_known],
            show_labels=False,
        )
        recording.log("world/hand/sites", points)
        drawn = [i for i, pair in enumerate(ends) if np.isfinite(places[pair]).all()]
        strips = rerun.LineStrips3D(
            [places[ends[i]] for i in drawn], radii=[radii[i] for i in drawn], colors=plain
        )
        recording.log("world/hand/segments", strips)
    recording.reset_time()


def _wrists(episode: Episode, scene: Scene) -> Floats:
    """Return the wrist in every frame, which goes with the palm's sites, shape (n, 3)."""
    palm = episode.sites[:, list(PALM)]
    if not np.isfinite(scene.nodes[[*PALM, WRIST]]).all():
        return np.full((episode.n_frames, 3), np.nan)
    fit = fit_rigid(scene.nodes[list(PALM)], palm, np.isfinite(palm).all(axis=2).astype(float))
    return transform_points(fit.rotations, fit.positions, scene.nodes[None, WRIST])[:, 0]


def _log_numbers(recording: "RecordingStream", episode: Episode, gaps: Floats) -> None:
    import rerun

    tips = episode.sites[:, [SITES.index("thumb_tip"), SITES.index("index_tip")]]
    numbers: dict[str, Any] = {"grip_aperture": np.linalg.norm(tips[:, 0] - tips[:, 1], axis=1)}
    if len(gaps) == episode.n_frames:
        numbers |= {f"gap/{site}": gaps[:, i] for i, site in enumerate(SITES)}
    for entity, values in numbers.items():
        known = np.isfinite(values)
        times = [rerun.TimeColumn(_TIME, duration=episode.time[known])]
        recording.send_columns(entity, times, rerun.Scalars.columns(scalars=values[known]))


def _bytes(colour: str) -> list[int]:
    """Return red, green and blue from 0 to 255."""
    return [round(255 * channel) for channel in palette.rgb(colour)]
