"""How light below a coat is computed: one module per published or derived form, each a `prepare` and an `evaluate`.

`prepare` runs once per material and gives the constants of a shader; `evaluate` runs per pair of directions.
"""
