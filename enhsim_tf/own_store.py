"""The paper's pipeline with a server of one's own: `python -m enhsim_tf.reproduce --store influxdb`."""

import dataclasses
import zlib
from typing import TYPE_CHECKING

from enhsim_tf.common.errors import InputError
from enhsim_tf.telemetry.influx_store import InfluxStore, parse_location

if TYPE_CHECKING:
    from enhsim_tf.paper.telemetry import Telemetry


class InfluxTelemetry:
    """The paper's store: a measurement in InfluxDB 2, through the tool's client. The place is that of the option `--store`."""

    def __init__(self, place: str):
        if place != "influxdb" and not place.startswith("influxdb://"):
            raise InputError(f"Expected --store parquet, influxdb or influxdb://bucket/measurement/field. Received: --store {place}.")
        self.location = parse_location("influxdb://telemetry/enhsim_tf/value" if place == "influxdb" else place)
        self.store = InfluxStore(self.location)
        self.store.check()

    def write(self, telemetry: "Telemetry") -> None:
        """Places a series, tagged by its content, unless it is there."""
        from enhsim_tf.telemetry.series import Telemetry as Series

        content = f"{zlib.crc32(telemetry.values.tobytes()):08x}"
        self.store = InfluxStore(dataclasses.replace(self.location, tags=(*self.location.tags, ("run", content))))
        if telemetry.name not in self.store.names():
            start = telemetry.start.replace("Z", "+00:00")
            self.store.write(Series(telemetry.values, telemetry.interval, start=start, name=telemetry.name))

    def read(self) -> "Telemetry":
        """Reads the series back."""
        from enhsim_tf.paper.telemetry import Telemetry

        series = self.store.read(self.store.names()[0])
        return Telemetry(series.values, series.interval_s, series.start.replace("+00:00", "Z"), series.name)
