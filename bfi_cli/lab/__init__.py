"""The laboratory: rival methods, sweeps over thousands of trials, methods side by side, published figures and tables.

The analyses of a log import nothing of it: methods of this package are named by string in `bfi_cli.methods`.
"""
