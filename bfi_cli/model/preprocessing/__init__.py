"""From a log to the regression of an analysis: a window cut, checked, filtered, decimated, scaled and factorised.

`window` gives a `PreparedWindow` in SI units, `regression` the scaled `RegressionData` of it at one rate. Both act
alike on inputs, outputs and dictionary, so that a fault keeps its relation to the signals it acts on.
"""
