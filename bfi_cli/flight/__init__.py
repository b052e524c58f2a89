"""The flight model of a log: one likelihood of all recorded channels, by which what finders propose is judged."""
