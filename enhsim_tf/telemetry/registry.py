"""Names and readers of all sources of telemetry (step 4 of the paper's pipeline).

To add a source, write its reader in a module of this package and add one line here: the ending of the file's name, or the form
of the address. A reader is called as `reader(source, columns, time, options)`, with the arguments of `sources.read_source`, and
returns the raw channels by name. This module imports nothing slow, so that the command line can list the sources.
"""

FILES = {
    ".csv": "enhsim_tf.telemetry.tables:read_table_channels",
    ".tsv": "enhsim_tf.telemetry.tables:read_table_channels",
    ".txt": "enhsim_tf.telemetry.tables:read_table_channels",
    ".parquet": "enhsim_tf.telemetry.tables:read_table_channels",
    ".npy": "enhsim_tf.telemetry.arrays:read_array_channels",
}
"""Maps the ending of a file's name to the path `module:function` of its reader. The stages of the reproduction read these as imports."""

ADDRESSES = {"influxdb://bucket/measurement/field?tag=value": "enhsim_tf.telemetry.stores:read_influx_channels"}
"""The same for addresses; the part up to `//` tells the kinds of addresses apart."""

FOLDER = "enhsim_tf.telemetry.stores:read_folder_channels"
"""The reader of a folder, which is called with the one channel in `columns` for `folder#channel`."""

_endings = list(FILES)
SOURCES = f"a {', '.join(_endings[:-1])} or {_endings[-1]} file, the folder of a store, folder#channel, or {' or '.join(ADDRESSES)}"
"""All sources as text, for help and messages."""
