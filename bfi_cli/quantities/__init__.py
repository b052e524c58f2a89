"""What is measured: channels, their units, and how numbers and words of them are written."""
