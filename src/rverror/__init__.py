"""rverror: the output error of rotary vector (RV) reducers, from part errors to transmission error and back."""

from rverror.catalogue import CATALOGUE
from rverror.compose import influence, transmission_error, transmission_error_by_effect
from rverror.model import Effect, Model, effect
from rverror.reducer import Drive, Reducer, Stiffness, reducer

__version__ = "0.1.0"

__all__ = [
    "CATALOGUE",
    "Drive",
    "Effect",
    "Model",
    "Reducer",
    "Stiffness",
    "effect",
    "influence",
    "reducer",
    "transmission_error",
    "transmission_error_by_effect",
]
