"""The flight in one command: every analysis of the air data that the log allows, and one verdict."""
