"""What a report holds, and its renderings: tables on a terminal, figures, CSV files, one HTML page.

`content` and `text` are what an analysis makes a report of; the other modules draw it. None of them knows an analysis.
"""
