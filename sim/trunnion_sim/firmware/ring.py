"""The receive ring of the serial port: bytes that find it full are lost, as on a real UART."""


class ReceiveRing:
    """Bytes that arrived while the command queue was full."""

    def __init__(self, size: int = 128) -> None:
        self.size = size
        self.lost = 0
        """Bytes lost since power-up."""
        self._bytes = bytearray()

    def __len__(self) -> int:
        return len(self._bytes)

    def put(self, data: bytes) -> None:
        """Store what fits; the rest is lost."""
        space = self.size - len(self._bytes)
        self._bytes += data[:space]
        self.lost += max(len(data) - space, 0)

    def take_line(self) -> bytes:
        """The bytes up to and with the first line end, or all of them."""
        data = self._bytes
        ends = [place for place in (data.find(b"\n"), data.find(b"\r")) if place >= 0]
        stop = min(ends) + 1 if ends else len(data)
        line = bytes(data[:stop])
        del data[:stop]
        return line

    def flush(self) -> None:
        """Forget everything."""
        self._bytes.clear()
