"""The card of an export: what it holds, where that comes from, and under which licences."""

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import pyarrow as pa

from graspdb.export.options import ExportOptions
from graspdb.export.registry import Feature, Format, Written


@dataclass(frozen=True)
class Told:
    """What a card tells.

    Attributes
    ----------
    form : Format
        The format.
    options : ExportOptions
        What was asked for.
    rows : pyarrow.Table
        What was selected.
    written : sequence of Written
        What came of it.
    features : sequence of Feature
        What the files hold.
    version : str
        Version of graspdb.
    database : str
        Name and version of the database.
    refused : sequence of str
        Licences that were left out.
    """

    form: Format
    options: ExportOptions
    rows: pa.Table
    written: Sequence[Written]
    features: Sequence[Feature]
    version: str
    database: str
    refused: Sequence[str]


def totals(written: Sequence[Written], split: str | None = None) -> dict[str, int]:
    """Return what was written, summed over the parts, or over those of one side of the split."""
    counter: Counter[str] = Counter()
    for part in written:
        if split in (None, part.split):
            counter.update(part.counts)
    return dict(counter)


def left_out(written: Sequence[Written]) -> dict[str, int]:
    """Return what was not written: reason -> number."""
    counter: Counter[str] = Counter()
    for part in written:
        counter.update(part.left_out)
    return {reason: number for reason, number in counter.items() if number}


def card(told: Told) -> str:
    """Return the card, as Markdown."""
    return "\n".join(_lines(told)) + "\n"


def _lines(told: Told) -> Iterator[str]:
    options = told.options
    yield f"# {told.form.title}"
    yield ""
    yield f"Exported by graspdb {told.version} from {told.database}."
    yield "`sha256sum --check SHA256SUMS` tells whether all files are whole."
    yield ""
    yield "## What was asked for"
    yield ""
    yield f"- format: {told.form.name}"
    yield f"- grasps: {'all' if options.where is None else f'those with `{_inline(options.where)}`'}"
    for name in told.form.options:
        yield f"- {name}: {getattr(options, name)}"
    if told.refused:
        yield f"- without trials whose licence note has: {', '.join(map(_inline, told.refused))}"
    yield ""
    yield from _counts(told)
    yield from _features(told.features)
    yield from _provenance(told)


def _counts(told: Told) -> Iterator[str]:
    yield "## What is in it"
    yield ""
    counts = totals(told.written)
    sides = list(dict.fromkeys(part.split for part in told.written if part.split))
    yield f"| | {' | '.join(counts)} |"
    yield f"|---|{'---|' * len(counts)}"
    for side in sides:
        by_side = totals(told.written, side)
        yield f"| {side} | {' | '.join(f'{by_side.get(name, 0):,}' for name in counts)} |"
    yield f"| all | {' | '.join(f'{number:,}' for number in counts.values())} |"
    yield ""
    if sides:
        shared = "trial" if told.options.split == "random" else told.options.split
        yield f"The sides share no {shared}. The side that one is on follows from its name and the seed,"
        yield f"{told.options.seed}, alone: it stays there when data is added."
        yield ""
    gone = left_out(told.written)
    for reason, number in gone.items():
        yield f"- left out: {number:,} {reason}"
    if gone:
        yield ""


def _features(features: Sequence[Feature]) -> Iterator[str]:
    yield "## Features"
    yield ""
    yield "| feature | type | shape | unit | what it is |"
    yield "|---|---|---|---|---|"
    for feature in features:
        yield f"| `{feature.name}` | {feature.kind} | {feature.shape} | {feature.unit} | {feature.doc} |"
    yield ""


def _provenance(told: Told) -> Iterator[str]:
    yield "## Where it comes from"
    yield ""
    yield "| data set | version | licence | sessions | trials |"
    yield "|---|---|---|---|---|"
    for (name, version, licence), sessions, trials in _sources(told.rows):
        yield (
            f"| {_inline(name or 'own recordings')} | {_inline(version or '')} | "
            f"{_inline(licence or 'none noted')} | {_inline(', '.join(sessions))} | {trials:,} |"
        )


def _sources(rows: pa.Table) -> Iterator[tuple[tuple[Any, Any, Any], list[str], int]]:
    """Yield each data set with its licence: sessions, and number of trials."""
    names = ["data_set", "data_set_version", "licence"]
    trials = rows.select([*names, "session", "trial"]).group_by([*names, "session", "trial"]).aggregate([])
    grouped = trials.group_by(names).aggregate([("session", "distinct"), ("trial", "count")])
    for row in sorted(grouped.to_pylist(), key=lambda row: [row[name] or "" for name in names]):
        yield tuple(row[name] for name in names), sorted(row["session_distinct"]), row["trial_count"]


def _inline(text: str) -> str:
    """Return a text that stays in its cell and its line."""
    return " ".join(text.split()).replace("|", "\\|")
