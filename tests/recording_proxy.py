"""A proxy for tests: takes HTTP CONNECT on a port of this machine, connects to the one server that it knows, whatever it is
asked for, and keeps all that clients sent."""

from __future__ import annotations

import socket
import threading


class RecordingProxy:
    """Attributes:
      url: "http://127.0.0.1:port".
      asked: the first line of each connection, "CONNECT bench2:50051 HTTP/1.1".
      sent: every byte that came from clients.
    """

    def __init__(self, server: str):
        """server: "127.0.0.1:port" where every CONNECT ends."""
        self._server = server
        self.asked: list[str] = []
        self.sent = b""
        self._lock = threading.Lock()
        self._listener = socket.create_server(("127.0.0.1", 0))
        self.url = f"http://127.0.0.1:{self._listener.getsockname()[1]}"
        threading.Thread(target=self._accept, daemon=True).start()

    def close(self) -> None:
        # A blocked accept() outlives a close().
        self._listener.shutdown(socket.SHUT_RDWR)
        self._listener.close()

    def _accept(self) -> None:
        while True:
            try:
                client, _ = self._listener.accept()
            except OSError:
                return
            threading.Thread(target=self._serve, args=(client,), daemon=True).start()

    def _keep(self, data: bytes) -> bytes:
        with self._lock:
            self.sent += data
        return data

    def _serve(self, client: socket.socket) -> None:
        head = b""
        with client:
            while b"\r\n\r\n" not in head:
                data = client.recv(4096)
                if not data:
                    return
                head += self._keep(data)
            with self._lock:
                self.asked.append(head.split(b"\r\n")[0].decode())
            host, _, port = self._server.rpartition(":")
            with socket.create_connection((host, int(port))) as server:
                client.sendall(b"HTTP/1.1 200 Connection established\r\n\r\n")
                back = threading.Thread(target=self._copy, args=(server, client, lambda data: data), daemon=True)
                back.start()
                self._copy(client, server, self._keep)
                back.join()

    @staticmethod
    def _copy(source, target, keep) -> None:
        try:
            while data := source.recv(65536):
                target.sendall(keep(data))
            target.shutdown(socket.SHUT_WR)
        except OSError:
            pass
