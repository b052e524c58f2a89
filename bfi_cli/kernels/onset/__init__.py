"""Every onset of a fault of known shape at once: the likelihood of a record, maximised over the fault's magnitude."""
