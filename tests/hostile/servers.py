"""Servers that are none of ours, dead, silent, slow or talkative without end."""

from __future__ import annotations

import socket
import time
from collections.abc import Callable, Iterator

from tests.hostile.case import Case
from tests.hostile.good import DETECT, LIFT


def silent(connection: socket.socket) -> None:
    time.sleep(60)


def gone(connection: socket.socket) -> None:
    connection.close()


def web(connection: socket.socket) -> None:
    connection.recv(1000)
    connection.sendall(b"HTTP/1.1 200 OK\r\nContent-Length: 2\r\n\r\nok")
    connection.close()


def banner(connection: socket.socket) -> None:
    connection.sendall(b"SSH-2.0-OpenSSH_9.9\r\n")
    time.sleep(60)


def byte_by_byte(connection: socket.socket) -> None:
    while True:
        connection.sendall(b"\x01")
        time.sleep(1)


def flood(connection: socket.socket) -> None:
    while True:
        connection.sendall(bytes(1 << 16))


def vast_frames(connection: socket.socket) -> None:
    """As Dask frames a message: that of 2^60 bytes follows."""
    connection.sendall((2**60).to_bytes(8, "little") * 64)
    time.sleep(60)


def echo(connection: socket.socket) -> None:
    while received := connection.recv(1 << 16):
        connection.sendall(received)


SERVERS: dict[str, Callable[[socket.socket], None]] = {
    "silent": silent, "closes at once": gone, "a web server": web, "a shell server": banner,
    "one byte a second": byte_by_byte, "an echo": echo, "without end": flood,
    "2^60 bytes announced": vast_frames
}  # fmt: skip
SPREAD = f"{DETECT} --out out.json --dask tcp://127.0.0.1:PORT"
OTHERS = (f"{LIFT} --out out.parquet --dask tcp://127.0.0.1:PORT",
          "scenes render out --n 2 --dask tcp://127.0.0.1:PORT",
          "record simulate mocap out --n-frames 2 --dask tcp://127.0.0.1:PORT",
          "report --results out --dask tcp://127.0.0.1:PORT")  # fmt: skip
ADDRESSES = ("", "tcp://127.0.0.1:9", "tcp://127.0.0.1:99999", "tcp://:1", "127.0.0.1:8786", "tcp://no.such.host.invalid:1",
             "inproc://x/1/1", "file:///etc/passwd", "tcp://[::1]:9", "tls://127.0.0.1:9", "ucx://127.0.0.1:9",
             "ws://127.0.0.1:9", "tcp://127.0.0.1:9\x1b[2J")  # fmt: skip


def cases() -> Iterator[Case]:
    for kind, serve in SERVERS.items():
        yield Case(f"server: detect: {kind}", SPREAD, serve=serve)
    for command in OTHERS:
        yield Case(f"server: {command.split()[0]} {command.split()[1]}: silent", command, serve=silent)
    for address in ADDRESSES:
        yield Case(f"server: address {address!r}", [*SPREAD.split()[:-1], address])
