"""A small NTRIP caster on loopback, version 1 or 2, with or without TLS: what it is sent and what it sends is in the hands of a test."""

import contextlib
import datetime
import ipaddress
import socket
import ssl
import threading
from base64 import b64encode
from collections.abc import Iterable
from pathlib import Path
from types import TracebackType
from typing import Self

from cryptography import x509
from cryptography.hazmat.primitives import hashes, serialization
from cryptography.hazmat.primitives.asymmetric import ec
from cryptography.x509.oid import NameOID

TABLE_LINE = "STR;{};Somewhere;RTCM 3.3;1005(10),1077(1);2;GPS+GAL;NET;JPN;35.3;139.5;0;0;RCV;none;B;N;9600;\r\n"


class Mount:
    """A mount point, and whoever listens to it. `said`: what the listeners sent after the answer."""

    def __init__(self, chunked: bool) -> None:
        self.listeners: list[socket.socket] = []
        self.said = b""
        self._chunked = chunked

    def send(self, data: bytes) -> None:
        """To all listeners, as one chunk in version 2."""
        self.send_as_it_is(b"%x\r\n%b\r\n" % (len(data), data) if self._chunked else data)

    def send_as_it_is(self, data: bytes) -> None:
        for listener in list(self.listeners):
            try:
                listener.sendall(data)
            except OSError:
                self.listeners.remove(listener)

    def hang_up(self) -> None:
        for listener in self.listeners:
            with contextlib.suppress(OSError):
                listener.shutdown(socket.SHUT_RDWR)
        self.listeners.clear()


class Caster:
    """Serves `mounts` by name. `answer` is what everyone gets instead, b"": nothing, for ever; `user` is "user:password", "" for all."""

    def __init__(
        self,
        names: Iterable[str] = ("MOUNT",),
        *,
        version: int = 2,
        user: str = "",
        answer: bytes | None = None,
        tls: ssl.SSLContext | None = None,
        port: int = 0,
    ) -> None:
        self.mounts = {name: Mount(version == 2) for name in names}
        self.requests: list[str] = []
        self._version, self._answer, self._tls = version, answer, tls
        self._authorization = f"Authorization: Basic {b64encode(user.encode()).decode()}" if user else ""
        self._server = socket.create_server(("127.0.0.1", port))
        self._connections: list[socket.socket] = []
        self._threads = [threading.Thread(target=self._serve)]
        self._ended = threading.Event()
        self.port: int = self._server.getsockname()[1]

    def url(self, mount: str = "MOUNT", user: str = "", options: str = "") -> str:
        return f"ntrip{'s' * (self._tls is not None)}://{user + '@' if user else ''}127.0.0.1:{self.port}/{mount}{options}"

    def __enter__(self) -> Self:
        self._threads[0].start()
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        with contextlib.suppress(OSError):
            self._server.shutdown(socket.SHUT_RDWR)  # or accept would go on
        self._threads[0].join()
        self._server.close()
        for connection in self._connections:
            with contextlib.suppress(OSError):
                connection.shutdown(socket.SHUT_RDWR)
        self._ended.set()
        for thread in self._threads[1:]:
            thread.join()

    def _serve(self) -> None:
        with contextlib.suppress(OSError):
            while True:
                connection, _ = self._server.accept()
                self._connections.append(connection)
                self._threads.append(threading.Thread(target=self._talk, args=(connection,)))
                self._threads[-1].start()

    def _talk(self, connection: socket.socket) -> None:
        with contextlib.suppress(OSError):
            if self._tls is not None:
                try:
                    connection = self._tls.wrap_socket(connection, server_side=True)
                except OSError:
                    connection.close()
                    raise
                self._connections.append(connection)
            with connection:
                self._read(connection)

    def _read(self, connection: socket.socket) -> None:
        request = b""
        while b"\r\n\r\n" not in request:
            data = connection.recv(4096)
            if not data:
                return
            request += data
        self.requests.append(request.decode())
        self._answered(connection, request.decode())
        while connection.recv(4096):  # until the other end is gone, or this one ends
            pass

    def _answered(self, connection: socket.socket, request: str) -> None:
        name = request.split()[1].removeprefix("/")
        if self._answer is not None:
            connection.sendall(self._answer)
        elif self._authorization not in request:
            connection.sendall(b"HTTP/1.1 401 Unauthorized\r\nWWW-Authenticate: Basic\r\nContent-Length: 0\r\n\r\n")
        elif name in self.mounts:
            self._stream(connection, self.mounts[name])
            return
        elif name and self._version == 2:
            connection.sendall(b"HTTP/1.1 404 Not Found\r\nConnection: close\r\n\r\n")
        else:
            connection.sendall(self._table())
        if self._answer != b"":
            connection.shutdown(socket.SHUT_RDWR)

    def _stream(self, connection: socket.socket, mount: Mount) -> None:
        v2 = b"HTTP/1.1 200 OK\r\nNtrip-Version: Ntrip/2.0\r\nContent-Type: gnss/data\r\nTransfer-Encoding: chunked\r\n\r\n"
        connection.sendall(v2 if self._version == 2 else b"ICY 200 OK\r\n\r\n")
        mount.listeners.append(connection)
        if self._tls is not None:
            self._ended.wait()  # a TLS connection may not be read and written at once
            return
        while data := connection.recv(4096):
            mount.said += data

    def _table(self) -> bytes:
        table = "".join(TABLE_LINE.format(name) for name in self.mounts) + "ENDSOURCETABLE\r\n"
        if self._version == 1:
            return f"SOURCETABLE 200 OK\r\nContent-Type: text/plain\r\nContent-Length: {len(table)}\r\n\r\n{table}".encode()
        head = "HTTP/1.1 200 OK\r\nContent-Type: gnss/sourcetable\r\nTransfer-Encoding: chunked\r\n\r\n"
        return f"{head}{len(table):x}\r\n{table}\r\n0\r\n\r\n".encode()


def certificate(folder: Path, host: str = "127.0.0.1") -> tuple[ssl.SSLContext, Path]:
    """A server's TLS with a certificate of its own making, and the file that whoever trusts it needs."""
    key = ec.generate_private_key(ec.SECP256R1())
    name = x509.Name([x509.NameAttribute(NameOID.COMMON_NAME, "caster of a test")])
    now = datetime.datetime.now(datetime.UTC)
    made = (
        x509.CertificateBuilder()
        .subject_name(name)
        .issuer_name(name)
        .public_key(key.public_key())
        .serial_number(x509.random_serial_number())
        .not_valid_before(now - datetime.timedelta(hours=1))
        .not_valid_after(now + datetime.timedelta(hours=1))
        .add_extension(x509.SubjectAlternativeName([x509.IPAddress(ipaddress.ip_address(host))]), critical=False)
        .add_extension(x509.BasicConstraints(ca=True, path_length=None), critical=True)
        .sign(key, hashes.SHA256())
    )
    pem = made.public_bytes(serialization.Encoding.PEM)
    secret = key.private_bytes(serialization.Encoding.PEM, serialization.PrivateFormat.PKCS8, serialization.NoEncryption())
    folder.mkdir(exist_ok=True)
    (folder / "ca.pem").write_bytes(pem)
    (folder / "server.pem").write_bytes(secret + pem)
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
    context.load_cert_chain(folder / "server.pem")
    return context, folder / "ca.pem"
