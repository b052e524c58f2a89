"""`python -m bfi_cli` is `bfi`."""

from .commands import main

if __name__ == "__main__":
    main()
