"""A printer's port: bytes out, bytes in, and one clear sentence when there is none."""

import errno
from typing import TYPE_CHECKING, Protocol

from trunnion_core.errors import StreamError

if TYPE_CHECKING:
    import serial


class Port(Protocol):
    """What the stream needs of a device, a pty, a socket or a machine inside this process."""

    def read(self, timeout: float) -> bytes:
        """Whatever came, as soon as something did; empty after `timeout` s. Raises OSError when the port is gone."""

    def write(self, data: bytes) -> None:
        """Send everything. Raises OSError when the port is gone."""

    def close(self) -> None:
        """Give the port back."""


def open_port(url: str, baud: int = 250000) -> Port:
    """The printer at a device, a pty or `tcp://HOST:PORT`. Raises StreamError that says what is wrong with it."""
    import serial

    where = url.strip()
    if where.startswith("tcp://"):
        host, _, number = where.removeprefix("tcp://").rpartition(":")
        if not host or not number.isdigit() or not 0 < int(number) < 65536:
            raise StreamError(f"{url}: should be tcp://HOST:PORT, for instance tcp://127.0.0.1:4000")
        address = f"socket://{host}:{number}"
    elif not where:
        raise StreamError("the port is empty, should be a device, a pty or tcp://HOST:PORT")
    else:
        address = where
    try:
        if "://" in address:
            return _SerialPort(serial.serial_for_url(address, baudrate=baud, timeout=0), where)
        return _SerialPort(serial.Serial(address, baudrate=baud, timeout=0, write_timeout=10, exclusive=True), where)
    except (OSError, ValueError) as error:  # pyserial's own errors are OSErrors
        raise StreamError(f"{where}: {_reason(error, baud)}") from None


class _SerialPort:
    """A pyserial port of any kind."""

    def __init__(self, device: "serial.SerialBase", where: str) -> None:
        self._device = device
        self._where = where

    def read(self, timeout: float) -> bytes:
        """See Port."""
        device = self._device
        try:
            device.timeout = timeout
            first: bytes = device.read(1)
            if not first:
                return b""
            device.timeout = 0
            return first + bytes(device.read(4096))
        except (OSError, TypeError) as error:  # a closed pyserial port raises TypeError
            raise OSError(f"{self._where} is gone: {error}") from None

    def write(self, data: bytes) -> None:
        """See Port."""
        try:
            self._device.write(data)
        except (OSError, TypeError) as error:
            raise OSError(f"{self._where} is gone: {error}") from None

    def close(self) -> None:
        """See Port."""
        self._device.close()


def _reason(error: Exception, baud: int) -> str:
    """What is wrong, in words; pyserial hides the number of some errors in its text."""
    text = str(error)
    number = error.errno if isinstance(error, OSError) else None
    if number == errno.ENOENT or "No such file" in text:
        return "there is no such port"
    if number in (errno.EACCES, errno.EPERM) or "Permission denied" in text:
        return "you may not open this port; on Linux join the group that owns it (often dialout)"
    if number in (errno.EBUSY, errno.EAGAIN) or "exclusively lock" in text:
        return "the port is in use by another program"
    if number == errno.ECONNREFUSED or "refused" in text:
        return "nothing listens there (connection refused)"
    if isinstance(error, ValueError) and "baud" in text.lower():
        return f"{baud} baud is not possible on this port"
    return f"cannot be opened: {text}"
