"""A real InfluxDB 2 server for the tests, on the loopback interface with a temporary folder. Tests can kill and restart it."""

import contextlib
import os
import secrets
import shutil
import socket
import subprocess
import time
import urllib.request
from pathlib import Path

ROOT = Path(__file__).parents[2]
WITHOUT = (
    "no InfluxDB 2 server: put influxd on the PATH or name it in ENHSIM_TF_INFLUXD (.ci/influxd/build makes one); or start "
    "`docker run influxdb:2`, set INFLUXDB_V2_URL, INFLUXDB_V2_TOKEN and INFLUXDB_V2_ORG, and ENHSIM_TF_INFLUXDB=running"
)


def find_influxd():
    """Path of the influxd program: the configured one, one on the PATH, or the build of `.ci/influxd/build`; None if missing."""
    cache = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "enhsim_tf"
    places = [os.environ.get("ENHSIM_TF_INFLUXD"), shutil.which("influxd"), *sorted(cache.glob("influxd-*/influxd"))]
    return next((str(place) for place in places if place and os.access(place, os.X_OK)), None)


def _free_port():
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


class Server:
    """A server started by the tests: its URL, organisation and token, and methods to start and kill it."""

    def __init__(self, program, folder):
        self.program, self.folder, self.process = program, Path(folder), None
        self.url, self.org, self.token = f"http://127.0.0.1:{_free_port()}", "proving ground", secrets.token_urlsafe(24)
        self.start()
        from influxdb_client import InfluxDBClient, OnboardingRequest, SetupService

        with InfluxDBClient(self.url) as client:
            request = OnboardingRequest(
                username="tester", password=secrets.token_urlsafe(12), org=self.org, bucket="first", token=self.token
            )
            SetupService(client.api_client).post_setup(onboarding_request=request)

    def start(self):
        options = {"bolt-path": "bolt", "sqlite-path": "sqlite", "engine-path": "engine"}
        words = [f"--{name}={self.folder / file}" for name, file in options.items()]
        words += [f"--http-bind-address={self.url.removeprefix('http://')}", "--reporting-disabled", "--log-level=error"]
        environment = os.environ | {"HOME": str(self.folder)}
        with open(self.folder / "log", "ab") as log:
            self.process = subprocess.Popen([self.program, *words], stdout=log, stderr=log, env=environment)
        until = time.monotonic() + 60
        while True:
            assert self.process.poll() is None, (self.folder / "log").read_text(errors="replace")[-2_000:]
            with contextlib.suppress(OSError), urllib.request.urlopen(f"{self.url}/health", timeout=5):
                return
            assert time.monotonic() < until, "the server does not come up"
            time.sleep(0.05)

    def kill(self):
        self.process.kill()
        self.process.wait()

    def end(self):
        """Terminates the server, and kills it if that takes too long."""
        self.process.terminate()
        try:
            self.process.wait(10)
        except subprocess.TimeoutExpired:
            self.kill()


class Running:
    """A running server that the environment variables name. The tests do not kill it."""

    def __init__(self):
        self.url, self.token, self.org = (os.environ[f"INFLUXDB_V2_{name}"] for name in ("URL", "TOKEN", "ORG"))
