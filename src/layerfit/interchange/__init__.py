"""Materials in the words of other programs: a coat over a base, as OpenPBR, glTF, Blender, three.js and Babylon.js have it.

`dialects` says in what their formulas differ, `engine` is the formula, `mapping` the one place where a stack becomes a coat over a base and
back, `convert` the best parameters and what is lost, measured. Beside them one module for each format.
"""
