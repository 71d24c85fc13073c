"""The paper's experiment with InfluxDB 2 as the storage and retrieval system ("Goal" in Figure 1): `--store influxdb`.

This is a separate module, so that the other stages do not depend on the database or its client.
"""

import dataclasses
import functools
import hashlib
import json
from pathlib import Path

from enhsim_tf.common.atomic_files import sha256, write_json
from enhsim_tf.common.stages import Stages
from enhsim_tf.reproduce.paper.data import Source, fill_store
from enhsim_tf.reproduce.paper.pipeline import Experiment
from enhsim_tf.reproduce.settings import Settings
from enhsim_tf.telemetry.influx_store import InfluxStore, parse_location

_VERSIONS = "versions.json"  # in the stage's folder: what the store held when it was filled


class InfluxExperiment(Experiment):
    """The reproduction, its telemetry placed in InfluxDB and read back from there.

    Args:
        location: Where in InfluxDB; what is placed there gets a tag `run` by its content, so that no two runs meet.
        settings: All settings.
        stages: Runs stages and caches their results.
        source: A file of real telemetry, or None for the paper's example.
        verbose: Progress bars: 0 none, 1 one for each training.
    """

    def __init__(self, location: str, settings: Settings, stages: Stages, source: Source | None = None, verbose: int = 0):
        super().__init__(settings, stages, source, verbose)
        self.location = parse_location(location)

    @functools.cached_property
    def store(self) -> InfluxStore:
        """The store that holds the telemetry ("Goal" of the paper's Figure 1)."""
        settings, source = self.settings, self.source
        depends = (settings.telemetry, settings.seed)
        if source is not None:
            depends = (source.path.name, source.column, source.time, sha256(source.path))
        content = hashlib.sha256(repr(depends).encode()).hexdigest()[:16]
        store = InfluxStore(dataclasses.replace(self.location, tags=(*self.location.tags, ("run", content))))

        def place_telemetry(folder: Path) -> None:
            fill_store(store, settings, source)
            write_json(folder / _VERSIONS, store.versions())

        folder = self.stages.run("telemetry", place_telemetry, (*depends, str(store.location)))
        kept = json.loads((folder / _VERSIONS).read_text(encoding="utf-8"))
        if store.versions() != kept:  # the stage was done before: on another server, or its points are deleted since
            fill_store(store, settings, source)
        return store
