"""Linear radiance of a material at samples: the sum over light samples of BRDF times weight."""

from typing import Any

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from .stack import Stack, evaluate


def radiance(
    stack: Stack, wi: Float[Array, "n s 3"], wo: Float[Array, "n 3"], weight: Float[Array, "n s 3"]
) -> Float[Array, "n 3"]:
    """Radiance of pixels: directions in their surface frames, `weight` what each direction brings per unit of BRDF."""
    return radiance_prepared(stack.form, stack.prepare(), wi, wo, weight)


def radiance_prepared(form: Any, prepared: Any, wi: Any, wo: Any, weight: Any) -> Any:
    """`radiance` of a material whose constants are known."""

    def pixel(wi: Any, wo: Any, weight: Any) -> Any:
        if wi.shape[0] == 1:
            return evaluate(form, prepared, wi[0], wo) * weight[0]
        f = jax.vmap(lambda w: jnp.broadcast_to(evaluate(form, prepared, w, wo), (3,)))(wi)
        return jnp.sum(f * weight, 0)

    return jax.vmap(pixel)(wi, wo, weight)


def brdf(stack: Stack, wi: Float[Array, "n 3"], wo: Float[Array, "n 3"]) -> Float[Array, "n 3"]:
    """BRDF [1/sr] of pairs of unit directions in the surface frame, without the cosine."""
    prepared = stack.prepare()
    return jax.vmap(lambda i, o: jnp.broadcast_to(evaluate(stack.form, prepared, i, o), (3,)))(wi, wo)
