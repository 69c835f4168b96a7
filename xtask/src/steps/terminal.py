"""Runs a program on a terminal of its own and closes the terminal after half a second.

terminal.py told|untold PROGRAM WORDS...   untold: the end of the session is ignored, as by nohup.
"""

import fcntl
import os
import pty
import signal
import struct
import sys
import termios
import time

told, words = sys.argv[1] == "told", sys.argv[2:]
pid, terminal = pty.fork()
if pid == 0:
    signal.signal(signal.SIGHUP, signal.SIG_DFL if told else signal.SIG_IGN)
    os.environ["TERM"] = "xterm"
    os.execv(words[0], words)
fcntl.ioctl(terminal, termios.TIOCSWINSZ, struct.pack("HHHH", 30, 100, 0, 0))
end = time.monotonic() + 0.5
seen = b""
while time.monotonic() < end:
    seen += os.read(terminal, 65536)
os.close(terminal)
_, status = os.waitpid(pid, 0)
if not os.WIFEXITED(status) or os.WEXITSTATUS(status) > 1:
    sys.exit(f"it ended with status {status}; it said {seen[-300:]!r}")
if len(seen) < 500:
    sys.exit(f"it drew nothing: {seen!r}")
