"""A real InfluxDB 2 server for the tests, on the loopback interface with a temporary folder. Tests
can kill and restart it.
"""

import contextlib
import os
import secrets
import shutil
import socket
import subprocess
import time
import urllib.request
from pathlib import Path

WITHOUT = (
    "no InfluxDB 2 server: put influxd on the PATH or name it in ENHSIM_TF_INFLUXD "
    "(.ci/influxd/build makes one)"
)


def find_influxd():
    """Path of the influxd program: the configured one, one on the PATH, or the build of
    `.ci/influxd/build`; None if missing.
    """
    cache = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "enhsim_tf"
    places = [
        os.environ.get("ENHSIM_TF_INFLUXD"),
        shutil.which("influxd"),
        *sorted(cache.glob("influxd-*/influxd")),
    ]
    return next((str(place) for place in places if place and os.access(place, os.X_OK)), None)


class Server:
    """A server started by the tests: its URL, organisation and token, and methods to start and kill
    it.
    """

    def __init__(self, program, folder):
        from influxdb_client import InfluxDBClient, OnboardingRequest, SetupService

        self.program, self.folder, self.process = program, Path(folder), None
        with socket.socket() as probe:
            probe.bind(("127.0.0.1", 0))
            self.url = f"http://127.0.0.1:{probe.getsockname()[1]}"
        self.org, self.token = "proving ground", secrets.token_urlsafe(24)
        self.start()
        setup = {
            "username": "tester",
            "password": secrets.token_urlsafe(12),
            "org": self.org,
            "bucket": "first",
            "token": self.token,
        }
        with InfluxDBClient(self.url) as client:
            SetupService(client.api_client).post_setup(
                onboarding_request=OnboardingRequest(**setup)
            )

    def start(self):
        options = {"bolt-path": "bolt", "sqlite-path": "sqlite", "engine-path": "engine"}
        words = [f"--{name}={self.folder / file}" for name, file in options.items()]
        words += [
            f"--http-bind-address={self.url.removeprefix('http://')}",
            "--reporting-disabled",
            "--log-level=error",
        ]
        with open(self.folder / "log", "ab") as log:
            environment = os.environ | {"HOME": str(self.folder)}
            self.process = subprocess.Popen(
                [self.program, *words], stdout=log, stderr=log, env=environment
            )
        until = time.monotonic() + 60
        while True:
            assert self.process.poll() is None, (self.folder / "log").read_text(errors="replace")[
                -2_000:
            ]
            with (
                contextlib.suppress(OSError),
                urllib.request.urlopen(f"{self.url}/health", timeout=5),
            ):
                return
            assert time.monotonic() < until, "the server does not come up"
            time.sleep(0.05)

    def kill(self):
        self.process.kill()
        self.process.wait()
