"""The same models in JAX, for many motions at once: pure functions that can be compiled, mapped and differentiated.

Implemented as a separate recursion, not translated from the symbolic expressions; the two are tested against each
other. Importing this package changes no setting of JAX. Enable 64-bit numbers where the model is called:

>>> import jax, numpy as np
>>> from regressors.models.differential import DifferentialModel
>>> from regressors.readers.library import built_in
>>> from regressors.jax_models import JaxModel
>>> jax_model = JaxModel(DifferentialModel(built_in("ur10e")))
>>> q = np.zeros((100, 50, 6))  # 100 motions of 50 instants
>>> with jax.enable_x64(True):
...     Y = jax.jit(jax_model.rows)(q, q, q)
>>> Y.shape == (100, 50, 6, len(jax_model.names))
True
"""

from regressors.jax_models.jax_model import JaxModel

__all__ = ["JaxModel"]
