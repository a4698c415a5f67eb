"""The rows that a trial or a session brings to the database."""

from collections.abc import Mapping
from dataclasses import dataclass

import pyarrow as pa


@dataclass(frozen=True)
class TrialTables:
    """Rows by table name, as the schemas declare them but for ``ingest_id``, which the store adds.

    Attributes
    ----------
    tables : mapping of str to pyarrow.Table
        The rows; a table without rows may be left out.
    """

    tables: Mapping[str, pa.Table]
