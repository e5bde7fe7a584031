"""A wire between a firmware and the companion that can be cut: TCP or UDP, both ways or one."""

import select
import socket
import threading


class Relay:
    """Passes bytes on until `cut`; what arrives while it is cut is lost, as on a radio link."""

    def __init__(self):
        self.cut = False
        self.running = True
        self.thread = threading.Thread(target=self._run, daemon=True)

    def start(self):
        self.thread.start()
        return self

    def close(self):
        self.running = False
        self.thread.join(2.0)


class TcpRelay(Relay):
    """Listens for the companion on `port` and speaks to the firmware's TCP server on `firmware`."""

    def __init__(self, port, firmware):
        super().__init__()
        self.firmware = firmware
        self.server = socket.create_server(("127.0.0.1", port))
        self.server.settimeout(0.2)

    def _run(self):
        while self.running:
            try:
                companion, _ = self.server.accept()
            except TimeoutError:
                continue
            with companion, socket.create_connection(("127.0.0.1", self.firmware), 5.0) as firmware:
                for one in (companion, firmware):
                    one.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
                self._pass_on(companion, firmware)
        self.server.close()

    def _pass_on(self, companion, firmware):
        other = {companion: firmware, firmware: companion}
        while self.running:
            for ready in select.select(list(other), [], [], 0.2)[0]:
                try:
                    data = ready.recv(65536)
                    if data and not self.cut:
                        other[ready].sendall(data)
                except OSError:
                    return
                if not data:
                    return


class UdpRelay(Relay):
    """The firmware sends to `port`; the companion listens on `companion`."""

    def __init__(self, port, companion):
        super().__init__()
        self.companion = ("127.0.0.1", companion)
        self.to_firmware = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.to_firmware.bind(("127.0.0.1", port))
        self.to_companion = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)

    def _run(self):
        peer = None
        while self.running:
            ready = select.select([self.to_firmware, self.to_companion], [], [], 0.2)[0]
            for one in ready:
                try:
                    data, sender = one.recvfrom(65536)
                except OSError:
                    continue
                if one is self.to_firmware:
                    peer = sender
                if self.cut:
                    continue
                if one is self.to_firmware:
                    self.to_companion.sendto(data, self.companion)
                elif peer:
                    self.to_firmware.sendto(data, peer)
        self.to_firmware.close()
        self.to_companion.close()
