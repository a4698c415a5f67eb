"""Tables to answers: the DuckDB engine and the named queries."""
