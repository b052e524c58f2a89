"""Text of a log, a dictionary, a file name or a command line, made safe to show on a terminal and in a file."""

from __future__ import annotations

import codecs

# Name of the error handler of `valid_text`, for streams, files and `str.encode`.
SHOWN = "bfi-shown"

NAMED = {"\n": r"\n", "\t": r"\t", "\r": r"\r"}
BYTES = range(0xDC80, 0xDD00)  # what Python makes of a byte of a file name that is not UTF-8


def printable(text: str) -> str:
    r"""Return `text` with every character that is not printable as an escape, the others as they are.

    Printable is what `str.isprintable` says: letters of any script, digits, marks, symbols and the plain space, so "é",
    "°" and "µ" stay. Line feed, tab and carriage return become `\n`, `\t`, `\r`; other controls (also DEL and those of
    eight bits), blanks but the plain space, separators of lines and paragraphs, marks of writing direction and other
    characters without a shape, private, unassigned and lone surrogate code points become `\x1b`, `\u202e` or
    `\U000e0001`; a byte of a file name that is not UTF-8 becomes `\xff`. Backslashes are not doubled: text that is
    printable already is returned as it is, so a name that holds the four letters `\x1b` looks like one that holds the
    character.
    """
    return text if text.isprintable() else "".join(x if x.isprintable() else _code(x) for x in text)


def _code(letter: str) -> str:
    code = ord(letter)
    if code in BYTES:
        code -= 0xDC00
    if code < 0x100:
        return NAMED.get(letter) or f"\\x{code:02x}"
    return f"\\u{code:04x}" if code < 0x10000 else f"\\U{code:08x}"


def shortened(text: str, width: int) -> str:
    """Return `text` printable, its middle left out where it is longer than `width`."""
    if len(text) > 2 * width:  # what is left out in any case need not be escaped: it may be megabytes
        text = text[:width] + text[-width:]
    text = printable(text)
    if len(text) <= width:
        return text
    head = (width - 1) // 2
    return f"{text[:head]}…{text[len(text) - (width - 1 - head) :]}"


def valid_text(text: str) -> str:
    r"""Return `text` as any UTF-8 file can hold it: the byte 0xff of a file name (a lone surrogate) becomes `\xff`."""
    return text if text.isascii() else text.encode("utf-8", SHOWN).decode("utf-8")


def _escaped(error: UnicodeError) -> tuple[str, int]:
    """Replace characters that an encoding lacks by their codes."""
    if not isinstance(error, UnicodeEncodeError):
        raise error
    return "".join(map(_code, error.object[error.start : error.end])), error.end


codecs.register_error(SHOWN, _escaped)
