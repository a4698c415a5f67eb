"""What a grasp is, in words and numbers."""

from graspdb.view.scene import Scene


def subtitle(scene: Scene) -> str:
    """Return whose grasp of what it is, in one line."""
    grasp = scene.grasp
    words = [f"{grasp.object}, {grasp.side} hand of {grasp.subject}", scene.task]
    if scene.repetition is not None:
        words.append(f"repetition {scene.repetition}")
    return ", ".join(word for word in words if word)


def facts(scene: Scene) -> list[tuple[str, str]]:
    """Return name and value, with its unit, of what is known of a grasp."""
    grasp = scene.grasp
    areas = scene.surface.areas[grasp.feature_points] if len(scene.surface.areas) else scene.surface.areas
    found = [
        ("object", grasp.object),
        ("subject", f"{grasp.subject}, {grasp.side} hand"),
        ("task", scene.task),
        ("type", scene.grasp_type),
        ("digits", ", ".join(grasp.digits)),
        ("contacts", f"{len(grasp.contact_sites)} of {len(grasp.gap)} sites{_threshold(scene.threshold)}"),
        ("snapshot", _snapshot(scene)),
        ("enclosed", None if grasp.hull_volume is None else f"{1e6 * grasp.hull_volume:.1f} cm³"),
        ("feature", f"{len(grasp.feature_points)} points, {1e4 * float(areas.sum()):.1f} cm²"),
    ]
    found += [(name.replace("_", " "), f"{value:.3g}") for name, value in grasp.quality.items()]
    return [(name, value) for name, value in found if value]


def description(scene: Scene) -> str:
    """Return a sentence that stands for the picture where it cannot be seen."""
    grasp = scene.grasp
    digits = ", ".join(grasp.digits) or "no digit"
    return (
        f"Grasp {grasp.id}: the {grasp.side} hand of {grasp.subject} holds {grasp.object}; "
        f"{digits} in contact at {len(grasp.contact_sites)} sites."
    )


def _threshold(threshold: float | None) -> str:
    return "" if threshold is None else f", gap below {1e3 * threshold:g} mm"


def _snapshot(scene: Scene) -> str:
    kind = (scene.grasp.snapshot_kind or "").replace("_", " ")
    time = scene.grasp.snapshot_time
    return kind if time is None else f"{kind}, {time:.2f} s"
