"""Write src/layerfit/optics/daylight.csv: what each wavelength brings to the three channels, from colour-science, which takes seconds to import.

python tools/make_daylight.py
"""

import numpy as np

from layerfit.optics.spectra import DAYLIGHT, WAVELENGTHS_NM, rgb_weights

HEAD = """\
Linear Rec.709 of light reflected by a surface in daylight: CIE 1931 2 degree observer times D65, white = (1, 1, 1). By tools/make_daylight.py.
wavelength_nm, r, g, b"""


def main() -> None:
    table = np.column_stack([WAVELENGTHS_NM, rgb_weights("D65")])
    np.savetxt(DAYLIGHT, table, ["%.0f", *["%.12g"] * 3], ",", header=HEAD)


if __name__ == "__main__":
    main()
