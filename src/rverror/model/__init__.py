"""A model: the catalogue of all sources, the effects that are declared, and the output error in closed form."""

from typing import TYPE_CHECKING

from rverror.base.lazy import attach

if TYPE_CHECKING:
    from rverror.model.catalogue import CATALOGUE as CATALOGUE, extended as extended
    from rverror.model.compose import (
        influence as influence,
        transmission_error as transmission_error,
        transmission_error_by_effect as transmission_error_by_effect,
    )
    from rverror.model.effects import Effect as Effect, Model as Model, effect as effect
    from rverror.model.ends import Bench as Bench, Encoders as Encoders
    from rverror.model.model_file import (
        load_model as load_model,
        save_model as save_model,
    )
    from rverror.model.results import Equilibrium as Equilibrium, Influence as Influence

else:
    __getattr__, __dir__ = attach(__name__)
