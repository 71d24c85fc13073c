"""The paper's pipeline with a server of one's own: `python -m enhsim_tf.reproduce --store
influxdb`.
"""

import dataclasses
import zlib
from typing import TYPE_CHECKING

import numpy as np

from enhsim_tf.common.errors import InputError
from enhsim_tf.telemetry.influx_store import InfluxStore, parse_location

if TYPE_CHECKING:
    from enhsim_tf.paper.telemetry import Telemetry


class InfluxTelemetry:
    """The paper's store: a series in InfluxDB 2. The place is that of the option `--store`."""

    def __init__(self, place: str):
        if place != "influxdb" and not place.startswith("influxdb://"):
            raise InputError(
                "Expected --store parquet, influxdb or influxdb://bucket/measurement/field. "
                f"Received: --store {place}."
            )
        self.location = parse_location(
            "influxdb://telemetry/enhsim_tf/value" if place == "influxdb" else place
        )
        InfluxStore(self.location).check()

    def write(self, telemetry: "Telemetry") -> None:
        """Places a series, with a tag that is the checksum of its content, so that other series at
        the place stay apart.
        """
        self.written = telemetry
        self.times = telemetry.stamps.as_unit("ns").asi8
        content = f"{zlib.crc32(self.times.tobytes() + telemetry.values.tobytes()):08x}"
        self.store = InfluxStore(
            dataclasses.replace(self.location, tags=(*self.location.tags, ("run", content)))
        )
        self.store.write(self.times, telemetry.values)

    def read(self) -> "Telemetry":
        """Reads the series back; raises InputError if a sample is missing."""
        times, values = self.store.read()
        if not np.array_equal(times, self.times):
            raise InputError(
                f"Expected the {len(self.times):,} samples that were written to {self.location}. "
                f"Received: {len(times):,}, or other times. "
                "Run the command again, or give another --store."
            )
        return dataclasses.replace(self.written, values=values.astype(np.float32))
