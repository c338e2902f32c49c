"""Tools of every room: arguments of calls, messages, files, deadlines, workers."""
