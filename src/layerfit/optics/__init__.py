"""Light at one boundary and through one medium: formulas without a material."""
