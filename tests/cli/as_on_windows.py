"""Runs `snr` in a separate process without the modules, functions and constants that Windows does not have.

Python's own modules are imported first and keep their references, so this tests the use by snr_sim itself.
It cannot test how paths, open files and consoles behave on Windows.
"""

import asyncio
import multiprocessing.connection
import os
import select
import selectors
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
import threading
from pathlib import Path
from typing import Any

MODULES = ("fcntl", "grp", "nis", "posix", "pty", "pwd", "readline", "resource", "spwd", "syslog", "termios", "tty")
# Functions with "Availability: Unix" in their documentation that snr_sim may use.
OF_OS = """
    O_CLOEXEC O_DIRECTORY O_NOCTTY O_NOFOLLOW O_NONBLOCK O_SYNC chown fchdir fchmod fchown fork forkpty
    get_blocking set_blocking getegid geteuid getgid getgroups getpgid getpgrp getpriority getresuid getsid getuid
    initgroups killpg lchown major makedev memfd_create mkfifo mknod nice openpty pidfd_open pipe2 posix_fallocate
    posix_fadvise posix_spawn pread preadv pwrite pwritev readv register_at_fork sched_getaffinity sched_setaffinity
    sched_yield setgid setgroups setpgid setpriority setregid setresgid setresuid setreuid setsid setuid
    fstatvfs sysconf sync tcgetpgrp tcsetpgrp ttyname wait wait3 wait4 waitid writev
"""
OF_SIGNAL = """
    SIGALRM SIGBUS SIGCHLD SIGCONT SIGHUP SIGIO SIGKILL SIGPIPE SIGPROF SIGQUIT SIGSTOP SIGTSTP SIGTTIN SIGTTOU SIGUSR1
    SIGUSR2 SIGVTALRM SIGWINCH SIGXCPU SIGXFSZ ITIMER_PROF ITIMER_REAL ITIMER_VIRTUAL SIG_BLOCK SIG_SETMASK SIG_UNBLOCK
    alarm getitimer pause pidfd_send_signal pthread_kill pthread_sigmask setitimer siginterrupt sigpending sigtimedwait
    sigwait sigwaitinfo
"""
OF_SELECT = "PIPE_BUF epoll poll"
OF_SOCKET = "AF_UNIX SOCK_CLOEXEC SOCK_NONBLOCK SOCK_SEQPACKET SO_REUSEPORT recv_fds send_fds"
BLOCKED = (
    f"import sys; sys.path.insert(0, {str(Path(__file__).parent)!r}); import as_on_windows; as_on_windows.block(); "
)


def block() -> None:
    """Remove what Windows does not have, here and in each Python process that is started from here."""
    unix, pair = socket.AF_UNIX, socket.socketpair
    kept = (asyncio, multiprocessing.connection, selectors, shutil, tempfile, threading)  # imported while all is there
    assert kept
    for name in MODULES:
        sys.modules[name] = None  # type: ignore[assignment]
    for module, names in ((os, OF_OS), (signal, OF_SIGNAL), (select, OF_SELECT), (socket, OF_SOCKET)):
        for name in names.split():
            if hasattr(module, name):
                delattr(module, name)
    os.supports_dir_fd.clear()
    os.supports_fd.clear()
    shutil._use_fd_functions = False  # type: ignore[attr-defined]  # it has asked before
    socket.socketpair = lambda: pair(unix)  # there over TCP
    begin = subprocess.Popen.__init__

    def begun(self: Any, args: Any, *more: Any, **options: Any) -> None:
        assert not options.get("pass_fds"), "pass_fds not supported on Windows."
        assert not options.get("preexec_fn"), "preexec_fn is not supported on Windows platforms"
        if isinstance(args, list) and "-c" in args:
            place = args.index("-c") + 1
            args = [*args[:place], BLOCKED + args[place], *args[place + 1 :]]
        begin(self, args, *more, **options)

    subprocess.Popen.__init__ = begun  # type: ignore[method-assign]
    subprocess.Popen.kill = lambda self: self.send_signal(9)  # type: ignore[method-assign]  # there it needs no signal


if __name__ == "__main__":
    block()
    from snr_sim.cli.entry import main

    main()
