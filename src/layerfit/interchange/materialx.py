"""MaterialX's own opinion of a document: its validation, and the BRDF of the GLSL that it prints. The only file that imports MaterialX."""

import importlib
import importlib.util
import re

import numpy as np

from ..capture.geometry import frames
from ..capture.samples import Samples
from ..errors import MachineError
from ..shader.gl import shade_points

_BLOCK = re.compile(r"in VertexData\s*\{(.*?)\}\s*vd;", re.S)
_MEMBER = re.compile(r"vec3 (\w+);")


def is_here() -> bool:
    """Whether the extra is installed."""
    return importlib.util.find_spec("MaterialX") is not None


def shader(text: str) -> str:
    """The fragment shader that MaterialX prints for the first material of a document, for one directional light and no image-based one.

    Raises `MachineError` where MaterialX finds the document at fault: it was written here.
    """
    # Its modules take their names from compiled ones, which no type checker sees.
    mx, glsl, gen = (
        importlib.import_module(f"MaterialX{part}") for part in ("", ".PyMaterialXGenGlsl", ".PyMaterialXGenShader")
    )

    search, library, document = mx.getDefaultDataSearchPath(), mx.createDocument(), mx.createDocument()
    mx.loadLibraries(mx.getDefaultDataLibraryFolders(), search, library)
    mx.readFromXmlString(document, text)
    document.setDataLibrary(library)
    valid, problem = document.validate()
    if not valid:
        raise MachineError(f"MaterialX {mx.__version__} does not take the document: {problem}. Please report it")
    generator = glsl.GlslShaderGenerator.create()
    context = gen.GenContext(generator)
    context.registerSourceCodeSearchPath(search)
    options = context.getOptions()
    options.hwSpecularEnvironmentMethod = gen.HwSpecularEnvironmentMethod.SPECULAR_ENVIRONMENT_NONE
    options.hwMaxActiveLightSources = 1
    gen.HwShaderGenerator.bindLightShader(library.getNodeDef("ND_directional_light"), 1, context)
    element = gen.findRenderableElements(document)[0]
    text = generator.generate("material", element, context).getSourceCode(gen.PIXEL_STAGE)
    # 1.39.5 forgets to declare this one where there is no image-based light.
    declared = "uniform bool u_refractionTwoSided" in text
    return text if declared else text.replace("\n", "\nuniform bool u_refractionTwoSided;\n", 1)


def brdf(fragment: str, wi: np.ndarray, wo: np.ndarray) -> np.ndarray:
    """BRDF (n, 3) [1/sr] of such a shader at pairs of unit directions (n, 3) in the surface frame, drawn in OpenGL.

    Its light is the same for all points. So each has a frame of its own, in which the light stands above it.
    """
    turn = frames(np.asarray(wi, float), None)
    tangent, bitangent, normal = (turn[:, :, axis] for axis in range(3))
    position = -np.einsum("nij,nj->ni", turn, np.asarray(wo, float))  # seen from the origin
    known = {"normalWorld": normal, "tangentWorld": tangent, "bitangentWorld": bitangent, "positionWorld": position}
    block = _BLOCK.search(fragment)
    names = _MEMBER.findall(block[1]) if block else []
    plain = _BLOCK.sub("".join(f"in vec3 {name};\n" for name in names), fragment).replace("vd.", "")
    uniforms = {
        "u_numActiveLightSources": 1,
        "u_viewPosition": (0.0, 0.0, 0.0),
        "u_lightData[0].type": 1,
        "u_lightData[0].direction": (0.0, 0.0, -1.0),  # in which light goes
        "u_lightData[0].color": (1.0, 1.0, 1.0),
        "u_lightData[0].intensity": 1.0,
    }
    drawn = shade_points(plain, {name: known[name].astype(np.float32) for name in names}, uniforms)
    return drawn / wi[:, 2:]


def radiance(fragment: str, samples: Samples) -> np.ndarray:
    """Radiance (pixels, 3) of such a shader at the samples of a reference."""
    lights = samples.wi.shape[1]
    f = brdf(fragment, samples.wi.reshape(-1, 3), np.repeat(samples.wo, lights, 0))
    return np.sum(f.reshape(samples.weight.shape) * samples.weight, 1)
