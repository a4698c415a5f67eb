"""``parquet`` and ``csv``: one row a grasp, flat, a column for each number."""

import csv
from collections.abc import Sequence
from typing import Final

import pyarrow as pa
import pyarrow.csv as pacsv
import pyarrow.parquet as pq

from graspdb.export.flat import PROVENANCE, flat_schema, flatten, source_columns
from graspdb.export.items import Grasp
from graspdb.export.registry import Feature, Format, Part, Writer, Written, export_format
from graspdb_schemas.tables import doc_of, unit_of

_PART: Final = 2000

_ROWS: Final = """
    SELECT {columns}
    FROM grasps g JOIN trials t ON t.trial = g.trial
    WHERE g.grasp IN (SELECT unnest($grasps))
    ORDER BY g.grasp
"""


class _FlatWriter(Writer[Grasp]):
    """One file a part."""

    ending = ""

    def write(self, part: Part[Grasp]) -> Written:
        """Write the grasps of a part."""
        columns = ", ".join(f"{'t' if name in PROVENANCE else 'g'}.{name}" for name in source_columns())
        keys = [grasp.id for grasp in part.items]
        rows = self.database.sql(_ROWS.format(columns=columns), grasps=keys).table
        self.write_table(flatten(rows, part.split), f"{part.split or 'grasps'}-{part.index:05}")
        return Written(part.split, {"grasps": rows.num_rows})

    def write_table(self, table: pa.Table, name: str) -> None:
        """Write one file."""
        raise NotImplementedError

    def features(self) -> Sequence[Feature]:
        """Return what the files hold."""
        return [
            Feature(field.name, str(field.type), "()", unit_of(field), doc_of(field))
            for field in flat_schema()
        ]


@export_format(Format("parquet", "Grasps as flat Parquet, one row each", items="grasps", part=_PART))
class ParquetWriter(_FlatWriter):
    """Units and documentation stand in the metadata of the fields."""

    def write_table(self, table: pa.Table, name: str) -> None:
        """Write one file."""
        pq.write_table(table, self.folder / f"{name}.parquet")


@export_format(Format("csv", "Grasps as flat CSV, one row each", items="grasps", part=_PART))
class CsvWriter(_FlatWriter):
    """Units and documentation stand in ``columns.csv``; numbers have all their digits, nothing is missing."""

    def write_table(self, table: pa.Table, name: str) -> None:
        """Write one file."""
        pacsv.write_csv(table, self.folder / f"{name}.csv")

    def finish(self, written: Sequence[Written]) -> None:  # noqa: ARG002
        """Write what the columns mean."""
        told = [[column.name, column.kind, column.unit, column.doc] for column in self.features()]
        with (self.folder / "columns.csv").open("w", encoding="utf-8", newline="") as file:
            rows = csv.writer(file, lineterminator="\n")
            rows.writerow(["column", "type", "unit", "meaning"])
            rows.writerows(told)
