"""Arrays in, arrays out: numpy and scipy only, no files, no configuration; what is wrong is a `ValueError`."""
