"""A kernel's side of /dev/i2c-1 for other processes: runs in the system's Python, under umockdev-wrapper.

Prints where its devices are; then, for each call of a driver, one line [address, "read" or "write", register, length or
bytes], and reads one line: the bytes that were read, or an error's number.
"""

import json
import signal
import struct
import sys

SLAVE, FUNCS, SMBUS = 0x0703, 0x0705, 0x0720
READ = 1
BYTE, BYTE_DATA, BLOCK = 1, 2, 8  # sizes of a transfer
EVERYTHING = 0xEFF0008  # functions of the adapter; not used by our calls


class Adapter:
    """The selected address, and the test process at our standard streams."""

    def __init__(self):
        self.address = 0

    def handle(self, handler, client):
        request, argument = client.get_request(), client.get_arg()
        if request == SLAVE:
            self.address = int.from_bytes(argument.retrieve(), sys.byteorder) & 0x7F
            client.complete(0, 0)
        elif request == FUNCS:
            argument.resolve(0, 8).update(0, struct.pack("@L", EVERYTHING))
            client.complete(0, 0)
        elif request == SMBUS:
            result, number = self.transfer(argument.resolve(0, 16))
            client.complete(result, number)
        else:
            client.complete(-1, 25)  # ENOTTY
        return True

    def transfer(self, request):
        direction, register, size = struct.unpack_from("@BBI", request.retrieve())
        if size not in (BYTE, BYTE_DATA, BLOCK):
            return -1, 95  # EOPNOTSUPP: as the kernel's i2c-stub
        data = None if size == BYTE and direction != READ else request.resolve(8, 34)
        if direction == READ:
            length = data.retrieve()[0] if size == BLOCK else 1
            answer = ask([self.address, "read", register if size != BYTE else None, length])
            if isinstance(answer, int):
                return -1, answer
            data.update(1 if size == BLOCK else 0, bytes(answer))
            return 0, 0
        written = [] if data is None else list(data.retrieve())
        if size == BLOCK:
            written = written[1 : 1 + written[0]]
        answer = ask([self.address, "write", register, written[:1] if size == BYTE_DATA else written])
        return (-1, answer) if isinstance(answer, int) else (0, 0)


def ask(call):
    print(json.dumps(call), flush=True)
    return json.loads(sys.stdin.readline())


def main():
    import gi

    gi.require_version("UMockdev", "1.0")
    from gi.repository import GLib, UMockdev

    testbed = UMockdev.Testbed.new()
    testbed.add_from_string("P: /devices/i2c-1\nN: i2c-1\nE: DEVNAME=/dev/i2c-1\nE: SUBSYSTEM=i2c-dev\n")
    adapter = Adapter()
    handler = UMockdev.IoctlBase()
    handler.connect("handle-ioctl", adapter.handle)
    testbed.attach_ioctl("/dev/i2c-1", handler)
    print(json.dumps(testbed.get_root_dir()), flush=True)
    loop = GLib.MainLoop()
    GLib.unix_signal_add(GLib.PRIORITY_DEFAULT, signal.SIGTERM, loop.quit)  # so that its folder is removed
    loop.run()
    testbed.detach_ioctl("/dev/i2c-1")


if __name__ == "__main__":
    main()
