"""The closed loop: what measured runs say that a model lacks."""

from typing import TYPE_CHECKING

from rverror.base.lazy import attach

if TYPE_CHECKING:
    from rverror.diagnosis.loop import diagnose as diagnose
    from rverror.diagnosis.order_passport import passport as passport
    from rverror.diagnosis.policy import POLICY as POLICY, Policy as Policy
    from rverror.diagnosis.result import Diagnosis as Diagnosis
    from rverror.diagnosis.validation import validated as validated
else:
    __getattr__, __dir__ = attach(__name__)
