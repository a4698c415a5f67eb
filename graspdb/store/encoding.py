"""How the Parquet files of each table are encoded."""

from functools import cache
from typing import Final

import pyarrow as pa
from deltalake import ColumnProperties, WriterProperties

from graspdb_schemas.tables import TABLES

_DICTIONARY: Final = ColumnProperties(dictionary_enabled=True)
_PLAIN: Final = ColumnProperties(dictionary_enabled=False)


@cache
def encoding(name: str) -> WriterProperties:
    """Return how to write a table: compressed, and with dictionaries of columns of text alone.

    Measured numbers hardly ever repeat: to fill dictionaries of them took longer than all else, and made
    files larger.
    """
    texts = [field.name for field in TABLES[name] if pa.types.is_string(field.type)]
    return WriterProperties(
        compression="ZSTD",
        compression_level=3,
        default_column_properties=_PLAIN,
        column_properties=dict.fromkeys(texts, _DICTIONARY),
    )
