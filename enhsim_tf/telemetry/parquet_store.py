"""The "storage and retrieval system" of the paper's section 2: a folder of Parquet files, which keeps values, times, unit and name unchanged.

`influx_store` has the same methods `write`, `read` and `names`.
"""

import os
import urllib.parse
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from enhsim_tf.common.atomic_files import encode_name, replace_folder
from enhsim_tf.common.errors import InputError
from enhsim_tf.common.size_limits import check_parquet, short_reason
from enhsim_tf.telemetry.series import Telemetry, nanoseconds

_DAY_NS = 86_400 * 10**9


class ParquetStore:
    """A store with one folder per channel, which holds one Parquet file per day with the columns `time` and `value`.

    Any tool that reads Parquet can read it, for example `pandas.read_parquet("store/attitude")`.

    Args:
        folder: Folder of the store. It is created by the first `write`.
    """

    def __init__(self, folder: str | os.PathLike):
        self.folder = Path(folder)

    def write(self, telemetry: Telemetry) -> None:
        """Stores a series atomically under its name. An existing series of that name is replaced.

        Raises:
            InputError: If the series has no name or no samples, or its folder holds other files.
        """
        if not telemetry.name or not len(telemetry):
            raise InputError(f"Expected a series with a name and samples. Received: {len(telemetry)} samples, name={telemetry.name!r}.")
        channel = self._channel(telemetry.name)
        others = sorted(path.name for path in channel.iterdir() if path.suffix != ".parquet") if channel.is_dir() else []
        if others or channel.is_file():
            what = f"which holds {others[0]!r}" if others else "a file"
            raise InputError(f"Expected a place for the series. Received: {channel}, {what}. Name another folder for the store.")
        times = nanoseconds(telemetry)
        described = {"name": telemetry.name, "unit": telemetry.unit, "start": telemetry.start or ""}
        described |= {key: repr(getattr(telemetry, key)) for key in ("interval_s", "offset_s")}
        table = pa.table({"time": pa.array(times, pa.timestamp("ns", "UTC")), "value": pa.array(telemetry.values, pa.float32())})
        table = table.replace_schema_metadata(described)
        days = times // _DAY_NS
        edges = np.flatnonzero(np.diff(days, prepend=days[0] - 1))
        with replace_folder(channel) as folder:
            for first, stop in zip(edges, [*edges[1:], len(days)], strict=True):
                file = folder / f"{np.datetime64(int(days[first]), 'D')}.parquet"
                pq.write_table(table.slice(first, stop - first), file, compression="zstd")

    def read(self, name: str) -> Telemetry:
        """Reads the series stored under `name`.

        Raises:
            InputError: If there is no such series, or if samples are missing from it.
        """
        files = sorted(self._channel(name).glob("*.parquet"))
        if not files:
            raise InputError(f"Expected a series of this store: {', '.join(self.names()) or 'it is empty'}. Received: {name!r}.")
        try:
            for file in files:
                check_parquet(file)
            table = pa.concat_tables([pq.read_table(file) for file in files])
            about = {key.decode(): value.decode() for key, value in table.schema.metadata.items()}
            name, unit, start = about["name"], about["unit"], about["start"]
            interval_s, offset_s = float(about["interval_s"]), float(about["offset_s"])
            if not (len(table) and 0 < interval_s < np.inf and np.isfinite(offset_s)):
                raise ValueError("no samples, or an invalid offset or interval")
            values = table["value"].to_numpy().astype(np.float32)
            times = table["time"].cast(pa.int64()).to_numpy()
        except (pa.ArrowException, OSError, KeyError, AttributeError, ValueError) as error:
            raise InputError(
                f"Expected Parquet files of this store in {files[0].parent}. Received: {short_reason(error)}. Write the series again."
            ) from None
        if len(times) > 1 and np.abs(np.diff(times) - interval_s * 1e9).max() > 1e-3 * interval_s * 1e9:
            raise InputError(f"Expected a sample every {interval_s:g} s. Received: a gap in {name!r}. Write the series again.")
        telemetry = Telemetry(values, interval_s, offset_s, start or None, name, unit)
        nanoseconds(telemetry)  # raises if the start is not a time
        return telemetry

    def names(self) -> list[str]:
        """The sorted names of the stored series."""
        folders = self.folder.glob("[!.]*") if self.folder.is_dir() else ()
        return sorted(urllib.parse.unquote(folder.name) for folder in folders if any(folder.glob("*.parquet")))

    def _channel(self, name: str) -> Path:
        return self.folder / encode_name(name)
