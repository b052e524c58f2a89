"""Text that every stream and file can hold: bytes of a file name that are no text are shown by their code."""

from __future__ import annotations

import codecs

__all__ = ["SHOWN", "shown"]

# Name of the error handler below, for streams and `str.encode`.
SHOWN = "bfi-shown"


def shown(text: str) -> str:
    r"""Return `text` as valid UTF-8: the byte 0xff of a file name (a lone surrogate in Python) becomes `\xff`."""
    return text.encode("utf-8", SHOWN).decode("utf-8")


def _code(error: UnicodeError) -> tuple[str, int]:
    if not isinstance(error, UnicodeEncodeError):
        raise error
    return "".join(map(_letter, error.object[error.start : error.end])), error.end


def _letter(letter: str) -> str:
    r"""Return the code of a lone surrogate, "?" for a letter that an encoding lacks."""
    if "\udc80" <= letter <= "\udcff":
        return f"\\x{ord(letter) - 0xDC00:02x}"
    return f"\\u{ord(letter):04x}" if "\ud800" <= letter <= "\udfff" else "?"


codecs.register_error(SHOWN, _code)
