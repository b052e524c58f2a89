"""What a report holds, and its renderings: tables on a terminal, figures, CSV files, one HTML page.

An analysis makes a report of `content` and `text`; the other modules draw it. None of them knows an analysis.
"""
