"""What every room uses: arguments of calls, messages, files, deadlines, workers."""
