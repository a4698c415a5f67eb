"""``parquet``: one row a grasp."""

from collections.abc import Sequence

import pyarrow as pa
import pyarrow.parquet as pq

from graspdb.export.items import Grasp
from graspdb.export.registry import Feature, Format, Part, Writer, Written, export_format


@export_format(Format("parquet", "Grasps as Parquet", items="grasps", part=1000))
class ParquetWriter(Writer[Grasp]):
    """One file a part, one row a grasp."""

    def write(self, part: Part[Grasp]) -> Written:
        """Write the grasps of a part."""
        rows = [{"grasp": grasp.id, "q": grasp.q.tolist()} for grasp in part.items]
        pq.write_table(pa.Table.from_pylist(rows), self.folder / f"part-{part.index:05}.parquet")
        return Written(part.split, {"grasps": len(rows)})

    def features(self) -> Sequence[Feature]:
        """Return what the files hold."""
        return [
            Feature("grasp", "string", "()", "", "key of the grasp"),
            Feature("q", "float64", "(30,)", "m, 1, rad", "configuration of the hand"),
        ]
