"""A Ray cluster of two nodes on this machine, started by the commands that docs/scale.md names."""

import os
import secrets
import socket
import subprocess
import sys
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path

_PATIENCE = 180
"""How long a node may take to come up [s]."""


@contextmanager
def two_nodes(folder: Path) -> Iterator[Mapping[str, str]]:
    """Start the cluster, each node with one core, and yield the environment that leads to it."""
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    environment = {
        "RAY_ADDRESS": f"127.0.0.1:{port}",
        "RAY_AUTH_MODE": "token",
        "RAY_AUTH_TOKEN": secrets.token_hex(32),
        "RAY_USAGE_STATS_ENABLED": "0",
    }
    head = ["--head", f"--port={port}", "--include-dashboard=false", f"--temp-dir={folder}"]
    nodes: list[subprocess.Popen[bytes]] = []
    try:
        for arguments in (head, [f"--address=127.0.0.1:{port}"]):
            nodes.append(_started(folder, arguments, environment, len(nodes)))
        yield environment
    finally:
        for node in reversed(nodes):
            node.terminate()
        for node in nodes:
            node.wait(60)


def _started(
    folder: Path, arguments: list[str], environment: Mapping[str, str], number: int
) -> subprocess.Popen[bytes]:
    """Start a node and wait until it says that it runs."""
    log = folder / f"node-{number}.log"
    command = [str(Path(sys.executable).with_name("ray")), "start", *arguments]
    command += ["--num-cpus=1", "--object-store-memory=100000000", "--block"]
    with log.open("wb") as file:
        node = subprocess.Popen(command, stdout=file, stderr=file, env={**os.environ, **environment})
    end = time.monotonic() + _PATIENCE
    while "Ray runtime started" not in log.read_text(errors="replace"):
        if node.poll() is not None or time.monotonic() > end:
            node.kill()
            raise RuntimeError(f"no node: {log.read_text(errors='replace')[-2000:]}")
        time.sleep(0.2)
    return node
