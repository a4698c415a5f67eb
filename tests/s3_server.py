"""A server of object storage on this machine: moto, which speaks the protocol of S3 over HTTP."""

import socket
import subprocess
import sys
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager

BUCKET = "grasp-data"


@contextmanager
def s3_server() -> Iterator[Mapping[str, str]]:
    """Start a server with an empty bucket, and yield the environment that leads to it."""
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    command = [sys.executable, "-m", "moto.server", "-H", "127.0.0.1", "-p", str(port)]
    server = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    try:
        environment = {
            "AWS_ACCESS_KEY_ID": "key",
            "AWS_SECRET_ACCESS_KEY": "secret",
            "AWS_REGION": "us-east-1",
            "AWS_ENDPOINT_URL": f"http://127.0.0.1:{port}",
            "AWS_ALLOW_HTTP": "true",
        }
        _make_bucket(port)
        yield environment
    finally:
        server.terminate()
        server.wait(20)


def _make_bucket(port: int) -> None:
    """Wait for the server, then make the bucket."""
    request = f"PUT /{BUCKET} HTTP/1.0\r\nHost: 127.0.0.1:{port}\r\nContent-Length: 0\r\n\r\n".encode()
    end = time.monotonic() + 60
    while True:
        try:
            with socket.create_connection(("127.0.0.1", port), timeout=30) as connection:
                connection.sendall(request)
                answer = connection.recv(64)
        except OSError:
            if time.monotonic() > end:
                raise
            time.sleep(0.05)
            continue
        if b" 200 " not in answer:
            raise RuntimeError(f"no bucket: {answer!r}")
        return
