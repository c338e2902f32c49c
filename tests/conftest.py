"""Set-up of the whole suite."""

import signal

# a suite started in the background inherits an ignored SIGINT, and so would the programs whose Ctrl-C is tested
signal.signal(signal.SIGINT, signal.default_int_handler)
