"""`bfi`, and `python -m bfi_cli`."""

import gc

# What the first imports make stays: circles of references are searched for once `main` says how often.
gc.disable()

from .commands import main  # noqa: E402

if __name__ == "__main__":
    main()
