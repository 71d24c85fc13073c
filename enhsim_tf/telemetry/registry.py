"""The files that can be read as telemetry (step 4 of the paper's pipeline). This module imports nothing slow, as the command line lists them.

To add a kind of file, write its reader in a module of this package and add one line here. A reader is called as
`reader(source, columns, time, options)`, with the arguments of `sources.read_source`, and returns the raw channels by name.
"""

PACKED = (".gz", ".zip")
"""Endings of packed files, each with one table inside."""
FILES = dict.fromkeys(
    (".csv", ".tsv", ".txt", ".parquet", ".xlsx", ".xlsm", *PACKED), "enhsim_tf.telemetry.reading.channels:read_table_channels"
)
FILES[".npy"] = "enhsim_tf.telemetry.arrays:read_array_channels"
"""Maps the ending of a file's name to the path `module:function` of its reader."""

SOURCES = f"a {', '.join(FILES)} file, several files of tables, a folder of them, or influxdb://bucket/measurement/field?tag=value"
"""All sources as text, for help and messages."""
