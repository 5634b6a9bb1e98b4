"""From samples to a material: parameters, residuals, the solve, and what it can and cannot tell."""
