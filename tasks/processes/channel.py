"""Numbered messages between two processes, which no interrupt can tear in two.

Ctrl-C may end a call at any moment: half of a message would then be read as the next one. Here a
message is one or more packets, each of which the kernel takes and gives as a whole, with the
number of the message in front; what belongs to another number than the reader wants is dropped.
"""

from __future__ import annotations

import socket
import struct
from collections.abc import Sequence

_HEAD = struct.Struct("!QII")  # the message's number, the packet's, and how many there are
_PIECE = 2**15  # bytes of a message in one packet; well below Linux's default buffer of a socket
_DESCRIPTOR = struct.Struct("i")


class Channel:
    """One end of a connection between two processes; can be an argument of a `WorkerProcess`."""

    def __init__(self, end: socket.socket, *, takes_descriptors: bool = True) -> None:
        """Take an end of a socket pair, as `pair` makes it.

        Args:
            end: The end.
            takes_descriptors: Whether file descriptors may come with messages.
        """
        self._end, self._takes_descriptors = end, takes_descriptors
        self._number, self._pieces = -1, list[bytes]()
        self.descriptors: list[int] = []
        """What came with messages; whoever takes one out closes it."""

    @classmethod
    def pair(cls) -> tuple[Channel, Channel]:
        """Return both ends of a new connection; file descriptors can be sent to the second one.

        Raises:
            OSError: If file descriptors run out.
        """
        one, other = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        return cls(one, takes_descriptors=False), cls(other)

    def fileno(self) -> int:
        """Return its file descriptor, for those who poll."""
        return self._end.fileno()

    def limit_sending(self, seconds: float) -> None:
        """Let `send` fail once a packet has waited so long for a reader that is stopped."""
        whole = int(seconds)
        limit = struct.pack("ll", whole, int((seconds - whole) * 1e6))
        self._end.setsockopt(socket.SOL_SOCKET, socket.SO_SNDTIMEO, limit)

    def send(self, number: int, message: bytes, descriptors: Sequence[int] = ()) -> None:
        """Send a message.

        Args:
            number: Its number; those of one direction grow.
            message: What it says.
            descriptors: File descriptors that go with it; the reader gets duplicates.

        Raises:
            OSError: If the other end is gone, or nobody reads there.
        """
        count = max(1, -(-len(message) // _PIECE))
        for i in range(count):
            packet = _HEAD.pack(number, i, count) + message[i * _PIECE : (i + 1) * _PIECE]
            if descriptors and i == count - 1:
                socket.send_fds(self._end, [packet], descriptors)
            else:
                self._end.send(packet)

    def receive(self) -> tuple[int, bytes]:
        """Return the next message that is whole, and its number; wait for it.

        Raises:
            EOFError: If the other end is gone.
        """
        while True:
            if (message := self._read(0)) is not None:
                return message

    def receive_now(self) -> tuple[int, bytes] | None:
        """Read one packet; returns the number and the message that it completes, else None.

        Raises:
            EOFError: If the other end is gone.
            BlockingIOError: If nothing has arrived.
        """
        return self._read(socket.MSG_DONTWAIT)

    def close(self) -> None:
        """Close this end."""
        self._end.close()

    def _read(self, flags: int) -> tuple[int, bytes] | None:
        packet = self._packet(flags)
        if not packet:
            raise EOFError("the other end is closed")
        number, i, count = _HEAD.unpack_from(packet)
        if i == 0:
            self._number, self._pieces = number, []
        if number != self._number or i != len(self._pieces):  # the rest of one that was torn
            return None
        self._pieces.append(packet[_HEAD.size :])
        return (number, b"".join(self._pieces)) if i == count - 1 else None

    def _packet(self, flags: int) -> bytes:
        if not self._takes_descriptors:
            return self._end.recv(_HEAD.size + _PIECE, flags)
        space = socket.CMSG_SPACE(_DESCRIPTOR.size)
        packet, ancillary, _, _ = self._end.recvmsg(_HEAD.size + _PIECE, space, flags)
        for level, kind, data in ancillary:
            if (level, kind) == (socket.SOL_SOCKET, socket.SCM_RIGHTS):
                self.descriptors.extend(value for (value,) in _DESCRIPTOR.iter_unpack(data))
        return packet
