"""Fit layered materials to reference renders, and print them as shaders.

- Materials: Stack of Coat or Patina over Conductor, Dielectric, Lambert or OrenNayar, in the form Precise, Corrected or Faithful.
  Weathered metal is a Stack of Deposit, Overgrowth, Erosion and Polish, the latest first.
  read_preset and write_preset; shipped_presets lists those that are there, each a Shipped.
- Classic bases: Phong, Blinn, Lafortune, TorranceSparrow, CookTorrance. Metallic and car paint: Flakes, CarPaint.
  Pigment in layers: KubelkaMunk.
- fit_lazanyi gives a short Fresnel formula of a metal, a Lazanyi.
- Spectra: metal gives the index of a named Metal, absorption_rgb the Absorption of a coat, both in three channels with their error.
- References: read_scene gives a Scene, load its View of each reference, from which Samples are drawn; inspect says what a file holds.
  read_brdf gives a MeasuredBrdf.
- Before a fit: advise gives an Advice, what a capture determines and which further image would tell most.
- Fitting: fit gives a FitResult, parameters its values with sigmas; fit_scene does what `layerfit fit` does; image_error compares pictures.
- Many fits: fit_batch does what `layerfit batch` does, and gives a Batch.
- Maps: fit_map does what `layerfit map` does, a fit for every texel, and gives a MapFit.
- Structures: choose_structure tries candidates and gives a StructureChoice; structures_of does what `layerfit structures` does.
- Rendering: predict gives pixels, radiance the same traced, brdf the plain function; Place is where on the surface.
- Shaders: print_material gives a Shader; shade_samples draws it; check_pairs and check_image compare it with JAX and give a Parity.
- Other programs: export_to writes their material, an Export with what is lost; read_start gives the layers of one of theirs.
- Error against run time: tradeoff does what `layerfit tradeoff` does, specialise leaves out what a scene does not need.
- Studies: study does what `layerfit study` does, trials of a material by a design, as an xarray Dataset; plot_study draws it.
- Notebooks: live shows a material with sliders, both ways. plot_plane, plot_convergence and plot_tradeoff draw into axes of matplotlib.
- Tiers: make_tier gives another way to print a material, a Tier; choose_tier the cheapest that is near enough, a Choice.
- The machine: use_compilation_cache. Faults: InputError and MachineError, each a LayerfitError.

Names are loaded when they are first used: importing the package costs nothing. `__init__.pyi` says where each is found.

Conventions throughout. Directions `wi` (to the light) and `wo` (to the viewer) are unit vectors that point away from the surface, in
its frame: tangent, bitangent, normal (0, 0, 1). A BRDF is in 1/sr and holds no cosine. Colours are linear Rec.709.
"""

import lazy_loader as _lazy

__version__ = "0.1.0"

__getattr__, __dir__, __all__ = _lazy.attach_stub(__name__, __file__)
