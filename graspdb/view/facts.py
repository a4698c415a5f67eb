"""What a grasp is, in words and numbers."""

from graspdb.grasp import Grasp
from graspdb.view.scene import Scene


def subtitle(scene: Scene) -> str:
    """Return whose grasp of what it is, in one line."""
    grasp = scene.grasp
    words = [f"{grasp.object}, {grasp.side} hand of {grasp.subject}", scene.task]
    if scene.repetition is not None:
        words.append(f"repetition {scene.repetition}")
    return ", ".join(word for word in words if word)


def facts(scene: Scene) -> list[tuple[str, str]]:
    """Return name and value, with its unit, of what is known of a grasp and its trial."""
    areas = scene.surface.areas[scene.feature]
    more = {
        "task": scene.task,
        "type": scene.grasp_type,
        "gap below": None if scene.threshold is None else f"{1e3 * scene.threshold:g} mm",
        "feature": f"{len(scene.feature)} points, {1e4 * float(areas.sum()):.1f} cm²",
    }
    return _known({**_of_grasp(scene.grasp), **more})


def grasp_facts(grasp: Grasp) -> list[tuple[str, str]]:
    """Return the same of what a grasp alone says."""
    return _known(_of_grasp(grasp))


def _of_grasp(grasp: Grasp) -> dict[str, str | None]:
    """Return facts by name in the order in which they are shown; None for what is not known."""
    kind = (grasp.snapshot_kind or "").replace("_", " ")
    time = grasp.snapshot_time
    return {
        "object": grasp.object,
        "subject": f"{grasp.subject}, {grasp.side} hand",
        "task": None,
        "type": None,
        "digits": ", ".join(grasp.digits),
        "contacts": f"{len(grasp.contact_sites)} of {len(grasp.gap)} sites",
        "gap below": None,
        "snapshot": kind if time is None else f"{kind}, {time:.2f} s",
        "enclosed": None if grasp.hull_volume is None else f"{1e6 * grasp.hull_volume:.1f} cm³",
        "feature": f"{len(grasp.feature_points)} points",
        **{name.replace("_", " "): f"{value:.3g}" for name, value in grasp.quality.items()},
    }


def description(scene: Scene) -> str:
    """Return a sentence that stands for the picture where it cannot be seen."""
    grasp = scene.grasp
    digits = ", ".join(grasp.digits) or "no digit"
    return (
        f"Grasp {grasp.id}: the {grasp.side} hand of {grasp.subject} holds {grasp.object}; "
        f"{digits} in contact at {len(grasp.contact_sites)} sites."
    )


def _known(found: dict[str, str | None]) -> list[tuple[str, str]]:
    return [(name, value) for name, value in found.items() if value]
