"""Names and readers of all sources of telemetry (step 4 of the paper's pipeline).

To add a source, write its reader in a module of this package and add one line here: the ending of the file's name, or the form
of the address. A reader is called as `reader(source, columns, time, options)`, with the arguments of `sources.read_source`, and
returns the raw channels by name. This module imports nothing slow, so that the command line can list the sources.
"""

_TABLES = (".csv", ".tsv", ".txt", ".parquet", ".xlsx", ".xlsm")
PACKED = (".gz", ".zip")
"""Endings of packed files, each with one table inside."""
FILES = dict.fromkeys((*_TABLES, *PACKED), "enhsim_tf.telemetry.reading.channels:read_table_channels")
FILES[".npy"] = "enhsim_tf.telemetry.arrays:read_array_channels"
"""Maps the ending of a file's name to the path `module:function` of its reader. The stages of the reproduction read these as imports."""

ADDRESSES = {"influxdb://bucket/measurement/field?tag=value": "enhsim_tf.telemetry.stores:read_influx_channels"}
"""The same for addresses; the part up to `//` tells the kinds of addresses apart."""

FOLDER = "enhsim_tf.telemetry.stores:read_folder_channels"
"""The reader of a folder, which is called with the one channel in `columns` for `folder#channel`."""

SOURCES = f"a {', '.join(FILES)} file, several files of tables, a folder of them, the folder of a store, folder#channel, or {' or '.join(ADDRESSES)}"
"""All sources as text, for help and messages."""
