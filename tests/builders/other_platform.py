"""A system without what POSIX has, as far as that can be simulated: for processes that start with this folder."""

from __future__ import annotations

import os
from pathlib import Path

SITE = '''
import os, signal, sys, warnings
for name in ("fcntl", "resource", "termios", "pwd", "grp", "pty", "tty"):
    sys.modules[name] = None  # importing it fails
for name in ("fork", "forkpty", "getuid", "geteuid", "getgid", "getegid", "killpg", "setsid", "getpgid", "getpgrp",
             "O_DIRECTORY", "O_NOFOLLOW", "sched_getaffinity", "getloadavg", "fchmod", "mkfifo", "sysconf", "sync"):
    if hasattr(os, name):
        delattr(os, name)
for name in ("SIGHUP", "SIGQUIT", "SIGALRM", "SIGUSR1", "SIGUSR2", "SIGCHLD", "SIGPIPE", "SIGSTOP", "SIGCONT",
             "SIGKILL", "pthread_sigmask", "sigwait", "setitimer", "alarm", "siginterrupt", "pthread_kill"):
    if hasattr(signal, name):
        delattr(signal, name)
_replace, _open, _kill, _refused = os.replace, os.open, os.kill, set()
def replace(source, destination, **more):
    """Refuse once, as where another program has the destination open."""
    if os.path.exists(destination) and str(destination) not in _refused:
        _refused.add(str(destination))
        raise PermissionError(13, "Permission denied", str(destination))
    return _replace(source, destination, **more)
def open_file(path, *more, **named):
    """Refuse folders."""
    if not isinstance(path, int) and os.path.isdir(path):
        raise PermissionError(13, "Permission denied", str(path))
    return _open(path, *more, **named)
def kill(process, number):
    """Whatever the signal, the process ends."""
    return _kill(process, 9)
os.replace, os.rename, os.open, os.kill = replace, replace, open_file, kill
import shutil
shutil._use_fd_functions = False  # there are no descriptors of folders
warnings.filterwarnings("error", category=EncodingWarning, module=r"(excite|constraints|regressors)(\\.|$)")
'''


def environment_of(folder: Path) -> dict[str, str]:
    """Variables with which Python starts as on such a system, and with a console of Windows-1252.

    Parameters
    ----------
    folder : Path
        Empty.
    """
    (folder / "sitecustomize.py").write_text(SITE, encoding="utf-8")
    path = os.pathsep.join([str(folder), *filter(None, [os.environ.get("PYTHONPATH")])])
    return {"PYTHONPATH": path, "PYTHONIOENCODING": "cp1252", "PYTHONWARNDEFAULTENCODING": "1"}
