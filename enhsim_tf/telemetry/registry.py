"""The files that can be read as telemetry (step 4 of the paper's pipeline). This module imports nothing, as the command line lists them."""

PACKED = (".gz", ".zip")
"""Endings of packed files, each with one table inside."""
TABLES = (".csv", ".tsv", ".txt", ".parquet", ".xlsx", ".xlsm", *PACKED)
"""Endings of the names of tables."""

SOURCES = (
    f"a {', '.join((*TABLES, '.npy'))} file, several files of tables, a folder of them, or influxdb://bucket/measurement/field?tag=value"
)
"""All sources as text, for help and messages."""
