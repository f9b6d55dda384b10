"""What holds for every test."""

import signal

# a shell's background job begins with SIGINT ignored, and the commands that tests interrupt would inherit that
signal.signal(signal.SIGINT, signal.default_int_handler)
