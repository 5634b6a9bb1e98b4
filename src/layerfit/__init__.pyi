# The public names, and where each is found. Read at run time too: it is the list that names are loaded by.

from ._place import Place as Place
from .batch import Batch as Batch, fit_batch as fit_batch
from .cache import use_compilation_cache as use_compilation_cache
from .capture.inspect import inspect as inspect
from .capture.load import load as load
from .capture.measured.data import MeasuredBrdf as MeasuredBrdf
from .capture.measured.read import read_brdf as read_brdf
from .capture.samples import Samples as Samples, View as View
from .capture.scene import Scene as Scene
from .capture.scene_file import read_scene as read_scene
from .errors import InputError as InputError, LayerfitError as LayerfitError, MachineError as MachineError
from .fit.advise import Advice as Advice, advise as advise
from .fit.fit import fit as fit
from .fit.metrics import image_error as image_error
from .fit.result import FitResult as FitResult, parameters as parameters
from .fit.structures import StructureChoice as StructureChoice, choose_structure as choose_structure
from .forms.corrected import Corrected as Corrected
from .forms.faithful import Faithful as Faithful
from .forms.precise import Precise as Precise
from .interchange.formats import Export as Export, export_to as export_to, read_start as read_start
from .job import fit_scene as fit_scene
from .layers import (
    Coat as Coat,
    Deposit as Deposit,
    Erosion as Erosion,
    Overgrowth as Overgrowth,
    Patina as Patina,
    Polish as Polish,
)
from .maps import fit_map as fit_map
from .maps.result import MapFit as MapFit
from .notebook import live as live
from .optics.lazanyi import Lazanyi as Lazanyi, fit_lazanyi as fit_lazanyi
from .optics.metals import Metal as Metal, metal as metal
from .optics.spectra import Absorption as Absorption, absorption_rgb as absorption_rgb
from .plot import (
    plot_convergence as plot_convergence,
    plot_plane as plot_plane,
    plot_study as plot_study,
    plot_tradeoff as plot_tradeoff,
)
from .preset import read_preset as read_preset, write_preset as write_preset
from .render import brdf as brdf, predict as predict, radiance as radiance
from .shader.choose import Choice as Choice, choose_tier as choose_tier
from .shader.export import Shader as Shader, print_material as print_material
from .shader.verify import (
    Parity as Parity,
    check_image as check_image,
    check_pairs as check_pairs,
    shade_samples as shade_samples,
)
from .shipped import Shipped as Shipped, shipped_presets as shipped_presets
from .specialising import specialise as specialise
from .stack import Stack as Stack
from .structures import structures_of as structures_of
from .study.sweep import study as study
from .surfaces import (
    Blinn as Blinn,
    CarPaint as CarPaint,
    Conductor as Conductor,
    CookTorrance as CookTorrance,
    Dielectric as Dielectric,
    Flakes as Flakes,
    KubelkaMunk as KubelkaMunk,
    Lafortune as Lafortune,
    Lambert as Lambert,
    OrenNayar as OrenNayar,
    Phong as Phong,
    TorranceSparrow as TorranceSparrow,
)
from .tradeoffs import tradeoff as tradeoff

__version__: str
from .tiers.tier import Tier as Tier, make_tier as make_tier
