"""The cheapest tier of a material that is near enough."""

import dataclasses

from ..errors import InputError
from ..stack import Stack
from ..tiers.tier import TIERS, Tier, check_max_error, make_tier
from .cost import instructions, phong
from .export import Shader, print_material


@dataclasses.dataclass(frozen=True)
class Choice:
    """A tier, its shader, and what it costs."""

    tier: Tier
    shader: Shader
    cost: float
    """SPIR-V instructions over those of Phong, for one light."""

    def __str__(self) -> str:
        error = "the exact form" if self.tier.name == "exact" else f"within {self.tier.error:.1e} of the exact form"
        return f"{self.tier.name}: {error}, {self.cost:.1f} times the instructions of Phong"


def choose_tier(stack: Stack, name: str, max_error: float | None = None, max_cost: float | None = None) -> Choice:
    """The cheapest tier within `max_error` and `max_cost`; with a cost alone, the nearest to the exact form within it.

    Costs are SPIR-V instructions after spirv-opt -O, in times of Phong: the same on every machine. Raises `InputError` where no tier
    meets what is asked, and `MachineError` without the tools that count.
    """
    check_max_error(max_error)
    choices, left_out = [], []
    for tier_name in TIERS:
        try:
            tier = make_tier(stack, tier_name, max_error)
        except InputError as reason:
            left_out.append(str(reason))
            continue
        shader = print_material(tier.stack, name)
        choices.append(Choice(tier, shader, instructions(shader).total / instructions(phong()).total))
    met = [choice for choice in choices if max_cost is None or choice.cost <= max_cost]
    if not met:
        least = min(choice.cost for choice in choices)
        raise InputError(
            f"no tier costs {max_cost:g} times Phong or less; the least is {least:.1f}. {'. '.join(left_out)}".rstrip()
        )
    if max_error is None:
        return min(met, key=lambda choice: (choice.tier.error, choice.cost))
    return min(met, key=lambda choice: (choice.cost, choice.tier.error))
