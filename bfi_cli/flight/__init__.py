"""The flight model of a log: one likelihood of all recorded channels, which weighs what finders propose."""
